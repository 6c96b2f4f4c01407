// What the fuzzer drives: a whole adapter with console, pins, pad, a robot of a few lines, and time.
//
// Theory of operation. The input is a program: each byte is a action, what it needs
// follows. The actions are all that the outside world can do to an adapter: bytes on
// the line (any, or those of a robot, whole or damaged), levels on the pins, reports
// of a pad, characters on the console, a change of masters, settings, and time. The
// rules that must hold whatever happens are checked after each action; a broken one
// traps, as a sanitizer's finding does.
//
//     clang++ -fsanitize=fuzzer,address,undefined …   searches (adapter_fw/fuzz/search.py)
//     build.py replay                                 reads the kept corpus again, with g++

#include <cstddef>
#include <cstdint>
#include <cstdio>

#include "../core/adapter/adapter.hpp"
#include "../core/adapter/fields.hpp"
#include "../core/app/console.hpp"
#include "../generated/rev_b/pins.hpp"
#include "../generated/robots.hpp"
#include "../selftest/robot.hpp"

namespace {

using p2os::Bytes;
using p2os::Nanos;
using p2os::NS_PER_MS;

//: The robot's own limits: no command may leave with more, whatever is set.
constexpr std::int32_t MOST_MM_S = 750, MOST_DEG_S = 100;

[[noreturn]] void broken(const char* rule) {
  std::fprintf(stderr, "broken rule: %s\n", rule);
  __builtin_trap();
}

//: The input, read from its front; zeros beyond its end.
class Source {
 public:
  explicit Source(Bytes data) : data_(data) {}

  bool is_empty() const { return data_.size == 0; }
  std::uint8_t byte() { return take(1).size == 0 ? std::uint8_t{0} : last_[0]; }
  std::int32_t word() {
    const std::int32_t low = byte();
    return low | byte() << 8;
  }
  Bytes take(std::size_t size) {
    last_ = {data_.data, size < data_.size ? size : data_.size};
    data_ = data_.from(last_.size);
    return last_;
  }

