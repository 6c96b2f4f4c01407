// Time as this code knows it: whole nanoseconds in 64 bits, passed in by the caller.
//
// Nothing here reads a clock. 64 bits last 292 years, so no comparison has to
// mind a wrap; a program whose clock has 32 bits widens it before it calls.
#pragma once

#include <cstdint>

namespace p2os {

using Nanos = std::int64_t;

constexpr Nanos NS_PER_US = 1'000;
constexpr Nanos NS_PER_MS = 1'000'000;
constexpr Nanos NS_PER_S = 1'000'000'000;

//: Later than any deadline.
constexpr Nanos NEVER = Nanos{1} << 62;

constexpr Nanos earlier(Nanos one, Nanos other) { return one < other ? one : other; }
constexpr Nanos later(Nanos one, Nanos other) { return one > other ? one : other; }

}  // namespace p2os
