/* AFIO: which pins the debug port and the crystal keep from GPIO.
 *
 * What follows from a remap or from a route of EXTI is Python's: `peripherals/afio.py`.
 * Source: RM0008 9.3.1 to 9.3.5, table 35; pulls of the debug port 31.4.4.
 * Invariant: each debug pin is held exactly while SWJ_CFG (or reset) says so.
 */
#include "../fabric/fabric.h"
#include "../registers/afio.h"

enum { PORT_A, PORT_B, PORT_D = 3 };
enum { PULLS_NOT, PULLS_UP, PULLS_DOWN };

/* The debug port's pins after reset (JTMS, JTCK, JTDI, JTDO, NJTRST), the values of SWJ_CFG that give each of them up, a
 * bit each, and its pull; the crystal's, which PD01_REMAP gives up. */
static const struct {
    uint8_t port, pin, given_up, pull;
} debug_pins[] = {
    {PORT_A, 13, 1 << 4, PULLS_UP}, {PORT_A, 14, 1 << 4, PULLS_DOWN}, {PORT_A, 15, 1 << 4 | 1 << 2, PULLS_UP},
    {PORT_B, 3, 1 << 4 | 1 << 2, PULLS_NOT}, {PORT_B, 4, 1 << 4 | 1 << 2 | 1 << 1, PULLS_UP},
};
enum { CRYSTAL_PINS = 1 << 0 | 1 << 1 };
/* The values of SWJ_CFG that mean something; what ST's own code writes to leave the debug port as it is (RM0008 9.4.2). */
enum { LEGAL = 1 << 0 | 1 << 1 | 1 << 2 | 1 << 4, UNCHANGED = 7 };

static void put(uint32_t *bits, uint32_t bit, bool is_set) { *bits = is_set ? *bits | bit : *bits & ~bit; }

/* Holds and releases the pins. */
static void place(struct device *device, bool is_written)
{
    struct afio *afio = device->state;
    uint32_t held[PORTS] = {[PORT_D] = device->words[MAPR] & PD01_REMAP ? 0 : CRYSTAL_PINS}, up[PORTS] = {0}, down[PORTS] = {0};
    for (uint32_t n = 0; n < sizeof debug_pins / sizeof *debug_pins; ++n) {
        const uint32_t bit = 1u << debug_pins[n].pin, port = debug_pins[n].port;
        if (!(debug_pins[n].given_up >> afio->swj_cfg & 1)) {
            held[port] |= bit;
            put(&up[port], bit, debug_pins[n].pull == PULLS_UP);
            put(&down[port], bit, debug_pins[n].pull == PULLS_DOWN);
        }
    }
    for (uint32_t n = 0; n < PORTS; ++n) {
        struct port *port = &device->fabric->ports[n];
        const uint32_t mine = afio->held[n] | held[n], changed = afio->held[n] ^ held[n];
        afio->held[n] = held[n];
        if (changed) {
            port->held = (port->held & ~mine) | held[n];
            port->hold_up = (port->hold_up & ~mine) | up[n];
            port->hold_down = (port->hold_down & ~mine) | down[n];
            pins_changed(device->fabric, n);
        }
    }
    ask(device, PLACED, is_written);
}

static void write(struct device *device, uint32_t index, uint32_t written, uint32_t previous)
{
    struct afio *afio = device->state;
    (void)previous;
    if (index == MAPR) {
        const uint32_t swj_cfg = written >> SWJ_CFG_AT & 7;
        if (LEGAL >> swj_cfg & 1) {
            afio->swj_cfg = swj_cfg;
        } else if (swj_cfg != UNCHANGED) {
            ask(device, MEANINGLESS, swj_cfg);
        }
        place(device, true);
    }
    ask_about(device, ROUTED);
}

static uint32_t command(struct device *device, uint32_t what, uint32_t one, uint32_t other)
{
    (void)one;
    (void)other;
    if (what == RESET) {
        ((struct afio *)device->state)->swj_cfg = 0;
        place(device, false);
        ask_about(device, ROUTED);
    }
    return 0;
}

DEVICE_KIND(afio_kind) = {.name = "afio", .write = write, .command = command};
