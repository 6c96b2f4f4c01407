// The 22 wires on the ESP32's pins, as the board's generated header places them.
//
// Inputs: all six motor bits stand in the second input register and are read at one
// instant; p2dx_con is in the first. rst is EN itself: a program that runs sees it low.
// Outputs: one write sets, one clears; distances of a revision with a shift register
// follow by the register's latch, all at once.
// Duties: a capture unit of the motor-control PWM stamps the edges of two inputs, from about
// 40 Hz (duty_timeout_ns) to 5 kHz: each edge is an interrupt.
#pragma once

#include "../../core/adapter/settings.hpp"
#include "../../hal/pins.hpp"

namespace esp32 {

class Wires final : public hal::PinsIn, public hal::PinsOut, public hal::OutputPads {
 public:
  // Makes every wire an input that follows its pull.
  void start();

  // Begins to measure the duties of the motors' first wires, where the settings ask for them.
  void measure_duties(const adapter::Settings& settings);

  std::uint32_t read(p2os::Nanos) override;
  std::int32_t duty(std::int32_t bit, p2os::Nanos now) override;
  void drive(std::uint32_t mask, std::uint32_t levels, p2os::Nanos) override;
  // A shift register lets all its outputs go; it is enabled again with the next of them that is driven.
  void release(p2os::Nanos) override;
  // A shift register's outputs cannot be read back: they are taken to be what was shifted in.
  std::uint32_t sense(p2os::Nanos) override;

 private:
  void shift(std::uint32_t levels);

  std::uint32_t shown_ = 0;
};

// Reads the jumper that chooses who commands after a boot; before `start`, for the pin may be an output later.
bool is_pad_jumper_fitted();

// Tells whether the mode button is held down.
bool is_mode_button_down();

// Makes the button's pin an input; after the boot, which reads it for itself.
void start_mode_button();

}  // namespace esp32
