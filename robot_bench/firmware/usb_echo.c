/* usb_echo: a CDC ACM device by registers: echoes in capitals what comes, 64 bytes at a time, and sleeps meanwhile.
 *
 * Interrupts stay masked: WFI ends with one that is pending (RM0008 table 63, 20), and the loop looks at ISTR.
 * PB0 low as it starts pulls D+ (PA12) down for 20 ms first, so that a host enumerates anew after a reset.
 */
#include "board.h"
#include "f103.h"

struct usb { volatile uint32_t EPR[8], gap[8], CNTR, ISTR, FNR, DADDR, BTABLE; };
#define USB ((struct usb *)0x40005C00u)
#define PMA ((volatile uint32_t *)0x40006000u)
#define NVIC_ICPR ((volatile uint32_t *)0xE000E280u)

enum { CTR_RX = 1 << 15, STAT_RX = 3 << 12, SETUP = 1 << 11, CTR_TX = 1 << 7, STAT_TX = 3 << 4 };
enum { RX_NAK = 2 << 12, RX_STALL = 1 << 12, RX_VALID = 3 << 12, TX_NAK = 2 << 4, TX_STALL = 1 << 4, TX_VALID = 3 << 4 };
enum { BULK = 0 << 9, CONTROL = 1 << 9, INTERRUPT = 3 << 9 };
enum { CTR = 1 << 15, WKUP = 1 << 12, SUSP = 1 << 11, RESET = 1 << 10 };
enum { IRQ = 20 };
/* Where the buffers are in the memory of packets. */
enum { TX0 = 0x40, RX0 = 0x80, TX1 = 0xC0, RX2 = 0x100, TX2 = 0x140 };

static const uint8_t device[] = {18, 1, 0, 2, 2, 0, 0, 64, 0x09, 0x12, 0x01, 0x00, 0, 1, 1, 2, 0, 1};
static const uint8_t configuration[] = {
    9, 2, 67, 0, 2, 1, 0, 0x80, 50,
    9, 4, 0, 0, 1, 2, 2, 0, 0,
    5, 0x24, 0, 0x10, 1, 5, 0x24, 1, 0, 1, 4, 0x24, 2, 2, 5, 0x24, 6, 0, 1,
    7, 5, 0x81, 3, 8, 0, 255,
    9, 4, 1, 0, 2, 10, 0, 0, 0,
    7, 5, 0x02, 2, 64, 0, 0,
    7, 5, 0x82, 2, 64, 0, 0,
};
static const uint8_t languages[] = {4, 3, 9, 4};
static const uint8_t maker[] = {10, 3, 'p', 0, '2', 0, 'o', 0, 's', 0};
static const uint8_t product[] = {10, 3, 'e', 0, 'c', 0, 'h', 0, 'o', 0};
static const uint8_t *const strings[] = {languages, maker, product};

static uint8_t line_coding[7] = {0x80, 0x25, 0, 0, 0, 0, 8};
static uint8_t request[8];
static const uint8_t *to_send;
static uint32_t left, asked, wants_address, wants_coding, is_configured;

/* Sets fields that toggle to what they shall be, and leaves the flags alone. */
static void set(uint32_t n, uint32_t mask, uint32_t value)
{
    const uint32_t word = USB->EPR[n];
    USB->EPR[n] = (word & 0x070Fu) | CTR_RX | CTR_TX | ((word ^ value) & mask);
}

static void acknowledge(uint32_t n, uint32_t flag)
{
    USB->EPR[n] = (USB->EPR[n] & 0x070Fu) | ((CTR_RX | CTR_TX) & ~flag);
}

static void copy_out(uint32_t at, const uint8_t *from, uint32_t count)
{
    for (uint32_t n = 0; n < count; n += 2) {
        PMA[(at + n) / 2] = (uint32_t)from[n] | (n + 1 < count ? (uint32_t)from[n + 1] << 8 : 0);
    }
}

static uint32_t copy_in(uint32_t at, uint8_t *to, uint32_t count)
{
    for (uint32_t n = 0; n < count; n++) {
        to[n] = (uint8_t)(PMA[(at + n) / 2] >> 8 * (n & 1));
    }
    return count;
}

/* The words of an endpoint's buffers: ADDR_TX, COUNT_TX, ADDR_RX, COUNT_RX. */
static void buffers(uint32_t n, uint32_t tx, uint32_t rx)
{
    PMA[4 * n] = tx;
    PMA[4 * n + 1] = 0;
    PMA[4 * n + 2] = rx;
    PMA[4 * n + 3] = 1u << 15 | 1u << 10; /* two blocks of 32 */
}

static uint32_t received(uint32_t n) { return PMA[4 * n + 3] & 0x3FFu; }

static void open(uint32_t n, uint32_t type, uint32_t stat)
{
    USB->EPR[n] = type | n | CTR_RX | CTR_TX;
    set(n, STAT_RX | STAT_TX | 1u << 14 | 1u << 6, stat);
}

