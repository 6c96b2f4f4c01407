// The ESP32's microsecond timer.
#pragma once

#include <esp_timer.h>

#include "../../hal/clock.hpp"

namespace esp32 {

class Clock final : public hal::Clock {
 public:
  p2os::Nanos now() override { return esp_timer_get_time() * p2os::NS_PER_US; }
};

}  // namespace esp32
