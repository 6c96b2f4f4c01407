// One UART of the ESP32: two FIFOs, a transmitter, and what interrupts.
//
// Source: esp32 technical reference manual, UART; ESP-IDF 5.4, hal/esp32 (uart_ll.h) for the units of the registers.
// Whether RXFIFO_FULL comes at its threshold or one byte above it differs in the sources; here it comes at it.
//
// Not modelled: framing and parity errors, break, flow control, where the time-out's counter of 8 bits stands when a
// byte ends (here it begins anew with each).
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "queue.hpp"

namespace simulated {

constexpr std::size_t FIFO_BYTES = 128;
constexpr std::int64_t BITS_A_BYTE = 10, US_PER_S = 1'000'000;
constexpr std::int64_t NEVER_US = std::numeric_limits<std::int64_t>::max();
//: UART_RX_TOUT_THRHD counts in these, and has 7 bits.
constexpr std::int32_t TIMEOUT_UNIT_BITS = 8, MOST_TIMEOUT_UNITS = 0x7F;

//: When the last of some bits ends that began at `begin_us`.
inline std::int64_t end_of_bits(std::int64_t begin_us, std::int64_t bits, std::int32_t baud) {
  return begin_us + (bits * US_PER_S + baud - 1) / baud;
}

struct TimedByte {
  std::uint8_t byte;
  std::int64_t at_us;
};

//: Bytes on the RX pin and in the receiver.
struct Receiver {
  //: chosen: a second of a line at 38400 baud; given by whoever runs the machine.
  Queue<TimedByte, 4'096> arriving{};
  Queue<std::uint8_t, FIFO_BYTES> fifo{};
  std::size_t full_threshold = 0;
  //: In units of 8 bits; 0: there is no time-out.
  std::int32_t timeout_units = 0;
  //: Whether the driver listens to RXFIFO_FULL and RXFIFO_TOUT.
  bool interrupts = false;
  std::int64_t last_byte_us = 0;

  //: When RXFIFO_TOUT comes if no byte does.
  std::int64_t times_out_us(std::int32_t baud) const {
    const bool is_idle = !interrupts || timeout_units == 0 || fifo.empty();
    return is_idle ? NEVER_US : end_of_bits(last_byte_us, std::int64_t{timeout_units} * TIMEOUT_UNIT_BITS, baud);
  }
  //: When a byte next arrives.
  std::int64_t arrives_us() const { return arriving.empty() ? NEVER_US : arriving.front().at_us; }
  bool interrupts_at(std::int64_t now_us, std::int32_t baud) const {
    return interrupts && (fifo.size() >= full_threshold || now_us >= times_out_us(baud));
  }
};

//: Bytes in the transmitter and on the TX pin.
struct Transmitter {
  Queue<std::uint8_t, FIFO_BYTES> fifo{};
  std::size_t empty_threshold = 0;
  bool interrupts = false;
  //: What is shifted out, and its end; the bytes since the line was last idle are counted, so that no rounding adds up.
  std::uint8_t byte = 0;
  std::int64_t ends_us = NEVER_US, busy_since_us = 0, bytes_since = 0;
  //: chosen: above what the program's drivers ask for; taken by whoever runs the machine.
  Queue<TimedByte, 9'216> sent{};

  bool is_idle() const { return ends_us == NEVER_US && fifo.empty(); }
  bool interrupts_now() const { return interrupts && fifo.size() < empty_threshold; }

  //: Shifts the next byte out, from `now_us` on where the line was idle or its speed is another.
  void begin(std::int64_t now_us, std::int32_t baud) {
    if (ends_us != NEVER_US || fifo.empty()) {
      return;
    }
    busy_since_us = bytes_since == 0 ? now_us : busy_since_us;
    byte = fifo.front();
    fifo.pop_front();
    ends_us = end_of_bits(busy_since_us, ++bytes_since * BITS_A_BYTE, baud);
  }

  void end() {
    if (sent.is_full()) {
      sent.pop_front();  // nobody has taken it
    }
    sent.push_back({byte, ends_us});
    ends_us = NEVER_US;
    bytes_since = fifo.empty() ? 0 : bytes_since;
  }
};

}  // namespace simulated
