// The core's self-test: an adapter, a robot of a few lines, and accidents.
//
// It needs no hardware and no operating system, so it runs wherever the core is
// compiled to: on a PC with sanitizers, on an emulated Cortex-M3, on an Xtensa in
// QEMU. Everything that leaves the adapter goes into one hash: the same on all of
// them, or the core is not the same machine everywhere.
#pragma once

#include <cstdint>

#include "../core/p2os/time.hpp"

namespace selftest {

struct Result {
  //: FNV-1a over every frame and every change of a pin, with its time.
  std::uint32_t hash = 2'166'136'261U;
  std::uint32_t frames = 0;
  std::uint32_t pin_changes = 0;
  std::uint32_t sessions = 0;
  std::uint32_t losses = 0;
  std::uint32_t resets = 0;
  std::uint32_t rejected = 0;
  //: What was seen and must not be; nullptr for nothing.
  const char* failure = nullptr;
};

// Runs for `span` with the accidents that `seed` brings.
Result run(p2os::Nanos span, std::uint32_t seed);

//: Called before and after each call of the core; a platform with a cycle counter measures between them.
extern void (*before_step)();
extern void (*after_step)();

}  // namespace selftest
