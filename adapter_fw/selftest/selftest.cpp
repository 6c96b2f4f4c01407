#include "selftest.hpp"

#include "../core/adapter/adapter.hpp"
#include "../generated/rev_b/pins.hpp"
#include "../generated/robots.hpp"
#include "robot.hpp"

namespace selftest {

using adapter::Adapter;
using p2os::Bytes;
using p2os::Nanos;
using p2os::NS_PER_MS;

void (*before_step)() = nullptr;
void (*after_step)() = nullptr;

namespace {

//: As motor pins can ask for, and as the pad can.
constexpr std::int32_t MOST_MM_S = 400, MOST_DEG_S = 100;
constexpr Nanos STEP_NS = 1 * NS_PER_MS;
//: A SIP's age beyond which nothing but zero may stand on the wire.
using p2os::LIVENESS_NS;

//: Numerical Recipes' generator: the same numbers on every machine.
class RandomSource {
 public:
  explicit RandomSource(std::uint32_t seed) : state_(seed) {}

  std::uint32_t below(std::uint32_t limit) {
    state_ = state_ * 1'664'525U + 1'013'904'223U;
    return (state_ >> 8) % limit;
  }

 private:
  std::uint32_t state_;
};

//: The adapter with everything around it.
class Trial final : private hal::PinsIn, private hal::PinsOut, private adapter::Observer {
 public:
  explicit Trial(std::uint32_t seed) : random_source_(seed), part_({}, *adapter::find_robot("p2dx"), board::WIRES, 0) {
    part_.attach(this, this, this);
  }

  Result run(Nanos span) {
    for (now_ = 0; now_ < span && result_.failure == nullptr; now_ += STEP_NS) {
      if (now_ >= next_accident_) {
        accident();
        next_accident_ = now_ + (100 + random_source_.below(2'400)) * NS_PER_MS;
      }
      if (now_ >= next_report_) {
        report_pad();
        next_report_ = now_ + 20 * NS_PER_MS;
      }
      step();
    }
    result_.rejected = part_.client().wire_stats().bad_checksums;
    return result_;
  }

 private:
  void step() {
    robot_.advance_to(now_);
    deliver();
    timed([this] { part_.advance_to(now_); });
    p2os::CommandFrame frame;
    while (part_.take_output(frame)) {
      take(frame.bytes());
    }
    const adapter::Speeds speeds = part_.speeds();
    if (part_.state() == adapter::State::DRIVING && now_ - sip_at_ > LIVENESS_NS) {
      result_.failure = "drives without a SIP";
    } else if (adapter::State::DRIVING != part_.state() && speeds != adapter::Speeds{}) {
      result_.failure = "holds a speed while it does not drive";
    } else if (part_.client().stats().overflows != 0) {
      result_.failure = "output overflowed";
    }
  }

  void deliver() {
    const Bytes answer = robot_.output();
    if (answer.size != 0 && !is_cut_) {
      std::array<std::uint8_t, Robot::MAX_OUTPUT> bytes{};
      for (std::size_t place = 0; place < answer.size; ++place) {
        bytes[place] = answer[place];
      }
      if (random_source_.below(40) == 0) {
        bytes[random_source_.below(static_cast<std::uint32_t>(answer.size))] ^= static_cast<std::uint8_t>(1U << random_source_.below(8));
      }
      const std::uint32_t sips = part_.sips();
      timed([&] { part_.receive({bytes.data(), answer.size}, now_); });
      sip_at_ = part_.sips() != sips ? now_ : sip_at_;
    }
    robot_.forget_output();
  }

  //: A frame that leaves the adapter.
  void take(Bytes frame) {
    ++result_.frames;
    mix(now_);
    for (std::size_t place = 0; place < frame.size; ++place) {
      mix_byte(frame[place]);
    }
    if (frame.size == p2os::CommandFrame::MAX_BYTES) {
      const std::int32_t value = frame[5] | frame[6] << 8;
      const auto number = static_cast<p2os::CommandNumber>(frame[3]);
      if ((number == p2os::CommandNumber::VEL && value > MOST_MM_S) ||
          (number == p2os::CommandNumber::RVEL && value > MOST_DEG_S)) {
        result_.failure = "a speed beyond its limit";
      }
    }
    if (!is_cut_) {
      robot_.receive(frame, now_);
    }
  }

  void accident() {
    switch (random_source_.below(12)) {
      case 0:
        pins_ ^= 1U << 6;  // p2dx_con
        break;
      case 1:
        pins_ |= 1U << 7;  // rst
        ++result_.resets;
        break;
      case 2:
        is_cut_ = !is_cut_;
        break;
      case 3:
        robot_.reboot();
        break;
      case 4:
        part_.set_master(random_source_.below(2) == 0 ? adapter::Master::BLUEPILL : adapter::Master::PAD, now_);
        break;
      case 5:
        up_ = !up_;
        break;
      case 6:
        has_pad_ = !has_pad_;
        break;
      case 7:
        noise();
        break;
      default:
        // Most of the time things go well: the line is whole, the BluePill wants the robot, its motors change.
        is_cut_ = false;
        pins_ = (pins_ & ~(1U << 7) & ~0x3FU) | 1U << 6 | random_source_.below(64);
        break;
    }
  }

  void noise() {
    std::uint8_t bytes[24];
    for (std::uint8_t& byte : bytes) {
      byte = static_cast<std::uint8_t>(random_source_.below(4) == 0 ? 0xFA + random_source_.below(2) : random_source_.below(256));
    }
    part_.receive({bytes, sizeof bytes}, now_);
  }

  void report_pad() {
    if (has_pad_) {
      part_.receive_pad({up_, false, static_cast<std::int32_t>(random_source_.below(1'024)), 0,
                         static_cast<std::int32_t>(random_source_.below(1'024)) - 512},
                        now_);
    }
  }

  template <typename Call>
  void timed(Call call) {
    if (before_step != nullptr) {
      before_step();
    }
    call();
    if (after_step != nullptr) {
      after_step();
    }
  }

  std::uint32_t read(Nanos) override { return pins_; }

  void drive(std::uint32_t mask, std::uint32_t levels, Nanos now) override {
    ++result_.pin_changes;
    mix(now);
    mix(mask);
    mix(levels);
  }

  void release(Nanos now) override { drive(0, 0, now); }

  void happened(Nanos now, adapter::What what, const char*, std::int32_t first, std::int32_t second) override {
    result_.sessions += what == adapter::What::CONNECTED ? 1 : 0;
    result_.losses += what == adapter::What::LOST || what == adapter::What::IMPLAUSIBLE ? 1 : 0;
    mix(now);
    mix_byte(static_cast<std::uint8_t>(what));
    mix(first);
    mix(second);
  }

  void mix(std::int64_t value) {
    for (int shift = 0; shift < 64; shift += 8) {
      mix_byte(static_cast<std::uint8_t>(value >> shift & 0xFF));
    }
  }

  void mix_byte(std::uint8_t byte) { result_.hash = (result_.hash ^ byte) * 16'777'619U; }

  RandomSource random_source_;
  Adapter part_;
  Robot robot_;
  Result result_;
  Nanos now_ = 0;
  Nanos next_accident_ = 600 * NS_PER_MS;
  Nanos next_report_ = 0;
  Nanos sip_at_ = 0;
  std::uint32_t pins_ = 1U << 6;
  bool is_cut_ = false;
  bool has_pad_ = true;
  bool up_ = false;
};

}  // namespace

Result run(Nanos span, std::uint32_t seed) { return Trial(seed).run(span); }

}  // namespace selftest
