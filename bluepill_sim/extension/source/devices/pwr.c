/* PWR: what its registers hold, the lock of the backup domain among it.
 *
 * The supply's detector, the wake-up pin and what a mode stops are Python's: `peripherals/pwr.py`.
 * Source: RM0008 5.4.
 */
#include "../fabric/fabric.h"
#include "../registers/pwr.h"

static void write(struct device *device, uint32_t index, uint32_t written, uint32_t previous)
{
    uint32_t *words = device->words;
    if (index == CSR) {
        if ((words[CSR] ^ previous) & EWUP) {
            ask_about(device, WAKE_PIN);
        }
        return;
    }
    words[CSR] &= ~(uint32_t)((written & CWUF ? WUF : 0) | (written & CSBF ? SBF : 0));
    if ((words[CR] ^ previous) & DBP) {
        ask(device, BACKUP, (words[CR] & DBP) != 0);
    }
    if ((words[CR] | previous) & PVDE) {
        ask_about(device, SUPPLY);
    }
}

DEVICE_KIND(pwr_kind) = {.name = "pwr", .write = write, .line = hand_on_line, .pins = hand_on_pins, .command = obey_listen};
