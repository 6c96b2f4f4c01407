// Debounced inputs: motor wires by majority, duties by median, p2dx_con by time.
//
// A word is taken when it makes up more than half of the last samples; while no
// word does (the BluePill is half-way through writing its bits), the last one
// taken stays. p2dx_con counts as high once it has been seen high for MORE than
// connect_after_ns without a break, as low once seen low for disconnect_after_ns.
//
// A period of a duty lasts from one rising edge to the next, and the duty is known at
// its end; a wire without an edge for duty_timeout_ns has a level. The twin of
// adapter_sim/duty.py, which says more.
#pragma once

#include <array>
#include <cstdint>

#include "settings.hpp"

namespace adapter {

class Majority {
 public:
  explicit Majority(std::int32_t count) : count_(count) {}

  // Adds a sample; tells whether the word taken has changed.
  bool take(std::uint32_t word);

  // Forgets all samples, as if 0 had always been there.
  void reset();

  std::uint32_t word() const { return word_; }

 private:
  std::array<std::uint32_t, MAX_SAMPLE_COUNT> window_{};
  std::int32_t count_;
  std::int32_t next_ = 0;
  std::uint32_t word_ = 0;
};

class DutyMeter {
 public:
  explicit DutyMeter(Nanos timeout_ns) : timeout_ns_(timeout_ns) {}

  // Forgets all edges; the wire counts as having been at `level` for long.
  void restart(bool level);
  // Takes a change of the wire, in the order of time. `stamp` is when by a clock of any rate, which wraps.
  void edge(bool level, Nanos at, std::uint32_t stamp);
  // Returns the share of a period at level 1 as known at `at`, in 1/1000.
  std::int32_t duty(Nanos at);

 private:
  void expire(Nanos at);

  Nanos timeout_ns_;
  Nanos edge_at_{};
  std::uint32_t rose_{};
  std::uint32_t fell_{};
  std::int32_t duty_ = 0;
  bool level_ = false;
  bool has_edge_ = false;
  bool has_risen_ = false;
};

// A window over a number's last samples, with their median.
class Median {
 public:
  explicit Median(std::int32_t count) : count_(count) {}

  // Adds a sample; tells whether the median has changed.
  bool take(std::int32_t sample);
  // Forgets all samples, as if 0 had always been there.
  void reset();

  std::int32_t value() const { return value_; }

 private:
  std::array<std::int32_t, MAX_SAMPLE_COUNT> window_{};
  std::int32_t count_;
  std::int32_t next_ = 0;
  std::int32_t value_ = 0;
};

class Debounce {
 public:
  Debounce(Nanos high_after_ns, Nanos low_after_ns) : high_after_ns_(high_after_ns), low_after_ns_(low_after_ns) {}

  // Adds a sample; tells whether the level that counts has changed.
  bool take(bool raw, Nanos now);
  void reset();

  bool level() const { return level_; }

 private:
  Nanos high_after_ns_;
  Nanos low_after_ns_;
  Nanos since_{};
  bool level_ = false;
  bool raw_ = false;
};

// Returns the signed value that motor wires carry; the last wire weighs most unless `order` says otherwise.
std::int32_t motor_value(std::uint32_t code, std::int32_t width, BitOrder order);

}  // namespace adapter
