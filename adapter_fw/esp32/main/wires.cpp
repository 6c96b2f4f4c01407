#include "wires.hpp"

#include <driver/gpio.h>
#include <driver/mcpwm_cap.h>
#include <esp_attr.h>
#include <esp_rom_sys.h>
#include <esp_timer.h>
#include <freertos/FreeRTOS.h>
#include <soc/gpio_struct.h>

#include <pins.hpp>

#include "../../core/adapter/inputs.hpp"

namespace esp32 {

namespace {

constexpr std::size_t OUTPUTS = sizeof board::OUTPUT_PINS;
constexpr std::size_t INPUTS = sizeof board::INPUT_PINS;
constexpr bool HAS_SHIFT_REGISTER = board::SHIFT_LATCH >= 0;
//: Pins below this are in the first registers.
constexpr int SECOND_REGISTER = 32;
//: chosen: many times what the pull and the wire need.
constexpr std::uint32_t SETTLE_US = 1'000;

constexpr bool are_outputs_in_the_first_register() {
  for (const std::int8_t pin : board::OUTPUT_PINS) {
    if (pin >= SECOND_REGISTER) {
      return false;
    }
  }
  return true;
}
static_assert(are_outputs_in_the_first_register(), "one write must set every output");

constexpr std::uint64_t bit_of(std::int8_t pin) { return pin >= 0 ? std::uint64_t{1} << pin : 0; }

//: Low: the shift register drives its outputs.
constexpr auto SHIFT_ENABLE = static_cast<std::uint32_t>(bit_of(board::SHIFT_ENABLE));

//: Those outputs of a word that hang on the shift register.
[[maybe_unused]] constexpr std::uint32_t shifted_outputs() {
  std::uint32_t word = 0;
  for (std::size_t place = 0; place < OUTPUTS; ++place) {
    word |= board::OUTPUT_PLACES[place] >= 0 ? 1U << place : 0;
  }
  return word;
}

//: Those pins of the first register that carry the outputs of a word.
std::uint32_t pins_of(std::uint32_t word) {
  std::uint64_t pins = 0;
  for (std::size_t place = 0; place < OUTPUTS; ++place) {
    pins |= (word >> place & 1U) != 0 ? bit_of(board::OUTPUT_PINS[place]) : 0;
  }
  return static_cast<std::uint32_t>(pins);
}

void set_up(std::uint64_t pins, gpio_mode_t mode, gpio_pulldown_t pull_down, gpio_pullup_t pull_up) {
  if (pins == 0) {
    return;
  }
  gpio_config_t config = {};
  config.pin_bit_mask = pins;
  config.mode = mode;
  config.pull_down_en = pull_down;
  config.pull_up_en = pull_up;
  config.intr_type = GPIO_INTR_DISABLE;
  ESP_ERROR_CHECK(gpio_config(&config));
}

//: What an interrupt and the adapter's task share.
portMUX_TYPE capture_lock = portMUX_INITIALIZER_UNLOCKED;

//: The first wire of a motor, and its meter.
struct Channel {
  std::int32_t bit;
  adapter::DutyMeter meter;
};

bool IRAM_ATTR take_edge(mcpwm_cap_channel_handle_t, const mcpwm_capture_event_data_t* event, void* context) {
  auto* channel = static_cast<Channel*>(context);
  portENTER_CRITICAL_ISR(&capture_lock);
  channel->meter.edge(event->cap_edge == MCPWM_CAP_EDGE_POS, esp_timer_get_time() * p2os::NS_PER_US, event->cap_value);
  portEXIT_CRITICAL_ISR(&capture_lock);
  return false;
}

//: Set once, before the first read.
Channel* channels[2] = {};

}  // namespace

void Wires::measure_duties(const adapter::Settings& settings) {
  if (settings.motor_command != adapter::MotorCommand::DUTY) {
    return;
  }
  static Channel left{0, adapter::DutyMeter(settings.duty_timeout_ns)};
  static Channel right{board::WIRES.motor1_width, adapter::DutyMeter(settings.duty_timeout_ns)};
  mcpwm_capture_timer_config_t timer_config = {};
  timer_config.clk_src = MCPWM_CAPTURE_CLK_SRC_DEFAULT;
  mcpwm_cap_timer_handle_t timer = nullptr;
  ESP_ERROR_CHECK(mcpwm_new_capture_timer(&timer_config, &timer));
  for (Channel* channel : {&left, &right}) {
    channels[channel == &left ? 0 : 1] = channel;
    channel->meter.restart((read(0) >> channel->bit & 1U) != 0);
    mcpwm_capture_channel_config_t config = {};
    config.gpio_num = static_cast<gpio_num_t>(board::INPUT_PINS[channel->bit]);
    config.prescale = 1;
    config.flags.pos_edge = true;
    config.flags.neg_edge = true;
    mcpwm_cap_channel_handle_t handle = nullptr;
    ESP_ERROR_CHECK(mcpwm_new_capture_channel(timer, &config, &handle));
    mcpwm_capture_event_callbacks_t callbacks = {};
    callbacks.on_cap = take_edge;
    ESP_ERROR_CHECK(mcpwm_capture_channel_register_event_callbacks(handle, &callbacks, channel));
    ESP_ERROR_CHECK(mcpwm_capture_channel_enable(handle));
  }
  ESP_ERROR_CHECK(mcpwm_capture_timer_enable(timer));
  ESP_ERROR_CHECK(mcpwm_capture_timer_start(timer));
}

std::int32_t Wires::duty(std::int32_t bit, p2os::Nanos now) {
  std::int32_t found = 0;
  for (Channel* channel : channels) {
    if (channel != nullptr && channel->bit == bit) {
      portENTER_CRITICAL(&capture_lock);
      found = channel->meter.duty(now);
      portEXIT_CRITICAL(&capture_lock);
    }
  }
  return found;
}

void Wires::start() {
  std::uint64_t wires = 0;
  for (const std::int8_t pin : board::INPUT_PINS) {
    wires |= bit_of(pin);
  }
  for (const std::int8_t pin : board::OUTPUT_PINS) {
    wires |= bit_of(pin);
  }
  set_up(wires, GPIO_MODE_INPUT, GPIO_PULLDOWN_DISABLE, GPIO_PULLUP_DISABLE);
  if constexpr (HAS_SHIFT_REGISTER) {
    GPIO.out_w1ts = SHIFT_ENABLE;
    set_up(SHIFT_ENABLE | bit_of(board::SHIFT_DATA) | bit_of(board::SHIFT_CLOCK) | bit_of(board::SHIFT_LATCH), GPIO_MODE_OUTPUT,
           GPIO_PULLDOWN_DISABLE, GPIO_PULLUP_DISABLE);
  }
  release(0);
}

std::uint32_t Wires::read(p2os::Nanos) {
  // The second register first and once: the motor bits of one instant.
  const std::uint64_t second = GPIO.in1.val;
  const std::uint64_t levels = second << SECOND_REGISTER | GPIO.in;
  std::uint32_t word = 0;
  for (std::size_t place = 0; place < INPUTS; ++place) {
    word |= (levels & bit_of(board::INPUT_PINS[place])) != 0 ? 1U << place : 0;
  }
  return word;
}

// The levels first, then the drivers: a wire never shows an old level.
void Wires::drive(std::uint32_t mask, std::uint32_t levels, p2os::Nanos) {
  GPIO.out_w1ts = pins_of(mask & levels);
  GPIO.out_w1tc = pins_of(mask & ~levels);
  GPIO.enable_w1ts = pins_of(mask);
  if constexpr (HAS_SHIFT_REGISTER) {
    shift((shown_ & ~mask) | (levels & mask));
    GPIO.out_w1tc = (mask & shifted_outputs()) != 0 ? SHIFT_ENABLE : 0;
  }
}

void Wires::release(p2os::Nanos) {
  GPIO.enable_w1tc = pins_of(~0U);
  if constexpr (HAS_SHIFT_REGISTER) {
    GPIO.out_w1ts = SHIFT_ENABLE;
    shift(board::WIRES.safe_levels);
  }
}

std::uint32_t Wires::sense(p2os::Nanos) {
  const std::uint64_t levels = GPIO.in;
  std::uint32_t word = 0;
  for (std::size_t place = 0; place < OUTPUTS; ++place) {
    const bool is_shifted = board::OUTPUT_PLACES[place] >= 0;
    const bool level = is_shifted ? (shown_ >> place & 1U) != 0 : (levels & bit_of(board::OUTPUT_PINS[place])) != 0;
    word |= level ? 1U << place : 0;
  }
  return word;
}

// The last bit in is QA's.
void Wires::shift(std::uint32_t levels) {
  shown_ = levels;
  const auto clock = static_cast<std::uint32_t>(bit_of(board::SHIFT_CLOCK));
  const auto data = static_cast<std::uint32_t>(bit_of(board::SHIFT_DATA));
  const auto latch = static_cast<std::uint32_t>(bit_of(board::SHIFT_LATCH));
  for (std::int8_t output = 7; output >= 0; --output) {
    bool level = false;
    for (std::size_t place = 0; place < OUTPUTS; ++place) {
      level = level || (board::OUTPUT_PLACES[place] == output && (levels >> place & 1U) != 0);
    }
    GPIO.out_w1tc = clock;
    (level ? GPIO.out_w1ts : GPIO.out_w1tc) = data;
    GPIO.out_w1ts = clock;
  }
  GPIO.out_w1ts = latch;
  GPIO.out_w1tc = latch;
}

bool is_pad_jumper_fitted() {
  if constexpr (board::MODE_JUMPER < 0) {
    return false;
  }
  set_up(bit_of(board::MODE_JUMPER), GPIO_MODE_INPUT, GPIO_PULLDOWN_ENABLE, GPIO_PULLUP_DISABLE);
  esp_rom_delay_us(SETTLE_US);
  return gpio_get_level(static_cast<gpio_num_t>(board::MODE_JUMPER)) != 0;
}

void start_mode_button() {
  set_up(bit_of(board::MODE_BUTTON), GPIO_MODE_INPUT, GPIO_PULLDOWN_DISABLE, GPIO_PULLUP_ENABLE);
}

bool is_mode_button_down() {
  return board::MODE_BUTTON >= 0 && gpio_get_level(static_cast<gpio_num_t>(board::MODE_BUTTON)) == 0;
}

}  // namespace esp32
