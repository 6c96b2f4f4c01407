#include "outputs.hpp"

#include "numbers.hpp"

namespace adapter {

namespace {

//: `count` is below 32.
constexpr std::uint32_t bits(std::int32_t count) { return (1U << count) - 1; }

}  // namespace

Nanos CodeWalk::due_at(std::int64_t target, Nanos now) const {
  if (shown_ == target) {
    return p2os::NEVER;
  }
  return has_stepped_ ? p2os::later(now, stepped_at_ + dwell_ns_) : now;
}

void CodeWalk::step(std::int64_t target, Nanos now) {
  if (due_at(target, now) == now) {
    shown_ += target > shown_ ? 1 : -1;
    stepped_at_ = now;
    has_stepped_ = true;
  }
}

void CodeWalk::rebase(std::int64_t steps) { shown_ = remainder_floor(shown_ + steps / 2, steps) - steps / 2; }

void Outputs::release(Nanos now) {
  if (driven_ != 0) {
    driven_ = levels_ = 0;
    if (pins_) {
      pins_->release(now);
    }
  }
}

void Outputs::show_distances(std::uint32_t levels, Nanos now) { show(bits(wires_.distances), levels, now); }

void Outputs::show_encoders(Wheels counts, Nanos now) {
  const std::uint32_t code = bits(wires_.encoder_width);
  const std::uint32_t left = static_cast<std::uint32_t>(counts.left) & code;
  const std::uint32_t right = static_cast<std::uint32_t>(counts.right) & code;
  const std::uint32_t both = left | right << wires_.encoder_width;
  show(bits(2 * wires_.encoder_width) << wires_.distances, both << wires_.distances, now);
}

void Outputs::show(std::uint32_t mask, std::uint32_t levels, Nanos now) {
  const std::uint32_t changed = mask & (~driven_ | (levels ^ levels_));
  if (changed == 0) {
    return;
  }
  driven_ |= mask;
  levels_ = (levels_ & ~mask) | (levels & mask);
  if (pins_) {
    pins_->drive(changed, levels & changed, now);
  }
}

}  // namespace adapter
