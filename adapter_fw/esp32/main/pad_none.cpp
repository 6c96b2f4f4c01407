#include "pad.hpp"

namespace esp32 {

hal::Pad* pad(Store&) { return nullptr; }

void run_pad() {}

}  // namespace esp32
