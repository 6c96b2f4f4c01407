/* Open questions of a real STM32F103C8, asked on pins for an eight-channel logic analyser.
 *
 * It runs at 8 MHz from the crystal, so that a cycle is 125 ns: three samples of an analyser of 24 MHz. Nothing need be
 * connected but the analyser and ground. Every question begins at its own tick of SysTick, out of sleep, so that what
 * one takes longer moves no other. Eight rounds with pauses that differ, so that no two moments look alike; then it
 * sleeps. A round:
 *   PB0  high while it lasts
 *   PA0  up right before an interrupt is made pending by NVIC_ISPR, down in main when it is over
 *   PA1  up and down: the handler's first two stores
 *   PA2  up: the store right behind the one that makes it pending. Before PA1, or after it?
 *   PA3  four times high, around the same 64 instructions with 16 branches: 0, 1, 2 wait states, and 2 without the prefetch buffer
 *   PA4  up right before a character is written to USART1_DR (115200 8N1), down when TXE is up, TC after that
 *   PA9  the character: its start bit
 *   PA5  eight times high, from SWSTART to EOC, with the eight sampling times; ADC clock 4 MHz
 */
#include <stdint.h>

#define REG(address) (*(volatile uint32_t *)(address))
#define RCC 0x40021000u
#define FLASH_ACR REG(0x40022000u)
#define GPIOA 0x40010800u
#define GPIOB 0x40010C00u
#define USART1 0x40013800u
#define ADC1 0x40012400u
#define NVIC_ISER1 REG(0xE000E104u)
#define NVIC_ISPR1 0xE000E204u
#define SET REG(GPIOA + 0x10u)
#define CLEAR REG(GPIOA + 0x14u)
#define BIT(n) (1u << (n))
#define USART1_LINE BIT(37 - 32)
#define SYSTICK 0xE000E010u
#define ROUNDS 8u
#define TICK 8000u

int main(void);
void USART1_IRQHandler(void);
void SysTick_Handler(void);

void SysTick_Handler(void)
{
}

static void ticks(uint32_t count)
{
    while (count--) {
        __asm__ volatile("wfi");
    }
}

/* The handler's first two instructions that reach a pin; r0 and r1 are its own. */
__attribute__((naked)) void USART1_IRQHandler(void)
{
    __asm__ volatile("ldr r0, =0x40010810\n movs r1, #2\n str r1, [r0]\n lsls r1, r1, #16\n str r1, [r0]\n bx lr\n .ltorg");
}

static void crystal(void)
{
    REG(RCC) |= BIT(16);
    while (!(REG(RCC) & BIT(17))) {
    }
    REG(RCC + 4u) = 1;
    while ((REG(RCC + 4u) & 0xCu) != 4u) {
    }
}

static void start(void)
{
    REG(RCC + 0x18u) |= BIT(2) | BIT(3) | BIT(9) | BIT(14);
    REG(GPIOA) = 0x44333333u;         /* PA0 to PA5: outputs, 50 MHz */
    REG(GPIOA + 4u) = 0x444444B4u;    /* PA9: USART1_TX */
    REG(GPIOB) = 0x44444443u;
    REG(USART1 + 8u) = 69;            /* 8 MHz / 69 = 115942 bit/s */
    REG(USART1 + 12u) = BIT(13) | BIT(3);
    NVIC_ISER1 = USART1_LINE;
    REG(ADC1 + 8u) = BIT(0) | BIT(20) | 7u << 17;
    REG(ADC1 + 0x34u) = 17;           /* the reference: no pin is needed */
    REG(ADC1 + 8u) |= BIT(23);
    for (volatile uint32_t n = 0; n < 100; n++) {
    }
    REG(ADC1 + 8u) |= BIT(2);
    while (REG(ADC1 + 8u) & BIT(2)) {
    }
    REG(SYSTICK + 4u) = TICK - 1u;
    REG(SYSTICK + 8u) = 0;
    REG(SYSTICK) = 7;
}

/* PA0 up, pending, PA2 up: three stores in a row, their values in registers before. */
static void interrupt(void)
{
    register uint32_t set __asm__("r2") = GPIOA + 0x10u;
    register uint32_t pending __asm__("r3") = NVIC_ISPR1;
    __asm__ volatile(
        "movs r4, #1\n movs r5, #32\n movs r6, #4\n"
        "str r4, [%0]\n str r5, [%1]\n str r6, [%0]\n nop\n nop\n nop\n nop\n"
        :: "r"(set), "r"(pending) : "r4", "r5", "r6", "memory");
    CLEAR = BIT(0) | BIT(2);
}

#define FOUR "ldr r4, [%0]\n add.w r5, r5, #1\n b 1f\n nop\n 1: nop\n"
#define SIXTEEN FOUR FOUR FOUR FOUR

static void instructions(void)
{
    register uint32_t any __asm__("r2") = 0x20000000u;
    SET = BIT(3);
    __asm__ volatile(SIXTEEN SIXTEEN SIXTEEN SIXTEEN :: "r"(any) : "r4", "r5", "cc", "memory");
    CLEAR = BIT(3);
}

static void wait_states(void)
{
    static const uint8_t ways[] = {0x10, 0x11, 0x12, 0x02};
    for (unsigned n = 0; n < sizeof ways; n++) {
        ticks(1);
        FLASH_ACR = ways[n];
        (void)FLASH_ACR;
        instructions();
        FLASH_ACR = 0x10;
    }
}

static void character(uint32_t round)
{
    SET = BIT(4);
    REG(USART1 + 4u) = 0x55u ^ round;
    while (!(REG(USART1) & BIT(7))) {
    }
    CLEAR = BIT(4);
    while (!(REG(USART1) & BIT(6))) {
    }
}

static void conversions(void)
{
    for (uint32_t time = 0; time < 8; time++) {
        ticks(1);
        REG(ADC1 + 0x0Cu) = time << 21;
        SET = BIT(5);
        REG(ADC1 + 8u) |= BIT(22);
        while (!(REG(ADC1) & BIT(1))) {
        }
        CLEAR = BIT(5);
        (void)REG(ADC1 + 0x4Cu);
    }
}

int main(void)
{
    crystal();
    start();
    for (uint32_t round = 0; round < ROUNDS; round++) {
        ticks(1u + (round * 5u & 7u));
        REG(GPIOB + 0x10u) = 1;
        interrupt();
        wait_states();
        ticks(1);
        character(round);
        conversions();
        REG(GPIOB + 0x14u) = 1;
    }
    REG(SYSTICK) = 0;
    for (;;) {
        ticks(1);
    }
}
