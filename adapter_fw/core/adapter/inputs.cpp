#include "inputs.hpp"

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
  next_ = 0;
  word_ = 0;
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

void Debounce::reset() {
  level_ = raw_ = false;
  since_ = 0;
}

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
