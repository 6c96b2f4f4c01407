// The UARTs: a ring each way, and a transmitter that sends a byte after the other at its speed.

#include <driver/uart.h>

#include <algorithm>
#include <cstring>
#include <limits>

#include "machine.hpp"

namespace simulated {

namespace {

//: Technical reference manual: each UART has 128 bytes of its own before the driver's ring.
constexpr std::size_t FIFO_BYTES = 128;
constexpr std::int64_t BITS_A_BYTE = 10, US_PER_S = 1'000'000;
constexpr std::int64_t NEVER_US = std::numeric_limits<std::int64_t>::max();
constexpr std::int32_t DEFAULT_BAUD = 115'200;

struct Sent {
  std::uint8_t byte;
  std::int64_t at_us;
};

//: A queue without heap; who fills it looks at `size` first.
template <typename Item, std::size_t MOST>
class Queue {
 public:
  std::size_t size() const { return count_; }
  bool empty() const { return count_ == 0; }
  bool is_full() const { return count_ == MOST; }
  const Item& front() const { return items_[first_]; }
  void push_back(const Item& item) { items_[(first_ + count_++) % MOST] = item; }
  void pop_front() {
    first_ = (first_ + 1) % MOST;
    --count_;
  }

 private:
  Item items_[MOST] = {};
  std::size_t first_ = 0, count_ = 0;
};

struct Port {
  bool is_installed = false;
  std::size_t receive_room = 0, send_room = 0;
  //: chosen: above what the program's drivers ask for; `sent` is taken by whoever runs the machine.
  Queue<std::uint8_t, 1'024> received{};
  Queue<std::uint8_t, 9'216> waiting{};
  Queue<Sent, 9'216> sent{};
  std::int64_t byte_ends_us = NEVER_US;
};
Port ports[MACHINE_PORTS];

std::int64_t byte_us(int port) { return (BITS_A_BYTE * US_PER_S + state.baud[port] - 1) / state.baud[port]; }

bool is_usable(uart_port_t port) { return ports[port].is_installed; }

}  // namespace

std::int64_t next_byte_us() {
  std::int64_t soonest = NEVER_US;
  for (const Port& port : ports) {
    soonest = std::min(soonest, port.byte_ends_us);
  }
  return soonest;
}

void move_uarts(std::int64_t now_us) {
  for (int number = 0; number < MACHINE_PORTS; ++number) {
    Port& port = ports[number];
    while (port.byte_ends_us <= now_us) {
      if (port.sent.is_full()) {
        port.sent.pop_front();  // nobody has taken it
      }
      port.sent.push_back({port.waiting.front(), port.byte_ends_us});
      port.waiting.pop_front();
      port.byte_ends_us = port.waiting.empty() ? NEVER_US : port.byte_ends_us + byte_us(number);
    }
  }
}

}  // namespace simulated

using simulated::ports;
using simulated::state;

extern "C" {

void machine_receive(int number, const std::uint8_t* data, std::size_t size) {
  simulated::Port& port = ports[number];
  for (std::size_t place = 0; place < size; ++place) {
    if (!port.is_installed || port.received.size() == port.receive_room) {
      ++state.lost[number];
    } else {
      port.received.push_back(data[place]);
    }
  }
}

std::size_t machine_sent(int number, std::uint8_t* data, std::int64_t* at_us, std::size_t size) {
  auto& sent = ports[number].sent;
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
  port.receive_room = static_cast<std::size_t>(receive_bytes) + simulated::FIFO_BYTES;
  port.send_room = static_cast<std::size_t>(send_bytes) + simulated::FIFO_BYTES;
  state.baud[number] = simulated::DEFAULT_BAUD;
  state.tx_pin[number] = number == UART_NUM_0 ? 1 : -1;
  state.rx_pin[number] = number == UART_NUM_0 ? 3 : -1;
  return ESP_OK;
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
  return ESP_OK;
}

esp_err_t uart_wait_tx_done(uart_port_t number, TickType_t ticks) {
  const std::int64_t limit_us = state.now_us + std::int64_t{ticks} * 1'000;
  while (!ports[number].waiting.empty() && state.now_us < limit_us) {
    simulated::wait_until(std::min(limit_us, ports[number].byte_ends_us));
  }
  return ports[number].waiting.empty() ? ESP_OK : ESP_ERR_TIMEOUT;
}

esp_err_t uart_get_tx_buffer_free_size(uart_port_t number, std::size_t* size) {
  if (!simulated::is_usable(number)) {
    return ESP_ERR_INVALID_ARG;
  }
  // What the FIFO holds is no longer in the ring.
  const simulated::Port& port = ports[number];
  *size = std::min(port.send_room - port.waiting.size(), port.send_room - simulated::FIFO_BYTES);
  return ESP_OK;
}

int uart_read_bytes(uart_port_t number, void* data, std::uint32_t size, TickType_t) {
  if (!simulated::is_usable(number)) {
    return -1;
  }
  auto& received = ports[number].received;
  std::uint32_t taken = 0;
  for (; taken < size && !received.empty(); ++taken, received.pop_front()) {
    static_cast<std::uint8_t*>(data)[taken] = received.front();
  }
  return static_cast<int>(taken);
}

// Waits while the ring is full, as the driver does.
int uart_write_bytes(uart_port_t number, const void* data, std::size_t size) {
  if (!simulated::is_usable(number)) {
    return -1;
  }
  simulated::Port& port = ports[number];
  for (std::size_t place = 0; place < size; ++place) {
    while (port.waiting.size() == port.send_room) {
      simulated::wait_until(port.byte_ends_us);
    }
    if (port.waiting.empty()) {
      port.byte_ends_us = state.now_us + simulated::byte_us(number);
    }
    port.waiting.push_back(static_cast<const std::uint8_t*>(data)[place]);
  }
  return static_cast<int>(size);
}

}  // extern "C"
