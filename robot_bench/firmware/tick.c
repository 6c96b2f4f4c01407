/* SysTick at 100 Hz. */
#include "tick.h"

#include "board.h"
#include "f103.h"

static volatile uint32_t ticks;

void SysTick_Handler(void);
void SysTick_Handler(void)
{
    ticks = ticks + 1;
}

void tick_start(void)
{
    SYSTICK->LOAD = HCLK_HZ / TICKS_PER_S - 1u; /* 719 999: fits the 24 bits */
    SYSTICK->VAL = 0;
    SYSTICK->CTRL = SYSTICK_CTRL_CLKSOURCE_CORE | SYSTICK_CTRL_TICKINT | SYSTICK_CTRL_ENABLE;
}

uint32_t tick_now(void)
{
    return ticks;
}

void tick_wait_until(uint32_t due)
{
    /* With interrupts off a tick between the test and WFI still wakes the core,
     * which a plain `while (...) WFI` would sleep through. */
    interrupts_off();
    while ((int32_t)(due - ticks) > 0) {
        wait_for_interrupt();
        interrupts_on();
        interrupts_off();
    }
    interrupts_on();
}

void tick_sleep(uint32_t duration)
{
    tick_wait_until(ticks + duration);
}
