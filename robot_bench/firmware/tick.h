/* Time in ticks of 10 ms, from SysTick. Waiting sleeps in WFI. */
#ifndef TICK_H
#define TICK_H

#include <stdint.h>

#define TICKS_PER_S 100u

/* Starts the 100 Hz tick; the core runs at HCLK_HZ already. */
void tick_start(void);

/* Ticks since tick_start; wraps after 497 days. */
uint32_t tick_now(void);

/* Sleeps until tick `due`; returns at once when it has passed. */
void tick_wait_until(uint32_t due);

/* Sleeps `ticks` ticks from now. */
void tick_sleep(uint32_t ticks);

#endif
