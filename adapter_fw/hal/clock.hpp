// The time; one of six small interfaces of the hardware.
#pragma once

#include "../core/p2os/time.hpp"

namespace hal {

class Clock {
 public:
  //: Returns nanoseconds since any fixed instant; never goes back.
  virtual p2os::Nanos now() = 0;

 protected:
  ~Clock() = default;
};

}  // namespace hal
