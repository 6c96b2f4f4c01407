// Every line of the console, its answer whole, and what stands behind it: the log and a test of the board.

#include <array>
#include <cstdio>
#include <cstring>

#include "../../core/adapter/fields.hpp"
#include "../../core/app/console.hpp"
#include "../../core/app/event_printer.hpp"
#include "../robot.hpp"
#include "claims.hpp"

namespace units {

namespace {

using adapter::What;
using p2os::Nanos;
using p2os::NS_PER_MS;

//: Flash that keeps numbers by their names, and may be full.
class Flash final : public app::Store {
 public:
  bool load(const char* name, std::int64_t& value) override {
    Row* row = find(name);
    if (row != nullptr) {
      value = row->value;
    }
    return row != nullptr;
  }
  bool save(const char* name, std::int64_t value) override {
    if (is_full) {
      return false;
    }
    Row* row = find(name);
    *(row != nullptr ? row : &rows_[count_++]) = {name, value};
    return true;
  }
  void forget(const char* name) override {
    if (Row* row = find(name)) {
      *row = rows_[--count_];
    }
  }
  bool is_full = false;
  std::size_t count() const { return count_; }

 private:
  struct Row {
    const char* name;
    std::int64_t value;
  };
  Row* find(const char* name) {
    for (std::size_t place = 0; place < count_; ++place) {
      if (app::is_same(rows_[place].name, name)) {
        return &rows_[place];
      }
    }
    return nullptr;
  }
  std::array<Row, 64> rows_{};
  std::size_t count_ = 0;
};

//: All hardware; notes what was asked of it.
class Hardware final : public hal::PinsIn, public hal::PinsOut, public hal::OutputPads, public hal::Uart, public hal::Pad {
 public:
  std::uint32_t read(Nanos) override { return in; }
  std::int32_t duty(std::int32_t bit, Nanos) override { return 100 + bit; }
  void drive(std::uint32_t mask, std::uint32_t levels, Nanos) override {
    driven |= mask;
    out = (out & ~mask) | (levels & mask);
    ++drives;
  }
  void release(Nanos) override {
    driven = 0;
    ++releases;
  }
  std::uint32_t sense(Nanos) override { return out; }
  std::size_t read(std::uint8_t* data, std::size_t size) override {
    const std::size_t taken = waiting < size ? waiting : size;
    for (std::size_t place = 0; place < taken; ++place) {
      data[place] = next++;
    }
    waiting -= taken;
    return taken;
  }
  void write(p2os::Bytes data) override {
    std::memcpy(sent, data.data, data.size);
    sent_size = data.size;
  }
  void set_baud(std::int32_t baud) override { line_speed = baud; }
  bool take(adapter::PadReport& report) override {
    report = {true, false, 11, 22, -33};
    return reports > 0 && reports-- > 0;
  }
  void pair(Nanos now) override { paired_at = now; }

  std::uint32_t in = 0, driven = 0, out = 0;
  int drives = 0, releases = 0, reports = 0;
  std::size_t waiting = 0, sent_size = 0;
  std::uint8_t next = 0, sent[64] = {};
  std::int32_t line_speed = 0;
  Nanos paired_at = -1;
};

struct Desk {
  explicit Desk(bool has_pad = true)
      : test({hardware, hardware, hardware, hardware, has_pad ? &hardware : nullptr}) {
    part.attach(&test, &test, &log);
    part.advance_to(300 * NS_PER_MS);
  }
  //: Types a line; tells whether this is the whole answer.
  bool says(const char* line, const char* answer) {
    type(line);
    return page.is(answer);
  }
  void type(const char* line) {
    for (; *line != '\0'; ++line) {
      console.take(*line, now);
    }
    console.take('\r', now);
  }

