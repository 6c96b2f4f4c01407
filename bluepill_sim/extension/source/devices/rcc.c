/* RCC: its clock gates and resets of peripherals, which drivers write without end. All else of it is Python's.
 *
 * Which bit is whose stands in the fabric, from the chip's page. Source: RM0008 7.3.4, 7.3.5, 7.3.6 to 7.3.8.
 */
#include "../fabric/fabric.h"
#include "../registers/rcc.h"

/* The registers of the enables follow those of the resets in the same order, behind that of the AHB. */
static void write(struct device *device, uint32_t index, uint32_t written, uint32_t previous)
{
    (void)written;
    const struct rcc *rcc = device->state;
    if (index >= AHBENR) {
        if (rcc->watches_gates) {
            ask(device, GATES, 0);
        }
        return;
    }
    struct fabric *fabric = device->fabric;
    for (uint32_t left = device->words[index] & ~previous; left; left &= left - 1) {
        const uint32_t slot = fabric->gated[index - APB2RSTR + 1][__builtin_ctz(left)];
        if (slot && fabric->devices[slot].resets_alone) {
            reset_device(&fabric->devices[slot]);
        } else if (slot) {
            ask(device, RESETS, slot);
        }
    }
}

static bool needs_time(const struct device *device, uint32_t index, bool is_write)
{
    (void)is_write; /* its reads are plain */
    return index < AHBENR || ((const struct rcc *)device->state)->watches_gates;
}

DEVICE_KIND(rcc_kind) = {.name = "rcc", .needs_time = needs_time, .write = write, .line = hand_on_line,
                        .pins = hand_on_pins, .command = obey_listen};
