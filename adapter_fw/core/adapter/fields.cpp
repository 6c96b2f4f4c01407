#include "fields.hpp"

namespace adapter {

namespace {

#define SETTING(member) ADAPTER_FIELD(Settings, member)
#define BAUD(place)                                                                            \
  {                                                                                            \
    "baud" #place, [](const Settings& owner) { return std::int64_t{owner.bauds[place]}; },     \
        [](Settings& owner, std::int64_t value) { owner.bauds[place] = static_cast<std::int32_t>(value); } \
  }

constexpr Field<Settings> SETTINGS[] = {
    SETTING(threshold_um), SETTING(bit_order), SETTING(motor_meaning), SETTING(step_um_per_s),
    SETTING(angular_step_urad_per_s), SETTING(max_velocity_mm_s), SETTING(max_rotation_deg_s),
    SETTING(sample_period_ns), SETTING(sample_count), SETTING(connect_after_ns), SETTING(disconnect_after_ns),
    SETTING(boot_ns), SETTING(pair_spacing_ns), SETTING(refresh_ns), SETTING(pulse_ns), SETTING(liveness_ns),
    SETTING(first_sip_ns), SETTING(retry_ns), SETTING(plausibility_ns), SETTING(plausibility_tolerance_mm_s),
    SETTING(plausibility_progress_mm_s), SETTING(distance_stale_ns), SETTING(settle_ns), SETTING(encoder_at_open),
    SETTING(encoder_dwell_ns), SETTING(stop_unknown_robot), SETTING(stop_repeats), SETTING(stop_repeat_ns),
    SETTING(pad_velocity_mm_s), SETTING(pad_rotation_mrad_s), SETTING(pad_trigger_dead), SETTING(pad_stick_dead),
    SETTING(pad_loss_ns), BAUD(0), BAUD(1), BAUD(2), BAUD(3), BAUD(4), BAUD(5), BAUD(6), BAUD(7),
};
static_assert(MAX_BAUDS == 8, "one row a line speed");

constexpr Renamed RENAMED[] = {
    {"disbelief_ns", "plausibility_ns"},
    {"disbelief_tolerance_mm_s", "plausibility_tolerance_mm_s"},
    {"disbelief_progress_mm_s", "plausibility_progress_mm_s"},
};

bool is_same(const char* one, const char* other) {
  while (*one != '\0' && *one == *other) {
    ++one;
    ++other;
  }
  return *one == *other;
}

}  // namespace

std::int32_t setting_count() { return static_cast<std::int32_t>(sizeof SETTINGS / sizeof SETTINGS[0]); }

const Field<Settings>& setting(std::int32_t place) { return SETTINGS[place]; }

std::int32_t find_setting(const char* name) {
  for (std::int32_t place = 0; place < setting_count(); ++place) {
    if (is_same(setting(place).name, name)) {
      return place;
    }
  }
  return -1;
}

std::int32_t renamed_count() { return static_cast<std::int32_t>(sizeof RENAMED / sizeof RENAMED[0]); }

const Renamed& renamed(std::int32_t place) { return RENAMED[place]; }

const char* present_name(const char* old_name) {
  for (const Renamed& one : RENAMED) {
    if (is_same(one.old_name, old_name)) {
      return one.name;
    }
  }
  return nullptr;
}

}  // namespace adapter
