// Single functions at their boundaries: sines, speeds, frames, words, the LED, equality.

#include <cmath>
#include <cstdint>
#include <cstring>
#include <initializer_list>

#include "../../core/adapter/encoders.hpp"
#include "../../core/adapter/gamepad.hpp"
#include "../../core/adapter/inputs.hpp"
#include "../../core/adapter/mixing.hpp"
#include "../../core/adapter/numbers.hpp"
#include "../../core/app/led.hpp"
#include "../../core/app/text.hpp"
#include "../../core/p2os/client.hpp"
#include "claims.hpp"

namespace units {

namespace {

using adapter::Master;
using adapter::Speeds;
using adapter::State;
using adapter::Wheels;
using p2os::CommandFrame;
using p2os::CommandNumber;
using p2os::Nanos;
using p2os::NS_PER_MS;

void check_arithmetic() {
  for (std::int32_t k = -8'192; k <= 16'384; ++k) {
    const double exact = std::sin(2 * M_PI * k / 8'192) * (1 << 30);
    if (adapter::sine(k) != std::lround(exact)) {
      claim(false, "a sine is rounded to 2^-30");
      break;
    }
  }
  for (const std::int32_t turn : {1'024, -1'024}) {
    claim(adapter::forward_step(100, 0, 0, turn) > std::int64_t{100} * adapter::sine(turn + 2'048), "a quarter is an arc");
    claim(adapter::forward_step(100, 0, 0, turn + turn / 1'024) ==
              std::int64_t{100} * adapter::sine(turn + turn / 1'024 + 2'048), "more is a chord");
  }
  // As adapter_sim/encoders.py has them.
  claim(adapter::forward_step(16'000, 0, 0, 1'000) == 13'582'325'611'127 && adapter::forward_step(16'000, -7, -1'000, 0) == 13'588'053'001'387 &&
            adapter::forward_step(-16'000, 0, 0, 1'000) == -13'582'325'713'936 && adapter::forward_step(9, 16'000, 3, -1) == 36'017'305'548,
        "an arc is longer than its chord");
  claim(adapter::divide_half_away(-5, 2) == -3 && adapter::divide_half_away(5, 2) == 3 &&
            adapter::divide_half_away(-1, 3) == 0, "halves away from zero");
  claim(adapter::divide_floor(-4, 4) == -1 && adapter::divide_floor(-5, 4) == -2 && adapter::divide_floor(3, 4) == 0, "floor");
  adapter::Unwrapper wrap(8);
  claim(wrap.update(7) == 0 && wrap.update(2) == 3 && wrap.update(6) == -4 && wrap.update(1) == 3, "half is backward");

  // One more or one less of pi or of a radian's degrees, in 1e-9, gives another number here.
  adapter::RobotNumbers large = ROBOT;
  large.wheel_diameter_um = 10'000'000;
  for (const std::int64_t phase_um : {2'136'283'004, 2'136'283'005}) {
    adapter::Encoders encoders(large, NS_PER_MS, 3);
    encoders.begin({phase_um * 1'000, 0});
    const std::int64_t wanted = phase_um == 2'136'283'004 ? 31'415'925 : 0;
    claim(encoders.phases_um() == Wheels{wanted, 0}, "a turn of ten metres");
  }
  adapter::Settings settings;
  adapter::RobotNumbers narrow = ROBOT;
  narrow.track_mm = 1;
  narrow.max_rotation_deg_s = narrow.max_velocity_mm_s = 10'000'000;
  settings.step_um_per_s = 9'017'367;
  claim(adapter::Mixer(settings, narrow, 4).mix(-4, 3) == Speeds{-4'509, 3'616'599}, "degrees of a radian");
  settings.step_um_per_s = 9'120'127;
  claim(adapter::Mixer(settings, narrow, 4).mix(-4, 3) == Speeds{-4'560, 3'657'814}, "degrees of a radian");
}

void check_equality() {
  claim(Speeds{1, 2} == Speeds{1, 2} && Speeds{1, 2} != Speeds{1, 3} && Speeds{1, 2} != Speeds{2, 2}, "speeds");
  claim(!(Speeds{1, 2} == Speeds{1, 3}) && !(Speeds{1, 2} == Speeds{2, 2}) && !(Speeds{1, 2} != Speeds{1, 2}), "speeds");
  claim(Wheels{1, 2} == Wheels{1, 2} && !(Wheels{1, 2} == Wheels{1, 3}) && !(Wheels{1, 2} == Wheels{2, 2}), "wheels");
}

bool is_frame(const CommandFrame& frame, std::initializer_list<std::uint8_t> bytes) {
  return frame.bytes().size == bytes.size() && std::memcmp(frame.bytes().data, bytes.begin(), bytes.size()) == 0;
}

void check_frames() {
  claim(is_frame(CommandFrame(CommandNumber::STOP), {0xFA, 0xFB, 3, 29, 0, 29}), "a bare command");
  claim(is_frame(CommandFrame(CommandNumber::VEL, 0x1234), {0xFA, 0xFB, 6, 11, 0x3B, 0x34, 0x12, 0x3F, 0x4D}), "+");
  claim(is_frame(CommandFrame(CommandNumber::VEL, -0x1234), {0xFA, 0xFB, 6, 11, 0x1B, 0x34, 0x12, 0x3F, 0x2D}), "-");
  for (const std::int32_t most : {65'535, 65'536, 0x7FFF'FFFF}) {
    claim(is_frame(CommandFrame(CommandNumber::VEL, most), {0xFA, 0xFB, 6, 11, 0x3B, 0xFF, 0xFF, 0x0B, 0x3A}), "most");
    claim(is_frame(CommandFrame(CommandNumber::VEL, -most), {0xFA, 0xFB, 6, 11, 0x1B, 0xFF, 0xFF, 0x0B, 0x1A}), "least");
  }
  claim(is_frame(CommandFrame(CommandNumber::VEL, 65'534), {0xFA, 0xFB, 6, 11, 0x3B, 0xFE, 0xFF, 0x0A, 0x3A}), "one less");
  claim(is_frame(CommandFrame(CommandNumber::VEL, 0), {0xFA, 0xFB, 6, 11, 0x3B, 0, 0, 11, 0x3B}), "zero is positive");
}

void check_text() {
  Page page;
  app::write_hex(page, 0x1234ABCD, 8);
  app::write_hex(page, 0x1234ABCD, 9);
  app::write_hex(page, 0x1234ABCD, 2);
  app::write_hex(page, 0, 1);
  claim(page.is("1234abcd1234abcdcd0"), "digits from the lowest on");
  std::uint32_t value = 0;
  claim(app::read_hex("0189abef", value) && value == 0x0189'ABEF, "eight digits");
  claim(app::read_hex("ffffffff", value) && value == 0xFFFF'FFFF && app::read_hex("7", value) && value == 7, "one");
  for (const char* text : {"", "012345678", "/", ":", "`", "g", "A", "1 ", "0x1"}) {
    claim(!app::read_hex(text, value), text);
  }
  char line[] = "\t one two\tthree  four five";
  const app::Words words(line);
  claim(words.count == 5 && app::is_same(words.words[0], "one") && app::is_same(words.words[2], "three"), "words");
  claim(app::is_same(words.words[1], "two"), "end at a blank");
  char blank[] = " \t";
  claim(app::Words(blank).count == 0, "blanks are no word");
  claim(!app::is_same("a", "ab") && !app::is_same("ab", "a") && app::is_same("", ""), "the same to the end");
}

//: Tells whether the LED is on in each of the forty parts of two seconds, at its first and its last nanosecond.
bool flashes(State state, Master master, const char* pattern) {
  constexpr Nanos PART = 50 * NS_PER_MS;
  for (int part = 0; part < 40; ++part) {
    const bool is_on = pattern[part] != '.';
    for (const Nanos at : {part * PART, (part + 1) * PART - 1, part * PART + app::LED_PERIOD_NS}) {
      if (app::led_is_on(state, master, at) != is_on) {
        return false;
      }
    }
  }
  return true;
}

void check_led() {
  constexpr char DARK[] = "........................................", ON[] = "########################################";
  claim(flashes(State::RESET, Master::BLUEPILL, DARK) && flashes(State::BOOTING, Master::PAD, DARK), "dark until the boot");
  claim(flashes(State::IDLE, Master::PAD, "##......................................"), "idle is one flash");
  claim(flashes(State::CONNECTING, Master::PAD, "##..##.................................."), "connecting is two");
  claim(flashes(State::SETTLING, Master::PAD, "##..##..##.............................."), "settling is three");
  claim(flashes(State::CLOSING, Master::PAD, "##..##..##..##.........................."), "closing is four");
  claim(flashes(State::DRIVING, Master::BLUEPILL, ON), "driving is on");
  claim(flashes(State::DRIVING, Master::PAD, "..######################################"), "by the pad with one gap");
  claim(flashes(State::LOST, Master::PAD, "#.#.#.#.#.#.#.#.#.#.#.#.#.#.#.#.#.#.#.#."), "lost flickers");
}

void check_pad() {
  adapter::Settings settings;
  settings.pad_trigger_dead = 1'022;
  adapter::Gamepad pad(settings);
  pad.take({false, false, INT32_MAX, INT32_MIN, INT32_MIN}, 0);
  claim(pad.forward() == 2 * adapter::TRIGGER_FULL && pad.turn() == adapter::STICK_FULL, "any number is cut to the ends");
  pad.take({false, false, 1'022, 1'023, 511}, 0);
  claim(pad.forward() == -adapter::TRIGGER_FULL && pad.turn() == -adapter::STICK_FULL, "a dead zone's end is at rest");
}

void check_reasons() {
  claim(app::is_same(p2os::text(p2os::EndReason::NO_ANSWER), "no answer to SYNC0") &&
            app::is_same(p2os::text(p2os::EndReason::SILENCE), "no packet in time") &&
            app::is_same(p2os::text(p2os::EndReason::CONTROLLER_RESET), "the robot's controller was reset") &&
            app::is_same(p2os::text(p2os::EndReason::RESTARTED), "the robot was restarted"), "reasons in words");
}

}  // namespace

void check_parts() {
  check_arithmetic();
  check_equality();
  check_frames();
  check_text();
  check_led();
  check_pad();
  check_reasons();
}

}  // namespace units
