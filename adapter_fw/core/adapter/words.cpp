// The words for states and events: those of the Python model, so that logs can be compared.

#include "adapter.hpp"

namespace adapter {

const char* text(State state) {
  constexpr const char* WORDS[] = {"reset",    "booting", "idle",    "connecting",
                                   "settling", "driving", "closing", "lost"};
  return WORDS[static_cast<std::size_t>(state)];
}

const char* text(What what) {
  constexpr const char* WORDS[] = {
      "reset",   "booting", "booted",          "connecting",   "connected", "no connection",
      "driving", "command", "stall",           "odometry jumped", "disconnected", "idle",
      "lost",    "implausible", "pad lost",      "master",       "master",    "shutdown",
  };
  return WORDS[static_cast<std::size_t>(what)];
}

const char* text(Master master) { return master == Master::PAD ? "pad" : "bluepill"; }

}  // namespace adapter
