/* The silicon kit: what a real STM32F103C8 says of itself, over USART1 at 115200 8N1 on PA9.
 *
 * It reads all registers before it changes any, then counts cycles of kernels and of peripherals by DWT_CYCCNT, and
 * notes flags in their order. Nothing need be connected but the line. A line is a kind, a name and one or two numbers in hex;
 * the last one has their count and a checksum. It ends asleep.
 * Take care: it erases and programs the last page of the flash, 0x0800FC00.
 */
#include <stdint.h>

#define REG(address) (*(volatile uint32_t *)(address))
#define HALF(address) (*(volatile uint16_t *)(address))
#define RCC 0x40021000u
#define FLASH_R 0x40022000u
#define GPIOA 0x40010800u
#define GPIOB 0x40010C00u
#define USART1 0x40013800u
#define SPI1 0x40013000u
#define I2C1 0x40005400u
#define TIM2 0x40000000u
#define ADC1 0x40012400u
#define DMA1 0x40020000u
#define CRC_R 0x40023000u
#define PWR 0x40007000u
#define RTC 0x40002800u
#define CYCCNT REG(0xE0001004u)
#define LAST_PAGE 0x0800FC00u
#define BAUD 115200u

int main(void);

/* Ranges of registers: first address and count of words. RCC comes first: the next ones need their clocks. */
static const struct {
    uint32_t first, count;
} ranges[] = {
    {RCC, 10}, {FLASH_R, 9}, {0x40010000u, 7}, {0x40010400u, 6}, {GPIOA, 7}, {GPIOB, 7}, {0x40011000u, 7}, {0x40011400u, 7},
    {USART1, 7}, {0x40004400u, 7}, {0x40004800u, 7}, {SPI1, 7}, {0x40003800u, 7}, {I2C1, 9}, {0x40005800u, 9},
    {0x40012C00u, 20}, {TIM2, 20}, {0x40000400u, 20}, {0x40000800u, 20}, {ADC1, 20}, {0x40012800u, 20}, {DMA1, 36},
    {CRC_R, 3}, {0x40006C04u, 12}, {PWR, 2}, {RTC, 10}, {0x40003000u, 4}, {0x40002C00u, 3}, {0x40006400u, 8},
    {0x40006600u, 8}, {0x40005C00u, 8}, {0x40005C40u, 5}, {0xE000E010u, 4}, {0xE000E100u, 2}, {0xE000E180u, 2},
    {0xE000E300u, 2}, {0xE000E400u, 15}, {0xE000ED00u, 4}, {0xE000ED10u, 8}, {0xE0042000u, 2}, {0x1FFFF7E0u, 1},
    {0x1FFFF7E8u, 3}, {0x1FFFF800u, 4},
};
#define MOST_WORDS 420u
static uint32_t at_reset[MOST_WORDS];

/* Printing. */

static uint32_t lines, checksum;

static void put(char character)
{
    while (!(REG(USART1) & 1u << 7)) {
    }
    REG(USART1 + 4u) = (uint8_t)character;
    checksum = (checksum << 1 | checksum >> 31) + (uint8_t)character;
}

static void text(const char *words)
{
    while (*words != '\0') {
        put(*words++);
    }
}

static void hex(uint32_t value)
{
    put(' ');
    for (int shift = 28; shift >= 0; shift -= 4) {
        put("0123456789abcdef"[value >> shift & 15u]);
    }
}

static void end_line(void)
{
    text("\n");
    lines++;
}

static void say(const char *kind, const char *name, uint32_t value)
{
    text(kind);
    put(' ');
    text(name);
    hex(value);
    end_line();
}

/* The clock. */

static void usart_start(uint32_t hz)
{
    REG(USART1 + 12u) = 0;
    REG(USART1 + 8u) = (hz + BAUD / 2u) / BAUD;
    REG(USART1 + 12u) = 1u << 13 | 1u << 3;
}

