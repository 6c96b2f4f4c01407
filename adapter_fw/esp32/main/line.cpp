#include "line.hpp"

#include <driver/uart.h>

#include <pins.hpp>

namespace esp32 {

namespace {

constexpr uart_port_t PORT = UART_NUM_2;
//: chosen: a quarter of a second of SIPs at 9600 baud.
constexpr int RECEIVE_BYTES = 256;
//: 40 bytes of the driver's ring for each of the core's 64 frames: a write never waits.
constexpr int SEND_BYTES = 2'560;
constexpr TickType_t DRAIN_TICKS = pdMS_TO_TICKS(200);
//: The loop's passes; bytes that are handed over more often are seen no earlier.
constexpr std::int32_t PASSES_A_SECOND = 1'000, BITS_A_BYTE = 10;
//: In bytes, the least that there is: the end of a burst, of which fewer than the threshold are left.
constexpr std::uint8_t TIMEOUT_BYTES = 1;
//: chosen: the FIFO has room for half a burst more, should an interrupt be late.
constexpr std::int32_t MOST_THRESHOLD = 64;

//: As many bytes as come in a pass: one interrupt a millisecond, and at 9600 baud one a byte, 960 a second.
constexpr std::int32_t threshold(std::int32_t baud) {
  const std::int32_t in_a_pass = baud / (BITS_A_BYTE * PASSES_A_SECOND);
  return in_a_pass < 1 ? 1 : in_a_pass < MOST_THRESHOLD ? in_a_pass : MOST_THRESHOLD;
}

// The driver's own is 120 bytes, or ten idle ones: a SIP would be seen 11 ms late, and of a burst each 125 ms.
void hand_over_early(std::int32_t baud) {
  ESP_ERROR_CHECK(uart_set_rx_full_threshold(PORT, threshold(baud)));
  ESP_ERROR_CHECK(uart_set_rx_timeout(PORT, TIMEOUT_BYTES));
}

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
  // Behind uart_param_config: the time-out is counted in bytes as they are then.
  hand_over_early(baud);
}

std::size_t Line::read(std::uint8_t* data, std::size_t size) {
  const int taken = uart_read_bytes(PORT, data, size, 0);
  return taken > 0 ? static_cast<std::size_t>(taken) : 0;
}

void Line::write(p2os::Bytes data) { uart_write_bytes(PORT, data.data, data.size); }

void Line::set_baud(std::int32_t baud) {
  uart_set_baudrate(PORT, static_cast<std::uint32_t>(baud));
  hand_over_early(baud);
}

void Line::drain() { uart_wait_tx_done(PORT, DRAIN_TICKS); }

}  // namespace esp32
