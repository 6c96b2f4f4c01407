// Where reports of a game pad come from; the build chooses pad_none.cpp or pad_bluepad32.cpp.
#pragma once

#include "../../hal/pad.hpp"
#include "store.hpp"

namespace esp32 {

// Returns the pad; nullptr where this firmware has none. Which one was paired is kept in the store, which has started.
hal::Pad* pad(Store& store);

// Runs what the pad's radio needs, for ever, on the task that calls; returns at once where there is none.
void run_pad();

}  // namespace esp32
