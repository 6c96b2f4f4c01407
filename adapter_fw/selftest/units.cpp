// Checks of what no life exercises: the LED, the mode button, numbers as text, faults of settings.
//
// Prints each broken claim; ends with `ok` and exit code 0, or with 1.

#include <cstdio>
#include <cstring>

#include "../core/adapter/fields.hpp"
#include "../core/shell/led.hpp"
#include "../core/shell/mode_button.hpp"
#include "../core/shell/text.hpp"

namespace {

using adapter::Master;
using adapter::Settings;
using adapter::State;
using p2os::Nanos;
using p2os::NS_PER_MS;
using p2os::NS_PER_S;

int broken = 0;

void claim(bool holds, const char* what) {
  if (!holds) {
    std::printf("broken: %s\n", what);
    ++broken;
  }
}

//: Times that the LED comes on within a period.
int flashes(State state, Master master = Master::BLUEPILL) {
  int count = 0;
  bool before = shell::led_is_on(state, master, shell::LED_PERIOD_NS - NS_PER_MS);
  for (Nanos at = 0; at < shell::LED_PERIOD_NS; at += NS_PER_MS) {
    const bool is_on = shell::led_is_on(state, master, at);
    count += is_on && !before ? 1 : 0;
    before = is_on;
  }
  return count;
}

void check_led() {
  claim(flashes(State::RESET) == 0 && !shell::led_is_on(State::BOOTING, Master::BLUEPILL, 0), "dark until the boot");
  claim(flashes(State::IDLE) == 1, "idle is one flash");
  claim(flashes(State::CONNECTING) == 2, "connecting is two");
  claim(flashes(State::SETTLING) == 3, "settling is three");
  claim(flashes(State::CLOSING) == 4, "closing is four");
  claim(flashes(State::DRIVING) == 0 && shell::led_is_on(State::DRIVING, Master::BLUEPILL, 0), "driving is on");
  claim(flashes(State::DRIVING, Master::PAD) == 1, "driving by the pad has one gap");
  claim(flashes(State::LOST) == 20, "lost flickers ten times a second");
}

void check_button() {
  shell::ModeButton held;
  claim(!held.take(true, 0) && !held.take(true, NS_PER_S), "a button held from the start says nothing");
  shell::ModeButton button;
  button.take(false, 0);
  claim(!button.take(true, 49 * NS_PER_MS), "49 ms do not count");
  claim(button.take(true, 50 * NS_PER_MS), "50 ms do");
  claim(!button.take(true, 2 * NS_PER_S), "and only once");
  button.take(false, 2 * NS_PER_S);
  button.take(true, 2 * NS_PER_S + 30 * NS_PER_MS);
  button.take(false, 2 * NS_PER_S + 31 * NS_PER_MS);
  claim(!button.take(true, 2 * NS_PER_S + 60 * NS_PER_MS), "a bounce begins anew");
}

class Page final : public shell::Writer {
 public:
  void write(const char* text) override { std::strncat(text_, text, sizeof text_ - std::strlen(text_) - 1); }
  bool is(const char* text) const { return std::strcmp(text_, text) == 0; }

 private:
  char text_[64] = {};
};

void check_numbers() {
  Page page;
  shell::write_number(page, INT64_MIN);
  shell::write_number(page, 0);
  shell::write_number(page, INT64_MAX);
  claim(page.is("-922337203685477580809223372036854775807"), "the ends of 64 bits are written");
  std::int64_t value = 0;
  claim(shell::read_number("-42", value) && value == -42, "a number is read");
  for (const char* text : {"", "-", "4x", "0x10", " 4", "1234567890123456789", "--1"}) {
    claim(!shell::read_number(text, value), text);
  }
}

//: The fault that one value leaves the settings with.
const char* fault_with(const char* name, std::int64_t value) {
  Settings settings;
  adapter::setting(adapter::find_setting(name)).set(settings, value);
  return adapter::fault_of(settings, {});
}

void check_faults() {
  claim(adapter::fault_of(Settings{}, {}) == nullptr, "the defaults are sound");
  const struct {
    const char* name;
    std::int64_t least, most;
  } ranges[] = {
      {"sample_period_ns", NS_PER_MS / 10, 3'600 * NS_PER_S}, {"pulse_ns", 10 * NS_PER_MS, 3'600 * NS_PER_S},
      {"liveness_ns", 1, 3'600 * NS_PER_S},                    {"pair_spacing_ns", NS_PER_MS, 200 * NS_PER_MS},
      {"bit_order", 0, 1},                                     {"sample_count", 1, 31},
      {"pad_velocity_mm_s", 0, 65'535},                        {"pad_stick_dead", 0, 510},
      {"step_um_per_s", 0, 10'000'000},
  };
  for (const auto& range : ranges) {
    claim(fault_with(range.name, range.least) == nullptr && fault_with(range.name, range.most) == nullptr, range.name);
    claim(fault_with(range.name, range.least - 1) != nullptr, range.name);
    claim(fault_with(range.name, range.most + 1) != nullptr, range.name);
  }
}

}  // namespace

int main() {
  check_led();
  check_button();
  check_numbers();
  check_faults();
  if (broken == 0) {
    std::puts("ok");
  }
  return broken == 0 ? 0 : 1;
}
