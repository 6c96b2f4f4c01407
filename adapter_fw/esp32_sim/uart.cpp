// The driver of the UARTs: rings, and the interrupt that moves bytes between them and the FIFOs.
//
// Source: ESP-IDF 5.4, esp_driver_uart/src/uart.c, read. A reader gets what the interrupt has taken from the FIFO: when
// it holds as many bytes as the threshold, or when the line was idle for the time-out. A program that sets neither
// waits for 120 bytes or ten idle ones. Interrupts take no time here; on the chip some microseconds, not measured.
//
// Not modelled: the part of a sending ring that is lost where an item does not fit in front of its end.

#include <driver/uart.h>

#include <algorithm>
#include <cstring>

#include "machine.hpp"
#include "uart_port.hpp"

namespace simulated {

namespace {

constexpr std::int32_t DEFAULT_BAUD = 115'200;
//: What uart_driver_install asks for.
constexpr std::size_t FULL_THRESHOLD = 120, EMPTY_THRESHOLD = 10;
constexpr std::int32_t TIMEOUT_BYTES = 10;
//: UART_RXFIFO_FULL_THRHD has 7 bits.
constexpr int MOST_FULL_THRESHOLD = 0x7F;
//: Of a ring whose items are kept whole: each has a head; in front of a message stands an item of its kind and size.
constexpr std::size_t ITEM_HEAD = 8, ITEM_ALIGN = 4, MESSAGE_ITEM = ITEM_HEAD + 12;

constexpr std::size_t item_bytes(std::size_t size) { return ITEM_HEAD + (size + ITEM_ALIGN - 1) / ITEM_ALIGN * ITEM_ALIGN; }

//: What is sent by one call.
struct Message {
  std::size_t left, taken;
};

struct Port {
  bool is_installed = false;
  Receiver receiver{};
  Transmitter transmitter{};
  //: chosen: above what the program's drivers ask for.
  Queue<std::uint8_t, 1'024> received{};
  //: What the interrupt could not put into the ring; until it fits nothing is taken from the FIFO.
  Queue<std::uint8_t, FIFO_BYTES> stash{};
  std::size_t receive_room = 0, send_room = 0, send_used = 0;
  Queue<std::uint8_t, 9'216> waiting{};
  Queue<Message, 1'024> messages{};
};
Port ports[MACHINE_PORTS];

bool is_usable(uart_port_t port) { return ports[port].is_installed; }

// Takes what the FIFO holds; a ring that is too full for all of it gets nothing.
void take_fifo(int number) {
  Port& port = ports[number];
  state.handed[number] += static_cast<std::uint32_t>(port.receiver.fifo.size());
  const bool fits = port.received.size() + port.receiver.fifo.size() <= port.receive_room;
  for (; !port.receiver.fifo.empty(); port.receiver.fifo.pop_front()) {
    fits ? port.received.push_back(port.receiver.fifo.front()) : port.stash.push_back(port.receiver.fifo.front());
  }
  port.receiver.interrupts = fits;
}

// Fills the sending FIFO from the ring, whose items are given back when they are empty.
void fill_fifo(Port& port) {
  Transmitter& transmitter = port.transmitter;
  bool has_filled = false;
  while (!transmitter.fifo.is_full() && !port.messages.empty()) {
    transmitter.fifo.push_back(port.waiting.front());
    port.waiting.pop_front();
    has_filled = true;
    Message& message = port.messages.front();
    if (--message.left == 0) {
      port.send_used -= message.taken;
      port.messages.pop_front();
    }
  }
  transmitter.interrupts = has_filled;
}

void interrupt(int number, std::int64_t now_us) {
  Port& port = ports[number];
  if (port.transmitter.interrupts_now()) {
    fill_fifo(port);
  }
  if (port.receiver.interrupts_at(now_us, state.baud[number])) {
    take_fifo(number);
  }
  port.transmitter.begin(now_us, state.baud[number]);
}

void arrive(int number, std::int64_t now_us) {
  Port& port = ports[number];
  Receiver& receiver = port.receiver;
  const std::uint8_t byte = receiver.arriving.front().byte;
  receiver.arriving.pop_front();
  if (!port.is_installed) {
    ++state.lost[number];
  } else if (receiver.fifo.is_full()) {  // RXFIFO_OVF: the driver empties it
    state.lost[number] += static_cast<std::uint32_t>(receiver.fifo.size()) + 1;
    receiver.fifo.clear();
  } else {
    receiver.fifo.push_back(byte);
  }
  receiver.last_byte_us = now_us;
}

std::int64_t next_event_us(int number) {
  const Port& port = ports[number];
  return std::min({port.transmitter.ends_us, port.receiver.arrives_us(), port.receiver.times_out_us(state.baud[number])});
}

// What has been stashed goes first, then the FIFO is listened to again.
void empty_stash(int number) {
  Port& port = ports[number];
  if (port.stash.empty() || port.received.size() + port.stash.size() > port.receive_room) {
    return;
  }
  for (; !port.stash.empty(); port.stash.pop_front()) {
    port.received.push_back(port.stash.front());
  }
  port.receiver.interrupts = true;
  interrupt(number, state.now_us);
}

}  // namespace

std::int64_t next_uart_us() {
  std::int64_t soonest = NEVER_US;
  for (int number = 0; number < MACHINE_PORTS; ++number) {
    soonest = std::min(soonest, next_event_us(number));
  }
  return soonest;
}

void move_uarts(std::int64_t now_us) {
  for (int number = 0; number < MACHINE_PORTS; ++number) {
    for (std::int64_t at_us = next_event_us(number); at_us <= now_us; at_us = next_event_us(number)) {
      Port& port = ports[number];
      if (port.transmitter.ends_us == at_us) {
        port.transmitter.end();
      }
      if (port.receiver.arrives_us() <= at_us) {
        arrive(number, at_us);
      }
      interrupt(number, at_us);
    }
  }
}

}  // namespace simulated

