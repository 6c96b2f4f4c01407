// The registers of the pins that the program uses, with what a write does to them.
#pragma once
#include <cstdint>

enum class GpioRegister : std::uint8_t { OUT, OUT_SET, OUT_CLEAR, ENABLE, ENABLE_SET, ENABLE_CLEAR, IN, IN1 };

class GpioWord {
 public:
  explicit constexpr GpioWord(GpioRegister which) : which_(which) {}
  GpioWord(const GpioWord&) = delete;
  void operator=(std::uint32_t word);
  operator std::uint32_t() const;

 private:
  GpioRegister which_;
};

struct gpio_dev_t {
  GpioWord out{GpioRegister::OUT}, out_w1ts{GpioRegister::OUT_SET}, out_w1tc{GpioRegister::OUT_CLEAR};
  GpioWord enable{GpioRegister::ENABLE}, enable_w1ts{GpioRegister::ENABLE_SET}, enable_w1tc{GpioRegister::ENABLE_CLEAR};
  GpioWord in{GpioRegister::IN};
  struct {
    GpioWord val{GpioRegister::IN1};
  } in1;
};
extern gpio_dev_t GPIO;
