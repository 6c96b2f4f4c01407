// Keeps where the wheels stand while the program does not run: the encoders are absolute.
//
//     what happened                           from              the codes go on
//     restart, watchdog, panic, brown-out     memory            where they were
//     rst (EN) low, power cut                 store             where the wheels last stood for STANDS_NS
//     neither is sound (a first start)        -                 the code that its wires show before
//
// EN powers an ESP32 down, its RTC memory included, so that only flash is left. Flash wears, and writing it halts
// the program for milliseconds: it is written at a standstill only. What the wheels turn
// while no program runs, nobody knows.
#pragma once

#include <cstdint>

#include "../adapter/adapter.hpp"
#include "console.hpp"

namespace app {

//: Lies in memory that a start of the program does not clear; may hold anything.
struct RetainedWheels {
  std::int64_t left_um;
  std::int64_t right_um;
  std::uint32_t check;
};

class CodeKeeper {
 public:
  //: chosen: longer than any pause within a motion; a robot that drives all day is stored some thousand times.
  static constexpr p2os::Nanos STANDS_NS = 1 * p2os::NS_PER_S;

  CodeKeeper(RetainedWheels& memory, Store& store) : memory_(memory), store_(store) {}

  // Places the wheels of an adapter that has not run yet.
  void restore(adapter::Adapter& part);

  // Keeps where they stand now; after each pass of the loop.
  void keep(const adapter::Adapter& part, p2os::Nanos now);

 private:
  void remember(adapter::Wheels phases_um);

  RetainedWheels& memory_;
  Store& store_;
  adapter::Wheels last_;
  p2os::Nanos since_{};
  bool is_stored_ = true;
};

}  // namespace app
