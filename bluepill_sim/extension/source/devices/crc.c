/* CRC: the remainder of 32-bit words by the Ethernet polynomial, most significant bit first.
 *
 * Source: RM0008 4.
 */
#include "../fabric/fabric.h"
#include "../registers/crc.h"

#define POLYNOMIAL 0x04C11DB7u

static bool needs_time(const struct device *device, uint32_t index, bool is_write)
{
    (void)device;
    (void)index;
    (void)is_write;
    return false;
}

static uint32_t remainder_of(uint32_t word)
{
    for (uint32_t n = 0; n < 32; ++n) {
        word = word << 1 ^ (POLYNOMIAL & -(word >> 31));
    }
    return word;
}

static void write(struct device *device, uint32_t index, uint32_t written, uint32_t previous)
{
    if (index == DR) {
        device->words[DR] = remainder_of(previous ^ written);
    } else if (written & CR_RESET) { /* it leaves IDR alone */
        device->words[DR] = UINT32_MAX;
    }
}

DEVICE_KIND(crc_kind) = {.name = "crc", .needs_time = needs_time, .write = write};
