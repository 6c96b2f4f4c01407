// A P2OS robot of a few lines: it synchronises, obeys at once, and sends a SIP every 100 ms.
//
// Not a model of a Pioneer (that is p2os.pioneer): a counterpart that gives the
// adapter something to talk to where no Python runs.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "../core/p2os/decoder.hpp"

namespace selftest {

class Robot final : private p2os::FrameSink {
 public:
  static constexpr std::size_t MAX_OUTPUT = 64;

  // Takes bytes of the adapter; answers go to the output at once.
  void receive(p2os::Bytes data, p2os::Nanos now) { decoder_.receive(data, now, *this); }

  // Makes the SIP that is due, if one is.
  void advance_to(p2os::Nanos now);
  p2os::Nanos next_deadline() const { return is_open_ ? next_sip_ : p2os::NEVER; }

  // Returns what has to go out, and forgets it.
  p2os::Bytes output() const { return {output_.data(), size_}; }
  void forget_output() { size_ = 0; }

  void reboot();

  std::int32_t forward_mm_s() const { return forward_mm_s_; }
  std::int32_t turn_deg_s() const { return turn_deg_s_; }

 private:
  void take_frame(p2os::Bytes payload, p2os::Nanos now) override;
  void send(const std::uint8_t* payload, std::size_t size);

  p2os::Decoder decoder_;
  std::array<std::uint8_t, MAX_OUTPUT> output_{};
  std::size_t size_ = 0;
  std::uint8_t synced_ = 0;
  bool is_open_ = false;
  p2os::Nanos next_sip_ = 0;
  std::int32_t forward_mm_s_ = 0;
  std::int32_t turn_deg_s_ = 0;
  //: Position and heading in thousandths of a count, so that small steps add up.
  std::int64_t x_ = 0;
  std::int64_t heading_ = 0;
  std::uint8_t sonar_ = 0;
};

}  // namespace selftest
