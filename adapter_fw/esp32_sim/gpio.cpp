// The pins: drivers, pulls and inputs. Pads 34 to 39 can only be read, and have no pulls.

#include <driver/gpio.h>
#include <soc/gpio_struct.h>

#include "machine.hpp"

using simulated::state;

gpio_dev_t GPIO;

namespace {

constexpr std::uint64_t ONLY_INPUTS = std::uint64_t{0x3F} << 34;
constexpr std::uint64_t FIRST = 0xFFFF'FFFF;
//: Pads of the flash, and those that an ESP-WROOM-32 has no leg for.
constexpr std::uint64_t UNUSABLE = std::uint64_t{0x3F} << 6 | std::uint64_t{1} << 20 | std::uint64_t{1} << 24 |
                                   std::uint64_t{0xF} << 28 | std::uint64_t{0x3} << 37;
constexpr std::uint64_t PADS = (std::uint64_t{1} << GPIO_NUM_MAX) - 1;

void set(std::uint64_t& word, std::uint64_t bits, bool is_on) {
  const std::uint64_t changed = is_on ? word | bits : word & ~bits;
  state.changes += changed != word ? 1 : 0;
  word = changed;
}

//: What a 74HC595 has taken in, and its pins as it last saw them.
std::uint32_t shifting = 0;
std::uint64_t seen = 0;

void shift() {
  const auto is_high = [](std::uint64_t word, std::int32_t pin) { return (word >> pin & 1) != 0; };
  const auto rises = [&](std::int32_t pin) { return is_high(state.out, pin) && !is_high(seen, pin); };
  if (state.shift_latch != 0) {
    // Both are strobes of their own: a latch takes what stood before the clock.
    if (rises(state.shift_latch)) {
      state.shifted = shifting;
    }
    if (rises(state.shift_clock)) {
      shifting = (shifting << 1 | (is_high(state.out, state.shift_data) ? 1U : 0U)) & 0xFF;
    }
  }
  seen = state.out;
}

std::uint64_t read() { return state.levels & state.inputs; }

}  // namespace

void GpioWord::operator=(std::uint32_t word) {
  switch (which_) {
    case GpioRegister::OUT:
      set(state.out, FIRST, false);
      set(state.out, word, true);
      break;
    case GpioRegister::OUT_SET:
    case GpioRegister::OUT_CLEAR:
      set(state.out, word, which_ == GpioRegister::OUT_SET);
      shift();
      break;
    case GpioRegister::ENABLE:
      set(state.driven, FIRST, false);
      set(state.driven, word, true);
      break;
    case GpioRegister::ENABLE_SET:
    case GpioRegister::ENABLE_CLEAR:
      set(state.driven, word, which_ == GpioRegister::ENABLE_SET);
      break;
    case GpioRegister::IN:
    case GpioRegister::IN1:
      break;
  }
}

GpioWord::operator std::uint32_t() const {
  switch (which_) {
    case GpioRegister::OUT:
      return static_cast<std::uint32_t>(state.out);
    case GpioRegister::ENABLE:
      return static_cast<std::uint32_t>(state.driven);
    case GpioRegister::IN:
      return static_cast<std::uint32_t>(read());
    case GpioRegister::IN1:
      return static_cast<std::uint32_t>(read() >> 32);
    default:
      return 0;  // what is written to set or clear reads as 0
  }
}

extern "C" {

esp_err_t gpio_config(const gpio_config_t* config) {
  const std::uint64_t pins = config->pin_bit_mask;
  const bool pulls = config->pull_up_en == GPIO_PULLUP_ENABLE || config->pull_down_en == GPIO_PULLDOWN_ENABLE;
  if (pins == 0 || (pins & ~PADS) != 0 || (pins & UNUSABLE) != 0 ||
      ((config->mode == GPIO_MODE_OUTPUT || pulls) && (pins & ONLY_INPUTS) != 0)) {
    return ESP_ERR_INVALID_ARG;
  }
  set(state.inputs, pins, config->mode == GPIO_MODE_INPUT);
  set(state.driven, pins, config->mode == GPIO_MODE_OUTPUT);
  set(state.pulled_up, pins, config->pull_up_en == GPIO_PULLUP_ENABLE);
  set(state.pulled_down, pins, config->pull_down_en == GPIO_PULLDOWN_ENABLE);
  return ESP_OK;
}

int gpio_get_level(gpio_num_t pin) { return static_cast<int>(read() >> pin & 1); }

esp_err_t gpio_set_level(gpio_num_t pin, std::uint32_t level) {
  set(state.out, std::uint64_t{1} << pin, level != 0);
  return ESP_OK;
}

esp_err_t gpio_set_direction(gpio_num_t pin, gpio_mode_t mode) {
  const std::uint64_t bit = std::uint64_t{1} << pin;
  if (mode == GPIO_MODE_OUTPUT && (bit & ONLY_INPUTS) != 0) {
    return ESP_ERR_INVALID_ARG;
  }
  set(state.driven, bit, mode == GPIO_MODE_OUTPUT);
  set(state.inputs, bit, mode == GPIO_MODE_INPUT);
  return ESP_OK;
}

}  // extern "C"
