// What the simulated parts share: the state, and the program's way to wait.
#pragma once

#include "machine.h"

namespace simulated {

extern machine_state state;

// Gives way until the clock stands at `until_us`; on the program's own stack.
void wait_until(std::int64_t until_us);

// Called where pads may have changed.
void take_captures();

// Called as time passes, up to `now_us`.
void move_uarts(std::int64_t now_us);
// When a byte next leaves or arrives, or a receiver's time-out ends; far away where nothing is to come.
std::int64_t next_uart_us();

}  // namespace simulated
