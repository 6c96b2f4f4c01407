/* board_test: obeys the self-test of the adapter board, `p2os board test`, wire by wire.
 *
 * Drives nothing until it is told to, runs from the internal oscillator, so that a
 * crystal that does not start is a finding and no silence, and answers each line:
 *
 *   i                        board_test 1 csr HEX   who it is, and RCC_CSR: why it began
 *   s DRIVEN LEVELS PULLED   r HEX                  every wire, once these were driven, those pulled and the others let go
 *   p DRIVEN LEVELS          r HEX                  every wire, while these were driven for a microsecond or two
 *   x                        crystal 0|1            whether the 8 MHz crystal runs
 *   anything else            ?
 *
 * Words are six hexadecimal digits, bit 0 is DD1, bit 21 is rst. PULLED wires follow LEVELS by the chip's own 40 k.
 */
#include "board.h"
#include "f103.h"

/* What no other program uses; in f103.h it would move the lines, and so the bytes, of all of them. */
#define GPIO_INPUT_PULLED 0x8u /* up or down as ODR has it (RM0008 9.2.1) */
#define USART_CR1_RE (1u << 2)
#define USART_CR1_RXNEIE (1u << 5)

#define WIRES 22u
#define BAUD 57600u     /* 8 MHz / 139: 0.1 % off, as 115200 would not be */
#define LINE 40u        /* chosen: the longest command and some */
#define SETTLE_LOOPS 250u /* chosen: some 100 us; 20k and a metre of wire need 10 */
#define CRYSTAL_LOOPS 20000u /* chosen: some 10 ms; a crystal takes 2 (DS5319 table 22) */
#define TX_PIN 9u /* PA9; PA10 is RX, a floating input after reset */

enum port { PORT_A, PORT_B, PORT_C, PORTS };

struct wire {
    uint8_t port;
    uint8_t bit;
};

#define WIRE(name, letter, bit) {PORT_##letter, bit},
static const struct wire wires[WIRES] = {
    DISTANCE_WIRES(WIRE) LEFT_ENCODER_WIRES(WIRE) RIGHT_ENCODER_WIRES(WIRE) LEFT_MOTOR_WIRES(WIRE)
    RIGHT_MOTOR_WIRES(WIRE) CONTROL_WIRES(WIRE)
};
static struct gpio *const ports[PORTS] = {GPIOA, GPIOB, GPIOC};

static char line[LINE];
static volatile uint32_t length;
static volatile uint32_t is_whole;

void USART1_IRQHandler(void);
void USART1_IRQHandler(void)
{
    char character = (char)USART1->DR;
    if (is_whole) {
        return; /* whoever does not wait for an answer loses what he says */
    }
    if (character == '\n' || character == '\r') {
        is_whole = length != 0;
    } else if (length + 1 < LINE) {
        line[length] = character;
        length = length + 1;
        line[length] = '\0';
    }
}

static void put(char character)
{
    while (!(USART1->SR & USART_SR_TXE)) {
    }
    USART1->DR = (uint8_t)character;
}

static void text(const char *words)
{
    while (*words != '\0') {
        put(*words++);
    }
}

static void hex(uint32_t word, unsigned digits)
{
    while (digits-- > 0) {
        put("0123456789abcdef"[word >> 4 * digits & 0xFu]);
    }
}

/* Reads the six digits of word `place` behind the command's letter; returns 0 where they are none. */
static int word_at(unsigned place, uint32_t *word)
{
    const char *digits = line + 1 + 7 * place;
    if (length < 8 + 7 * place || *digits++ != ' ') {
        return 0;
    }
    *word = 0;
    for (unsigned i = 0; i < 6; i++) {
        char digit = digits[i];
        int is_letter = digit >= 'a' && digit <= 'f';
        if (!is_letter && (digit < '0' || digit > '9')) {
            return 0;
        }
        *word = *word << 4 | (uint32_t)(is_letter ? digit - 'a' + 10 : digit - '0');
    }
    return 1;
}

static void set_mode(struct wire wire, uint32_t mode)
{
    volatile uint32_t *half = wire.bit < 8 ? &ports[wire.port]->CRL : &ports[wire.port]->CRH;
    unsigned shift = 4u * (wire.bit % 8u);
    *half = (*half & ~(0xFu << shift)) | mode << shift;
}

/* Sets the modes of all wires; a register that stays as it is is not written. */
static void set_modes(uint32_t driven, uint32_t pulled)
{
    for (unsigned port = 0; port < PORTS; port++) {
        uint32_t low = ports[port]->CRL, high = ports[port]->CRH, new_low = low, new_high = high;
        for (unsigned i = 0; i < WIRES; i++) {
            if (wires[i].port == port) {
                uint32_t *half = wires[i].bit < 8 ? &new_low : &new_high;
                unsigned shift = 4u * (wires[i].bit % 8u);
                uint32_t mode = driven >> i & 1u   ? GPIO_OUTPUT_PUSH_PULL_2MHZ
                                : pulled >> i & 1u ? GPIO_INPUT_PULLED
                                                   : GPIO_INPUT_FLOATING;
                *half = (*half & ~(0xFu << shift)) | mode << shift;
            }
        }
        if (new_low != low) {
            ports[port]->CRL = new_low;
        }
        if (new_high != high) {
            ports[port]->CRH = new_high;
        }
    }
}

