/* EXTI: edges on pins become interrupts and events; an edge is seen without any clock.
 *
 * Its outputs are its interrupts, in the order of `LINES_BY_IRQ`; its inputs are the lines 16 to 18.
 * Source: RM0008 10.
 * Invariant: an interrupt is raised exactly while one of its lines is pending and unmasked.
 */
#include "../fabric/fabric.h"
#include "../registers/exti.h"

enum { PIN_LINES = 0xFFFF, ALL = 0x7FFFF };

/* Lines that share an interrupt. */
static const uint32_t lines_by_irq[] = {1 << 0, 1 << 1, 1 << 2, 1 << 3, 1 << 4, 0x3E0, 0xFC00, 1 << 16, 1 << 17, 1 << 18};

static void update_irqs(struct device *device)
{
    const uint32_t active = device->words[PR] & device->words[IMR];
    for (uint32_t n = 0; n < sizeof lines_by_irq / sizeof *lines_by_irq; ++n) {
        output_set(device, n, (active & lines_by_irq[n]) != 0);
    }
}

/* Lines whose events trigger ADCs too: their outputs come behind those of interrupts. */
static const uint32_t trigger_lines[] = {11, 15};

static void signal_events(struct device *device, uint32_t lines)
{
    const uint32_t events = lines & device->words[EMR];
    if (!events) {
        return;
    }
    device->fabric->host.signal(device->fabric->host.user);
    for (uint32_t n = 0; n < sizeof trigger_lines / sizeof *trigger_lines; ++n) {
        if (events >> trigger_lines[n] & 1) {
            const uint32_t output = sizeof lines_by_irq / sizeof *lines_by_irq + n;
            output_set(device, output, true);
            output_set(device, output, false);
        }
    }
}

/* Takes new levels of lines; the edges that RTSR and FTSR choose make requests. */
static void take_levels(struct device *device, uint32_t levels)
{
    struct exti *exti = device->state;
    const uint32_t changed = exti->levels ^ levels;
    const uint32_t asked = changed & ((levels & device->words[RTSR]) | (~levels & device->words[FTSR]));
    exti->levels = levels;
    if (asked) {
        device->words[PR] |= asked;
        update_irqs(device);
        signal_events(device, asked);
    }
}

/* The levels of all lines; of those on pins only where an edge counts: nobody listens to the others. */
static uint32_t present_levels(const struct device *device)
{
    const struct exti *exti = device->state;
    const uint32_t wanted = device->words[RTSR] | device->words[FTSR];
    uint32_t levels = exti->levels & ~(uint32_t)PIN_LINES;
    for (uint32_t n = 0; n < PINS; ++n) {
        if (wanted >> n & 1) {
            levels |= port_input(device->fabric, exti->routes[n]) & 1u << n;
        }
    }
    return levels;
}

static void take_pins(struct device *device, uint32_t port, uint32_t changed)
{
    struct exti *exti = device->state;
    take_levels(device, (exti->levels & ~changed) | (device->fabric->ports[port].input & changed));
}

static void take_line(struct device *device, uint32_t input, bool level)
{
    struct exti *exti = device->state;
    const uint32_t bit = 1u << (16 + input);
    take_levels(device, level ? exti->levels | bit : exti->levels & ~bit);
}

/* Listens to the pins that AFIO has routed here. */
static void listen(struct device *device)
{
    const struct exti *exti = device->state;
    const uint32_t wanted = device->words[RTSR] | device->words[FTSR];
    uint32_t masks[PORTS] = {0};
    for (uint32_t n = 0; n < PINS; ++n) {
        masks[exti->routes[n]] |= wanted & 1u << n;
    }
    for (uint32_t port = 0; port < PORTS; ++port) {
        listen_to_pins(device, port, masks[port]);
    }
}

static void write(struct device *device, uint32_t index, uint32_t written, uint32_t previous)
{
    if (index == RTSR || index == FTSR) {
        struct exti *exti = device->state;
        exti->levels = present_levels(device);
        listen(device);
        return;
    }
    if (index == SWIER) {
        const uint32_t fresh = written & ALL & ~previous;
        device->words[SWIER] = previous | fresh;
        /* Only an unmasked line becomes pending by software (RM0008 10.3.5). */
        device->words[PR] |= fresh & device->words[IMR];
        update_irqs(device);
        signal_events(device, fresh);
        return;
    }
    if (index == PR) {
        device->words[SWIER] &= ~written;
    }
    update_irqs(device);
}

static uint32_t command(struct device *device, uint32_t what, uint32_t one, uint32_t other)
{
    struct exti *exti = device->state;
    (void)one;
    (void)other;
    if (what == ROUTE) {
        listen(device);
        take_levels(device, present_levels(device));
    } else if (what == RESET) {
        exti->levels = present_levels(device);
        listen(device);
        update_irqs(device);
    }
    return 0;
}

DEVICE_KIND(exti_kind) = {.name = "exti", .write = write, .line = take_line, .pins = take_pins, .command = command};
