/* A device in Python that has inputs: what it hears of lines and pins is handed on to `Peripheral.answer`.
 *
 * Its events and registers are Python's.
 */
#include "../fabric/fabric.h"

/* What Python asks for, as `fabric/registers.py` has it. */
enum { LISTEN = OWN_COMMANDS };

void hand_on_line(struct device *device, uint32_t input, bool level) { ask(device, HEARS_LINE, input << 1 | level); }

void hand_on_pins(struct device *device, uint32_t port, uint32_t changed)
{
    ask(device, HEARS_PINS, port << PINS | changed);
}

uint32_t obey_listen(struct device *device, uint32_t what, uint32_t one, uint32_t other)
{
    if (what == LISTEN) { /* to the pins `other` of the port `one` */
        listen_to_pins(device, one, other);
    }
    return 0;
}

DEVICE_KIND(listener_kind) = {.name = "listener", .line = hand_on_line, .pins = hand_on_pins, .command = obey_listen};
