/* USB: the part of its registers that programs write without end: toggles of EPnR, and CNTR with what it has already.
 *
 * What follows from a write, transactions and frames are Python's: `peripherals/usb.py`.
 * Invariant: Python is notified of each write that may change anything.
 */
#include "../fabric/fabric.h"
#include "../registers/usb.h"

/* EP0R to EP7R come first. What a 1 turns over in them: */
enum { ENDPOINTS = EP7R + 1, TOGGLES = DTOG_RX | STAT_RX | DTOG_TX | STAT_TX };

static void write(struct device *device, uint32_t index, uint32_t written, uint32_t previous)
{
    if (index < ENDPOINTS) {
        device->words[index] ^= written & TOGGLES;
    }
    if (device->words[index] != previous) {
        ask(device, WRITTEN, index << 16 | previous);
    }
}

DEVICE_KIND(usb_kind) = {.name = "usb", .write = write, .line = hand_on_line, .pins = hand_on_pins,
                        .command = obey_listen};
