// The serial console at the USB port: UART0, 115200 8N1.
//
// Writing never waits: what does not fit into what waits is left out, for a person who reads slowly must not stop the
// robot.
#pragma once

#include <array>

#include "../../core/app/text.hpp"

namespace esp32 {

class Terminal final : public app::Writer {
 public:
  void start();

  void write(const char* text) override;

  // Hands on to the UART what it has room for: 128 bytes, of which 12 leave in a millisecond.
  void send();

  // Takes a character; false where none has come.
  [[nodiscard]] bool take(char& character);

 private:
  //: chosen: a whole `get` or `log` fits at once.
  std::array<char, 8'192> waiting_{};
  std::size_t first_ = 0, count_ = 0;
};

}  // namespace esp32
