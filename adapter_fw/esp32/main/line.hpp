// UART2 as the line to the robot; the driver's rings stand between it and the loop.
//
// A byte is handed over within a millisecond of its stop bit at every speed, so that the loop's next pass sees it.
#pragma once

#include "../../hal/uart.hpp"

namespace esp32 {

class Line final : public hal::Uart {
 public:
  // Takes the pins of the board.
  void start(std::int32_t baud);

  std::size_t read(std::uint8_t* data, std::size_t size) override;
  void write(p2os::Bytes data) override;
  void set_baud(std::int32_t baud) override;

  // Waits until all is sent, before a restart; at most 200 ms.
  void drain();
};

}  // namespace esp32
