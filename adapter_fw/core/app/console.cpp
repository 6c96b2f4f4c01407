#include "console.hpp"

#include "../adapter/fields.hpp"
#include "version.hpp"

namespace app {

namespace {

constexpr char HELP[] =
    "version | status | pins | log | get [NAME] | set NAME VALUE | reset NAME\n"
    "master bluepill|pad | stop | restart\n"
    "test on|off | wires [MASK LEVELS] | link [HEX] | pad | pad pair\n";

void write_bits(Writer& writer, const char* name, std::uint32_t levels, std::int32_t from, std::int32_t count) {
  writer.write(name);
  for (std::int32_t bit = from; bit < from + count; ++bit) {
    writer.write((levels >> bit & 1U) != 0 ? "1" : "0");
  }
}

}  // namespace

adapter::Settings stored_settings(Store& store, const adapter::WireNumbers& wires, const char*& fault) {
  adapter::Settings settings;
  for (std::int32_t place = 0; place < adapter::setting_count(); ++place) {
    std::int64_t value{};
    if (store.load(adapter::setting(place).name, value)) {
      adapter::setting(place).set(settings, value);
    }
  }
  fault = adapter::fault_of(settings, wires);
  return fault == nullptr ? settings : adapter::Settings{};
}

void Console::take(char character, p2os::Nanos now) {
  if (character == '\r' || character == '\n') {
    line_[size_] = '\0';
    if (is_too_long_) {
      parts_.writer.write("error: the line is longer than 79 characters\n");
    } else if (size_ != 0) {
      run(line_.data(), now);
    }
    size_ = 0;
    is_too_long_ = false;
  } else if (size_ + 1 < line_.size()) {
    line_[size_++] = character;
  } else {
    is_too_long_ = true;
  }
}

void Console::banner() {
  parts_.writer.write("P2OS adapter ");
  parts_.writer.write(VERSION);
  parts_.writer.write(", board ");
  parts_.writer.write(parts_.board);
  parts_.writer.write("; type help\n");
}

void Console::run(char* line, p2os::Nanos now) {
  const Words given(line);
  const auto is = [&given](const char* verb, std::size_t count) {
    return given.count == count && is_same(given.words[0], verb);
  };
  Writer& writer = parts_.writer;
  if (is("help", 1)) {
    writer.write(HELP);
  } else if (is("version", 1)) {
    banner();
  } else if (is("status", 1)) {
    status();
  } else if (is("pins", 1)) {
    pins(now);
  } else if (is("log", 1)) {
    parts_.log.write(writer);
  } else if (is("get", 1) || is("get", 2)) {
    get(given.words[1]);
  } else if (is("set", 3)) {
    set(given.words[1], given.words[2]);
  } else if (is("reset", 2)) {
    reset(given.words[1]);
  } else if (is("master", 2) && (is_same(given.words[1], "bluepill") || is_same(given.words[1], "pad"))) {
    parts_.adapter.set_master(
        is_same(given.words[1], "pad") ? adapter::Master::PAD : adapter::Master::BLUEPILL, now);
    writer.write("ok\n");
  } else if (is("stop", 1)) {
    parts_.adapter.shutdown("stopped on the console", now);
    writer.write("ok\n");
  } else if (is("restart", 1)) {
    parts_.adapter.shutdown("restarted on the console", now);
    wants_restart_ = true;
    writer.write("ok\n");
  } else if (is("test", 2) && (is_same(given.words[1], "on") || is_same(given.words[1], "off"))) {
    test(is_same(given.words[1], "on"), now);
  } else if (is("wires", 1) || is("wires", 3)) {
    wires(given.words[1], given.words[2], now);
  } else if (is("link", 1) || is("link", 2)) {
    link(given.words[1]);
  } else if (is("pad", 1)) {
    pad();
  } else if (is("pad", 2) && is_same(given.words[1], "pair")) {
    pair(now);
  } else {
    writer.write("error: no such command; type help\n");
  }
}

void Console::status() {
  const adapter::Adapter& part = parts_.adapter;
  const p2os::DecoderStats& wire = part.client().wire_stats();
  Writer& writer = parts_.writer;
  writer.write("state ");
  writer.write(adapter::text(part.state()));
  writer.write(" (");
  writer.write(part.reason());
  writer.write("), master ");
  writer.write(adapter::text(part.master()));
  writer.write("\n");
  number("motor1", part.motor(1));
  number("motor2", part.motor(2));
  number("VEL_mm_s", part.speeds().forward_mm_s);
  number("RVEL_deg_s", part.speeds().turn_deg_s);
  number("encoder1", part.counts_shown().left);
  number("encoder2", part.counts_shown().right);
  number("baud", part.baud());
  writer.write("\n");
  number("SIPs", part.sips());
  number("frames", wire.frames);
  number("bad_checksums", wire.bad_checksums);
  number("bad_counts", wire.bad_counts);
  number("noise_bytes", wire.noise_bytes);
  number("losses", part.client().stats().losses);
  number("odometry_jumps", part.jumps());
  writer.write("\n");
}

void Console::pins(p2os::Nanos now) {
  const adapter::WireNumbers& wires = parts_.wires;
  const std::uint32_t in = parts_.test.inputs(now);
  const std::uint32_t out = parts_.adapter.outputs().levels();
  Writer& writer = parts_.writer;
  write_bits(writer, "in:  motor1_comm1.. ", in, 0, wires.motor1_width);
  write_bits(writer, "  motor2_comm1.. ", in, wires.motor1_width, wires.motor2_width);
  write_bits(writer, "  p2dx_con ", in, wires.motor1_width + wires.motor2_width, 1);
  writer.write(parts_.adapter.outputs().driven() != 0 ? "\nout: " : "\nout (released): ");
  write_bits(writer, "DD1.. ", out, 0, wires.distances);
  write_bits(writer, "  encoder1_s1.. ", out, wires.distances, wires.encoder_width);
  write_bits(writer, "  encoder2_s1.. ", out, wires.distances + wires.encoder_width, wires.encoder_width);
  writer.write("\n");
}

void Console::test(bool is_on, p2os::Nanos now) {
  BoardTest& test = parts_.test;
  if (is_on && !test.is_on()) {
    parts_.adapter.shutdown("the board is tested", now);
    test.begin(now);
  } else if (!is_on && test.is_on()) {
    test.end(now);
  }
  parts_.writer.write(is_on ? "test on, started by " : "test off, started by ");
  parts_.writer.write(parts_.started_by);
  parts_.writer.write("\n");
}

void Console::wires(const char* mask, const char* levels, p2os::Nanos now) {
  std::uint32_t driven{}, wanted{};
  if (mask != nullptr) {
    if (!is_in_test()) {
      return;
    }
    if (!read_hex(mask, driven) || !read_hex(levels, wanted)) {
      parts_.writer.write("error: that is no hexadecimal number\n");
      return;
    }
    parts_.test.hold(driven, wanted, now);
  }
  parts_.writer.write("wires in ");
  write_hex(parts_.writer, parts_.test.inputs(now), 8);
  parts_.writer.write(" out ");
  write_hex(parts_.writer, parts_.test.outputs(now), 8);
  parts_.writer.write("\n");
}

void Console::link(const char* hex) {
  if (!is_in_test()) {
    return;
  }
  if (hex != nullptr) {
    std::array<std::uint8_t, BoardTest::KEPT_BYTES / 2> bytes{};
    std::size_t size = 0;
    for (; hex[0] != '\0' && hex[1] != '\0' && size < bytes.size(); hex += 2, ++size) {
      const char pair[] = {hex[0], hex[1], '\0'};
      std::uint32_t value{};
      if (!read_hex(pair, value)) {
        break;
      }
      bytes[size] = static_cast<std::uint8_t>(value);
    }
    if (*hex != '\0' || size == 0) {
      parts_.writer.write("error: that is not one to 16 bytes in hexadecimal\n");
      return;
    }
    parts_.test.send({bytes.data(), size});
  }
  std::array<std::uint8_t, BoardTest::KEPT_BYTES> back{};
  const std::size_t size = parts_.test.take_back(back);
  parts_.writer.write("link ");
  for (std::size_t place = 0; place < size; ++place) {
    write_hex(parts_.writer, back[place], 2);
  }
  parts_.writer.write("\n");
}

void Console::pair(p2os::Nanos now) {
  hal::Pad* pad = parts_.test.pad();
  if (pad == nullptr) {
    parts_.writer.write("pad none\n");
    return;
  }
  pad->pair(now);
  parts_.writer.write("ok, for 30 s: hold the pad's pairing buttons\n");
}

void Console::pad() {
  if (!parts_.test.has_pad()) {
    parts_.writer.write("pad none\n");
    return;
  }
  const adapter::PadReport& report = parts_.test.last_report();
  number("pad", parts_.test.pad_reports());
  number("up", report.up);
  number("down", report.down);
  number("forward", report.forward);
  number("backward", report.backward);
  number("turn", report.turn);
  parts_.writer.write("\n");
}

bool Console::is_in_test() {
  if (!parts_.test.is_on()) {
    parts_.writer.write("error: only in a test; type test on\n");
  }
  return parts_.test.is_on();
}

void Console::get(const char* name) {
  const char* fault = nullptr;
  const adapter::Settings settings = stored_settings(parts_.store, parts_.wires, fault);
  if (name == nullptr) {
    for (std::int32_t place = 0; place < adapter::setting_count(); ++place) {
      show(place, settings);
    }
    return;
  }
  const std::int32_t place = adapter::find_setting(name);
  if (place < 0) {
    parts_.writer.write("error: no such setting; get lists them\n");
  } else {
    show(place, settings);
  }
}

// A value that leaves the settings with a fault is not stored: the next start must find sound ones.
void Console::set(const char* name, const char* value) {
  const std::int32_t place = adapter::find_setting(name);
  std::int64_t wanted{};
  if (place < 0) {
    parts_.writer.write("error: no such setting; get lists them\n");
    return;
  }
  if (!read_number(value, wanted)) {
    parts_.writer.write("error: that is no whole number\n");
    return;
  }
  const char* fault = nullptr;
  adapter::Settings settings = stored_settings(parts_.store, parts_.wires, fault);
  adapter::setting(place).set(settings, wanted);
  fault = adapter::fault_of(settings, parts_.wires);
  if (fault == nullptr && adapter::setting(place).get(settings) != wanted) {
    fault = "it does not fit";
  }
  if (fault != nullptr) {
    parts_.writer.write("error: ");
    parts_.writer.write(fault);
    parts_.writer.write("\n");
  } else if (!parts_.store.save(adapter::setting(place).name, wanted)) {
    parts_.writer.write("error: it could not be stored\n");
  } else {
    parts_.writer.write("ok, in force after restart\n");
  }
}

void Console::reset(const char* name) {
  const std::int32_t place = adapter::find_setting(name);
  if (place < 0) {
    parts_.writer.write("error: no such setting; get lists them\n");
  } else {
    parts_.store.forget(adapter::setting(place).name);
    parts_.writer.write("ok, in force after restart\n");
  }
}

void Console::show(std::int32_t place, const adapter::Settings& settings) {
  parts_.writer.write(adapter::setting(place).name);
  parts_.writer.write(" = ");
  write_number(parts_.writer, adapter::setting(place).get(settings));
  parts_.writer.write("\n");
}

void Console::number(const char* name, std::int64_t value) {
  parts_.writer.write(name);
  parts_.writer.write(" ");
  write_number(parts_.writer, value);
  parts_.writer.write("  ");
}

}  // namespace app
