// Everything about the adapter that can be set, and the numbers of robot and wires that it needs.
//
// The defaults are those of the Python model (adapter_sim/settings.py); a test holds
// them together. Robots and pins come from generated tables.
#pragma once

#include <cstddef>
#include <cstdint>

#include "../p2os/time.hpp"
#include "../p2os/times.hpp"

namespace adapter {

using p2os::Nanos;
using p2os::NS_PER_MS;
using p2os::NS_PER_S;

enum class BitOrder : std::uint8_t { COMM3_MSB, COMM1_MSB };
enum class MotorMeaning : std::uint8_t { WHEELS, LINEAR_ANGULAR };
enum class EncoderAtOpen : std::uint8_t { ZERO, CONTINUE };
//: Who commands the robot; never both.
enum class Master : std::uint8_t { BLUEPILL, PAD };

//: More than any board has; arrays are this long.
constexpr std::size_t MAX_DISTANCES = 16;
constexpr std::int32_t MAX_WIDTH = 8;
constexpr std::int32_t MAX_SAMPLE_COUNT = 31;
constexpr std::size_t MAX_BAUDS = 8;

//: A robot as the adapter sees it; from p2os/robots.
struct RobotNumbers {
  std::int64_t distance_nm_per_count = 840'000;
  std::int64_t angle_counts_per_turn = 4'096;
  std::int64_t velocity_um_s_per_count = 1'000;
  std::int64_t range_um_per_count = 268;
  std::int64_t track_mm = 357;
  std::int64_t wheel_diameter_um = 165'000;
  //: Ceiling of the model: no step of the odometry is longer than this makes.
  std::int64_t ceiling_mm_s = 2'200;
  //: The lower of the model's ceiling and its default limit.
  std::int64_t max_velocity_mm_s = 750;
  std::int64_t max_rotation_deg_s = 100;
  //: Half of the sonar's range: the threshold where none is set.
  std::int64_t half_sonar_range_um = 2'500'000;
};

//: The wires' widths and safe levels; from adapter_sim/pinout.toml.
struct WireNumbers {
  std::int32_t distances = 8;
  std::int32_t motor1_width = 3;
  std::int32_t motor2_width = 3;
  std::int32_t encoder_width = 3;
  //: Distance wires that are driven to a level when nothing is known, and that level (bit 0 is DD1).
  std::uint32_t safe_mask = 0xFF;
  std::uint32_t safe_levels = 0xFF;
};

struct Settings {
  //: Nearer is an obstacle; a negative value takes half of the robot's sonar range.
  std::int64_t threshold_um = -1;
  BitOrder bit_order = BitOrder::COMM3_MSB;
  MotorMeaning motor_meaning = MotorMeaning::WHEELS;
  std::int64_t step_um_per_s = 62'500;
  std::int64_t angular_step_urad_per_s = 425'000;
  //: Caps of what is sent; negative leaves the robot's own, which hold in any case.
  std::int64_t max_velocity_mm_s = -1;
  std::int64_t max_rotation_deg_s = -1;

  Nanos sample_period_ns = 2 * NS_PER_MS;
  std::int32_t sample_count = 5;
  Nanos connect_after_ns = 10 * NS_PER_MS;
  Nanos disconnect_after_ns = 10 * NS_PER_MS;
  Nanos boot_ns = 300 * NS_PER_MS;

  Nanos pair_spacing_ns = 25 * NS_PER_MS;
  Nanos refresh_ns = 200 * NS_PER_MS;
  Nanos pulse_ns = p2os::PULSE_NS;

  Nanos liveness_ns = p2os::LIVENESS_NS;
  Nanos first_sip_ns = 1 * NS_PER_S;
  Nanos retry_ns = 1 * NS_PER_S;
  Nanos plausibility_ns = 1 * NS_PER_S;
  std::int64_t plausibility_tolerance_mm_s = 40;
  std::int64_t plausibility_progress_mm_s = 5;
  Nanos distance_stale_ns = 1 * NS_PER_S;
  Nanos settle_ns = 500 * NS_PER_MS;
  EncoderAtOpen encoder_at_open = EncoderAtOpen::ZERO;
  Nanos encoder_dwell_ns = 20 * NS_PER_MS;
  bool stop_unknown_robot = true;
  std::int32_t stop_repeats = 3;
  Nanos stop_repeat_ns = 200 * NS_PER_MS;

  //: Line speeds that are tried in turn while nobody answers; 0 ends the list.
  std::int32_t bauds[MAX_BAUDS] = {9'600, 0, 0, 0, 0, 0, 0, 0};

  //: The thesis scales the pad to 0.4 m/s and 1.7 rad/s (its later repository to 0.5 m/s).
  std::int64_t pad_velocity_mm_s = 400;
  std::int64_t pad_rotation_mrad_s = 1'700;
  //: Triggers below this of 1023, and sticks nearer to the middle than this of 512, count as at rest.
  std::int32_t pad_trigger_dead = 40;
  std::int32_t pad_stick_dead = 40;
  //: A pad that was silent so long is gone. # chosen: 150 ms, a pair being sent and the STOP make less than 200 ms
  Nanos pad_loss_ns = 150 * NS_PER_MS;
};

// Returns what is wrong with settings as one line for a person, or nullptr.
[[nodiscard]] const char* fault_of(const WireNumbers& wires);
[[nodiscard]] const char* fault_of(const Settings& settings, const WireNumbers& wires);
[[nodiscard]] const char* fault_of(const RobotNumbers& robot);

}  // namespace adapter
