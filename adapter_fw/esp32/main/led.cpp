#include "led.hpp"

#include <driver/gpio.h>

#include <pins.hpp>

namespace esp32 {

namespace {

constexpr bool HAS_LED = board::STATUS_LED >= 0;
constexpr gpio_num_t LED = static_cast<gpio_num_t>(board::STATUS_LED);

}  // namespace

void start_led() {
  if constexpr (HAS_LED) {
    gpio_set_direction(LED, GPIO_MODE_OUTPUT);
  }
}

void show_on_led(const adapter::Adapter& part, p2os::Nanos now) {
  if constexpr (HAS_LED) {
    gpio_set_level(LED, app::led_is_on(part.state(), part.master(), now) ? 1 : 0);
  }
}

}  // namespace esp32
