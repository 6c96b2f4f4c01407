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
/* What Python is told beside what a listener hears: a write, with the word before it. */
enum { WRITTEN = OWN_ANSWERS };

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
