// Wheel travel out of the robot's odometry, and absolute codes out of travel.
//
// Between two packets the robot moved along a chord; its signed projection on the
// mean heading, lengthened to the arc, is the forward step. The wheels' travels
// are forward -+ heading x track / 2. The heading part is taken from the whole
// unwrapped heading, never summed; the forward part is summed in counts x 2^30, an
// exact integer. A step too long for any wheel is no travel: it becomes the new
// reference and is counted. The derivation stands in adapter_sim/encoders.py.
//
// Ranges: |chord| < 2^46, its arc's excess (2^26 x 2^20 x 107802) < 2^63.
#pragma once

#include <cstdint>

#include "mixing.hpp"
#include "settings.hpp"

namespace adapter {

//: Follows a counter that wraps: any step smaller than half of its modulus is exact.
class Unwrapper {
 public:
  explicit Unwrapper(std::int32_t modulus) : modulus_(modulus) {}

  // Takes a value; returns the signed step since the last one, 0 for the first.
  std::int32_t update(std::int32_t raw);
  void forget() { has_last_ = false; }

 private:
  std::int32_t modulus_;
  std::int32_t last_{};
  bool has_last_ = false;
};

class Encoders {
 public:
  Encoders(const RobotNumbers& robot, Nanos longest_gap_ns, std::int32_t width);

  // Starts anew at this travel in nm; the next packet is the reference.
  void begin(Wheels travel_nm);

  // Adds the odometry of a packet (heading in 4096ths of a turn); false where it is no step that a wheel can make.
  bool take(std::int32_t raw_x, std::int32_t raw_y, std::int32_t raw_heading);

  // Returns how far both rims have rolled, in nm, + forward.
  Wheels travel_nm() const;

  // Returns how far both rims have rolled where these steps begin, in nm; whole um, for what is kept has no finer.
  Wheels travel_nm_at(Wheels counts) const;

  // Returns where both wheels stand within their turn, in um of the rim.
  Wheels phases_um() const;

  // Returns the encoder steps of both wheels, by floor, unwrapped.
  Wheels counts() const;

  std::uint32_t jumps() const { return jumps_; }
  void forget_jumps() { jumps_ = 0; }

 private:
  std::int64_t distance_nm_per_count_;
  std::int64_t longest_counts_;
  std::int64_t per_turn_nm_;
  std::int64_t rim_per_turn_nm_;
  std::int32_t width_;
  Unwrapper x_;
  Unwrapper y_;
  Unwrapper turn_;
  std::int32_t raw_heading_{};
  bool has_heading_ = false;
  std::int64_t heading_ = 0;
  std::int64_t forward_ = 0;
  Wheels offset_nm_;
  std::uint32_t jumps_ = 0;
};

// Returns the sine x 2^30 of an angle in 8192nds of a turn.
std::int32_t sine(std::int32_t half_counts);

// Returns the signed length of a step along its mean heading, in counts x 2^30.
std::int64_t forward_step(std::int32_t dx, std::int32_t dy, std::int32_t heading_before, std::int32_t heading_after);

}  // namespace adapter
