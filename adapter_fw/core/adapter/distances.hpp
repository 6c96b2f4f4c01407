// The distance levels, out of sonar readings that arrive two at a time.
//
// A level is high where the last reading is nearer than the threshold, and high
// where there is none or it has gone stale: what is not known is an obstacle.
#pragma once

#include <array>
#include <cstdint>

#include "settings.hpp"

namespace adapter {

class Distances {
 public:
  Distances(std::int32_t count, std::int64_t threshold_um, Nanos stale_ns)
      : count_(count), threshold_um_(threshold_um), stale_ns_(stale_ns) {}

  // Stores a reading of sonar `number` (from 0); sonar without a wire are left out.
  void take(std::int32_t number, std::int64_t range_um, Nanos now);
  void forget();

  // Forgets the readings that are stale at `now`.
  void expire(Nanos now);

  // Returns when the oldest reading goes stale, NEVER where there is none.
  Nanos expires_at() const;

  // Returns the level of each distance wire, DD1 in bit 0.
  std::uint32_t levels() const;

 private:
  struct Reading {
    std::int64_t range_um{};
    Nanos at{};
    bool is_known = false;
  };

  std::array<Reading, MAX_DISTANCES> readings_{};
  std::int32_t count_;
  std::int64_t threshold_um_;
  Nanos stale_ns_;
};

}  // namespace adapter
