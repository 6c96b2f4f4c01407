/* Races with interrupts, one a kind, and each mended where MENDED is defined. On HSI, 8 MHz; RM0008 and PM0056.
 *
 * RACE_PORT   main and handler read, change and write one register
 * RACE_TICK   a count in two words is read while the handler carries from one to the other
 * RACE_FLAG   a count of events is tested and cleared while another handler adds to it
 */
#include <stdint.h>

#define REGISTER(address) (*(volatile uint32_t *)(address))
#define RCC_APB2ENR REGISTER(0x40021018u)
#define GPIOB_CRL REGISTER(0x40010C00u)
#define GPIOB_ODR REGISTER(0x40010C0Cu)
#define GPIOB_BSRR REGISTER(0x40010C10u)
#define RCC_APB1ENR REGISTER(0x4002101Cu)
#define TIM2_CR1 REGISTER(0x40000000u)
#define TIM2_DIER REGISTER(0x4000000Cu)
#define TIM2_SR REGISTER(0x40000010u)
#define TIM2_ARR REGISTER(0x4000002Cu)
#define NVIC_ISER0 REGISTER(0xE000E100u)
#define STK_CTRL REGISTER(0xE000E010u)
#define STK_LOAD REGISTER(0xE000E014u)

enum { MAIN = 1 << 0, HANDLER = 1 << 1, PERIOD = 997, OTHER_PERIOD = 1009, TIM2_IRQ = 28 };

static volatile uint32_t low, high, events;
static uint32_t shown __attribute__((unused)), shown_by_handler __attribute__((unused));

/* Changes one pin of port B and leaves the others alone. */
__attribute__((unused)) static void toggle(uint32_t *state, uint32_t pin)
{
    *state ^= pin;
    GPIOB_BSRR = *state & pin ? pin : pin << 16;
}

static void tick(void)
{
#if defined RACE_PORT && !defined MENDED
    GPIOB_ODR ^= HANDLER;
#else
    toggle(&shown_by_handler, HANDLER);
#endif
    low += 0x20000000u;
    high += low == 0;
    ++events;
}

static void other(void)
{
    TIM2_SR = 0;
    ++events;
}

#ifdef RACE_PORT
static void work(void)
{
#ifdef MENDED
    toggle(&shown, MAIN);
#else
    GPIOB_ODR ^= MAIN;
#endif
    for (volatile uint32_t n = 0; n < 3; ++n) {
    }
}
#elif defined RACE_TICK
static void work(void)
{
    static uint32_t last_high, last_low;
    uint32_t first = high, second = low;
#ifdef MENDED
    while (first != high) {
        first = high;
        second = low;
    }
#endif
    if (first < last_high || (first == last_high && second < last_low)) {
        toggle(&shown, MAIN); /* the time has gone back */
    }
    last_high = first;
    last_low = second;
}
#else
static void work(void)
{
#ifdef MENDED
    __asm__ volatile("cpsid i" ::: "memory");
#endif
    uint32_t found = events;
    if (found) {
        events = 0;
    }
#ifdef MENDED
    __asm__ volatile("cpsie i" ::: "memory");
#endif
    for (; found; --found) {
        toggle(&shown, MAIN);
    }
}
#endif

int main(void);
int main(void)
{
    RCC_APB2ENR |= 1u << 3;
    GPIOB_CRL = 0x44444422u;
    STK_LOAD = PERIOD - 1;
    STK_CTRL = 7;
#ifdef RACE_FLAG
    RCC_APB1ENR |= 1u;
    TIM2_ARR = OTHER_PERIOD - 1;
    TIM2_DIER = 1;
    NVIC_ISER0 = 1u << TIM2_IRQ;
    TIM2_CR1 = 1;
#endif
    for (;;) {
        work();
    }
}

__attribute__((section(".vectors"), used)) static const void *const vectors[16 + TIM2_IRQ + 1] = {
    [0] = (const void *)0x20005000, [1] = (const void *)main, [15] = (const void *)tick,
    [16 + TIM2_IRQ] = (const void *)other};
