// The serial console at the USB port: UART0, 115200 8N1.
//
// Writing never waits: what does not fit into the driver's ring is left out, for a
// person who reads slowly must not stop the robot.
#pragma once

#include "../../core/app/text.hpp"

namespace esp32 {

class Terminal final : public app::Writer {
 public:
  void start();

  void write(const char* text) override;

  // Takes a character; false where none has come.
  [[nodiscard]] bool take(char& character);
};

}  // namespace esp32
