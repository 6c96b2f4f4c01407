/* USB: the part of its registers that programs write without end: toggles of EPnR, and CNTR with what it has already.
 *
 * What follows from a write, transactions and frames are Python's: `peripherals/usb.py`.
 * Invariant: Python is told of each write that may change anything.
 */
#include "../fabric/fabric.h"

/* Registers by offset / 4: EP0R to EP7R come first. */
enum { ENDPOINTS = 8 };
/* DTOG_RX, STAT_RX, DTOG_TX, STAT_TX: a 1 turns them over. */
enum { TOGGLES = 0x7070 };
/* What Python is told: `fabric/registers.py` for the first two, then a write with the word before it. */
enum { HEARS_LINE, HEARS_PINS, WRITTEN };
enum { LISTEN = OWN_COMMANDS };

static void write(struct device *device, uint32_t index, uint32_t written, uint32_t previous)
{
    if (index < ENDPOINTS) {
        device->words[index] ^= written & TOGGLES;
    }
    if (device->words[index] != previous) {
        ask(device, WRITTEN, index << 16 | previous);
    }
}

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

DEVICE_KIND(usb_kind) = {.name = "usb", .write = write, .line = line, .pins = pins, .command = command};
