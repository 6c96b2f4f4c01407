// The status LED, on boards whose pin map has one; on others nothing.
#pragma once

#include "../../core/app/led.hpp"

namespace esp32 {

void start_led();
void show_on_led(const adapter::Adapter& part, p2os::Nanos now);

}  // namespace esp32
