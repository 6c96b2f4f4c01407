#pragma once
#include <cstdint>
typedef volatile struct gpio_dev_s {
  std::uint32_t out, out_w1ts, out_w1tc;
  std::uint32_t enable, enable_w1ts, enable_w1tc;
  std::uint32_t in;
  union {
    struct {
      std::uint32_t data : 8;
      std::uint32_t reserved : 24;
    };
    std::uint32_t val;
  } in1;
} gpio_dev_t;
extern gpio_dev_t GPIO;
