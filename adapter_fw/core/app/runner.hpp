// One pass of the adapter's loop: bytes, pad, deadlines, output. The same on every board.
//
// Theory of operation. One task owns the adapter and calls `pass` whenever
// something may have come, at the latest at the time that it returned. Interrupts
// and other tasks only fill queues behind the hardware's interfaces.
//
// A gap is a pass that comes more than GAP_NS after it was due: the machine slept,
// the program was stopped, or the task hung. What was commanded before it is out of date.
// So STOP goes out first, then what waits on the line is read, and the robot stands
// until its master asks anew.
#pragma once

#include <array>
#include <cstdint>

#include "../../hal/clock.hpp"
#include "../../hal/pad.hpp"
#include "../../hal/uart.hpp"
#include "../adapter/adapter.hpp"

namespace app {

class Runner {
 public:
  //: chosen: three SIP cycles and a frame, as long as silence of the robot is borne.
  static constexpr p2os::Nanos GAP_NS = 350 * p2os::NS_PER_MS;

  Runner(adapter::Adapter& adapter, hal::Clock& clock, hal::Uart& uart, hal::Pad* pad)
      : adapter_(adapter), clock_(clock), uart_(uart), pad_(pad), baud_(adapter.baud()), due_(clock.now()) {}

  // Does all that is due; returns when it wants to be called again at the latest.
  p2os::Nanos pass();

 private:
  // Returns the time, before which the adapter has stopped the robot if there was a gap.
  p2os::Nanos look_for_gap();
  void send();

  adapter::Adapter& adapter_;
  hal::Clock& clock_;
  hal::Uart& uart_;
  hal::Pad* pad_;
  std::int32_t baud_;
  //: When the pass that is due begins, or when the one that runs has begun.
  p2os::Nanos due_;
};

}  // namespace app
