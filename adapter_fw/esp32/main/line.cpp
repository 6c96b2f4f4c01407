#include "line.hpp"

#include <driver/uart.h>

#include <pins.hpp>

namespace esp32 {

namespace {

constexpr uart_port_t PORT = UART_NUM_2;
//: chosen: a quarter of a second of SIPs at 9600 baud; more than every frame that the core can have waiting.
constexpr int RECEIVE_BYTES = 256, SEND_BYTES = 1'024;
constexpr TickType_t DRAIN_TICKS = pdMS_TO_TICKS(200);

}  // namespace

void Line::start(std::int32_t baud) {
  uart_config_t config = {};
  config.baud_rate = static_cast<int>(baud);
  config.data_bits = UART_DATA_8_BITS;
  config.parity = UART_PARITY_DISABLE;
  config.stop_bits = UART_STOP_BITS_1;
  config.flow_ctrl = UART_HW_FLOWCTRL_DISABLE;
  config.source_clk = UART_SCLK_DEFAULT;
  ESP_ERROR_CHECK(uart_driver_install(PORT, RECEIVE_BYTES, SEND_BYTES, 0, nullptr, 0));
  ESP_ERROR_CHECK(uart_param_config(PORT, &config));
  ESP_ERROR_CHECK(uart_set_pin(PORT, board::P2OS_TX, board::P2OS_RX, UART_PIN_NO_CHANGE, UART_PIN_NO_CHANGE));
}

std::size_t Line::read(std::uint8_t* data, std::size_t size) {
  const int taken = uart_read_bytes(PORT, data, size, 0);
  return taken > 0 ? static_cast<std::size_t>(taken) : 0;
}

void Line::write(p2os::Bytes data) { uart_write_bytes(PORT, data.data, data.size); }

void Line::set_baud(std::int32_t baud) { uart_set_baudrate(PORT, static_cast<std::uint32_t>(baud)); }

void Line::drain() { uart_wait_tx_done(PORT, DRAIN_TICKS); }

}  // namespace esp32
