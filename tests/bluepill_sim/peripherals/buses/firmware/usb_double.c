/* usb_echo with two buffers a direction (DBL_BUF): OUT by the second endpoint register, IN by the third.
 *
 * The first two packets that go back are written into both buffers before STAT_TX is set, once, to VALID, with DTOG
 * and SW_BUF both 0: the order in which Klipper starts (RM0008 23.4.3).
 */
int usb_echo_main(void);
#define main usb_echo_main
#include "usb_echo.c"
#undef main

enum { DBL_BUF = 1 << 8, DTOG_RX = 1 << 14, DTOG_TX = 1 << 6, PACKET = 64 };
enum { OUT = 2, IN = 3, ADDRESS = 2, IN0 = 0x180, IN1 = 0x1C0 };

static uint8_t packet[PACKET];
static uint32_t has_packet, size, is_open, is_running, filled, next_in, next_out;

static void open_both(void)
{
    buffers(OUT, TX2, RX2);
    PMA[4 * OUT + 1] = PMA[4 * OUT + 3];
    buffers(IN, IN0, IN1);
    USB->EPR[OUT] = USB->EPR[OUT] & 0x7070u; /* all that toggles to 0 */
    USB->EPR[OUT] = BULK | DBL_BUF | ADDRESS | DTOG_TX | RX_VALID;
    USB->EPR[IN] = BULK | DBL_BUF | ADDRESS | TX_NAK;
    has_packet = is_running = filled = next_in = next_out = 0;
    is_open = 1;
}

/* Whether DTOG and SW_BUF are the same. */
static uint32_t is_blocked(uint32_t n) { return !(((USB->EPR[n] >> 8) ^ USB->EPR[n]) & DTOG_TX); }

static void turn(uint32_t n, uint32_t software)
{
    USB->EPR[n] = (USB->EPR[n] & 0x070Fu) | CTR_RX | CTR_TX | software;
}

static void take(void)
{
    if (!(USB->EPR[OUT] & CTR_RX) || has_packet) {
        return;
    }
    acknowledge(OUT, CTR_RX);
    turn(OUT, DTOG_TX); /* the other buffer is the device's from here on */
    size = copy_in(next_out ? RX2 : TX2, packet, PMA[4 * OUT + (next_out ? 3 : 1)] & 0x3FFu);
    next_out ^= 1;
    has_packet = 1;
    for (uint32_t n = 0; n < size; n++) {
        packet[n] = (uint8_t)(packet[n] >= 'a' && packet[n] <= 'z' ? packet[n] - 32 : packet[n]);
    }
}

static void give(void)
{
    if (USB->EPR[IN] & CTR_TX) {
        acknowledge(IN, CTR_TX);
        if (!is_running) {
            is_running = 1;
            filled = 0;
        }
    }
    if (has_packet && filled < (is_running ? 1u : 2u)) {
        copy_out(next_in ? IN1 : IN0, packet, size);
        PMA[4 * IN + (next_in ? 3 : 1)] = size;
        next_in ^= 1;
        has_packet = 0;
        if (++filled == 2) {
            set(IN, STAT_TX, TX_VALID);
        }
    }
    if (is_running && filled && is_blocked(IN)) {
        turn(IN, DTOG_RX);
        filled = 0;
    }
}

int main(void)
{
    interrupts_off();
    clock_start();
    RCC->APB1ENR |= 1u << 23;
    USB->CNTR = 1;
    USB->CNTR = 0;
    USB->ISTR = 0;
    for (;;) {
        if (USB->ISTR & RESET) {
            USB->ISTR = (uint32_t)~RESET;
            begin();
            is_open = 0;
        }
        control();
        if (!is_configured) {
            is_open = 0;
        } else if (!is_open) {
            open_both();
        } else {
            take();
            give();
        }
    }
}
