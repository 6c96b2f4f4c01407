/* Uses the timers as a robot's firmware does, and prints what it saw: one line "name value" (decimal) for each step on
 * USART1 at 115200 8N1, then "ready".
 *
 * Nothing is wired: TIM3 measures the PWM of TIM1 at PB1, which both have, and TIM4 counts the edges of an encoder that
 * the program itself plays on PB6 and PB7.
 * Compiled by test_timers.py, where a cross compiler is installed.
 */
#include <stdint.h>

struct tim {
    volatile uint32_t CR1, CR2, SMCR, DIER, SR, EGR, CCMR1, CCMR2, CCER, CNT, PSC, ARR, RCR, CCR1, CCR2, CCR3, CCR4, BDTR,
        DCR, DMAR;
};

#define WORD(address) (*(volatile uint32_t *)(address))
#define TIM1 ((struct tim *)0x40012C00u)
#define TIM2 ((struct tim *)0x40000000u)
#define TIM3 ((struct tim *)0x40000400u)
#define TIM4 ((struct tim *)0x40000800u)
#define RCC 0x40021000u
#define FLASH 0x40022000u
#define AFIO 0x40010000u
#define GPIOA 0x40010800u
#define GPIOB 0x40010C00u
#define USART1 0x40013800u
#define ISER0 WORD(0xE000E100u)

enum { CEN = 1 << 0, OPM = 1 << 3, ARPE = 1 << 7, UIF = 1 << 0, UIE = 1 << 0, MOE = 1 << 15 };

static volatile uint32_t updates;

static void put(char c)
{
    while ((WORD(USART1 + 0x00) & 0x80u) == 0) {
    }
    WORD(USART1 + 0x04) = (uint8_t)c;
}

static void report(const char *name, uint32_t value)
{
    char digits[10];
    int count = 0;
    do {
        digits[count++] = (char)('0' + value % 10);
        value /= 10;
    } while (value);
    while (*name) {
        put(*name++);
    }
    put(' ');
    while (count) {
        put(digits[--count]);
    }
    put('\n');
}

static void run_at_72_mhz(void)
{
    WORD(FLASH) = 0x12;
    WORD(RCC) |= 1u << 16;
    while ((WORD(RCC) & 1u << 17) == 0) {
    }
    WORD(RCC + 4) = 1u << 16 | 7u << 18 | 4u << 8;
    WORD(RCC) |= 1u << 24;
    while ((WORD(RCC) & 1u << 25) == 0) {
    }
    WORD(RCC + 4) |= 2;
    while ((WORD(RCC + 4) & 0xCu) != 8u) {
    }
}

/* A microsecond a count. */
static void start_clock(void)
{
    TIM2->PSC = 71;
    TIM2->ARR = 0xFFFF;
    TIM2->EGR = 1;
    TIM2->SR = 0;
    TIM2->CR1 = CEN;
}

static void wait_us(uint16_t us)
{
    const uint16_t start = (uint16_t)TIM2->CNT;
    while ((uint16_t)((uint16_t)TIM2->CNT - start) < us) {
    }
}

/* 20 kHz on PA8 (a quarter), and on PB1 the complement of another quarter, with a dead time of 1 us. */
static void start_pwm(void)
{
    TIM1->ARR = 3599;
    TIM1->CCR1 = 900;
    TIM1->CCR3 = 900;
    TIM1->CCMR1 = 0x68;
    TIM1->CCMR2 = 0x68;
    TIM1->CCER = 0x501; /* CH1, CH3 and CH3N */
    TIM1->EGR = 1;
    TIM1->BDTR = MOE | 72;
    TIM1->CR1 = CEN | ARPE;
}

/* PWM input of channels 3 and 4 at PB1: rising edges to CCR4, falling ones to CCR3. */
static void measure_pwm(void)
{
    TIM3->CCMR2 = 0x0102;
    TIM3->CCER = 0x1300;
    TIM3->CR1 = CEN;
    while (!(TIM3->SR & 1 << 4)) {
    }
    const uint32_t first = TIM3->CCR4;
    while (!(TIM3->SR & 1 << 4)) {
    }
    const uint32_t second = TIM3->CCR4;
    TIM3->SR = 0;
    while (!(TIM3->SR & 1 << 3)) {
    }
    const uint32_t fell = TIM3->CCR3;
    report("period", (second - first) & 0xFFFF);
    report("high", (fell - second) & 0xFFFF);
    TIM3->CR1 = TIM3->CCER = 0;
}

