#include "settings.hpp"

#include <initializer_list>

namespace adapter {

namespace {

//: Beyond these the 64-bit products of mixing.cpp and encoders.cpp would no longer fit.
constexpr std::int64_t MAX_RIM_UM_PER_S = 80'000'000;
constexpr std::int64_t MAX_LENGTH_UM = 10'000'000;
constexpr std::int64_t MAX_SPEED_MM_S = 65'535;
//: chosen: far beyond any use; times a robot's ceiling it is still exact.
constexpr Nanos MAX_TIME_NS = 3'600 * NS_PER_S;
//: chosen: what comes round more often than this would fill the line, or the loop, with itself.
constexpr Nanos MIN_SAMPLE_NS = NS_PER_MS / 10, MIN_SPACING_NS = 1 * NS_PER_MS, MIN_ROUND_NS = 10 * NS_PER_MS;

bool is_below(std::int64_t value, std::int64_t least) { return value < least; }

bool are_choices(const Settings& settings) {
  return settings.motor_command <= MotorCommand::DUTY && settings.bit_order <= BitOrder::COMM1_MSB && settings.motor_meaning <= MotorMeaning::LINEAR_ANGULAR &&
         settings.encoder_at_open <= EncoderAtOpen::CONTINUE;
}

bool leave_time(const Settings& settings) {
  return settings.sample_period_ns >= MIN_SAMPLE_NS && settings.pair_spacing_ns >= MIN_SPACING_NS &&
         settings.refresh_ns >= MIN_ROUND_NS && settings.pulse_ns >= MIN_ROUND_NS &&
         settings.distance_stale_ns >= MIN_ROUND_NS && settings.stop_repeat_ns >= MIN_ROUND_NS;
}

bool are_bounded(const Settings& settings) {
  for (const Nanos time :
       {settings.sample_period_ns, settings.duty_timeout_ns, settings.connect_after_ns, settings.disconnect_after_ns, settings.boot_ns,
        settings.pair_spacing_ns, settings.refresh_ns, settings.pulse_ns, settings.liveness_ns, settings.first_sip_ns,
        settings.retry_ns, settings.plausibility_ns, settings.distance_stale_ns, settings.settle_ns,
        settings.encoder_dwell_ns, settings.stop_repeat_ns, settings.pad_loss_ns}) {
    if (time > MAX_TIME_NS) {
      return false;
    }
  }
  return settings.plausibility_tolerance_mm_s <= MAX_SPEED_MM_S && settings.plausibility_progress_mm_s <= MAX_SPEED_MM_S;
}

}  // namespace

const char* fault_of(const Settings& settings, const WireNumbers& wires) {
#define CHECK(type, name, standard, least)                           \
  if (is_below(static_cast<std::int64_t>(settings.name), least)) { \
    return #name " must be " #least " or more";                     \
  }
  ADAPTER_SETTINGS(CHECK)
#undef CHECK
  if (!are_choices(settings)) {
    return "a choice that does not exist";
  }
  if (!are_bounded(settings)) {
    return "a time is longer than an hour, or a speed faster than P2OS can say";
  }
  if (!leave_time(settings)) {
    return "a time that comes round is too short: the least is 10 ms, 1 ms between pairs, 0.1 ms between samples";
  }
  if (settings.sample_count > MAX_SAMPLE_COUNT || settings.sample_count % 2 == 0) {
    return "sample_count must be odd, 1 to 31";
  }
  if (settings.refresh_ns < settings.pair_spacing_ns) {
    return "refresh_ns is below pair_spacing_ns";
  }
  const std::int32_t width = wires.motor1_width > wires.motor2_width ? wires.motor1_width : wires.motor2_width;
  const std::int64_t most = MAX_RIM_UM_PER_S >> width;
  if (settings.step_um_per_s > most || settings.angular_step_urad_per_s > most) {
    return "a motor step is larger than any robot's";
  }
  if (settings.pad_velocity_mm_s > MAX_SPEED_MM_S || settings.pad_rotation_mrad_s > MAX_SPEED_MM_S) {
    return "a speed of the pad is larger than any robot's";
  }
  if (settings.pad_trigger_dead >= TRIGGER_FULL || settings.pad_stick_dead >= STICK_FULL) {
    return "a dead zone of the pad leaves nothing";
  }
  if (settings.bauds[0] <= 0) {
    return "no line speed to try";
  }
  return nullptr;
}

const char* fault_of(const WireNumbers& wires) {
  if (wires.distances < 0 || wires.distances > static_cast<std::int32_t>(MAX_DISTANCES)) {
    return "more than 16 distance wires";
  }
  for (const std::int32_t width : {wires.motor1_width, wires.motor2_width, wires.encoder_width}) {
    if (width < 1 || width > MAX_WIDTH) {
      return "a value has 1 to 8 wires";
    }
  }
  return nullptr;
}

const char* fault_of(const RobotNumbers& robot) {
  for (const std::int64_t number :
       {robot.distance_nm_per_count, robot.angle_counts_per_turn, robot.velocity_um_s_per_count,
        robot.range_um_per_count, robot.track_mm, robot.wheel_diameter_um, robot.ceiling_mm_s,
        robot.max_velocity_mm_s, robot.max_rotation_deg_s, robot.half_sonar_range_um}) {
    if (number <= 0 || number > MAX_LENGTH_UM) {
      return "a number of the robot is out of its range";
    }
  }
  if (HEADING_MODULUS % robot.angle_counts_per_turn != 0) {
    return "angle_counts_per_turn must divide the modulus of the heading";
  }
  return nullptr;
}

}  // namespace adapter
