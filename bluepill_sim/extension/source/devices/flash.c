/* FLASH: the part of its registers that drivers write for each halfword: PG of CR, and the flags of SR.
 *
 * All else is Python's: `peripherals/flash.py`.
 * Invariant: Python is notified of each write after which anything is to be done.
 */
#include "../fabric/fabric.h"
#include "../registers/flash.h"

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
