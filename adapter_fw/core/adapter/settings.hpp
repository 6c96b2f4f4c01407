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
static_assert(MAX_DISTANCES + 2 * MAX_WIDTH <= 32, "the outputs are a word");

//: A robot as the adapter sees it; generated/robots.hpp has them.
struct RobotNumbers {
  std::int64_t distance_nm_per_count;
  std::int64_t angle_counts_per_turn;
  std::int64_t velocity_um_s_per_count;
  std::int64_t range_um_per_count;
  std::int64_t track_mm;
  std::int64_t wheel_diameter_um;
  //: Ceiling of the model: no step of the odometry is longer than this makes.
  std::int64_t ceiling_mm_s;
  //: The lower of the model's ceiling and its default limit.
  std::int64_t max_velocity_mm_s;
  std::int64_t max_rotation_deg_s;
  //: Half of the sonar's range: the threshold where none is set.
  std::int64_t half_sonar_range_um;
};

//: The wires' widths and levels; each board's generated/…/pins.hpp has them.
struct WireNumbers {
  std::int32_t distances;
  std::int32_t motor1_width;
  std::int32_t motor2_width;
  std::int32_t encoder_width;
  //: Distance wires that are driven to a level when nothing is known, and that level (bit 0 is DD1).
  std::uint32_t safe_mask;
  std::uint32_t safe_levels;
  //: What the encoders' wires show while nobody drives them, the left one's code in the low bits.
  std::uint32_t released_codes;
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
