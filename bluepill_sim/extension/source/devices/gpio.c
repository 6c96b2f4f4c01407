/* GPIO: a port's pins, their configuration and their data. LCKR and what is warned of are Python's (peripherals/gpio.py).
 *
 * A pin that the program configures as a floating input, or while something else has it, is looked at a little later.
 * Source: RM0008 9.1, 9.2.
 */
#include "../fabric/fabric.h"
#include "../registers/gpio.h"

enum { ALL = 0xFFFF };
/* A pin's CNF[1:0] MODE[1:0] in CRL or CRH: MODE is not 0 of an output, and a floating input is a pin after a reset. */
enum { NIBBLE = 15, MODE_BITS = 3, CNF_AT = 2, FLOATING_INPUT = 4, PINS_EACH = 8 };
/* chosen: how long after its configuration a wire may still come, and SWJ_CFG release a pin. */
enum { SETTLING_NS = 1000000 };

/* By CNF (table 20); CNF = 3 of an input is reserved and taken as floating. */
static const uint8_t input_modes[4] = {PIN_ANALOG, PIN_FLOATING, PIN_PULLED, PIN_FLOATING};
static const uint8_t output_modes[4] = {PIN_PUSH_PULL, PIN_OPEN_DRAIN, PIN_ALTERNATE, PIN_ALTERNATE_OPEN_DRAIN};

static uint32_t number_of(const struct device *device) { return ((const struct gpio *)device->state)->port; }

/* What the store of a word makes of ODR. */
static uint32_t stored(const struct device *device, uint32_t index, uint32_t written)
{
    const uint32_t before = device->words[ODR];
    switch (index) {
    case BSRR: return (before & ~(written >> 16)) | (written & ALL); /* a set wins over a reset (RM0008 9.2.5) */
    case BRR: return before & ~(written & ALL);
    case ODR: return written & ALL;
    default: return before;
    }
}

static bool needs_time(const struct device *device, uint32_t index, bool is_write)
{
    (void)index;
    return is_write || device->fabric->ports[number_of(device)].shown != 0;
}

static bool store_needs_time(const struct device *device, uint32_t index, uint32_t written)
{
    const uint32_t number = number_of(device);
    return index <= CRH ||
           !is_unwatched(device->fabric, number, stored(device, index, written) ^ device->fabric->ports[number].odr);
}

static void put(struct device *device, uint32_t bits)
{
    struct port *port = &device->fabric->ports[number_of(device)];
    device->words[ODR] = bits;
    if (port->odr != bits) {
        port->odr = bits;
        pins_changed(device->fabric, number_of(device));
    }
}

/* Configuration. */

static void check_later(struct device *device) { schedule(device, now_ns(device->fabric) + SETTLING_NS); }

static uint32_t mode_of(uint32_t nibble) { return (nibble & MODE_BITS ? output_modes : input_modes)[nibble >> CNF_AT]; }

/* The pins of CRL or CRH, a nibble each, whose value the program means although it was there already: only those that
 * float matter, since all others are known not to be intended as floating inputs. */
static uint32_t meant(struct device *device, uint32_t index, uint32_t changed)
{
    bool matters = false;
    for (uint32_t n = 0; n < PINS_EACH; ++n) {
        matters |= !(changed >> 4 * n & NIBBLE) && (device->words[index] >> 4 * n & NIBBLE) == FLOATING_INPUT;
    }
    return matters ? forced_bits(device->fabric, ((const struct gpio *)device->state)->base + 4 * index) : 0;
}

/* Notes whether a pin is intended as a floating input. */
static void note_intent(struct device *device, uint32_t number, uint32_t pc, bool is_floating)
{
    struct gpio *gpio = device->state;
    gpio->intended &= ~(1u << number);
    if (is_floating && !(gpio->locked >> number & 1)) {
        gpio->intended |= 1u << number;
        gpio->intended_pc[number] = pc;
        check_later(device);
    }
}

/* Brings the eight pins of CRL or CRH into the modes that it now asks for. */
static void write_modes(struct device *device, uint32_t index, uint32_t previous)
{
    struct gpio *gpio = device->state;
    const uint32_t changed = device->words[index] ^ previous, forced = meant(device, index, changed);
    const uint32_t pc = device->fabric->host.pc(device->fabric->host.user);
    for (uint32_t n = 0; n < PINS_EACH; ++n) {
        const uint32_t mask = (uint32_t)NIBBLE << 4 * n, nibble = device->words[index] >> 4 * n & NIBBLE;
        const uint32_t number = PINS_EACH * index + n, mode = mode_of(nibble);
        if ((changed | forced) & mask) {
            note_intent(device, number, pc, nibble == FLOATING_INPUT);
        }
        if (!(changed & mask)) {
            continue;
        }
        if (gpio->locked >> number & 1) {
            device->words[index] ^= changed & mask;
            ask(device, LOCKED, number);
            continue;
        }
        gpio->claimed &= ~(1u << number);
        if (device->fabric->ports[gpio->port].held >> number & 1 && mode != PIN_ANALOG && mode != PIN_FLOATING) {
            gpio->claimed |= 1u << number;
            gpio->claimed_pc[number] = pc;
            check_later(device);
        }
        configure_pin(device->fabric, PINS * gpio->port + number, mode, device->words[ODR] >> number & 1);
    }
}

static void reset(struct device *device)
{
    struct gpio *gpio = device->state;
    *gpio = (struct gpio){.port = gpio->port, .base = gpio->base, .warned = gpio->warned, .reported = gpio->reported};
    for (uint32_t n = 0; n < PINS; ++n) {
        configure_pin(device->fabric, PINS * gpio->port + n, PIN_FLOATING, false);
    }
}

static void write(struct device *device, uint32_t index, uint32_t written, uint32_t previous)
{
    if (index <= CRH) {
        write_modes(device, index, previous);
    } else {
        put(device, stored(device, index, written));
    }
}

static uint32_t read(struct device *device, uint32_t index)
{
    (void)index; /* IDR */
    return port_input(device->fabric, number_of(device));
}

static uint32_t command(struct device *device, uint32_t what, uint32_t one, uint32_t other)
{
    (void)other;
    switch (what) {
    case SETTLE: return read(device, one);
    case RESET: reset(device); break;
    case CHECK: check_later(device); break;
    default: break;
    }
    return 0;
}

DEVICE_KIND(gpio_kind) = {.name = "gpio", .needs_time = needs_time, .store_needs_time = store_needs_time, .read = read, .write = write, .command = command};
