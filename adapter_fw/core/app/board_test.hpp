// The hardware, handed from the adapter to the console while a board is tested.
//
// Stands between the adapter and its wires, line and pad. While a test is on
//
//     the adapter reads every wire as 0, so that it asks for no robot; what it drives is remembered, not driven
//     the console drives the output wires, one by one or none, and reads every pad
//     bytes from the line are kept for the console; what the adapter still has to say, its STOP, goes out
//     reports of the pad are counted, not obeyed
//
// When the test ends the outputs are what the adapter wants them to be.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "../../hal/pad.hpp"
#include "../../hal/pins.hpp"
#include "../../hal/uart.hpp"

namespace app {

class BoardTest final : public hal::PinsIn, public hal::PinsOut, public hal::Uart, public hal::Pad {
 public:
  struct Hardware {
    hal::PinsIn& in;
    hal::PinsOut& out;
    hal::OutputPads& pads;
    hal::Uart& line;
    //: nullptr where the firmware has none.
    hal::Pad* pad;
  };
  //: What came last on the line; older bytes are forgotten.
  static constexpr std::size_t KEPT_BYTES = 32;

  explicit BoardTest(const Hardware& hardware) : hardware_(hardware) {}

  bool is_on() const { return is_on_; }
  // Lets go of every output, and forgets what came on the line.
  void begin(p2os::Nanos now);
  void end(p2os::Nanos now);

  // What the console asks for; to be called while a test is on.
  void hold(std::uint32_t mask, std::uint32_t levels, p2os::Nanos now);
  void send(p2os::Bytes data) { hardware_.line.write(data); }
  // Copies what came on the line since the last call, the oldest first; returns how much.
  std::size_t take_back(std::array<std::uint8_t, KEPT_BYTES>& data);

  // Also without a test.
  std::uint32_t inputs(p2os::Nanos now) { return hardware_.in.read(now); }
  std::uint32_t outputs(p2os::Nanos now) { return hardware_.pads.sense(now); }
  bool has_pad() const { return hardware_.pad != nullptr; }
  std::uint32_t pad_reports() const { return reports_; }
  const adapter::PadReport& last_report() const { return report_; }

  // The adapter's sides.
  std::uint32_t read(p2os::Nanos at) override { return is_on_ ? 0 : hardware_.in.read(at); }
  std::int32_t duty(std::int32_t bit, p2os::Nanos at) override { return is_on_ ? 0 : hardware_.in.duty(bit, at); }
  void drive(std::uint32_t mask, std::uint32_t levels, p2os::Nanos now) override;
  void release(p2os::Nanos now) override;
  std::size_t read(std::uint8_t* data, std::size_t size) override;
  void write(p2os::Bytes data) override { hardware_.line.write(data); }
  void set_baud(std::int32_t baud) override { hardware_.line.set_baud(baud); }
  bool take(adapter::PadReport& report) override;
  void pair(p2os::Nanos now) override { hardware_.pad->pair(now); }
  // Returns the pad's side, nullptr where there is none.
  hal::Pad* pad() { return has_pad() ? this : nullptr; }

 private:
  Hardware hardware_;
  bool is_on_ = false;
  //: What the adapter wants.
  std::uint32_t driven_ = 0;
  std::uint32_t levels_{};
  std::array<std::uint8_t, KEPT_BYTES> back_{};
  std::size_t came_back_{};
  std::uint32_t reports_ = 0;
  adapter::PadReport report_{};
};

}  // namespace app
