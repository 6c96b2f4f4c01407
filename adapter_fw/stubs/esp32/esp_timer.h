#pragma once
#include <esp_err.h>
extern "C" std::int64_t esp_timer_get_time(void);
