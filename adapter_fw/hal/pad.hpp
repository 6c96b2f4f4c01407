// A game pad; one of six small interfaces of the hardware.
#pragma once

#include "../core/adapter/gamepad.hpp"

namespace hal {

class Pad {
 public:
  //: Copies the oldest report that has not been taken; false where there is none.
  virtual bool take(adapter::PadReport& report) = 0;
  //: Obeys the pad that connects within PAIRING_NS from now on, and from then on no other; nothing where pads are not paired.
  virtual void pair(p2os::Nanos) {}

  //: chosen: time to find the pad's pairing buttons.
  static constexpr p2os::Nanos PAIRING_NS = 30 * p2os::NS_PER_S;

 protected:
  ~Pad() = default;
};

}  // namespace hal
