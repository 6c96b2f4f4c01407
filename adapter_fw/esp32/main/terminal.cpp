#include "terminal.hpp"

#include <driver/uart.h>

#include <cstring>

namespace esp32 {

namespace {

constexpr uart_port_t PORT = UART_NUM_0;
constexpr int BAUD = 115'200;
//: chosen: a whole `get` or `log` fits at once.
constexpr int RECEIVE_BYTES = 256, SEND_BYTES = 8'192;

}  // namespace

void Terminal::start() {
  ESP_ERROR_CHECK(uart_driver_install(PORT, RECEIVE_BYTES, SEND_BYTES, 0, nullptr, 0));
  ESP_ERROR_CHECK(uart_set_baudrate(PORT, BAUD));
}

void Terminal::write(const char* text) {
  const std::size_t size = std::strlen(text);
  std::size_t room = 0;
  if (uart_get_tx_buffer_free_size(PORT, &room) == ESP_OK && size <= room) {
    uart_write_bytes(PORT, text, size);
  }
}

bool Terminal::take(char& character) { return uart_read_bytes(PORT, &character, 1, 0) == 1; }

}  // namespace esp32
