// What the status LED shows; a board whose pin map has no LED has no use for it.
//
//     state                    pattern, begins anew every two seconds
//     reset, booting           dark
//     idle                     one flash
//     connecting               two flashes
//     settling                 three flashes
//     driving, BluePill        on
//     driving, pad             on, with one gap
//     closing                  four flashes
//     lost                     flickers all the time
#pragma once

#include "../adapter/adapter.hpp"

namespace app {

constexpr p2os::Nanos LED_PERIOD_NS = 2 * p2os::NS_PER_S;

// Tells whether the LED is on at `now`.
bool led_is_on(adapter::State state, adapter::Master master, p2os::Nanos now);

}  // namespace app
