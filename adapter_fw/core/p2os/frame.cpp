#include "frame.hpp"

namespace p2os {

namespace {

//: Argument type bytes (sfARGINT, sfARGNINT in the manuals).
constexpr std::uint8_t POSITIVE = 0x3B;
constexpr std::uint8_t NEGATIVE = 0x1B;
constexpr std::int32_t MAX_MAGNITUDE = 0xFFFF;

}  // namespace

std::uint16_t checksum(Bytes payload) {
  std::uint16_t sum = 0;
  std::size_t place = 0;
  for (; place + 1 < payload.size; place += 2) {
    sum = static_cast<std::uint16_t>(sum + (payload[place] << 8) + payload[place + 1]);
  }
  if (place < payload.size) {
    sum = static_cast<std::uint16_t>(sum ^ payload[place]);
  }
  return sum;
}

CommandFrame::CommandFrame(CommandNumber number) {
  bytes_[PREFIX_BYTES] = static_cast<std::uint8_t>(number);
  finish(1);
}

CommandFrame::CommandFrame(CommandNumber number, std::int32_t argument) {
  std::int32_t magnitude = argument < 0 ? -argument : argument;
  magnitude = magnitude > MAX_MAGNITUDE ? MAX_MAGNITUDE : magnitude;
  bytes_[PREFIX_BYTES] = static_cast<std::uint8_t>(number);
  bytes_[PREFIX_BYTES + 1] = argument < 0 ? NEGATIVE : POSITIVE;
  bytes_[PREFIX_BYTES + 2] = static_cast<std::uint8_t>(magnitude & 0xFF);
  bytes_[PREFIX_BYTES + 3] = static_cast<std::uint8_t>(magnitude >> 8);
  finish(4);
}

void CommandFrame::finish(std::size_t payload_bytes) {
  bytes_[0] = HEADER_0;
  bytes_[1] = HEADER_1;
  bytes_[2] = static_cast<std::uint8_t>(payload_bytes + CHECKSUM_BYTES);
  const std::uint16_t sum = checksum({bytes_.data() + PREFIX_BYTES, payload_bytes});
  bytes_[PREFIX_BYTES + payload_bytes] = static_cast<std::uint8_t>(sum >> 8);
  bytes_[PREFIX_BYTES + payload_bytes + 1] = static_cast<std::uint8_t>(sum & 0xFF);
  size_ = static_cast<std::uint8_t>(PREFIX_BYTES + payload_bytes + CHECKSUM_BYTES);
}

}  // namespace p2os
