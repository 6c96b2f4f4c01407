// The 22 wires on a PC: a Unix socket that speaks lines.
//
//   to the adapter     in HEX              word of the input wires: motor1, motor2, p2dx_con, rst
//                      pad UP DOWN FORWARD BACKWARD TURN   a game pad's report, decimal
//   from the adapter   out MASK LEVELS     hex; the outputs of the mask have these levels now
//                      out 0 0             all outputs are released
//
// One far side at a time; a second one takes its place. When it leaves, its inputs
// stay as they are but p2dx_con, which falls: nobody wants the robot any more. A pad
// that reports no more is lost, as any other is.
#pragma once

#include <array>
#include <deque>
#include <string>

#include "../core/adapter/settings.hpp"
#include "../hal/pad.hpp"
#include "../hal/pins.hpp"

namespace host {

class Wires final : public hal::PinsIn, public hal::PinsOut, public hal::OutputPads, public hal::Pad {
 public:
  explicit Wires(const adapter::WireNumbers& wires)
      : connect_bit_(1U << (wires.motor1_width + wires.motor2_width)) {}
  Wires(const Wires&) = delete;
  Wires& operator=(const Wires&) = delete;
  ~Wires();

  // Waits for a far side at a path; false where it cannot, and `error()` is why.
  [[nodiscard]] bool listen(const std::string& path);

  // Takes what has come; never waits.
  void serve();

  std::uint32_t read(p2os::Nanos) override { return word_; }
  void drive(std::uint32_t mask, std::uint32_t levels, p2os::Nanos now) override;
  void release(p2os::Nanos now) override { drive(0, 0, now); }
  // Nothing but what is driven is known of the far side's wires.
  std::uint32_t sense(p2os::Nanos) override { return levels_; }
  bool take(adapter::PadReport& report) override;

  int listening() const { return listener_; }
  int connected() const { return far_side_; }
  const std::string& error() const { return error_; }

 private:
  void take(char character);
  void take_line();
  void leave();

  std::uint32_t connect_bit_;
  std::uint32_t word_ = 0;
  std::uint32_t driven_ = 0;
  std::uint32_t levels_ = 0;
  //: Reports that came since the last look: a press between two others must not be lost.
  std::deque<adapter::PadReport> reports_;
  int listener_ = -1;
  int far_side_ = -1;
  std::string path_;
  std::string error_;
  std::array<char, 48> line_{};
  std::size_t size_ = 0;
};

}  // namespace host
