#include "decoder.hpp"

#include <cstring>

namespace p2os {

void Decoder::receive(Bytes data, Nanos now, FrameSink& sink) {
  advance_to(now, sink);
  if (data.size == 0) {
    return;
  }
  last_byte_ns_ = now;
  for (std::size_t place = 0; place < data.size; ++place) {
    buffer_[size_++] = data[place];
    scan(now, sink);
  }
}

void Decoder::advance_to(Nanos now, FrameSink& sink) {
  if (size_ == 0 || now < last_byte_ns_ + GIVE_UP_NS) {
    return;
  }
  while (size_ != 0) {
    ++stats_.stalled;
    reject(size_);
    scan(now, sink);
  }
}

void Decoder::scan(Nanos now, FrameSink& sink) {
  while (size_ != 0) {
    const std::size_t before = bytes_before_header();
    if (before != 0) {
      stats_.noise_bytes += static_cast<std::uint32_t>(before);
      consume(before);
      continue;
    }
    if (size_ < PREFIX_BYTES) {
      return;
    }
    const std::uint8_t count = buffer_[2];
    if (count < MIN_COUNT || count > MAX_COUNT) {
      ++stats_.bad_counts;
      reject(PREFIX_BYTES);
      continue;
    }
    const std::size_t bytes = PREFIX_BYTES + count;
    if (size_ < bytes) {
      return;
    }
    judge(bytes, now, sink);
  }
}

// A lone FA at the end may yet become a header.
std::size_t Decoder::bytes_before_header() const {
  for (std::size_t place = 0; place < size_; ++place) {
    if (buffer_[place] == HEADER_0 && (place + 1 == size_ || buffer_[place + 1] == HEADER_1)) {
      return place;
    }
  }
  return size_;
}

void Decoder::judge(std::size_t bytes, Nanos now, FrameSink& sink) {
  const Bytes payload{buffer_.data() + PREFIX_BYTES, bytes - PREFIX_BYTES - CHECKSUM_BYTES};
  const std::uint16_t got = static_cast<std::uint16_t>(buffer_[bytes - 2] << 8 | buffer_[bytes - 1]);
  if (got != checksum(payload)) {
    ++stats_.bad_checksums;
    reject(bytes);
    return;
  }
  ++stats_.frames;
  stats_.rescued += rescanned_ > 0 ? 1 : 0;
  sink.take_frame(payload, now);
  consume(bytes);
}

// Drops the first byte of a rejected frame; the rest is scanned again.
void Decoder::reject(std::size_t bytes) {
  rescanned_ = rescanned_ > bytes ? rescanned_ : bytes;
  ++stats_.noise_bytes;
  consume(1);
}

void Decoder::consume(std::size_t bytes) {
  std::memmove(buffer_.data(), buffer_.data() + bytes, size_ - bytes);
  size_ -= bytes;
  rescanned_ = rescanned_ > bytes ? rescanned_ - bytes : 0;
}

}  // namespace p2os
