// A game pad; one of five small interfaces of the hardware.
#pragma once

#include "../core/adapter/gamepad.hpp"

namespace hal {

class Pad {
 public:
  //: Copies the newest report; false where none has come since the last call.
  virtual bool take(adapter::PadReport& report) = 0;

 protected:
  ~Pad() = default;
};

}  // namespace hal
