/* Meets each modelled peripheral once, as a program does, and prints what it read.
 *
 * One line "name value" (hexadecimal) for each step on USART1 at 115200 8N1, then "ready"; after
 * that it echoes what it receives in capitals and prints "edge n" for EXTI line 0 or 10.
 * Compiled by test_exercise.py, where a cross compiler is installed.
 */
#include <stdint.h>

#define WORD(address) (*(volatile uint32_t *)(address))
#define HALF(address) (*(volatile uint16_t *)(address))
#define BIT(address, bit) WORD(0x42000000u + ((address) - 0x40000000u) * 32u + (bit) * 4u)

#define RCC 0x40021000u
#define FLASH 0x40022000u
#define AFIO 0x40010000u
#define EXTI 0x40010400u
#define GPIOA 0x40010800u
#define GPIOB 0x40010C00u
#define GPIOC 0x40011000u
#define USART1 0x40013800u
#define TIM5 0x40000C00u
#define ISER0 WORD(0xE000E100u)
#define ISER1 WORD(0xE000E104u)
#define PAGE 0x0800F000u

static volatile uint32_t edges;

static void put(char c)
{
    while ((WORD(USART1 + 0x00) & 0x80u) == 0) {
    }
    WORD(USART1 + 0x04) = (uint8_t)c;
}

static void print(const char *text)
{
    while (*text != 0) {
        put(*text++);
    }
}

static void report(const char *name, uint32_t value)
{
    print(name);
    put(' ');
    for (int shift = 28; shift >= 0; shift -= 4) {
        put("0123456789abcdef"[(value >> shift) & 15u]);
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
    BIT(RCC, 24) = 1;
    while (BIT(RCC, 25) == 0) {
    }
    WORD(RCC + 4) |= 2;
    while ((WORD(RCC + 4) & 12u) != 8u) {
    }
}

static void program_flash(void)
{
    WORD(FLASH + 0x04) = 0x45670123u;
    WORD(FLASH + 0x04) = 0xCDEF89ABu;
    WORD(FLASH + 0x10) = 2;
    WORD(FLASH + 0x14) = PAGE;
    WORD(FLASH + 0x10) = 2 | 1u << 6;
    while (WORD(FLASH + 0x0C) & 1u) {
    }
    report("erased", WORD(PAGE));
    WORD(FLASH + 0x10) = 1;
    HALF(PAGE) = 0x1234;
    while (WORD(FLASH + 0x0C) & 1u) {
    }
    HALF(PAGE + 2) = 0xABCD;
    while (WORD(FLASH + 0x0C) & 1u) {
    }
    WORD(FLASH + 0x10) = 1u << 7;
    HALF(PAGE) = 0; /* locked: ignored */
    while (WORD(FLASH + 0x0C) & 1u) {
    }
    report("programmed", WORD(PAGE));
    report("flash-sr", WORD(FLASH + 0x0C));
}

static void meet_gpio(void)
{
    report("unclocked", WORD(GPIOC));
    WORD(GPIOC) = 0x44344444u;
    report("unmodelled", WORD(TIM5));
    WORD(RCC + 0x18) |= 1u << 4;
    report("clocked", WORD(GPIOC));
    report("pb4-jtag", WORD(GPIOB + 8) & 0x10u);
    WORD(AFIO + 4) = 2u << 24;
    report("pb4-free", WORD(GPIOB + 8) & 0x10u);
    WORD(GPIOB) = 0x24444444u;
    BIT(GPIOB + 0x0C, 7) = 1;
    report("bit-band", WORD(GPIOB + 0x0C));
    BIT(GPIOB + 0x0C, 7) = 0;
    WORD(GPIOC + 0x18) = 0x12000u;
    WORD(GPIOC + 0x18) = 0x02000u;
    WORD(GPIOC + 0x18) = 0x12000u;
    (void)WORD(GPIOC + 0x18);
    WORD(GPIOC + 0x04) = 0x44244444u;
    report("locked", WORD(GPIOC + 0x04));
    WORD(RCC + 0x0C) = 1u << 4;
    WORD(RCC + 0x0C) = 0;
    WORD(GPIOC + 0x04) = 0x44244444u;
    report("reset", WORD(GPIOC + 0x04));
}

static void listen(void)
{
    WORD(AFIO + 0x08) = 0;
    WORD(AFIO + 0x10) = 1u << 8;
    WORD(EXTI + 0x08) = 1u << 0;
    WORD(EXTI + 0x0C) = 1u << 10;
    WORD(EXTI + 0x00) = 1u << 0 | 1u << 10;
    WORD(USART1 + 0x0C) |= 1u << 5;
    ISER0 = 1u << 6;
    ISER1 = 1u << (40 - 32) | 1u << (37 - 32);
}

static void on_edge(void)
{
    uint32_t pending = WORD(EXTI + 0x14);
    WORD(EXTI + 0x14) = pending;
    edges |= pending;
    WORD(GPIOB + 0x10) = 1u << 7;
    WORD(GPIOB + 0x14) = 1u << 7;
}

static void on_usart(void)
{
    if (WORD(USART1) & 0x20u) {
        uint32_t c = WORD(USART1 + 4);
        WORD(USART1 + 4) = (c >= 'a' && c <= 'z') ? c - 32u : c;
    }
}

static void on_reset(void)
{
    run_at_72_mhz();
    WORD(RCC + 0x18) = 1u << 0 | 1u << 2 | 1u << 3 | 1u << 14;
    WORD(GPIOA + 4) = 0x444444B4u;
    WORD(USART1 + 8) = 625;
    WORD(USART1 + 0x0C) = 1u << 13 | 1u << 3 | 1u << 2;
    meet_gpio();
    program_flash();
    report("csr", WORD(RCC + 0x24));
    listen();
    print("ready\n");
    for (;;) {
        __asm__ volatile("wfi");
        if (edges & 1u) {
            print("edge 0\n");
        }
        if (edges & 1u << 10) {
            print("edge 10\n");
        }
        edges = 0;
    }
}

__attribute__((section(".vectors"), used)) static void (*const vectors[16 + 43])(void) = {
    [0] = (void (*)(void))0x20005000u, [1] = on_reset,       [16 + 6] = on_edge,
    [16 + 40] = on_edge,               [16 + 37] = on_usart,
};
