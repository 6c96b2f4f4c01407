// The rounding rules of the adapter's arithmetic: integers only, nothing else rounds.
//
// Every intermediate value fits 64 bits for the ranges that settings.hpp allows;
// where that is not obvious, the place says why.
#pragma once

#include <cstdint>

namespace adapter {

// Returns the quotient rounded to the nearest integer, halves away from zero; `denominator` is positive.
constexpr std::int64_t divide_half_away(std::int64_t numerator, std::int64_t denominator) {
  const std::int64_t size = numerator < 0 ? -numerator : numerator;
  const std::int64_t magnitude = (2 * size + denominator) / (2 * denominator);
  return numerator < 0 ? -magnitude : magnitude;
}

// Returns the quotient rounded towards minus infinity; `denominator` is positive.
constexpr std::int64_t divide_floor(std::int64_t numerator, std::int64_t denominator) {
  const std::int64_t quotient = numerator / denominator;
  return numerator % denominator < 0 ? quotient - 1 : quotient;
}

// Returns what `divide_floor` leaves, 0 to denominator - 1.
constexpr std::int64_t remainder_floor(std::int64_t numerator, std::int64_t denominator) {
  return numerator - divide_floor(numerator, denominator) * denominator;
}

constexpr std::int64_t size_of_number(std::int64_t value) { return value < 0 ? -value : value; }

}  // namespace adapter
