#include "inputs.hpp"

#include "../../hal/pins.hpp"

namespace adapter {

bool Majority::take(std::uint32_t word) {
  window_[static_cast<std::size_t>(next_)] = word;
  next_ = (next_ + 1) % count_;
  if (word == word_) {
    return false;
  }
  // Only the newest word can have gained a majority that it had not before.
  std::int32_t same = 0;
  for (std::int32_t place = 0; place < count_; ++place) {
    same += window_[static_cast<std::size_t>(place)] == word ? 1 : 0;
  }
  if (2 * same <= count_) {
    return false;
  }
  word_ = word;
  return true;
}

void Majority::reset() {
  window_.fill(0);
  word_ = 0;
}

void DutyMeter::restart(bool level) {
  level_ = level;
  duty_ = level ? hal::FULL_DUTY : 0;
  has_edge_ = has_risen_ = false;
}

void DutyMeter::edge(bool level, Nanos at, std::uint32_t stamp) {
  if (level == level_) {
    return;
  }
  expire(at);
  level_ = level;
  edge_at_ = at;
  has_edge_ = true;
  if (!level) {
    fell_ = stamp;
    return;
  }
  if (has_risen_) {
    const std::uint64_t high = fell_ - rose_;
    const std::uint64_t period = stamp - rose_;
    duty_ = period == 0 ? duty_ : static_cast<std::int32_t>((2 * high * hal::FULL_DUTY + period) / (2 * period));
  }
  rose_ = stamp;
  has_risen_ = true;
}

std::int32_t DutyMeter::duty(Nanos at) {
  expire(at);
  return duty_;
}

void DutyMeter::expire(Nanos at) {
  if (has_edge_ && at - edge_at_ >= timeout_ns_) {
    restart(level_);
  }
}

bool Median::take(std::int32_t sample) {
  window_[static_cast<std::size_t>(next_)] = sample;
  next_ = (next_ + 1) % count_;
  const std::int32_t before = value_;
  // The sample that at most half of the others are below, and at most half above.
  for (std::int32_t place = 0; place < count_; ++place) {
    const std::int32_t candidate = window_[static_cast<std::size_t>(place)];
    std::int32_t below = 0;
    std::int32_t above = 0;
    for (std::int32_t other = 0; other < count_; ++other) {
      below += window_[static_cast<std::size_t>(other)] < candidate ? 1 : 0;
      above += window_[static_cast<std::size_t>(other)] > candidate ? 1 : 0;
    }
    if (2 * below < count_ && 2 * above < count_) {
      value_ = candidate;
      break;
    }
  }
  return value_ != before;
}

void Median::reset() {
  window_.fill(0);
  value_ = 0;
}

bool Debounce::take(bool raw, Nanos now) {
  if (raw != raw_) {
    raw_ = raw;
    since_ = now;
  }
  if (raw == level_) {
    return false;
  }
  const Nanos lasted = now - since_;
  if (raw ? lasted <= high_after_ns_ : lasted < low_after_ns_) {
    return false;
  }
  level_ = raw;
  return true;
}

void Debounce::reset() { level_ = raw_ = false; }

std::int32_t motor_value(std::uint32_t code, std::int32_t width, BitOrder order) {
  std::uint32_t bits = code;
  if (order == BitOrder::COMM1_MSB) {
    bits = 0;
    for (std::int32_t bit = 0; bit < width; ++bit) {
      bits |= (code >> bit & 1U) << (width - 1 - bit);
    }
  }
  const std::int32_t sign = 1 << (width - 1);
  return (static_cast<std::int32_t>(bits) ^ sign) - sign;
}

}  // namespace adapter
