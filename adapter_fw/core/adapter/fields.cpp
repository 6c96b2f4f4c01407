#include "fields.hpp"

namespace adapter {

namespace {

#define SETTING(type, member, standard, least) ADAPTER_FIELD(Settings, member),
#define BAUD(place)                                                                            \
  {                                                                                            \
    "baud" #place, [](const Settings& owner) { return std::int64_t{owner.bauds[place]}; },     \
        [](Settings& owner, std::int64_t value) { owner.bauds[place] = static_cast<std::int32_t>(value); } \
  }

constexpr Field<Settings> SETTINGS[] = {
    ADAPTER_SETTINGS(SETTING) BAUD(0), BAUD(1), BAUD(2), BAUD(3), BAUD(4), BAUD(5), BAUD(6), BAUD(7),
};
static_assert(MAX_BAUDS == 8, "one row a line speed");

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

}  // namespace adapter
