/* A device in Python that has inputs: what it hears of lines and pins is handed on to `Peripheral.answer`.
 *
 * Its events and registers are Python's.
 */
#include "../fabric/fabric.h"

/* What Python is told, and what it asks for: `fabric/registers.py`. */
enum { HEARS_LINE, HEARS_PINS };
enum { LISTEN = OWN_COMMANDS };

static void line(struct device *device, uint32_t input, bool level) { ask(device, HEARS_LINE, input << 1 | level); }

static void pins(struct device *device, uint32_t port, uint32_t changed)
{
    ask(device, HEARS_PINS, port << PINS | changed);
}

static uint32_t command(struct device *device, uint32_t what, uint32_t one, uint32_t other)
{
    if (what == LISTEN) { /* to the pins `other` of the port `one` */
        listen_to_pins(device, one, other);
    }
    return 0;
}

DEVICE_KIND(listener_kind) = {.name = "listener", .line = line, .pins = pins, .command = command};
