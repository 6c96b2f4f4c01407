#include "robot.hpp"

#include <cstring>

namespace selftest {

using p2os::Bytes;
using p2os::CommandNumber;
using p2os::Nanos;

namespace {

constexpr Nanos SIP_NS = 100 * p2os::NS_PER_MS;
//: mm/s in 100 ms as thousandths of a 0.84 mm count; deg/s as thousandths of a 4096th of a turn.
constexpr std::int64_t X_PER_MM_S = 119;
constexpr std::int64_t HEADING_PER_DEG_S = 1'138;
constexpr std::size_t SIP_BYTES = 31;
constexpr char NAME[] = "\x02Self\0Pioneer\0p2dx";

std::int32_t argument(Bytes payload) {
  if (payload.size < 4) {
    return 0;
  }
  const std::int32_t magnitude = payload[2] | payload[3] << 8;
  return payload[1] == 0x1B ? -magnitude : magnitude;
}

}  // namespace

void Robot::take_frame(Bytes payload, Nanos now) {
  const auto number = static_cast<CommandNumber>(payload[0]);
  if (!is_open_) {
    if (payload[0] == 2 && synced_ == 2) {
      send(reinterpret_cast<const std::uint8_t*>(NAME), sizeof NAME);
      synced_ = 3;
    } else if (payload[0] == 1 && synced_ == 3) {
      is_open_ = true;
      next_sip_ = now + SIP_NS;
    } else if (payload[0] == 0 || (payload[0] == 1 && synced_ >= 1)) {
      send(payload.data, 1);
      synced_ = static_cast<std::uint8_t>(payload[0] + 1);
    }
    return;
  }
  switch (number) {
    case CommandNumber::CLOSE:
      reboot();
      break;
    case CommandNumber::STOP:
      forward_mm_s_ = turn_deg_s_ = 0;
      break;
    case CommandNumber::VEL:
      forward_mm_s_ = argument(payload);
      break;
    case CommandNumber::RVEL:
      turn_deg_s_ = argument(payload);
      break;
    case CommandNumber::SETO:
      x_ = heading_ = 0;
      break;
    default:
      break;
  }
}

void Robot::advance_to(Nanos now) {
  if (!is_open_ || now < next_sip_) {
    return;
  }
  next_sip_ += SIP_NS;
  x_ += forward_mm_s_ * X_PER_MM_S;
  heading_ += turn_deg_s_ * HEADING_PER_DEG_S;
  const auto x = static_cast<std::uint16_t>(x_ / 1'000 & 0x7FFF);
  const auto heading = static_cast<std::uint16_t>(((heading_ / 1'000 + 2'048) & 0xFFF) - 2'048);
  // Rim speeds: 3.1155 mm/s for each deg/s on a track of 357 mm.
  const std::int32_t rim = turn_deg_s_ * 3'115 / 1'000;
  const auto left = static_cast<std::uint16_t>(forward_mm_s_ - rim);
  const auto right = static_cast<std::uint16_t>(forward_mm_s_ + rim);
  std::uint8_t sip[SIP_BYTES] = {};
  sip[0] = forward_mm_s_ != 0 || turn_deg_s_ != 0 ? 0x33 : 0x32;
  const std::uint16_t words[] = {x, 0, heading, left, right};
  for (std::size_t place = 0; place < sizeof words / sizeof words[0]; ++place) {
    sip[1 + 2 * place] = static_cast<std::uint8_t>(words[place] & 0xFF);
    sip[2 + 2 * place] = static_cast<std::uint8_t>(words[place] >> 8);
  }
  sip[11] = 120;
  sip[19] = 2;
  for (std::size_t reading = 0; reading < 2; ++reading) {
    sonar_ = static_cast<std::uint8_t>((sonar_ + 1) % 8);
    const std::uint16_t range = static_cast<std::uint16_t>(1'000 + 700 * sonar_ + (x & 0x3FF));
    sip[20 + 3 * reading] = sonar_;
    sip[21 + 3 * reading] = static_cast<std::uint8_t>(range & 0xFF);
    sip[22 + 3 * reading] = static_cast<std::uint8_t>(range >> 8);
  }
  send(sip, sizeof sip);
}

void Robot::reboot() {
  is_open_ = false;
  synced_ = 0;
  forward_mm_s_ = turn_deg_s_ = 0;
}

void Robot::send(const std::uint8_t* payload, std::size_t size) {
  if (size_ + size + 5 > output_.size()) {
    return;
  }
  std::uint8_t* frame = output_.data() + size_;
  frame[0] = p2os::HEADER_0;
  frame[1] = p2os::HEADER_1;
  frame[2] = static_cast<std::uint8_t>(size + p2os::CHECKSUM_BYTES);
  std::memcpy(frame + 3, payload, size);
  const std::uint16_t sum = p2os::checksum({payload, size});
  frame[3 + size] = static_cast<std::uint8_t>(sum >> 8);
  frame[4 + size] = static_cast<std::uint8_t>(sum & 0xFF);
  size_ += size + 5;
}

}  // namespace selftest