static void turn_encoder(int steps)
{
    static const uint8_t codes[4] = {0, 1, 3, 2}; /* B6 leads */
    static unsigned at;
    for (int n = steps < 0 ? -steps : steps; n; --n) {
        at += steps < 0 ? 3u : 1u;
        const uint32_t code = codes[at & 3u];
        WORD(GPIOB + 0x10) = (code ^ 3u) << 22 | code << 6;
        wait_us(3);
    }
}

static void count_encoder(void)
{
    TIM4->CCMR1 = 0x3131; /* eight samples that agree */
    TIM4->SMCR = 3;
    TIM4->ARR = 0xFFFF;
    TIM4->CR1 = CEN;
    turn_encoder(100);
    report("forward", TIM4->CNT);
    turn_encoder(-130);
    report("back", TIM4->CNT);
    report("direction", TIM4->CR1 >> 4 & 1);
}

/* An interrupt a millisecond, while the core sleeps. */
static void tick(void)
{
    TIM3->PSC = 71;
    TIM3->ARR = 999;
    TIM3->EGR = 1;
    TIM3->SR = 0;
    TIM3->DIER = UIE;
    TIM3->CR1 = CEN;
    const uint32_t start = TIM2->CNT;
    while (updates < 3) {
        __asm__ volatile("wfi");
    }
    report("three-updates-us", (((TIM2->CNT - start) & 0xFFFF) + 50) / 100 * 100);
    TIM3->CR1 = TIM3->DIER = 0;
}

static void poll_updates(void)
{
    TIM3->SR = 0;
    TIM3->CNT = 0;
    TIM3->CR1 = CEN;
    const uint32_t start = TIM2->CNT;
    for (int n = 0; n < 2; ++n) {
        while (!(TIM3->SR & UIF)) {
        }
        TIM3->SR = 0;
    }
    report("two-polled-us", (((TIM2->CNT - start) & 0xFFFF) + 5) / 10 * 10);
    TIM3->CR1 = 0;
}

static void pulse_once(void)
{
    TIM4->SMCR = 0;
    TIM4->CR1 = 0; /* and DIR, which the encoder has set, to 0 */
    TIM4->PSC = 71;
    TIM4->ARR = 199;
    TIM4->EGR = 1;
    TIM4->SR = 0;
    TIM4->CR1 = OPM | CEN;
    const uint32_t start = TIM2->CNT;
    while (TIM4->CR1 & CEN) {
    }
    report("one-pulse-us", (((TIM2->CNT - start) & 0xFFFF) + 5) / 10 * 10);
}

int main(void)
{
    run_at_72_mhz();
    WORD(RCC + 0x18) = 1u << 14 | 1u << 11 | 1u << 3 | 1u << 2 | 1u << 0;
    WORD(RCC + 0x1C) = 7;
    WORD(GPIOA + 4) = 0x444444BBu; /* PA8: TIM1_CH1, PA9: TX */
    WORD(GPIOB + 0) = 0x334444B4u; /* PB1: TIM1_CH3N, PB6 and PB7: outputs */
    WORD(AFIO + 4) = 1u << 6 | 2u << 24;
    WORD(USART1 + 0x08) = 625;
    WORD(USART1 + 0x0C) = 1u << 13 | 1u << 3;
    ISER0 = 1u << 29;
    start_clock();
    start_pwm();
    measure_pwm();
    count_encoder();
    tick();
    poll_updates();
    pulse_once();
    const uint32_t start = TIM2->CNT;
    wait_us(2000);
    report("waited-us", (((TIM2->CNT - start) & 0xFFFF) + 5) / 10 * 10);
    for (const char *text = "ready\n"; *text; ++text) {
        put(*text);
    }
    for (;;) {
    }
}

static void on_tim3(void)
{
    TIM3->SR = 0;
    ++updates;
}

static void halt(void)
{
    for (;;) {
    }
}

__attribute__((section(".vectors"), used)) static const void *const vectors[16 + 43] = {
    [0] = (void *)0x20005000, [1] = (const void *)main, [2 ... 15] = (const void *)halt, [16 + 29] = (const void *)on_tim3,
};
