#include "distances.hpp"

namespace adapter {

void Distances::take(std::int32_t number, std::int64_t range_um, Nanos now) {
  if (number >= 0 && number < count_) {
    readings_[static_cast<std::size_t>(number)] = {range_um, now, true};
  }
}

void Distances::forget() { readings_.fill({}); }

void Distances::expire(Nanos now) {
  for (Reading& reading : readings_) {
    if (reading.is_known && now - reading.at >= stale_ns_) {
      reading = {};
    }
  }
}

Nanos Distances::expires_at() const {
  Nanos oldest = p2os::NEVER;
  for (const Reading& reading : readings_) {
    if (reading.is_known) {
      oldest = p2os::earlier(oldest, reading.at + stale_ns_);
    }
  }
  return oldest;
}

std::uint32_t Distances::levels() const {
  std::uint32_t levels = 0;
  for (std::int32_t number = 0; number < count_; ++number) {
    const Reading& reading = readings_[static_cast<std::size_t>(number)];
    if (!reading.is_known || reading.range_um < threshold_um_) {
      levels |= 1U << number;
    }
  }
  return levels;
}

}  // namespace adapter
