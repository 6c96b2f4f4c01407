#include "sip.hpp"

namespace p2os {

namespace {

//: Offsets from the type byte.
constexpr std::size_t X = 1, Y = 3, HEADING = 5, LEFT_VELOCITY = 7, RIGHT_VELOCITY = 9, BATTERY = 11, LEFT = 12,
                      RIGHT = 13, COUNT = 19, READINGS = 20;
constexpr std::size_t READING_BYTES = 3;
//: What stands after the readings: two port bytes, analog, digital in, digital out.
constexpr std::size_t BYTES_AFTER_READINGS = 5;

std::uint16_t word(Bytes bytes, std::size_t place) {
  return static_cast<std::uint16_t>(bytes[place] | bytes[place + 1] << 8);
}

std::int16_t signed_word(Bytes bytes, std::size_t place) { return static_cast<std::int16_t>(word(bytes, place)); }

}  // namespace

SonarReading Sip::sonar(std::uint8_t place) const {
  const std::uint8_t* reading = readings_ + READING_BYTES * place;
  return {reading[0], static_cast<std::uint16_t>(reading[1] | reading[2] << 8)};
}

bool Sip::read(Bytes payload, Sip& sip) {
  if (payload.size <= COUNT) {
    return false;
  }
  const std::size_t count = payload[COUNT];
  if (payload.size < READINGS + READING_BYTES * count + BYTES_AFTER_READINGS) {
    return false;
  }
  sip.raw_x = word(payload, X);
  sip.raw_y = word(payload, Y);
  sip.raw_heading = signed_word(payload, HEADING);
  sip.raw_left_velocity = signed_word(payload, LEFT_VELOCITY);
  sip.raw_right_velocity = signed_word(payload, RIGHT_VELOCITY);
  sip.raw_battery = payload[BATTERY];
  sip.stall_left = (payload[LEFT] & 1) != 0;
  sip.stall_right = (payload[RIGHT] & 1) != 0;
  sip.sonar_count = static_cast<std::uint8_t>(count);
  sip.readings_ = payload.data + READINGS;
  return true;
}

}  // namespace p2os