static void begin(void)
{
    USB->BTABLE = 0;
    buffers(0, TX0, RX0);
    buffers(1, TX1, 0);
    buffers(2, TX2, RX2);
    open(0, CONTROL, RX_VALID | TX_NAK);
    is_configured = left = 0;
    USB->DADDR = 0x80;
}

static void send_packet(void)
{
    const uint32_t count = left < 64 ? left : 64;
    copy_out(TX0, to_send, count);
    to_send += count;
    left -= count;
    PMA[1] = count;
    set(0, STAT_TX, TX_VALID);
}

static void send(const uint8_t *what, uint32_t count)
{
    to_send = what;
    left = count < asked ? count : asked;
    send_packet();
}

static void status_in(void)
{
    left = 0;
    PMA[1] = 0;
    set(0, STAT_TX, TX_VALID);
}

static void stall(void) { set(0, STAT_TX | STAT_RX, TX_STALL | RX_STALL); }

static void descriptor(void)
{
    const uint32_t index = request[2];
    if (request[3] == 1) {
        send(device, sizeof device);
    } else if (request[3] == 2) {
        send(configuration, sizeof configuration);
    } else if (request[3] == 3 && index < 3) {
        send(strings[index], strings[index][0]);
    } else {
        stall();
    }
}

static void setup(void)
{
    copy_in(RX0, request, 8);
    asked = request[6] | (uint32_t)request[7] << 8;
    switch (request[0] << 8 | request[1]) {
    case 0x8006:
        descriptor();
        break;
    case 0x0005: /* the address counts once the status has gone */
        wants_address = request[2];
        status_in();
        break;
    case 0x0009:
        open(1, INTERRUPT, TX_NAK);
        open(2, BULK, RX_VALID | TX_NAK);
        is_configured = 1;
        status_in();
        break;
    case 0x2120:
        wants_coding = 1;
        break;
    case 0xA121:
        send(line_coding, sizeof line_coding);
        break;
    case 0x2122:
        status_in();
        break;
    default:
        stall();
    }
}

static void control(void)
{
    const uint32_t word = USB->EPR[0];
    if (word & CTR_RX) {
        acknowledge(0, CTR_RX);
        if (word & SETUP) {
            wants_coding = wants_address = 0;
            setup();
        } else if (wants_coding && received(0) == sizeof line_coding) {
            copy_in(RX0, line_coding, sizeof line_coding);
            wants_coding = 0;
            status_in();
        }
        set(0, STAT_RX, (USB->EPR[0] & STAT_RX) == RX_STALL ? RX_STALL : RX_VALID);
    }
    if (word & CTR_TX) {
        acknowledge(0, CTR_TX);
        if (wants_address) {
            USB->DADDR = 0x80 | wants_address;
            wants_address = 0;
        } else if (left) {
            send_packet();
        }
    }
}

static void echo(void)
{
    static uint8_t bytes[64];
    if (!(USB->EPR[2] & CTR_RX) || (USB->EPR[2] & STAT_TX) == TX_VALID) {
        return; /* the host waits while the last packet has not gone */
    }
    const uint32_t count = copy_in(RX2, bytes, received(2));
    acknowledge(2, CTR_RX);
    set(2, STAT_RX, RX_VALID);
    for (uint32_t n = 0; n < count; n++) {
        bytes[n] = (uint8_t)(bytes[n] >= 'a' && bytes[n] <= 'z' ? bytes[n] - 32 : bytes[n]);
    }
    copy_out(TX2, bytes, count);
    PMA[4 * 2 + 1] = count;
    set(2, STAT_TX, TX_VALID);
}

int main(void)
{
    interrupts_off();
    clock_start();
    RCC->APB2ENR |= RCC_APB2ENR_IOPAEN | RCC_APB2ENR_IOPBEN;
    GPIOB->ODR = 1;
    GPIOB->CRL = (GPIOB->CRL & ~0xFu) | 8u;
    if (!(GPIOB->IDR & 1u)) {
        GPIOA->CRH = (GPIOA->CRH & ~0xF0000u) | 0x20000u;
        for (volatile uint32_t n = 0; n < 200000; n++) {
        }
        GPIOA->CRH = (GPIOA->CRH & ~0xF0000u) | 0x40000u;
    }
    RCC->APB1ENR |= 1u << 23;
    USB->CNTR = 1;
    USB->CNTR = 0;
    USB->ISTR = 0;
    USB->CNTR = CTR | RESET;
    NVIC_ISER[0] = 1u << IRQ;
    for (;;) {
        NVIC_ICPR[0] = 1u << IRQ;
        const uint32_t flags = USB->ISTR;
        if (flags & RESET) {
            USB->ISTR = (uint32_t)~RESET;
            begin();
        } else if (flags & CTR) {
            control();
            if (USB->EPR[2] & CTR_TX) {
                acknowledge(2, CTR_TX);
            }
            echo();
        }
        if (!(USB->ISTR & CTR) || (is_configured && (USB->EPR[2] & STAT_TX) == TX_VALID)) {
            wait_for_interrupt();
        }
    }
}
