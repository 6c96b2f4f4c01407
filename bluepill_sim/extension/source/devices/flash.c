/* FLASH: the part of its registers that drivers write for each halfword: PG of CR, and the flags of SR.
 *
 * All else is Python's: `peripherals/flash.py`.
 * Invariant: Python is told of each write after which anything is to be done.
 */
#include "../fabric/fabric.h"

/* Registers by offset / 4, and their bits. */
enum { SR = 3, CR = 4 };
enum { BSY = 1 << 0, PG = 1 << 0, STRT = 1 << 6, LOCK = 1 << 7, ERRIE = 1 << 10, EOPIE = 1 << 12 };
/* What Python is told beside what a listener hears: a write, with the word before it. */
enum { WRITTEN = OWN_ANSWERS };

static void write(struct device *device, uint32_t index, uint32_t written, uint32_t previous)
{
    const uint32_t *words = device->words, control = words[CR];
    (void)written;
    const bool changes_pg_alone = index == CR && !((control ^ previous) & ~(uint32_t)PG) && !(control & (STRT | LOCK)) && !(words[SR] & BSY);
    const bool clears_flags_alone = index == SR && !(control & (ERRIE | EOPIE));
    if (!changes_pg_alone && !clears_flags_alone) {
        ask(device, WRITTEN, index << 16 | previous);
    }
}

DEVICE_KIND(flash_kind) = {.name = "flash", .write = write, .line = hand_on_line, .pins = hand_on_pins, .command = obey_listen};