  Hardware hardware;
  Flash flash;
  Page page;
  app::EventLog log;
  app::BoardTest test;
  adapter::Adapter part{{}, ROBOT, WIRES, 0};
  app::Console console{{part, log, test, flash, page, WIRES, "bench", "power"}};
  Nanos now = 300 * NS_PER_MS;
};

constexpr char UNKNOWN[] = "error: no such command; type help\n";
constexpr char NO_SETTING[] = "error: no such setting; get lists them\n";
constexpr char STORED[] = "ok, in force after restart\n";

void check_words() {
  Desk desk;
  claim(desk.says("", "") && desk.says("  \t ", UNKNOWN), "an empty line says nothing");
  for (const char* line : {"help me", "version 1", "status 1", "pins 1", "log 1", "get a b", "set", "set pulse_ns",
                           "set pulse_ns 1 2", "reset", "reset a b", "master", "master robot", "master pad 1", "stop 1",
                           "restart 1", "test", "test on 1", "test maybe", "wires 1", "wires 1 2 3", "link 1 2",
                           "pad 1", "pad pair 1", "pads", "", "hel", "helpp"}) {
    claim(desk.says(line, *line == '\0' ? "" : UNKNOWN), line);
  }
  claim(!desk.console.wants_restart(), "nothing of that is a restart");
  claim(desk.says("version", "P2OS adapter 0.2.0, board bench; type help\n"), "version");
  claim(desk.says(" version\t", "P2OS adapter 0.2.0, board bench; type help\n"), "blanks around a word");
  desk.type("help");
  claim(std::strncmp(desk.page.text(), "version | status |", 18) == 0, "help");
  desk.page.clear();
  desk.console.take('p', 0);
  desk.console.take('a', 0);
  desk.console.take('d', 0);
  desk.console.take('\n', 0);
  claim(desk.page.is("pad 0  up 0  down 0  forward 0  backward 0  turn 0  \n"), "a line ends with either");

  char line[82] = {};
  std::memset(line, 'x', 79);
  claim(desk.says(line, UNKNOWN), "79 characters are a line");
  line[79] = 'x';
  claim(desk.says(line, "error: the line is longer than 79 characters\n"), "80 are none");
  line[80] = 'x';
  claim(desk.says(line, "error: the line is longer than 79 characters\n"), "nor are 81");
  claim(desk.says("pad pair", "ok, for 30 s: hold the pad's pairing buttons\n"), "the next begins anew");
  claim(desk.hardware.paired_at == desk.now, "a pairing begins now");
  desk.type("restart");
  claim(desk.page.is("ok\n") && desk.console.wants_restart(), "restart");
  claim(std::strcmp(desk.part.reason(), "restarted on the console") == 0, "it stops the robot first");
  desk.type("stop");
  claim(desk.page.is("ok\n") && std::strcmp(desk.part.reason(), "stopped on the console") == 0, "stop");
  claim(desk.says("master pad", "ok\n") && desk.part.master() == adapter::Master::PAD, "master pad");
  claim(desk.says("master bluepill", "ok\n") && desk.part.master() == adapter::Master::BLUEPILL, "master bluepill");
}

void check_settings() {
  Desk desk;
  claim(desk.says("get pulse_ns", "pulse_ns = 500000000\n"), "a default");
  claim(desk.says("set pulse_ns 400000000", STORED) && desk.says("get pulse_ns", "pulse_ns = 400000000\n"), "set");
  claim(desk.says("reset pulse_ns", STORED) && desk.flash.count() == 0, "reset forgets");
  claim(desk.says("get pulse", NO_SETTING) && desk.says("set pulse 1", NO_SETTING) && desk.says("reset pulse", NO_SETTING),
        "an unknown name");
  claim(desk.says("set pulse_ns 4x", "error: that is no whole number\n"), "no number");
  claim(desk.says("set sample_count 4", "error: sample_count must be odd, 1 to 31\n") && desk.flash.count() == 0,
        "what is unsound is not stored");
  claim(desk.says("set baud1 4294967296", "error: it does not fit\n"), "nor is what does not fit");
  const std::int32_t count = adapter::setting_count();
  claim(app::is_same(adapter::setting(0).name, "threshold_um") && desk.says("set threshold_um 5", STORED) &&
            desk.says("get threshold_um", "threshold_um = 5\n"), "the first");
  claim(app::is_same(adapter::setting(count - 1).name, "baud7") && desk.says("set baud7 7", STORED) &&
            desk.says("get baud7", "baud7 = 7\n"), "the last");
  desk.flash.is_full = true;
  claim(desk.says("set baud7 8", "error: it could not be stored\n"), "full flash");
  desk.flash.is_full = false;
  char wanted[4'096] = {};
  const char* fault = "";
  const adapter::Settings settings = app::stored_settings(desk.flash, WIRES, fault);
  claim(fault == nullptr && settings.threshold_um == 5 && settings.bauds[7] == 7, "what is stored is taken");
  for (std::int32_t place = 0; place < count; ++place) {
    const std::size_t size = std::strlen(wanted);
    std::snprintf(wanted + size, sizeof wanted - size, "%s = %lld\n", adapter::setting(place).name,
                  static_cast<long long>(adapter::setting(place).get(settings)));
  }
  claim(desk.says("get", wanted), "get lists all");
  desk.flash.save("sample_count", 2);
  claim(app::stored_settings(desk.flash, WIRES, fault).threshold_um == -1 && fault != nullptr, "unsound: the defaults");
}

void check_status() {
  Desk desk;
  const adapter::Adapter off({}, ROBOT, WIRES, 0);
  claim(off.outputs().levels() == 0 && off.outputs().driven() == 0, "nothing is driven before the boot");
  selftest::Robot robot;
  desk.hardware.in = 1U << 6 | 1U << 3 | 3U;
  desk.part.receive({reinterpret_cast<const std::uint8_t*>("\xFA\xFB\x03\x01\x00\x00\xFA\xFB\x01zz"), 11}, desk.now);
  for (const Nanos end = desk.now + 3'000 * NS_PER_MS; desk.now < end; desk.now += NS_PER_MS) {
    desk.part.advance_to(desk.now);
    for (p2os::CommandFrame frame; desk.part.take_output(frame);) {
      robot.receive(frame.bytes(), desk.now);
    }
    robot.advance_to(desk.now);
    if (const p2os::Bytes output = robot.output(); output.size != 0) {
      desk.part.receive(output, desk.now);
      robot.forget_output();
    }
  }
  const adapter::Adapter& part = desk.part;
  const p2os::DecoderStats& wire = part.client().wire_stats();
  char wanted[512];
  std::snprintf(wanted, sizeof wanted,
                "state driving (odometry is taken, motors enabled), master bluepill\n"
                "motor1 3  motor2 1  VEL_mm_s 125  RVEL_deg_s -20  encoder1 %d  encoder2 %d  baud 9600  \n"
                "SIPs %u  frames %u  bad_checksums 1  bad_counts 1  noise_bytes %u  losses 0  odometry_jumps 0  \n",
                static_cast<int>(part.counts_shown().left), static_cast<int>(part.counts_shown().right), part.sips(),
                wire.frames, wire.noise_bytes);
  claim(part.sips() > 9 && wire.frames == part.sips() + 3 && part.counts_shown().left != part.counts_shown().right,
        "the robot was driven");
  claim(desk.says("status", wanted), "status");
  const std::uint32_t out = part.outputs().levels();
  const auto bit = [out](int place) { return (out >> place & 1U) != 0 ? '1' : '0'; };
  std::snprintf(wanted, sizeof wanted,
                "in:  motor1_comm1.. 110  motor2_comm1.. 100  p2dx_con 1\n"
                "out: DD1.. %c%c%c%c%c%c%c%c  encoder1_s1.. %c%c%c  encoder2_s1.. %c%c%c\n",
                bit(0), bit(1), bit(2), bit(3), bit(4), bit(5), bit(6), bit(7), bit(8), bit(9), bit(10), bit(11),
                bit(12), bit(13));
  claim(desk.says("pins", wanted), "pins");
  desk.hardware.in = 1U << 7;
  desk.part.advance_to(desk.now + 10 * NS_PER_MS);
  claim(desk.says("pins", "in:  motor1_comm1.. 000  motor2_comm1.. 000  p2dx_con 0\n"
                          "out (released): DD1.. 00000000  encoder1_s1.. 000  encoder2_s1.. 000\n"), "released");
}

void check_board_test() {
  Desk desk;
  Hardware& hardware = desk.hardware;
  const std::uint32_t driven = hardware.driven, levels = hardware.out;
  hardware.in = 0x55;
  constexpr char REFUSED[] = "error: only in a test; type test on\n";
  claim(desk.says("wires 1 1", REFUSED) && desk.says("link", REFUSED) && desk.says("link 55", REFUSED), "only in a test");
  claim(desk.says("wires", "wires in 00000055 out 000020ff\n"), "pads are read without a test too");
  claim(desk.test.read(desk.now) == 0x55 && desk.test.duty(3, desk.now) == 103, "the adapter sees its wires");
  hardware.waiting = 3;
  std::uint8_t data[40] = {};
  claim(static_cast<hal::Uart&>(desk.test).read(data, 40) == 3 && data[2] == 2, "and its line");
  desk.test.set_baud(7);
  claim(hardware.line_speed == 7, "and the line's speed");
  claim(desk.says("test off", "test off, started by power\n") && hardware.drives == 2, "no test is no news");

  const int releases = hardware.releases;
  claim(desk.says("test on", "test on, started by power\n") && hardware.driven == 0, "it lets go of every output");
  claim(std::strcmp(desk.part.reason(), "the board is tested") == 0, "the robot is stopped");
  claim(desk.says("test on", "test on, started by power\n") && hardware.releases == releases + 1, "twice is once");
  claim(desk.test.read(desk.now) == 0 && desk.test.duty(3, desk.now) == 0, "the adapter sees nothing");
  hardware.out = 0;
  claim(desk.says("wires 6 2", "wires in 00000055 out 00000002\n") && hardware.driven == 6, "wires are driven");
  claim(desk.says("wires 0 0", "wires in 00000055 out 00000002\n") && hardware.driven == 0, "or none");
  claim(desk.says("wires 1 g", "error: that is no hexadecimal number\n") && hardware.driven == 0, "levels in hexadecimal");
  claim(desk.says("wires ffffffff 0", "wires in 00000055 out 00000000\n"), "32 bits");

  claim(desk.says("link 0aff", "link \n") && hardware.sent_size == 2 && hardware.sent[0] == 10 && hardware.sent[1] == 255,
        "bytes are sent");
  for (const char* line : {"link 0", "link 0g", "link g0", "link 000", "link 000102030405060708090a0b0c0d0e0f10"}) {
    claim(desk.says(line, "error: that is not one to 16 bytes in hexadecimal\n"), line);
  }
  claim(desk.says("link 000102030405060708090a0b0c0d0e0f", "link \n") && hardware.sent_size == 16, "16 are sent");
  const auto come = [&](std::size_t count, std::uint8_t first) {
    hardware.next = first;
    hardware.waiting = count;
    claim(static_cast<hal::Uart&>(desk.test).read(data, 40) == 0, "the adapter gets none of them");
  };
  come(2, 0x41);
  claim(desk.says("link", "link 4142\n") && desk.says("link", "link \n"), "what came is shown once");
  come(32, 0);
  claim(desk.says("link", "link 000102030405060708090a0b0c0d0e0f101112131415161718191a1b1c1d1e1f\n"), "32 are kept");
  come(33, 0);
  claim(desk.says("link", "link 0102030405060708090a0b0c0d0e0f101112131415161718191a1b1c1d1e1f20\n"), "the last ones");

  adapter::PadReport report;
  hardware.reports = 2;
  claim(!static_cast<hal::Pad&>(desk.test).take(report), "reports are not obeyed");
  claim(desk.says("pad", "pad 1  up 1  down 0  forward 11  backward 22  turn -33  \n"), "they are counted");
  come(1, 0x77);
  claim(desk.says("test off", "test off, started by power\n"), "test off");
  claim(hardware.driven == driven && hardware.out == levels, "outputs are as the adapter wants them");
  claim(static_cast<hal::Pad&>(desk.test).take(report) && report.turn == -33, "and reports obeyed");
  desk.type("test on");
  desk.page.clear();
  claim(desk.says("link", "link \n"), "a test begins with nothing from the line");
  desk.test.drive(1, 0, desk.now);
  claim(hardware.driven == 0, "what the adapter drives in a test is kept for later");
  desk.test.release(desk.now);
  const int drives = hardware.drives;
  desk.type("test off");
  claim(hardware.drives == drives && hardware.driven == 0, "nothing is driven where the adapter has let go");
  desk.test.drive(1, 1, desk.now);
  desk.test.release(desk.now);
  claim(hardware.driven == 0, "without a test it lets go at once");

  Desk bare(false);
  claim(bare.says("pad", "pad none\n") && bare.says("pad pair", "pad none\n"), "no pad");
  claim(!static_cast<hal::Pad&>(bare.test).take(report) && bare.test.pad() == nullptr, "none to take from");
}

void check_log() {
  Page page;
  app::EventLog log;
  log.write(page);
  log.write_last(page);
  claim(page.is(""), "an empty log");
  log.happened(1'999'999, What::COMMAND, "", -5, 7);
  log.write_last(page);
  claim(page.is("1 ms command: VEL -5, RVEL 7\n"), "a pair");
  log.happened(2'000'000, What::STALL, "", 1, 0);
  log.write_last(page);
  claim(page.is("2 ms stall: left 1, right 0\n"), "a stall");
  log.happened(3'000'000, What::LOST, "why", 1, 2);
  log.write_last(page);
  claim(page.is("3 ms lost: why\n"), "a reason");
  log.happened(4'000'000, What::IDLE, "", 1, 2);
  log.write(page);
  claim(page.is("1 ms command: VEL -5, RVEL 7\n2 ms stall: left 1, right 0\n3 ms lost: why\n4 ms idle\n"), "all");
  app::EventPrinter printer(log, page);
  char wanted[512] = {};
  for (int number = 5; number <= 34; ++number) {
    printer.happened(number * NS_PER_MS, What::BOOTED, "", 0, 0);
    char line[24];
    std::snprintf(line, sizeof line, "%d ms booted\n", number);
    claim(page.is(line), "an event is printed when it happens");
    std::strcat(wanted, line);
  }
  log.write(page);
  char all[600] = "3 ms lost: why\n4 ms idle\n";
  std::strcat(all, wanted);
  claim(page.is(all) && log.count() == 34, "the last 32 are kept");
  const struct {
    What what;
    const char* word;
  } words[] = {
      {What::RESET, "reset"}, {What::BOOTING, "booting"}, {What::BOOTED, "booted"}, {What::CONNECTING, "connecting"},
      {What::CONNECTED, "connected"}, {What::NO_CONNECTION, "no connection"}, {What::DRIVING, "driving"},
      {What::COMMAND, "command"}, {What::STALL, "stall"}, {What::ODOMETRY_JUMPED, "odometry jumped"},
      {What::DISCONNECTED, "disconnected"}, {What::IDLE, "idle"}, {What::LOST, "lost"},
      {What::IMPLAUSIBLE, "implausible"}, {What::PAD_LOST, "pad lost"}, {What::MASTER, "master"},
      {What::MASTER_WAITS, "master"}, {What::SHUTDOWN, "shutdown"},
  };
  for (const auto& row : words) {
    claim(app::is_same(adapter::text(row.what), row.word), row.word);
  }
}

}  // namespace

void check_console() {
  check_words();
  check_settings();
  check_status();
  check_board_test();
  check_log();
}

}  // namespace units
