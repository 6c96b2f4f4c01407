#include "driver.hpp"

#include "numbers.hpp"

namespace adapter {

void PlausibilityCheck::begin(Nanos now) {
  command_ = measured_ = {};
  passed_at_ = now;
}

void PlausibilityCheck::expect(Wheels command) {
  if (!(command == command_)) {
    command_ = command;
    least_error_ = error();
  }
}

void PlausibilityCheck::take(Wheels measured, bool stalled, Nanos now) {
  const bool was_near = error() <= tolerance_mm_s_;
  measured_ = measured;
  const std::int64_t error_now = error();
  if (error_now <= tolerance_mm_s_ || stalled || error_now <= least_error_ - progress_mm_s_) {
    least_error_ = error_now;
    passed_at_ = now;
  } else if (was_near) {
    // It has left its command by itself: its way back is measured from here.
    least_error_ = error_now;
  }
}

std::int64_t PlausibilityCheck::error() const {
  const std::int64_t left = size_of_number(command_.left - measured_.left);
  const std::int64_t right = size_of_number(command_.right - measured_.right);
  return left > right ? left : right;
}

void CommandPacer::begin(Speeds speeds) {
  wanted_ = speeds;
  sent_ = {};
  has_sent_ = false;
}

Nanos CommandPacer::due_at(Nanos now) const {
  if (!has_sent_) {
    return now;
  }
  return wanted_ != sent_ ? p2os::later(now, sent_at_ + spacing_ns_) : sent_at_ + refresh_ns_;
}

Speeds CommandPacer::take(Nanos now) {
  sent_ = wanted_;
  sent_at_ = now;
  has_sent_ = true;
  return sent_;
}

}  // namespace adapter
