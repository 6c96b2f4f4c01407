// Where reports of a game pad come from; the build chooses pad_none.cpp or pad_bluepad32.cpp.
#pragma once

#include "../../hal/pad.hpp"

namespace esp32 {

// Returns the pad; nullptr where this firmware has none.
hal::Pad* pad();

// Runs what the pad's radio needs, for ever, on the task that calls; returns at once where there is none.
void run_pad();

}  // namespace esp32
