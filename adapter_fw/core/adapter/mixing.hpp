// Motor values and game pads to VEL and RVEL, in integers.
//
// As wheels: v = (left + right) / 2, w = (right - left) / track, in whole mm/s and
// whole deg/s, both rounded half away from zero. Where a speed is over its limit
// both are scaled by the same factor (towards zero): the robot keeps its path and
// only takes longer.
#pragma once

#include <cstdint>

#include "settings.hpp"

namespace adapter {

struct Speeds {
  std::int32_t forward_mm_s = 0;
  std::int32_t turn_deg_s = 0;  // + to the left

  constexpr bool operator==(const Speeds& other) const {
    return forward_mm_s == other.forward_mm_s && turn_deg_s == other.turn_deg_s;
  }
  constexpr bool operator!=(const Speeds& other) const { return !(*this == other); }
};

struct Wheels {
  std::int64_t left = 0;
  std::int64_t right = 0;

  constexpr bool operator==(const Wheels& other) const { return left == other.left && right == other.right; }
};

class Mixer {
 public:
  // A full duty stands for `full_steps`.
  Mixer(const Settings& settings, const RobotNumbers& robot, std::int64_t full_steps);

  // Returns the speeds that a pair of signed motor values asks for: steps, or duties in 1/1000.
  Speeds mix(std::int32_t motor1, std::int32_t motor2) const;

  // Returns the speeds of a pad: `forward` of TRIGGER_FULL, `turn` of STICK_FULL to the left.
  Speeds steer(std::int32_t forward, std::int32_t turn) const;

  // Returns the rim speeds that commanded speeds mean, in whole mm/s.
  Wheels wheels_mm_s(Speeds speeds) const;

 private:
  std::int64_t of_steps(std::int64_t value, std::int64_t step) const;
  Speeds limited(std::int64_t forward, std::int64_t turn) const;

  MotorMeaning meaning_;
  //: A motor value is so many steps, divided by `per_`.
  std::int64_t steps_;
  std::int64_t per_;
  std::int64_t step_um_per_s_;
  std::int64_t angular_step_urad_per_s_;
  std::int64_t pad_velocity_mm_s_;
  std::int64_t pad_rotation_mrad_s_;
  std::int64_t track_mm_;
  std::int64_t max_velocity_mm_s_;
  std::int64_t max_rotation_deg_s_;
};

}  // namespace adapter
