// A re-scanning decoder: bytes in, frames out, everything else counted.
//
// Theory of operation. Bytes wait in one buffer. At its head the decoder wants
// FA FB, a count of 3 to 204, and that many bytes. Whatever does not fit costs
// one byte: the head moves on by one and the same bytes are looked at again, so
// that a damaged frame hides nothing that follows it. A frame whose bytes stop
// coming for GIVE_UP_NS is treated as damaged: a false header with a legal count
// cannot hold up a quiet line.
//
// The price: a frame that stands inside the payload of a damaged frame can be
// found. Inside a sound frame nothing is looked for.
//
// Invariant: the buffer never holds more than one frame.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "frame.hpp"
#include "time.hpp"

namespace p2os {

//: chosen: two and a half SIP cycles; the longest frame takes 216 ms at 9600 baud, but its bytes never pause so long.
constexpr Nanos GIVE_UP_NS = 250 * NS_PER_MS;

//: What has passed the decoder since it was made.
struct DecoderStats {
  std::uint32_t frames = 0;
  std::uint32_t noise_bytes = 0;
  std::uint32_t bad_checksums = 0;
  std::uint32_t bad_counts = 0;
  std::uint32_t stalled = 0;
  //: Frames found among the bytes of a rejected one.
  std::uint32_t rescued = 0;
};

//: Takes the payload of each sound frame: type byte and data, at least one byte.
class FrameSink {
 public:
  virtual void take_frame(Bytes payload, Nanos now) = 0;

 protected:
  ~FrameSink() = default;
};

class Decoder {
 public:
  // Takes bytes that arrived at `now`; each sound frame goes to `sink` in the order of the stream.
  void receive(Bytes data, Nanos now, FrameSink& sink);

  // Gives up a frame whose bytes have stopped, if its time has come.
  void advance_to(Nanos now, FrameSink& sink);

  // Returns when the frame that has begun will be given up.
  Nanos next_deadline() const { return size_ != 0 ? last_byte_ns_ + GIVE_UP_NS : NEVER; }

  const DecoderStats& stats() const { return stats_; }

 private:
  void scan(Nanos now, FrameSink& sink);
  void judge(std::size_t bytes, Nanos now, FrameSink& sink);
  void reject(std::size_t bytes);
  void consume(std::size_t bytes);
  std::size_t bytes_before_header() const;

  std::array<std::uint8_t, MAX_FRAME_BYTES> buffer_{};
  std::size_t size_ = 0;
  //: Bytes at the head that belong to a frame already rejected.
  std::size_t rescanned_ = 0;
  Nanos last_byte_ns_{};
  DecoderStats stats_;
};

}  // namespace p2os
