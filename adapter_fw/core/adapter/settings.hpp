// Everything about the adapter that can be set, and the numbers of robot and wires that it needs.
//
// Settings, robots and pins come from generated tables.
#pragma once

#include <cstddef>
#include <cstdint>

#include "../p2os/time.hpp"
#include "setting_table.hpp"

namespace adapter {

using p2os::NS_PER_MS;
using p2os::NS_PER_S;

//: Who commands the robot; never both.
enum class Master : std::uint8_t { BLUEPILL, PAD };

//: More than any board has; arrays are this long.
constexpr std::size_t MAX_DISTANCES = 16;
constexpr std::int32_t MAX_WIDTH = 8;
constexpr std::int32_t MAX_SAMPLE_COUNT = 31;

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

//: The wires' widths and levels; from adapter_sim/pinout.toml.
struct WireNumbers {
  std::int32_t distances = 8;
  std::int32_t motor1_width = 3;
  std::int32_t motor2_width = 3;
  std::int32_t encoder_width = 3;
  //: Distance wires that are driven to a level when nothing is known, and that level (bit 0 is DD1).
  std::uint32_t safe_mask = 0xFF;
  std::uint32_t safe_levels = 0xFF;
  //: What the encoders' wires show while nobody drives them, the left one's code in the low bits.
  std::uint32_t released_codes = 0x20;
};

struct Settings {
#define MEMBER(type, name, standard, least) type name = standard;
  ADAPTER_SETTINGS(MEMBER)
#undef MEMBER
  //: Line speeds that are tried in turn while nobody answers; 0 ends the list.
  std::int32_t bauds[MAX_BAUDS] = {DEFAULT_BAUD};
};

// Returns what is wrong with settings as one line for a person, or nullptr.
[[nodiscard]] const char* fault_of(const WireNumbers& wires);
[[nodiscard]] const char* fault_of(const Settings& settings, const WireNumbers& wires);
[[nodiscard]] const char* fault_of(const RobotNumbers& robot);

}  // namespace adapter
