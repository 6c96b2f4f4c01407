#include "gamepad.hpp"

namespace adapter {

namespace {

// Returns a deflection with its dead zone taken out and the rest stretched to the full range.
std::int32_t outside(std::int32_t value, std::int32_t dead, std::int32_t full) {
  // Cut first: a report may hold any number, and the most negative one has no magnitude.
  const std::int32_t cut = value > full ? full : value < -full ? -full : value;
  const std::int32_t size = cut < 0 ? -cut : cut;
  if (size <= dead) {
    return 0;
  }
  const std::int32_t stretched = (size - dead) * full / (full - dead);
  return cut < 0 ? -stretched : stretched;
}

}  // namespace

void Gamepad::take(const PadReport& report, Nanos now) {
  reported_at_ = now;
  has_report_ = true;
  if (report.down) {
    wants_robot_ = false;
  } else if (report.up && !was_up_) {
    wants_robot_ = true;
  }
  was_up_ = report.up;
  forward_ = outside(report.forward, trigger_dead_, TRIGGER_FULL) -
             outside(report.backward, trigger_dead_, TRIGGER_FULL);
  turn_ = -outside(report.turn, stick_dead_, STICK_FULL);
}

// A button that was down when the pad went must come up before it means anything.
void Gamepad::lose() {
  has_report_ = wants_robot_ = false;
  was_up_ = true;
  forward_ = turn_ = 0;
}

}  // namespace adapter
