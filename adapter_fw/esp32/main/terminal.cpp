#include "terminal.hpp"

#include <driver/uart.h>

#include <algorithm>
#include <cstring>

namespace esp32 {

namespace {

constexpr uart_port_t PORT = UART_NUM_0;
constexpr int BAUD = 115'200;
constexpr int RECEIVE_BYTES = 256;

}  // namespace

// No sending ring of the driver: it waits for room, and cannot be asked how much there is.
void Terminal::start() {
  ESP_ERROR_CHECK(uart_driver_install(PORT, RECEIVE_BYTES, 0, 0, nullptr, 0));
  ESP_ERROR_CHECK(uart_set_baudrate(PORT, BAUD));
}

void Terminal::write(const char* text) {
  const std::size_t size = std::strlen(text);
  if (size > waiting_.size() - count_) {
    return;
  }
  for (std::size_t place = 0; place < size; ++place) {
    waiting_[(first_ + count_++) % waiting_.size()] = text[place];
  }
}

void Terminal::send() {
  while (count_ != 0) {
    const std::size_t whole = std::min(count_, waiting_.size() - first_);
    const int taken = uart_tx_chars(PORT, &waiting_[first_], whole);
    if (taken <= 0) {
      return;
    }
    first_ = (first_ + static_cast<std::size_t>(taken)) % waiting_.size();
    count_ -= static_cast<std::size_t>(taken);
  }
}

bool Terminal::take(char& character) { return uart_read_bytes(PORT, &character, 1, 0) == 1; }

}  // namespace esp32