static void usart_drain(void)
{
    while (!(REG(USART1) & 1u << 6)) {
    }
}

static void to_hsi(void)
{
    REG(RCC + 4u) &= ~3u;
    while (REG(RCC + 4u) & 0xCu) {
    }
    REG(FLASH_R) = 0x30;
}

/* 8 MHz crystal x 9, two wait states, prefetch; APB1 at 36 MHz, ADC at 12 MHz. */
static void to_72_mhz(void)
{
    REG(FLASH_R) = 0x32;
    REG(RCC + 4u) = (REG(RCC + 4u) & 3u) | 1u << 16 | 7u << 18 | 4u << 8 | 2u << 14;
    REG(RCC) |= 1u << 24;
    while (!(REG(RCC) & 1u << 25)) {
    }
    REG(RCC + 4u) |= 2u;
    while ((REG(RCC + 4u) & 0xCu) != 8u) {
    }
}

/* Kernels: each is 64 of the same, or a loop of 100, between its label and its end. r0 is memory, r1 a number. */

#define KERNEL(name, body)                                                                                              \
    __asm(".pushsection .text." #name ", \"ax\"\n.balign 16\n.thumb_func\n" #name ":\n" body                            \
          "\nbx lr\n.balign 4\n" #name "_end:\n.popsection\n");                                                        \
    extern const uint8_t name[], name##_end[];
#define TIMES_64(instruction) ".rept 64\n" instruction "\n.endr"

KERNEL(k_empty, "")
KERNEL(k_nop, TIMES_64("nop"))
KERNEL(k_add, TIMES_64("adds r2, r2, r1"))
KERNEL(k_add_wide, TIMES_64("add.w r2, r2, r1"))
KERNEL(k_mul, TIMES_64("muls r2, r1, r2"))
KERNEL(k_mla, TIMES_64("mla r2, r1, r1, r2"))
KERNEL(k_umull, TIMES_64("umull r2, r3, r1, r1"))
KERNEL(k_udiv_long, TIMES_64("udiv r2, r1, r12"))
KERNEL(k_udiv_short, TIMES_64("udiv r2, r1, r1"))
KERNEL(k_ldr, TIMES_64("ldr r2, [r0]"))
KERNEL(k_ldr_spaced, TIMES_64("ldr r2, [r0]\nadds r3, r1, #1"))
KERNEL(k_str, TIMES_64("str r1, [r0]"))
KERNEL(k_ldrb, TIMES_64("ldrb r2, [r0]"))
KERNEL(k_ldm4, TIMES_64("ldmia.w r0, {r1, r2, r3, r12}"))
KERNEL(k_stm4, TIMES_64("stmia.w r0, {r1, r2, r3, r12}"))
KERNEL(k_push_pop, TIMES_64("push {r1, r2}\npop {r1, r2}"))
KERNEL(k_branch, TIMES_64("b 1f\n1:"))
KERNEL(k_not_taken, "cmp r1, r1\n" TIMES_64("bne k_not_taken"))
KERNEL(k_it, "cmp r1, r1\n" TIMES_64("it ne\naddne r2, r1"))
KERNEL(k_call, "mov r12, lr\nmovs r2, #64\n2:\nbl 3f\nsubs r2, r2, #1\nbne 2b\nbx r12\n3:\nbx lr")
KERNEL(k_loop_subs_bne, "movs r2, #100\n2:\nsubs r2, r2, #1\nbne 2b")
KERNEL(k_loop_subs_bhi, "movw r2, #400\n2:\nsubs r2, r2, #4\nbhi 2b")
KERNEL(k_gpio_write, "movw r2, #0x0C10\nmovt r2, #0x4001\nmovs r3, #0\n" TIMES_64("str r3, [r2]"))
KERNEL(k_gpio_read, "movw r2, #0x0C08\nmovt r2, #0x4001\n" TIMES_64("ldr r3, [r2]"))
KERNEL(k_apb1_read, "movw r2, #0x0024\nmovt r2, #0x4000\n" TIMES_64("ldr r3, [r2]"))
KERNEL(k_flash_read, "movw r2, #0x0000\nmovt r2, #0x0800\n" TIMES_64("ldr r3, [r2]"))

#define ROW(name) {#name, name, name##_end}
static const struct {
    const char *name;
    const uint8_t *begin, *end;
} kernels[] = {
    ROW(k_nop), ROW(k_add), ROW(k_add_wide), ROW(k_mul), ROW(k_mla), ROW(k_umull), ROW(k_udiv_long), ROW(k_udiv_short),
    ROW(k_ldr), ROW(k_ldr_spaced), ROW(k_str), ROW(k_ldrb), ROW(k_ldm4), ROW(k_stm4), ROW(k_push_pop), ROW(k_branch),
    ROW(k_not_taken), ROW(k_it), ROW(k_call), ROW(k_loop_subs_bne), ROW(k_loop_subs_bhi), ROW(k_gpio_write),
    ROW(k_gpio_read), ROW(k_apb1_read), ROW(k_flash_read),
};
static uint32_t in_sram[224] __attribute__((aligned(16)));
static uint32_t memory[4];

/* Runs a kernel twice and returns the cycles of the second time; the buffers are warm then. */
__attribute__((noinline)) static uint32_t cycles_of(uint32_t entry)
{
    uint32_t took = 0;
    for (unsigned turn = 0; turn < 2; turn++) {
        uint32_t begin, end;
        __asm volatile("cpsid i\n"
                       "mov r4, %2\n"
                       "mov r0, %3\n"
                       "mov r1, #3\n"
                       "mov r12, #1\n"
                       "movw r5, #0x1004\n"
                       "movt r5, #0xE000\n"
                       "rsb r1, r1, #0\n"
                       "ldr r6, [r5]\n"
                       "blx r4\n"
                       "ldr r7, [r5]\n"
                       "mov %0, r6\n"
                       "mov %1, r7\n"
                       "cpsie i"
                       : "=r"(begin), "=r"(end)
                       : "r"(entry), "r"(memory)
                       : "r0", "r1", "r2", "r3", "r4", "r5", "r6", "r7", "r12", "lr", "cc", "memory");
        took = end - begin;
    }
    return took;
}

static uint32_t copied(const uint8_t *begin, const uint8_t *end)
{
    /* A function's symbol has its lowest bit set: Thumb. */
    const uint32_t *from = (const uint32_t *)((uintptr_t)begin & ~3u);
    for (uint32_t n = 0; n < (uint32_t)(end - begin + 3) / 4u; n++) {
        in_sram[n] = from[n];
    }
    __asm volatile("dsb\nisb");
    return (uint32_t)(uintptr_t)in_sram;
}

static void count_kernels(const char *kind, unsigned is_in_sram)
{
    uint32_t empty = is_in_sram ? copied(k_empty, k_empty_end) : (uint32_t)(uintptr_t)k_empty;
    uint32_t none = cycles_of(empty | 1u);
    for (unsigned n = 0; n < sizeof kernels / sizeof kernels[0]; n++) {
        uint32_t entry = is_in_sram ? copied(kernels[n].begin, kernels[n].end) : (uint32_t)(uintptr_t)kernels[n].begin;
        say(kind, kernels[n].name, cycles_of(entry | 1u) - none);
    }
}

/* Interrupts: EXTI0 and EXTI1 are pended by the program; their handlers read the counter first and last. */

static volatile uint32_t entered[2], left[2];
static uint32_t vectors[76] __attribute__((aligned(512)));

static void handler_0(void)
{
    entered[0] = CYCCNT;
    left[0] = CYCCNT;
}

static void handler_1(void)
{
    entered[1] = CYCCNT;
    left[1] = CYCCNT;
}

static void count_interrupts(void)
{
    for (unsigned n = 0; n < 76; n++) {
        vectors[n] = ((const uint32_t *)0x08000000u)[n];
    }
    vectors[16 + 6] = (uint32_t)(uintptr_t)handler_0;
    vectors[16 + 7] = (uint32_t)(uintptr_t)handler_1;
    REG(0xE000ED08u) = (uint32_t)(uintptr_t)vectors;
    REG(0xE000E100u) = 3u << 6;
    for (unsigned turn = 0; turn < 2; turn++) {
        uint32_t begin = CYCCNT;
        REG(0xE000E200u) = 1u << 6;
        __asm volatile("dsb\nisb");
        uint32_t end = CYCCNT;
        if (turn) {
            say("irq", "entry", entered[0] - begin);
            say("irq", "exit", end - left[0]);
        }
        begin = CYCCNT;
        REG(0xE000E200u) = 3u << 6;
        __asm volatile("dsb\nisb");
        end = CYCCNT;
        if (turn) {
            say("irq", "tail_chain", entered[1] - left[0]);
            say("irq", "both", end - begin);
        }
    }
    REG(0xE000E180u) = 3u << 6;
}

/* Peripherals, in cycles of 72 MHz. */

static void time_timer(void)
{
    REG(TIM2 + 0x2Cu) = 9999;
    REG(TIM2 + 0x28u) = 0;
    REG(TIM2 + 0x14u) = 1;
    say("flag", "tim_after_ug", REG(TIM2 + 0x10u));
    REG(TIM2 + 0x10u) = 0;
    REG(TIM2) = 1;
    uint32_t first = 0, last = 0;
    for (unsigned n = 0; n < 11; n++) {
        while (!(REG(TIM2 + 0x10u) & 1u)) {
        }
        last = CYCCNT;
        if (n == 0) {
            first = last;
        }
        REG(TIM2 + 0x10u) = 0;
    }
    say("tim", "tim2_10_periods", last - first);
    REG(TIM2) = 0;
    REG(0xE000E014u) = 71999;
    REG(0xE000E018u) = 0;
    REG(0xE000E010u) = 5;
    while (!(REG(0xE000E010u) & 1u << 16)) {
    }
    first = CYCCNT;
    for (unsigned n = 0; n < 10; n++) {
        while (!(REG(0xE000E010u) & 1u << 16)) {
        }
    }
    say("tim", "systick_10_periods", CYCCNT - first);
    REG(0xE000E010u) = 0;
}

static void time_adc(void)
{
    static const char *const names[] = {"adc_1_5", "adc_7_5", "adc_13_5", "adc_28_5", "adc_41_5", "adc_55_5", "adc_71_5", "adc_239_5"};
    REG(ADC1 + 8u) = 1;
    uint32_t begin = CYCCNT;
    while (CYCCNT - begin < 1000u) {
    }
    begin = CYCCNT;
    REG(ADC1 + 8u) = 1u | 1u << 2;
    while (REG(ADC1 + 8u) & 1u << 2) {
    }
    say("tim", "adc_calibration", CYCCNT - begin);
    for (uint32_t n = 0; n < 8; n++) {
        REG(ADC1 + 0x10u) = n;
        begin = CYCCNT;
        REG(ADC1 + 8u) = 1;
        while (!(REG(ADC1) & 2u)) {
        }
        uint32_t took = CYCCNT - begin;
        uint32_t done = REG(ADC1);
        (void)REG(ADC1 + 0x4Cu);
        uint32_t read = REG(ADC1);
        say("tim", names[n], took);
        if (n == 0) {
            say("flag", "adc_sr_done", done);
            say("flag", "adc_sr_read", read);
        }
    }
    REG(ADC1 + 8u) = 0;
}

static void time_lines(void)
{
    usart_drain();
    uint32_t idle = REG(USART1);
    uint32_t begin = CYCCNT;
    REG(USART1 + 4u) = '#';
    uint32_t behind = REG(USART1);
    while (!(REG(USART1) & 1u << 7)) {
    }
    uint32_t empty = CYCCNT - begin;
    while (!(REG(USART1) & 1u << 6)) {
    }
    uint32_t done = CYCCNT - begin;
    checksum = (checksum << 1 | checksum >> 31) + '#';
    end_line();
    say("flag", "usart_sr_idle", idle);
    say("flag", "usart_sr_written", behind);
    say("tim", "usart_txe", empty);
    say("tim", "usart_character", done);
    REG(SPI1) = 1u << 9 | 1u << 8 | 1u << 6 | 2u << 3 | 1u << 2;
    uint32_t before = REG(SPI1 + 8u);
    begin = CYCCNT;
    REG(SPI1 + 12u) = 0x5A;
    uint32_t at_once = REG(SPI1 + 8u);
    while (!(REG(SPI1 + 8u) & 1u)) {
    }
    uint32_t took = CYCCNT - begin;
    uint32_t full = REG(SPI1 + 8u);
    (void)REG(SPI1 + 12u);
    say("flag", "spi_sr_enabled", before);
    say("flag", "spi_sr_written", at_once);
    say("flag", "spi_sr_received", full & ~0x80u);
    say("tim", "spi_byte", took);
    REG(SPI1) = 0;
    REG(I2C1 + 4u) = 36;
    REG(I2C1) = 1;
    say("flag", "i2c_sr2_enabled", REG(I2C1 + 0x18u));
    REG(I2C1) = 0;
}

static uint32_t source[64], target[64];

static void time_dma_and_crc(void)
{
    REG(DMA1 + 0x0Cu) = 64;
    REG(DMA1 + 0x10u) = (uint32_t)(uintptr_t)source;
    REG(DMA1 + 0x14u) = (uint32_t)(uintptr_t)target;
    uint32_t begin = CYCCNT;
    REG(DMA1 + 0x08u) = 1u << 14 | 2u << 10 | 2u << 8 | 1u << 7 | 1u << 6 | 1u;
    while (!(REG(DMA1) & 2u)) {
    }
    say("tim", "dma_64_words", CYCCNT - begin);
    say("flag", "dma_isr_done", REG(DMA1));
    REG(DMA1 + 4u) = 1;
    say("flag", "dma_isr_cleared", REG(DMA1));
    REG(DMA1 + 0x08u) = 0;
    REG(CRC_R + 8u) = 1;
    begin = CYCCNT;
    REG(CRC_R) = 0x12345678u;
    uint32_t crc = REG(CRC_R);
    say("tim", "crc_word", CYCCNT - begin);
    say("flag", "crc_of_12345678", crc);
}

/* LSI clocks the RTC: 400 of its periods in cycles, first at 72 MHz from the crystal, then at 8 MHz from HSI. */
static uint32_t lsi_periods(void)
{
    uint32_t first = 0;
    for (unsigned n = 0; n < 3; n++) {
        REG(RTC + 4u) = REG(RTC + 4u) & ~1u;
        while (!(REG(RTC + 4u) & 1u)) {
        }
        if (n == 1) {
            first = CYCCNT;
        }
    }
    return CYCCNT - first;
}

static void rtc_start(void)
{
    REG(RCC + 0x24u) |= 1;
    while (!(REG(RCC + 0x24u) & 2u)) {
    }
    REG(PWR) |= 1u << 8;
    REG(RCC + 0x20u) = 1u << 16;
    REG(RCC + 0x20u) = 0;
    REG(RCC + 0x20u) = 2u << 8 | 1u << 15;
    while (!(REG(RTC + 4u) & 1u << 5)) {
    }
    REG(RTC + 4u) |= 1u << 4;
    REG(RTC + 8u) = 0;
    REG(RTC + 12u) = 399;
    REG(RTC + 4u) &= ~(1u << 4);
    while (!(REG(RTC + 4u) & 1u << 5)) {
    }
}

static void time_flash(void)
{
    REG(FLASH_R + 4u) = 0x45670123u;
    REG(FLASH_R + 4u) = 0xCDEF89ABu;
    REG(FLASH_R + 0x10u) = 2;
    REG(FLASH_R + 0x14u) = LAST_PAGE;
    uint32_t begin = CYCCNT;
    REG(FLASH_R + 0x10u) = 2u | 1u << 6;
    while (REG(FLASH_R + 0x0Cu) & 1u) {
    }
    say("tim", "flash_erase_page", CYCCNT - begin);
    say("flag", "flash_sr_erased", REG(FLASH_R + 0x0Cu));
    REG(FLASH_R + 0x0Cu) = 1u << 5;
    REG(FLASH_R + 0x10u) = 1;
    begin = CYCCNT;
    HALF(LAST_PAGE) = 0x1234;
    while (REG(FLASH_R + 0x0Cu) & 1u) {
    }
    say("tim", "flash_program", CYCCNT - begin);
    REG(FLASH_R + 0x0Cu) = 1u << 5;
    HALF(LAST_PAGE) = 0x4321;
    while (REG(FLASH_R + 0x0Cu) & 1u) {
    }
    say("flag", "flash_sr_not_erased", REG(FLASH_R + 0x0Cu));
    REG(FLASH_R + 0x0Cu) = 1u << 5 | 1u << 2;
    REG(FLASH_R + 0x10u) = 1u << 7;
    say("flag", "flash_word", REG(LAST_PAGE));
}

static void read_registers(void)
{
    unsigned at = 0;
    for (unsigned n = 0; n < sizeof ranges / sizeof ranges[0]; n++) {
        for (unsigned word = 0; word < ranges[n].count; word++) {
            at_reset[at++] = REG(ranges[n].first + 4u * word);
        }
        if (n == 0) {
            REG(RCC + 0x14u) |= 1u | 1u << 6;
            REG(RCC + 0x18u) = 0x5E7D;
            REG(RCC + 0x1Cu) = 0x1AE64807u | 1u << 23;
        }
    }
}

static void print_registers(void)
{
    unsigned at = 0;
    for (unsigned n = 0; n < sizeof ranges / sizeof ranges[0]; n++) {
        for (unsigned word = 0; word < ranges[n].count; word++) {
            text("reg");
            hex(ranges[n].first + 4u * word);
            hex(at_reset[at++]);
            end_line();
        }
    }
}

int main(void)
{
    read_registers();
    REG(0xE000EDFCu) |= 1u << 24;
    REG(0xE0001000u) |= 1;
    REG(GPIOA) = 0xB4B44440u; /* PA0 analog, PA5 and PA7 of SPI1 */
    REG(GPIOA + 4u) = 0x444444B4u;
    uint32_t begin = CYCCNT;
    REG(RCC) |= 1u << 16;
    while (!(REG(RCC) & 1u << 17)) {
    }
    uint32_t crystal = CYCCNT - begin;
    begin = CYCCNT;
    to_72_mhz();
    uint32_t pll = CYCCNT - begin;
    usart_start(72000000u);
    lines = checksum = 0;
    text("p2os-silicon 1\n");
    lines = 1;
    print_registers();
    say("start", "hse_ready", crystal);
    say("start", "pll_ready", pll);
    count_kernels("flash2", 0);
    count_kernels("sram", 1);
    count_interrupts();
    time_timer();
    time_adc();
    time_lines();
    time_dma_and_crc();
    rtc_start();
    uint32_t of_crystal = lsi_periods();
    say("tim", "lsi_400_periods", of_crystal);
    time_flash();
    usart_drain();
    to_hsi();
    uint32_t of_hsi = lsi_periods();
    usart_start(8000000u);
    say("tim", "lsi_400_periods_hsi", of_hsi);
    count_kernels("flash0", 0);
    uint32_t count = lines, sum = checksum;
    text("end");
    hex(count);
    hex(sum);
    text("\n");
    usart_drain();
    for (;;) {
        __asm volatile("wfi");
    }
}
