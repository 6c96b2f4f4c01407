// The adapter's output wires: distances and encoder codes, released or driven; each change once.
//
// Encoder codes walk: at most one code each encoder_dwell_ns, so that a program
// that polls never sees a jump, not even when packets were lost meanwhile.
#pragma once

#include <cstdint>

#include "../../hal/pins.hpp"
#include "../p2os/uncopied_pointer.hpp"
#include "mixing.hpp"
#include "settings.hpp"

namespace adapter {

//: One encoder's count on its way to a target.
class CodeWalk {
 public:
  explicit CodeWalk(Nanos dwell_ns) : dwell_ns_(dwell_ns) {}

  // Returns when the next step towards the target is due, NEVER where it is reached.
  Nanos due_at(std::int64_t target, Nanos now) const;

  // Takes a step if one is due.
  void step(std::int64_t target, Nanos now);

  // Names the same code by its count nearest to 0.
  void rebase(std::int64_t steps);
  // Forgets when the last step was; the code stays.
  void reset() { has_stepped_ = false; }
  // Stands at a count, at once.
  void stand_at(std::int64_t count) { shown_ = count; }

  std::int64_t shown() const { return shown_; }

 private:
  Nanos dwell_ns_;
  std::int64_t shown_ = 0;
  Nanos stepped_at_{};
  bool has_stepped_ = false;
};

class Outputs {
 public:
  explicit Outputs(const WireNumbers& wires) : wires_(wires) {}

  // Where the wires are; must outlive this.
  void set_pins(hal::PinsOut* pins) { pins_.set(pins); }

  void release(Nanos now);
  // Drives the safe levels; wires that hold stay as they are.
  void show_safe(Nanos now) { show(wires_.safe_mask, wires_.safe_levels, now); }
  void show_distances(std::uint32_t levels, Nanos now);
  void show_encoders(Wheels counts, Nanos now);

  // Returns which outputs are driven, and their levels.
  std::uint32_t driven() const { return driven_; }
  std::uint32_t levels() const { return levels_; }

 private:
  void show(std::uint32_t mask, std::uint32_t levels, Nanos now);

  WireNumbers wires_;
  p2os::UncopiedPointer<hal::PinsOut> pins_;
  std::uint32_t driven_ = 0;
  std::uint32_t levels_ = 0;
};

}  // namespace adapter
