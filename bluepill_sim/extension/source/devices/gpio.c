/* GPIO: the data registers of a port. How its pins are configured is Python's business (peripherals/gpio.py).
 *
 * Source: RM0008 9.2.
 */
#include "../fabric/fabric.h"

enum { ODR = 3, BSRR = 4, BRR = 5, ALL = 0xFFFF };

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
    return !is_unwatched(device->fabric, number, stored(device, index, written) ^ device->fabric->ports[number].odr);
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

static void write(struct device *device, uint32_t index, uint32_t written, uint32_t previous)
{
    (void)previous;
    put(device, stored(device, index, written));
}

static uint32_t read(struct device *device, uint32_t index)
{
    (void)index; /* IDR */
    return port_input(device->fabric, number_of(device));
}

static uint32_t command(struct device *device, uint32_t what, uint32_t one, uint32_t other)
{
    (void)other;
    return what == SETTLE ? read(device, one) : 0;
}

DEVICE_KIND(gpio_kind) = {.name = "gpio", .needs_time = needs_time, .store_needs_time = store_needs_time, .read = read, .write = write, .command = command};