using simulated::ports;
using simulated::state;

extern "C" {

void machine_receive(int number, const std::uint8_t* data, const std::int64_t* at_us, std::size_t size) {
  auto& arriving = ports[number].receiver.arriving;
  for (std::size_t place = 0; place < size; ++place) {
    if (arriving.is_full()) {
      ++state.lost[number];
    } else {
      arriving.push_back({data[place], at_us[place]});
    }
  }
}

std::size_t machine_sent(int number, std::uint8_t* data, std::int64_t* at_us, std::size_t size) {
  auto& sent = ports[number].transmitter.sent;
  std::size_t taken = 0;
  for (; taken < size && !sent.empty(); ++taken, sent.pop_front()) {
    data[taken] = sent.front().byte;
    at_us[taken] = sent.front().at_us;
  }
  return taken;
}

esp_err_t uart_driver_install(uart_port_t number, int receive_bytes, int send_bytes, int, QueueHandle_of_uart*, int) {
  simulated::Port& port = ports[number];
  // Each ring must be larger than the FIFO, or for sending 0.
  if (port.is_installed || receive_bytes <= static_cast<int>(simulated::FIFO_BYTES) ||
      (send_bytes != 0 && send_bytes <= static_cast<int>(simulated::FIFO_BYTES))) {
    return ESP_FAIL;
  }
  port.is_installed = true;
  port.receive_room = static_cast<std::size_t>(receive_bytes);
  port.send_room = static_cast<std::size_t>(send_bytes);
  state.baud[number] = simulated::DEFAULT_BAUD;
  state.tx_pin[number] = number == UART_NUM_0 ? 1 : -1;
  state.rx_pin[number] = number == UART_NUM_0 ? 3 : -1;
  port.receiver.full_threshold = simulated::FULL_THRESHOLD;
  port.receiver.interrupts = true;
  port.transmitter.empty_threshold = simulated::EMPTY_THRESHOLD;
  return uart_set_rx_timeout(number, simulated::TIMEOUT_BYTES);
}

esp_err_t uart_param_config(uart_port_t number, const uart_config_t* config) {
  return uart_set_baudrate(number, static_cast<std::uint32_t>(config->baud_rate));
}

esp_err_t uart_set_pin(uart_port_t number, int tx, int rx, int, int) {
  state.tx_pin[number] = tx;
  state.rx_pin[number] = rx;
  return ESP_OK;
}

esp_err_t uart_set_baudrate(uart_port_t number, std::uint32_t baud) {
  if (!simulated::is_usable(number) || baud == 0) {
    return ESP_FAIL;
  }
  state.baud[number] = static_cast<std::int32_t>(baud);
  ports[number].transmitter.bytes_since = 0;
  return ESP_OK;
}

// As the driver: without effect while a full ring keeps the interrupt off.
esp_err_t uart_set_rx_full_threshold(uart_port_t number, int threshold) {
  if (threshold <= 0 || threshold >= simulated::MOST_FULL_THRESHOLD) {
    return ESP_ERR_INVALID_ARG;
  }
  if (!simulated::is_usable(number)) {
    return ESP_ERR_INVALID_STATE;
  }
  simulated::Receiver& receiver = ports[number].receiver;
  if (receiver.interrupts) {
    receiver.full_threshold = static_cast<std::size_t>(threshold);
    simulated::interrupt(number, state.now_us);
  }
  return ESP_OK;
}

// In bytes of ten bits; the register counts eight bits at a time, rounded up.
esp_err_t uart_set_rx_timeout(uart_port_t number, std::uint8_t bytes) {
  const std::int64_t bits = simulated::BITS_A_BYTE * bytes;
  if (bits > simulated::MOST_TIMEOUT_UNITS * simulated::TIMEOUT_UNIT_BITS) {
    return ESP_ERR_INVALID_ARG;
  }
  ports[number].receiver.timeout_units =
      static_cast<std::int32_t>((bits + simulated::TIMEOUT_UNIT_BITS - 1) / simulated::TIMEOUT_UNIT_BITS);
  return ESP_OK;
}

esp_err_t uart_wait_tx_done(uart_port_t number, TickType_t ticks) {
  const simulated::Transmitter& transmitter = ports[number].transmitter;
  const std::int64_t limit_us = state.now_us + std::int64_t{ticks} * 1'000;
  while (!transmitter.is_idle() && state.now_us < limit_us) {
    simulated::wait_until(std::min(limit_us, transmitter.ends_us));
  }
  return transmitter.is_idle() ? ESP_OK : ESP_ERR_TIMEOUT;
}

// As the driver counts: what the message that is being sent has left, not what waits behind it.
esp_err_t uart_get_tx_buffer_free_size(uart_port_t number, std::size_t* size) {
  if (!simulated::is_usable(number)) {
    return ESP_ERR_INVALID_ARG;
  }
  const simulated::Port& port = ports[number];
  *size = port.send_room - (port.messages.empty() ? 0 : port.messages.front().left);
  return ESP_OK;
}

int uart_read_bytes(uart_port_t number, void* data, std::uint32_t size, TickType_t) {
  if (!simulated::is_usable(number)) {
    return -1;
  }
  auto& received = ports[number].received;
  std::uint32_t taken = 0;
  for (simulated::empty_stash(number); taken < size && !received.empty(); simulated::empty_stash(number)) {
    for (; taken < size && !received.empty(); ++taken, received.pop_front()) {
      static_cast<std::uint8_t*>(data)[taken] = received.front();
    }
  }
  return static_cast<int>(taken);
}

// Waits while the ring is full, as the driver does; a message longer than half of it is not needed here.
int uart_write_bytes(uart_port_t number, const void* data, std::size_t size) {
  simulated::Port& port = ports[number];
  const std::size_t needed = simulated::MESSAGE_ITEM + simulated::item_bytes(size);
  if (!simulated::is_usable(number) || needed > port.send_room) {
    return -1;
  }
  if (size == 0) {
    return 0;
  }
  while (port.send_used + needed > port.send_room) {
    simulated::wait_until(port.transmitter.ends_us);
  }
  for (std::size_t place = 0; place < size; ++place) {
    port.waiting.push_back(static_cast<const std::uint8_t*>(data)[place]);
  }
  port.send_used += needed;
  port.messages.push_back({size, needed});
  port.transmitter.interrupts = true;
  simulated::interrupt(number, state.now_us);
  return static_cast<int>(size);
}

// Only without a sending ring: fills the FIFO, and never waits.
int uart_tx_chars(uart_port_t number, const char* data, std::uint32_t size) {
  if (!simulated::is_usable(number)) {
    return -1;
  }
  simulated::Transmitter& transmitter = ports[number].transmitter;
  std::uint32_t taken = 0;
  for (; taken < size && !transmitter.fifo.is_full(); ++taken) {
    transmitter.fifo.push_back(static_cast<std::uint8_t>(data[taken]));
  }
  transmitter.begin(state.now_us, state.baud[number]);
  return static_cast<int>(taken);
}

}  // extern "C"
