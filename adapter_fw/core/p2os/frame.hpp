// P2OS frames: FA FB, count, payload, checksum.
//
// Source: Pioneer 3 manual, page 32; P2OS manual, page 36.
// Invariant: a Frame that exists can be sent as it stands.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "commands.hpp"

namespace p2os {

constexpr std::uint8_t HEADER_0 = 0xFA;
constexpr std::uint8_t HEADER_1 = 0xFB;
//: Header and count.
constexpr std::size_t PREFIX_BYTES = 3;
constexpr std::size_t CHECKSUM_BYTES = 2;
//: The count covers payload and checksum; the smallest frame has one command byte.
constexpr std::uint8_t MIN_COUNT = 3;
//: Largest count that an ARCOS robot accepts (Pioneer 3 manual, page 32).
constexpr std::uint8_t MAX_COUNT = 204;
constexpr std::size_t MAX_FRAME_BYTES = PREFIX_BYTES + MAX_COUNT;

//: Bytes that somebody else keeps.
struct Bytes {
  const std::uint8_t* data = nullptr;
  std::size_t size = 0;

  constexpr std::uint8_t operator[](std::size_t place) const { return data[place]; }
  constexpr Bytes from(std::size_t place) const { return {data + place, size - place}; }
};

//: A command's frame: at most a number, a type byte and 16 bits.
class CommandFrame {
 public:
  static constexpr std::size_t MAX_BYTES = 9;

  //: A bare command.
  explicit CommandFrame(CommandNumber number);
  //: A command with an integer, -65535 to 65535; what lies beyond is brought to the nearer end.
  CommandFrame(CommandNumber number, std::int32_t argument);
  CommandFrame() = default;

  Bytes bytes() const { return {bytes_.data(), size_}; }

 private:
  void finish(std::size_t payload_bytes);

  std::array<std::uint8_t, MAX_BYTES> bytes_{};
  std::uint8_t size_ = 0;
};

// Returns the checksum of a payload: big-endian pairs summed, an odd last byte XORed into the low byte.
std::uint16_t checksum(Bytes payload);

}  // namespace p2os
