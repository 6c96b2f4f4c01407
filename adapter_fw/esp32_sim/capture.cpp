// The capture unit of the motor-control PWM: a timer of 80 MHz, and three channels that stamp edges of their pads.
//
// An edge is where `levels` has changed when the program next runs, and its interrupt comes at once.

#include <driver/mcpwm_cap.h>

#include "machine.hpp"

using simulated::state;

struct mcpwm_cap_timer_t {
  bool is_made, is_enabled, runs;
};

struct mcpwm_cap_channel_t {
  mcpwm_capture_channel_config_t config;
  mcpwm_capture_event_callbacks_t callbacks;
  void* context;
  bool is_made, is_enabled;
};

namespace {

constexpr std::uint32_t TICKS_PER_US = 80;
constexpr std::size_t CHANNELS = 3;

mcpwm_cap_timer_t timer{};
mcpwm_cap_channel_t channels[CHANNELS]{};
std::uint64_t seen = 0;

bool is_high(std::uint64_t levels, const mcpwm_cap_channel_t& channel) {
  return (levels >> channel.config.gpio_num & 1) != 0;
}

}  // namespace

void simulated::take_captures() {
  const std::uint64_t before = seen;
  seen = state.levels;
  for (mcpwm_cap_channel_t& channel : channels) {
    const bool level = timer.runs && channel.is_enabled && is_high(seen, channel);
    if (timer.runs && channel.is_enabled && level != is_high(before, channel) &&
        (level ? channel.config.flags.pos_edge : channel.config.flags.neg_edge) != 0) {
      const mcpwm_capture_event_data_t event{static_cast<std::uint32_t>(state.now_us) * TICKS_PER_US,
                                             level ? MCPWM_CAP_EDGE_POS : MCPWM_CAP_EDGE_NEG};
      channel.callbacks.on_cap(&channel, &event, channel.context);
    }
  }
}

extern "C" {

esp_err_t mcpwm_new_capture_timer(const mcpwm_capture_timer_config_t*, mcpwm_cap_timer_handle_t* made) {
  if (timer.is_made) {
    return ESP_ERR_INVALID_ARG;
  }
  timer.is_made = true;
  *made = &timer;
  return ESP_OK;
}

esp_err_t mcpwm_new_capture_channel(mcpwm_cap_timer_handle_t of, const mcpwm_capture_channel_config_t* config,
                                    mcpwm_cap_channel_handle_t* made) {
  if (of != &timer || config->gpio_num < 0 || config->gpio_num >= GPIO_NUM_MAX || config->prescale == 0) {
    return ESP_ERR_INVALID_ARG;
  }
  for (mcpwm_cap_channel_t& channel : channels) {
    if (!channel.is_made) {
      channel.is_made = true;
      channel.config = *config;
      *made = &channel;
      return ESP_OK;
    }
  }
  return ESP_ERR_INVALID_ARG;
}

esp_err_t mcpwm_capture_channel_register_event_callbacks(mcpwm_cap_channel_handle_t channel,
                                                         const mcpwm_capture_event_callbacks_t* callbacks,
                                                         void* context) {
  if (channel->is_enabled) {
    return ESP_ERR_INVALID_ARG;
  }
  channel->callbacks = *callbacks;
  channel->context = context;
  return ESP_OK;
}

esp_err_t mcpwm_capture_channel_enable(mcpwm_cap_channel_handle_t channel) {
  channel->is_enabled = channel->callbacks.on_cap != nullptr;
  return channel->is_enabled ? ESP_OK : ESP_ERR_INVALID_ARG;
}

esp_err_t mcpwm_capture_timer_enable(mcpwm_cap_timer_handle_t which) {
  which->is_enabled = true;
  return ESP_OK;
}

esp_err_t mcpwm_capture_timer_start(mcpwm_cap_timer_handle_t which) {
  if (!which->is_enabled) {
    return ESP_ERR_INVALID_ARG;
  }
  which->runs = true;
  seen = state.levels;
  return ESP_OK;
}

}  // extern "C"
