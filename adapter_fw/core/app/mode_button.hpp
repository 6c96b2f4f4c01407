// The button that gives the robot to the other master.
//
// A press counts once it has been held for HOLD_NS without a break; the button must
// come up before it counts again. One that is held from the start on does not count.
#pragma once

#include "../p2os/time.hpp"

namespace app {

class ModeButton {
 public:
  //: chosen: longer than any contact bounces, shorter than anyone presses.
  static constexpr p2os::Nanos HOLD_NS = 50 * p2os::NS_PER_MS;

  // Takes the button as it stands; tells whether it has just counted.
  bool take(bool is_down, p2os::Nanos now) {
    if (!is_down) {
      is_armed_ = true;
      since_ = now;
      return false;
    }
    if (!is_armed_ || now - since_ < HOLD_NS) {
      return false;
    }
    is_armed_ = false;
    return true;
  }

 private:
  bool is_armed_ = false;
  p2os::Nanos since_{};
};

}  // namespace app
