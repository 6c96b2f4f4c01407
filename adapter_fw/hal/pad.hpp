// A game pad; one of six small interfaces of the hardware.
#pragma once

#include "../core/adapter/gamepad.hpp"

namespace hal {

class Pad {
 public:
  //: Copies the oldest report that has not been taken; false where there is none.
  virtual bool take(adapter::PadReport& report) = 0;

 protected:
  ~Pad() = default;
};

}  // namespace hal
