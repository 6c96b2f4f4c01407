// One pass of the adapter's loop: bytes, pad, deadlines, output. The same on every board.
//
// Theory of operation. One task owns the adapter and calls `pass` whenever
// something may have come, at the latest at the time that it returned. Interrupts
// and other tasks only fill queues behind the hardware's interfaces.
#pragma once

#include <array>
#include <cstdint>

#include "../../hal/clock.hpp"
#include "../../hal/pad.hpp"
#include "../../hal/uart.hpp"
#include "../adapter/adapter.hpp"

namespace shell {

class Runner {
 public:
  Runner(adapter::Adapter& adapter, hal::Clock& clock, hal::Uart& uart, hal::Pad* pad)
      : adapter_(adapter), clock_(clock), uart_(uart), pad_(pad), baud_(adapter.baud()) {}

  // Does all that is due; returns when it wants to be called again at the latest.
  p2os::Nanos pass();

 private:
  adapter::Adapter& adapter_;
  hal::Clock& clock_;
  hal::Uart& uart_;
  hal::Pad* pad_;
  std::int32_t baud_;
};

}  // namespace shell