static uint32_t levels_now(void)
{
    uint32_t levels[PORTS], word = 0;
    for (unsigned i = 0; i < PORTS; i++) {
        levels[i] = ports[i]->IDR;
    }
    for (unsigned i = 0; i < WIRES; i++) {
        word |= (levels[wires[i].port] >> wires[i].bit & 1u) << i;
    }
    return word;
}

/* Lets go first, then sets the levels, then drives: no wire is driven to an old level, nor two where one was meant. */
static void hold_all(uint32_t driven, uint32_t levels, uint32_t pulled)
{
    uint32_t set_and_reset[PORTS] = {0};
    for (unsigned i = 0; i < WIRES; i++) {
        set_and_reset[wires[i].port] |= 1u << (levels >> i & 1u ? wires[i].bit : wires[i].bit + 16u);
    }
    set_modes(0, pulled);
    for (unsigned port = 0; port < PORTS; port++) {
        ports[port]->BSRR = set_and_reset[port];
    }
    set_modes(driven, pulled & ~driven);
    for (volatile unsigned i = 0; i < SETTLE_LOOPS; i++) {
    }
}

/* A pin that stands in a short bears it for so long. */
static uint32_t pulse(uint32_t driven, uint32_t levels)
{
    uint32_t seen = levels_now();
    for (unsigned i = 0; i < WIRES; i++) {
        if (driven >> i & 1u) {
            struct wire wire = wires[i];
            ports[wire.port]->BSRR = 1u << (levels >> i & 1u ? wire.bit : wire.bit + 16u);
            set_mode(wire, GPIO_OUTPUT_PUSH_PULL_2MHZ);
            uint32_t port = ports[wire.port]->IDR;
            port = ports[wire.port]->IDR; /* the first may be of the cycle before (RM0008 9.1.7) */
            set_mode(wire, GPIO_INPUT_FLOATING);
            seen = (seen & ~(1u << i)) | (port >> wire.bit & 1u) << i;
        }
    }
    return seen;
}

static int has_crystal(void)
{
    RCC->CR |= RCC_CR_HSEON;
    unsigned left = CRYSTAL_LOOPS;
    while (!(RCC->CR & RCC_CR_HSERDY) && left > 0) {
        left--;
    }
    int is_ready = (RCC->CR & RCC_CR_HSERDY) != 0;
    RCC->CR &= ~RCC_CR_HSEON;
    return is_ready;
}

static void answer(void)
{
    uint32_t driven = 0, levels = 0, pulled = 0;
    if (line[0] == 'i' && length == 1) {
        text("board_test 1 csr ");
        hex(RCC->CSR, 8);
    } else if (line[0] == 'x' && length == 1) {
        text("crystal ");
        put(has_crystal() ? '1' : '0');
    } else if (line[0] == 's' && length == 22 && word_at(0, &driven) && word_at(1, &levels) && word_at(2, &pulled)) {
        hold_all(driven, levels, pulled);
        text("r ");
        hex(levels_now(), 6);
    } else if (line[0] == 'p' && length == 15 && word_at(0, &driven) && word_at(1, &levels)) {
        text("r ");
        hex(pulse(driven, levels), 6);
    } else {
        put('?');
    }
    put('\n');
}

int main(void)
{
    RCC->APB2ENR |=
        RCC_APB2ENR_AFIOEN | RCC_APB2ENR_IOPAEN | RCC_APB2ENR_IOPBEN | RCC_APB2ENR_IOPCEN | RCC_APB2ENR_USART1EN;
    (void)RCC->APB2ENR; /* the clocks are on two cycles later (RM0008 7.3.7) */
    AFIO->MAPR = AFIO_MAPR_SWJ_CFG_JTAG_OFF; /* PB3 and PB4 are wires; serial-wire debugging stays */
    hold_all(0, 0, 0);
    uint32_t shift = 4u * (TX_PIN - 8u);
    GPIOA->CRH = (GPIOA->CRH & ~(0xFu << shift)) | GPIO_ALTERNATE_PUSH_PULL_2MHZ << shift;
    USART1->BRR = (HSI_HZ + BAUD / 2u) / BAUD; /* PCLK2 is HCLK is the internal oscillator after reset */
    USART1->CR1 = USART_CR1_UE | USART_CR1_TE | USART_CR1_RE | USART_CR1_RXNEIE;
    NVIC_ISER[USART1_IRQ / 32u] = 1u << USART1_IRQ % 32u;
    text("board_test: ready\n");
    for (;;) {
        interrupts_off();
        while (!is_whole) {
            wait_for_interrupt(); /* a character between the test and WFI still ends the sleep */
            interrupts_on();
            interrupts_off();
        }
        interrupts_on();
        answer();
        length = 0;
        is_whole = 0;
    }
}
