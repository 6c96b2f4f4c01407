// The standard server information packet, as far as an adapter needs it.
//
// Source: P2OS manual, SIP table. Raw values are those of the wire; the tail that
// AROS and ARCOS robots append is left alone.
#pragma once

#include <cstdint>

#include "frame.hpp"

namespace p2os {

//: Types that clients take for a standard SIP; 0x32 standing, 0x33 moving.
constexpr std::uint8_t FIRST_SIP_KIND = 0x30;
constexpr std::uint8_t LAST_SIP_KIND = 0x34;

constexpr bool is_sip_kind(std::uint8_t kind) { return kind >= FIRST_SIP_KIND && kind <= LAST_SIP_KIND; }

struct SonarReading {
  std::uint8_t number;      // from 0
  std::uint16_t raw_range;  // counts of RangeConvFactor
};

struct Sip {
  std::uint16_t raw_x{};       // 15-bit counts of DistConvFactor
  std::uint16_t raw_y{};
  std::int16_t raw_heading{};  // counts, 4096 to the turn
  std::int16_t raw_left_velocity{};
  std::int16_t raw_right_velocity{};
  std::uint8_t raw_battery{};  // 0.1 V
  bool stall_left{};
  bool stall_right{};
  std::uint8_t sonar_count{};

  // Returns one of the readings; they stay in the frame's bytes.
  SonarReading sonar(std::uint8_t place) const;

  // Reads a SIP's payload; false where it is shorter than its own sonar count requires.
  [[nodiscard]] static bool read(Bytes payload, Sip& sip);

 private:
  const std::uint8_t* readings_ = nullptr;
};

}  // namespace p2os
