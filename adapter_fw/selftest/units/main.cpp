// Checks of what no run of the self-test exercises: the codes over a restart, the mode button, numbers as text, gaps,
// the origin, a client to which nobody listens; console.cpp: every line of the console; parts.cpp: single functions.
//
// Prints each broken claim; ends with `ok` and exit code 0, or with 1.

#include <cstdio>
#include <cstring>
#include <initializer_list>

#include "../../core/adapter/inputs.hpp"
#include "../../core/app/code_keeper.hpp"
#include "../../core/app/mode_button.hpp"
#include "../../core/app/runner.hpp"
#include "../../core/app/text.hpp"
#include "../robot.hpp"
#include "claims.hpp"

namespace {

using adapter::Master;
using adapter::State;
using p2os::Nanos;
using p2os::NS_PER_MS;
using p2os::NS_PER_S;

using units::broken;
using units::claim;
using units::Page;
using units::ROBOT;
using units::WIRES;

void check_button() {
  app::ModeButton held;
  claim(!held.take(true, 0) && !held.take(true, NS_PER_S), "a button held from the start does not count");
  app::ModeButton button;
  button.take(false, 0);
  claim(!button.take(true, 50 * NS_PER_MS - 1), "a nanosecond less than 50 ms does not count");
  claim(button.take(true, 50 * NS_PER_MS), "50 ms do");
  claim(!button.take(true, 2 * NS_PER_S), "and only once");
  button.take(false, 2 * NS_PER_S);
  button.take(true, 2 * NS_PER_S + 30 * NS_PER_MS);
  button.take(false, 2 * NS_PER_S + 31 * NS_PER_MS);
  claim(!button.take(true, 2 * NS_PER_S + 60 * NS_PER_MS), "a bounce begins anew");
}

void check_numbers() {
  Page page;
  app::write_number(page, INT64_MIN);
  app::write_number(page, 0);
  app::write_number(page, INT64_MAX);
  claim(page.is("-922337203685477580809223372036854775807"), "the ends of 64 bits are written");
  std::int64_t value = 0;
  claim(app::read_number("-42", value) && value == -42, "a number is read");
  claim(app::read_number("0987654321", value) && value == 987'654'321, "all ten digits are");
  claim(app::read_number("999999999999999999", value) && value == 999'999'999'999'999'999, "18 digits fit");
  for (const char* text : {"", "-", "4x", "0x10", " 4", "1234567890123456789", "--1", "1/", "1:", "/", ":"}) {
    claim(!app::read_number(text, value), text);
  }
}

void check_duties() {
  adapter::DutyMeter meter(25 * NS_PER_MS);
  meter.edge(true, 0, 0);
  meter.edge(false, 4'995, 4'995);
  claim(meter.duty(9'999) == 0, "a period ends with the next rising edge");
  meter.edge(true, 10'000, 10'000);
  claim(meter.duty(10'000) == 500, "halves are rounded up");
  claim(meter.duty(25 * NS_PER_MS + 9'999) == 500, "a duty lasts for the time-out");
  claim(meter.duty(25 * NS_PER_MS + 10'000) == 1'000, "from then on it is a level");

  meter.restart(false);
  claim(meter.duty(50 * NS_PER_MS) == 0, "a wire that is low has no duty");
  meter.edge(true, 50 * NS_PER_MS, 20'000);
  claim(meter.duty(50 * NS_PER_MS) == 0, "one rising edge is no period yet");
  meter.restart(true);
  claim(meter.duty(200 * NS_PER_MS) == 1'000, "one that is high has all of it");
  meter.edge(false, 200 * NS_PER_MS, 30'000);
  meter.edge(true, 201 * NS_PER_MS, 31'000);
  claim(meter.duty(201 * NS_PER_MS) == 1'000, "nor is the first after a level");
  meter.edge(true, 201 * NS_PER_MS, 31'000);
  meter.edge(false, 201 * NS_PER_MS, 31'000);
  meter.edge(true, 201 * NS_PER_MS, 31'000);
  claim(meter.duty(201 * NS_PER_MS) == 1'000, "edges of one instant leave it");

  adapter::DutyMeter wraps(25 * NS_PER_MS);
  const std::uint32_t stamps[] = {0xFFFF'FF00U, 0xFFFF'FF80U, 0x100U};
  wraps.edge(true, 0, stamps[0]);
  wraps.edge(true, 10, 0);
  wraps.edge(false, 1'000, stamps[1]);
  wraps.edge(true, 4'000, stamps[2]);
  claim(wraps.duty(4'000) == 250, "stamps wrap, and the same level again is no edge");

  adapter::Median median(3);
  claim(!median.take(-7) && median.take(-7) && median.value() == -7, "a median needs more than half");
  claim(!median.take(900) && median.value() == -7, "one of three is an outlier");
  median.reset();
  claim(median.value() == 0 && !median.take(5) && median.take(6) && median.value() == 5, "the one in the middle");
}

class StandingClock final : public hal::Clock {
 public:
  Nanos now() override {
    at += looks_before_pause-- == 0 ? NS_PER_S : 0;
    return at;
  }
  Nanos at = 0;
  //: The machine is suspended for a second after so many looks; a machine can be in any line.
  int looks_before_pause = -1;
};

class Recorder final : public hal::Uart {
 public:
  std::size_t read(std::uint8_t*, std::size_t) override { return 0; }
  void write(p2os::Bytes data) override {
    if (count < sizeof kinds) {
      kinds[count] = data[3];
    }
    ++count;
  }
  void set_baud(std::int32_t) override {}
  //: Command numbers of the frames.
  std::uint8_t kinds[64] = {};
  std::size_t count = 0;
};

class HeldPins final : public hal::PinsIn {
 public:
  std::uint32_t read(Nanos) override { return word; }
  std::uint32_t word = 1U << 6;
};

//: An adapter whose p2dx_con is high, and which nobody answers: it is connecting.
struct Connecting {
  Connecting() {
    part.attach(&pins, nullptr, nullptr);
    while (part.state() != State::CONNECTING) {
      turn();
    }
    turn();
    uart.count = 0;
  }
  void turn() { clock.at = runner.pass(); }

  //: STOP, VEL, RVEL, CLOSE and nothing before.
  bool has_stopped() const {
    return uart.count >= 4 && uart.kinds[0] == 29 && uart.kinds[1] == 11 && uart.kinds[2] == 21 && uart.kinds[3] == 2;
  }

  StandingClock clock;
  Recorder uart;
  HeldPins pins;
  adapter::Adapter part{{}, ROBOT, WIRES, 0};
  app::Runner runner{part, clock, uart, nullptr};
};

//: A line with a robot at its far end. The machine can be suspended once, just after a VEL has gone out.
class Robotic final : public hal::Uart {
 public:
  explicit Robotic(StandingClock& clock) : clock_(clock) {}
  std::size_t read(std::uint8_t* data, std::size_t size) override {
    robot_.advance_to(clock_.at);
    const p2os::Bytes output = robot_.output();
    if (output.size == 0 || output.size > size) {
      return 0;
    }
    std::memcpy(data, output.data, output.size);
    robot_.forget_output();
    return output.size;
  }
  void write(p2os::Bytes data) override {
    robot_.receive(data, clock_.at);
    if (is_suspended && count < sizeof kinds) {
      kinds[count++] = data[3];
    }
    if (is_to_suspend && data[3] == 11) {
      clock_.at += app::Runner::GAP_NS + 1;
      is_to_suspend = false;
      is_suspended = true;
    }
  }
  void set_baud(std::int32_t) override {}
  bool is_to_suspend = false;
  bool is_suspended = false;
  //: Command numbers of the frames since then.
  std::uint8_t kinds[64] = {};
  std::size_t count = 0;

 private:
  StandingClock& clock_;
  selftest::Robot robot_;
};

void check_a_gap_between_two_frames() {
  StandingClock clock;
  Robotic uart(clock);
  HeldPins pins;
  adapter::Adapter part{{}, ROBOT, WIRES, 0};
  part.attach(&pins, nullptr, nullptr);
  app::Runner runner{part, clock, uart, nullptr};
  pins.word = 1U << 6 | 2U << 3 | 2U;
  const auto run = [&](Nanos span) {
    for (const Nanos end = clock.at + span; clock.at < end;) {
      const Nanos due = runner.pass();
      clock.at = due < clock.at + NS_PER_MS ? due : clock.at + NS_PER_MS;
    }
  };
  run(20 * NS_PER_S);
  claim(part.state() == State::DRIVING, "the robot drives");
  uart.is_to_suspend = true;
  run(NS_PER_S);
  const std::uint8_t stops[] = {29, 11, 21, 2};
  claim(uart.count >= sizeof stops && std::memcmp(uart.kinds, stops, sizeof stops) == 0,
        "RVEL, queued with a VEL before the gap, does not go out after it");
}

void check_gaps() {
  Connecting late;
  late.clock.at += app::Runner::GAP_NS;
  late.turn();
  claim(late.part.state() == State::CONNECTING, "350 ms late is no gap");

  Connecting paused;
  paused.clock.at += app::Runner::GAP_NS + 1;
  paused.turn();
  claim(paused.part.state() == State::LOST && paused.has_stopped(), "a nanosecond more is one: STOP goes out first");
  claim(std::strcmp(paused.part.reason(), "the program paused") == 0, "and it gives the reason");
  const Nanos later = paused.clock.at + 10 * NS_PER_S;
  while (paused.clock.at < later) {
    paused.turn();
  }
  claim(paused.part.state() == State::LOST, "it waits for a new connect request");
  paused.pins.word = 0;
  while (paused.part.state() == State::LOST) {
    paused.turn();
  }
  paused.pins.word = 1U << 6;
  for (int turns = 0; turns < 1'000; ++turns) {
    paused.turn();
  }
  claim(paused.part.state() == State::CONNECTING, "and goes on with it");

  Connecting slept;
  slept.clock.at += Nanos{365} * 86'400 * NS_PER_S;
  slept.turn();
  claim(slept.has_stopped() && slept.uart.count == 4, "a year is not lived through");

  Connecting awake, sleepy;
  Nanos says_at = 0;  // SYNC0 again
  while (awake.uart.count == 0) {
    says_at = awake.clock.at;
    awake.turn();
  }
  while (sleepy.clock.at < says_at) {
    sleepy.turn();
  }
  sleepy.clock.looks_before_pause = 1;
  sleepy.turn();
  claim(awake.uart.kinds[3] == 0 && sleepy.has_stopped(), "what was due before a gap within the pass stays unsaid");

  adapter::Adapter off({}, ROBOT, WIRES, 0);
  off.skip_to("gap", 150 * NS_PER_MS);
  claim(off.state() == State::BOOTING, "a gap in the boot is a longer boot");
}

//: Flash of one number that counts how often it was written.
class OneNumber final : public app::Store {
 public:
  bool load(const char*, std::int64_t& value) override {
    value = value_;
    return is_there_;
  }
  bool save(const char*, std::int64_t value) override {
    value_ = value;
    is_there_ = true;
    ++writes;
    return true;
  }
  void forget(const char*) override { is_there_ = false; }

  int writes = 0;

 private:
  std::int64_t value_ = 0;
  bool is_there_ = false;
};

//: An adapter that has just started, as the keeper placed it.
adapter::Wheels restored(app::RetainedWheels& memory, app::Store& store) {
  adapter::Adapter part({}, ROBOT, WIRES, 0);
  app::CodeKeeper(memory, store).restore(part);
  return part.wheel_phases_um();
}

//: Memory whose check is right; FNV-1a, written anew.
app::RetainedWheels with_check(std::int64_t left_um, std::int64_t right_um) {
  std::uint32_t hash = 2'166'136'261U;
  for (int place = 0; place < 16; ++place) {
    const auto number = static_cast<std::uint64_t>(place < 8 ? left_um : right_um);
    hash = (hash ^ static_cast<std::uint8_t>(number >> place % 8 * 8)) * 16'777'619U;
  }
  return {left_um, right_um, hash};
}

void check_codes() {
  using adapter::Wheels;
  app::RetainedWheels memory{1, 2, 3};
  OneNumber store;
  adapter::Adapter part({}, ROBOT, WIRES, 0);
  const Wheels unknown = part.wheel_phases_um();
  claim(part.counts() == Wheels{0, 4} && part.counts_shown() == Wheels{0, 4}, "a new one has the code of its released wires");
  claim(restored(memory, store) == unknown, "so has what nobody has kept");
  part.place_wheels(unknown);
  claim(part.counts() == Wheels{0, 4}, "and what was kept of it, in whole um");
  app::CodeKeeper keeper(memory, store);
  keeper.restore(part);
  part.place_wheels({70'000, 518'000});
  keeper.keep(part, 0);
  claim(memory.check == 0x2F50'FA45, "FNV-1a of both numbers, the lowest byte first");
  claim(part.counts() == Wheels{1, 7} && part.counts_shown() == Wheels{1, 7}, "a code is the eighth of its turn");
  claim(restored(memory, store) == Wheels{70'000, 518'000}, "a restart goes on where it was");
  keeper.keep(part, app::CodeKeeper::STANDS_NS - 1);
  claim(store.writes == 0, "wheels that have not stood for a second are not stored");
  keeper.keep(part, app::CodeKeeper::STANDS_NS);
  claim(store.writes == 1, "and are as soon as they have");
  keeper.keep(part, 2 * app::CodeKeeper::STANDS_NS);
  claim(store.writes == 1, "wheels that stand are stored once");
  part.place_wheels({140'000, 0});
  keeper.keep(part, 2 * app::CodeKeeper::STANDS_NS);
  memory.left_um ^= 1;
  claim(restored(memory, store) == Wheels{70'000, 518'000}, "after a power cut: where they last stood");
  memory.check = 0;
  store.save("", std::int64_t{1} << 62 | 5);
  claim(restored(memory, store).right == 5, "any number of the store gives a place");
  memory.check = 0;
  store.save("", -1);
  claim(restored(memory, store) == unknown, "but a negative one");
  // 2^31 - 1 um are 4142 turns of 518362.788 um and 424979.1 um.
  constexpr std::int64_t LONGEST = 0x7FFF'FFFF, LAST_IN_ITS_TURN = 424'979;
  for (const bool is_left : {true, false}) {
    for (const std::int64_t phase : {LONGEST, LONGEST + 1, std::int64_t{-1}}) {
      app::RetainedWheels other{};
      OneNumber empty;
      adapter::Adapter source({}, ROBOT, WIRES, 0);
      app::CodeKeeper(other, empty).restore(source);
      other = with_check(is_left ? phase : 5, is_left ? 5 : phase);
      const Wheels found = restored(other, empty);
      const Wheels wanted = is_left ? Wheels{LAST_IN_ITS_TURN, 5} : Wheels{5, LAST_IN_ITS_TURN};
      claim(found == (phase == LONGEST ? wanted : unknown), "a phase is 0 to 2^31 - 1");
      other.check = 0;
      const std::uint64_t left = static_cast<std::uint64_t>(is_left ? phase : 5);
      empty.save("", static_cast<std::int64_t>(left << 32 | (static_cast<std::uint64_t>(is_left ? 5 : phase) & 0xFFFF'FFFF)));
      claim(restored(other, empty) == (phase == LONGEST ? wanted : unknown), "in the store too");
    }
  }
}

//: A sound frame of the robot, whose payload is its kind and zeros, but for one byte that is 1.
struct Packet {
  Packet(std::uint8_t kind, std::size_t payload_bytes, std::size_t one_at = 0)
      : size(p2os::PREFIX_BYTES + payload_bytes + p2os::CHECKSUM_BYTES) {
    std::uint8_t* payload = frame + p2os::PREFIX_BYTES;
    payload[one_at] = 1;
    payload[0] = kind;
    const std::uint16_t sum = p2os::checksum({payload, payload_bytes});
    frame[2] = static_cast<std::uint8_t>(payload_bytes + p2os::CHECKSUM_BYTES);
    payload[payload_bytes] = static_cast<std::uint8_t>(sum >> 8);
    payload[payload_bytes + 1] = static_cast<std::uint8_t>(sum & 0xFF);
  }
  p2os::Bytes bytes() const { return {frame, size}; }

  std::size_t size;
  std::uint8_t frame[40] = {p2os::HEADER_0, p2os::HEADER_1};
};

//: What opens a session: the echoes of SYNC0 and SYNC1, and three empty names.
const Packet ANSWERS[] = {{0, 1}, {1, 1}, {2, 4}};
//: A SIP without sonar readings; x, y and heading are the six bytes behind its kind.
constexpr std::uint8_t SIP_KIND = 0x32;
constexpr std::size_t SIP_BYTES = 25;

//: Opens a session; returns when it is open.
Nanos open(p2os::Client& client) {
  client.connect(0);
  for (const Packet& answer : ANSWERS) {
    client.receive(answer.bytes(), 1);
  }
  client.advance_to(1 + p2os::OPEN_DELAY_NS);
  return 1 + p2os::OPEN_DELAY_NS;
}

void check_origin() {
  Connecting settling;
  for (const Packet& answer : ANSWERS) {
    settling.part.receive(answer.bytes(), settling.clock.at);
  }
  while (settling.part.state() == State::CONNECTING) {
    settling.turn();
  }
  for (std::size_t place = 1; place <= 6; ++place) {
    settling.part.receive(Packet(SIP_KIND, SIP_BYTES, place).bytes(), settling.clock.at);
    claim(settling.part.state() == State::SETTLING, "two zeros of x, y and heading are not the origin");
  }
  settling.part.receive(Packet(SIP_KIND, SIP_BYTES).bytes(), settling.clock.at);
  claim(settling.part.state() == State::DRIVING, "three are");
}

//: Of an Arduino sketch, not of the adapter: whoever asks again while a session is being opened begins nothing anew, and
//: nobody has to listen.
void check_client() {
  p2os::Client client({});
  p2os::CommandFrame frame;
  const auto taken = [&client, &frame] {
    int count = 0;
    while (client.take_output(frame)) {
      ++count;
    }
    return count;
  };
  client.send(p2os::CommandFrame(p2os::CommandNumber::STOP), 0);
  claim(taken() == 0, "nothing is sent while no session is open");
  client.connect(0);
  claim(client.state() == p2os::ClientState::SYNC0 && taken() > 0, "connect sends SYNC0");
  client.connect(1);
  claim(taken() == 0, "a second connect sends nothing");
  const Nanos opened_at = open(client);
  claim(client.is_open(), "the robot's three answers open a session");
  for (const Packet& packet : {Packet(SIP_KIND, SIP_BYTES), Packet(SIP_KIND, SIP_BYTES - 1), Packet(0x90, 4)}) {
    client.receive(packet.bytes(), opened_at);
  }
  claim(client.stats().frames_received == 6 && client.stats().malformed == 1, "packets are counted, heard or not");
  client.advance_to(opened_at + p2os::LIVENESS_NS);
  claim(client.state() == p2os::ClientState::LOST, "and silence ends it");
  const auto says = [&client, &frame](std::initializer_list<std::uint8_t> kinds) {
    bool is_so = true;
    for (const std::uint8_t kind : kinds) {
      is_so = client.take_output(frame) && frame.bytes()[3] == kind && is_so;
    }
    return is_so && !client.take_output(frame);
  };
  taken();
  const Nanos lost_at = opened_at + p2os::LIVENESS_NS;
  client.connect(lost_at);
  claim(client.state() == p2os::ClientState::RECOVERING && says({29, 11, 2}), "a lost robot is stopped and closed first");
  client.advance_to(lost_at + p2os::CLOSE_WAIT_NS - 1);
  claim(says({}), "that takes 200 ms");
  client.advance_to(lost_at + p2os::CLOSE_WAIT_NS);
  claim(client.state() == p2os::ClientState::SYNC0 && says({29, 11, 21, 0}), "then it is asked for its SYNC0");
  for (const std::uint8_t kind : {std::uint8_t{0xFD}, std::uint8_t{0xFE}, std::uint8_t{0xFF}}) {
    p2os::Client other({});
    other.receive(Packet(kind, 1).bytes(), open(other));
    claim(other.is_open() == (kind == 0xFD), "two kinds say that the controller was reset");
  }
}

}  // namespace

int main() {
  check_client();
  check_codes();
  check_button();
  check_numbers();
  check_duties();
  check_gaps();
  check_a_gap_between_two_frames();
  check_origin();
  units::check_console();
  units::check_parts();
  if (broken == 0) {
    std::puts("ok");
  }
  return broken == 0 ? 0 : 1;
}