 private:
  Bytes data_;
  Bytes last_;
};

//: Settings that a person could have stored; the bits choose.
adapter::Settings settings_of(Source& source, const adapter::WireNumbers& wires) {
  adapter::Settings settings;
  for (std::uint8_t count = source.byte() % 4; count > 0; --count) {
    const std::int32_t place = source.byte() % adapter::setting_count();
    std::int64_t value = source.word();
    value <<= source.byte() % 48;
    adapter::setting(place).set(settings, (source.byte() & 1) != 0 ? -value : value);
  }
  return adapter::fault_of(settings, wires) == nullptr ? settings : adapter::Settings{};
}

class World final : private hal::PinsIn,
                    private hal::PinsOut,
                    private hal::OutputPads,
                    private hal::Uart,
                    private app::Writer,
                    private app::Store {
 public:
  explicit World(Source& source)
      : source_(source),
        settings_(settings_of(source, wires_)),
        part_(settings_, *adapter::find_robot("p2dx"), wires_, 0),
        test_({*this, *this, *this, *this, nullptr}),
        console_({part_, log_, test_, *this, *this, wires_, "fuzz", "power"}) {
    part_.attach(&test_, &test_, &log_);
  }

  void run() {
    while (!source_.is_empty()) {
      action();
      check();
    }
  }

 private:
  void action() {
    switch (source_.byte() % 12) {
      case 0:
        pins_ = source_.byte();
        break;
      case 1:
        receive(source_.take(source_.byte()));
        break;
      case 2:
        damage_ = source_.byte();
        break;
      case 3:
        is_cut_ = !is_cut_;
        break;
      case 4:
        robot_.reboot();
        break;
      case 5: {
        const std::uint8_t buttons = source_.byte();
        const std::int32_t forward = source_.word(), backward = source_.word();
        part_.receive_pad({(buttons & 1) != 0, (buttons & 2) != 0, forward << 16 | backward, -backward,
                           source_.word() - 32'768}, now_);
        break;
      }
      case 6:
        part_.set_master((source_.byte() & 1) != 0 ? adapter::Master::PAD : adapter::Master::BLUEPILL, now_);
        break;
      case 7:
        type(source_.take(source_.byte() % 100));
        break;
      case 8:
        part_.shutdown("the fuzzer asks", now_);
        break;
      case 9:
        pass(source_.word());
        break;
      default:
        // Mostly time passes, as the robot's packets come.
        for (std::uint8_t left = source_.byte() % 16; left > 0; --left) {
          pass(25 * NS_PER_MS);
        }
        break;
    }
  }

  void type(Bytes text) {
    for (std::size_t place = 0; place < text.size; ++place) {
      console_.take(static_cast<char>(text[place]), now_);
    }
    console_.take('\n', now_);
  }

  //: Lets time pass as a loop would: to each deadline, and to the end.
  void pass(Nanos span) {
    const Nanos end = now_ + span;
    while (now_ < end) {
      const Nanos due = p2os::earlier(part_.next_deadline(), robot_.next_deadline());
      now_ = due <= now_ ? now_ + 1 : p2os::earlier(due, end);
      robot_.advance_to(now_);
      answer();
      part_.advance_to(now_);
      note_sips();
      send();
      if (part_.next_deadline() <= now_) {
        broken("a deadline in the past: the loop would spin");
      }
    }
  }

  void answer() {
    const Bytes bytes = robot_.output();
    if (bytes.size != 0 && !is_cut_) {
      std::array<std::uint8_t, selftest::Robot::MAX_OUTPUT> copy{};
      for (std::size_t place = 0; place < bytes.size; ++place) {
        copy[place] = bytes[place];
      }
      copy[damage_ % bytes.size] ^= damage_;
      damage_ = 0;
      receive({copy.data(), bytes.size});
    }
    robot_.forget_output();
  }

  void receive(Bytes bytes) {
    received_at_ = now_;
    part_.receive(bytes, now_);
    note_sips();
  }

  //: A SIP may be found only when bytes that hid it are given up; it is as old as they are.
  void note_sips() {
    sip_at_ = part_.sips() != sips_ ? received_at_ : sip_at_;
    sips_ = part_.sips();
  }

  void send() {
    p2os::CommandFrame frame;
    while (part_.take_output(frame)) {
      const Bytes bytes = frame.bytes();
      if (bytes.size == p2os::CommandFrame::MAX_BYTES) {
        const std::int32_t value = bytes[5] | bytes[6] << 8;
        const auto number = static_cast<p2os::CommandNumber>(bytes[3]);
        if ((number == p2os::CommandNumber::VEL && value > MOST_MM_S) ||
            (number == p2os::CommandNumber::RVEL && value > MOST_DEG_S)) {
          broken("a speed beyond the robot's limit");
        }
      }
      if (!is_cut_) {
        robot_.receive(bytes, now_);
      }
    }
  }

  void check() {
    send();
    const bool is_driving = part_.state() == adapter::State::DRIVING;
    if (is_driving && test_.is_on()) {
      broken("drives while the board is tested");
    }
    if (is_driving && now_ - sip_at_ > settings_.liveness_ns) {
      broken("drives without a SIP");
    }
    if (!is_driving && part_.speeds() != adapter::Speeds{}) {
      broken("holds a speed while it does not drive");
    }
    if (part_.client().stats().overflows != 0) {
      broken("the output overflowed");
    }
    if ((pins_ & 0x80U) != 0 && part_.state() == adapter::State::RESET && part_.outputs().driven() != 0) {
      broken("drives a pin in reset");
    }
  }

  std::uint32_t read(Nanos) override { return pins_; }
  void drive(std::uint32_t, std::uint32_t, Nanos) override {}
  void release(Nanos) override {}
  std::uint32_t sense(Nanos) override { return pins_; }
  std::size_t read(std::uint8_t*, std::size_t) override { return 0; }
  void write(p2os::Bytes) override {}
  void set_baud(std::int32_t) override {}
  void write(const char* text) override { said_ += text[0] != '\0' ? 1U : 0U; }
  bool load(const char*, std::int64_t&) override { return false; }
  bool save(const char*, std::int64_t) override { return true; }
  void forget(const char*) override {}

  const adapter::WireNumbers& wires_ = board::WIRES;
  Source& source_;
  adapter::Settings settings_;
  adapter::Adapter part_;
  app::EventLog log_;
  app::BoardTest test_;
  app::Console console_;
  selftest::Robot robot_;
  Nanos now_ = 0;
  Nanos received_at_ = 0;
  Nanos sip_at_ = 0;
  std::uint32_t sips_ = 0;
  std::uint32_t pins_ = 0;
  std::uint32_t said_ = 0;
  std::uint8_t damage_ = 0;
  bool is_cut_ = false;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Source source({data, size});
  World(source).run();
  return 0;
}
