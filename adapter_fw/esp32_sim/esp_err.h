// As the stub, but ESP_ERROR_CHECK ends the program as the real one does.
#pragma once
#include <cstddef>
#include <cstdint>
typedef int esp_err_t;
#define ESP_OK 0
#define ESP_FAIL (-1)
#define ESP_ERR_INVALID_ARG 0x102
#define ESP_ERR_INVALID_STATE 0x103
#define ESP_ERR_TIMEOUT 0x107
[[noreturn]] void simulated_panic(const char* call);
#define ESP_ERROR_CHECK(call)  \
  do {                         \
    if ((call) != ESP_OK) {    \
      simulated_panic(#call);  \
    }                          \
  } while (false)
