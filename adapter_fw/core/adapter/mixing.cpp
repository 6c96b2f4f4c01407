#include "mixing.hpp"

#include "../../hal/pins.hpp"
#include "numbers.hpp"

namespace adapter {

namespace {

//: 180/pi, in 1e-9.
constexpr std::int64_t DEG_PER_RAD_E9 = 57'295'779'513;
constexpr std::int64_t E9 = 1'000'000'000;
constexpr std::int64_t E12 = 1'000 * E9;

std::int64_t lower(std::int64_t robot, std::int64_t wanted) { return wanted >= 0 && wanted < robot ? wanted : robot; }

std::int64_t scaled(std::int64_t value, std::int64_t numerator, std::int64_t denominator) {
  return value * numerator / denominator;  // towards zero, as the language divides
}

}  // namespace

Mixer::Mixer(const Settings& settings, const RobotNumbers& robot, std::int64_t full_steps)
    : meaning_(settings.motor_meaning),
      steps_(settings.motor_command == MotorCommand::DUTY ? full_steps : 1),
      per_(settings.motor_command == MotorCommand::DUTY ? hal::FULL_DUTY : 1),
      step_um_per_s_(settings.step_um_per_s),
      angular_step_urad_per_s_(settings.angular_step_urad_per_s),
      pad_velocity_mm_s_(settings.pad_velocity_mm_s),
      pad_rotation_mrad_s_(settings.pad_rotation_mrad_s),
      track_mm_(robot.track_mm),
      max_velocity_mm_s_(lower(robot.max_velocity_mm_s, settings.max_velocity_mm_s)),
      max_rotation_deg_s_(lower(robot.max_rotation_deg_s, settings.max_rotation_deg_s)) {}

Speeds Mixer::mix(std::int32_t motor1, std::int32_t motor2) const {
  const std::int64_t first = of_steps(motor1, step_um_per_s_);
  if (meaning_ == MotorMeaning::WHEELS) {
    const std::int64_t second = of_steps(motor2, step_um_per_s_);
    // um/s over um of track are rad/s. fault_of() keeps the rim's difference below 8e7 um/s, so that this fits.
    const std::int64_t forward = divide_half_away(first + second, 2'000);
    const std::int64_t turn = divide_half_away((second - first) * DEG_PER_RAD_E9, track_mm_ * E12);
    return limited(forward, turn);
  }
  const std::int64_t forward = divide_half_away(first, 1'000);
  const std::int64_t second = of_steps(motor2, angular_step_urad_per_s_);
  return limited(forward, divide_half_away(second * DEG_PER_RAD_E9, 1'000 * E12));
}

std::int64_t Mixer::of_steps(std::int64_t value, std::int64_t step) const {
  return divide_half_away(value * step * steps_, per_);
}

Speeds Mixer::steer(std::int32_t forward, std::int32_t turn) const {
  const std::int64_t mm_s = divide_half_away(forward * pad_velocity_mm_s_, TRIGGER_FULL);
  const std::int64_t deg_s = divide_half_away(turn * pad_rotation_mrad_s_ * DEG_PER_RAD_E9, STICK_FULL * E12);
  return limited(mm_s, deg_s);
}

Wheels Mixer::wheels_mm_s(Speeds speeds) const {
  const std::int64_t rim = divide_half_away(speeds.turn_deg_s * track_mm_ * E9, 2 * DEG_PER_RAD_E9);
  return {speeds.forward_mm_s - rim, speeds.forward_mm_s + rim};
}

Speeds Mixer::limited(std::int64_t forward, std::int64_t turn) const {
  if (size_of_number(forward) > max_velocity_mm_s_) {
    turn = scaled(turn, max_velocity_mm_s_, size_of_number(forward));
    forward = forward < 0 ? -max_velocity_mm_s_ : max_velocity_mm_s_;
  }
  if (size_of_number(turn) > max_rotation_deg_s_) {
    forward = scaled(forward, max_rotation_deg_s_, size_of_number(turn));
    turn = turn < 0 ? -max_rotation_deg_s_ : max_rotation_deg_s_;
  }
  return {static_cast<std::int32_t>(forward), static_cast<std::int32_t>(turn)};
}

}  // namespace adapter
