// The section has a name from which the linker makes its bounds: a restart copies it.
#pragma once
#define IRAM_ATTR
#define RTC_NOINIT_ATTR __attribute__((section("rtc_noinit")))
