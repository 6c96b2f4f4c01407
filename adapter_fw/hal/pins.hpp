// The adapter's ends of the wires, as the core needs them; one of six small interfaces of the hardware.
#pragma once

#include <cstdint>

#include "../core/p2os/time.hpp"

namespace hal {

//: What a wire shows that is always high.
constexpr std::int32_t FULL_DUTY = 1'000;

//: The input wires, read at one instant.
class PinsIn {
 public:
  //: Returns a word: motor1's wires from bit 0 on, motor2's after them, then p2dx_con, then rst.
  //: `at` is the instant that is meant; hardware can only answer for the present.
  virtual std::uint32_t read(p2os::Nanos at) = 0;
  //: Returns for which share of a period the wire of a bit is high, in 1/1000, as a capture unit knows it at `at`.
  //: Who has none sees the level.
  virtual std::int32_t duty(std::int32_t bit, p2os::Nanos at) { return (read(at) >> bit & 1U) != 0 ? FULL_DUTY : 0; }

 protected:
  ~PinsIn() = default;
};

//: The output wires: distances from bit 0 on, then both encoders, least significant bits first.
class PinsOut {
 public:
  //: Drives the wires of `mask` to their bits of `levels`, all at once.
  virtual void drive(std::uint32_t mask, std::uint32_t levels, p2os::Nanos now) = 0;
  //: Lets every output follow its pull.
  virtual void release(p2os::Nanos now) = 0;

 protected:
  ~PinsOut() = default;
};

//: The output wires' own pads.
class OutputPads {
 public:
  //: Returns the levels that stand on them, whoever makes them; a word as of PinsOut.
  virtual std::uint32_t sense(p2os::Nanos now) = 0;

 protected:
  ~OutputPads() = default;
};

}  // namespace hal
