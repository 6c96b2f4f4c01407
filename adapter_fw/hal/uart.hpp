// The line to the robot; one of six small interfaces of the hardware.
#pragma once

#include <cstddef>
#include <cstdint>

#include "../core/p2os/frame.hpp"

namespace hal {

class Uart {
 public:
  //: Copies what has arrived, at most `size` bytes; never waits. Returns how many.
  virtual std::size_t read(std::uint8_t* data, std::size_t size) = 0;
  //: Queues bytes to be sent.
  virtual void write(p2os::Bytes data) = 0;
  virtual void set_baud(std::int32_t baud) = 0;

 protected:
  ~Uart() = default;
};

}  // namespace hal
