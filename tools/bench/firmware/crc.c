/* Long straight runs of arithmetic: CRC-32 a byte at a time by shifts and masks, unrolled, and a mixing function, without
 * end and without I/O; with BENCH_LOOP the CRC alone, in a loop of five instructions a bit.
 */
#include <stdint.h>

#include "board.h"

volatile uint32_t bench_rounds;
volatile uint32_t bench_sink;
static uint8_t bytes[256];

#define STEP crc = crc >> 1 ^ (0xEDB88320u & (0u - (crc & 1)));
#define MIX(a, b, c) a -= b; a -= c; a ^= c >> 13; b -= c; b -= a; b ^= a << 8; c -= a; c -= b; c ^= b >> 13;

int main(void)
{
#ifndef BENCH_NO_CLOCK
    clock_start();
#endif
    uint32_t a = 0x9E3779B9u, b = 1, c = 2;
    for (;;) {
        uint32_t crc = 0xFFFFFFFFu;
        for (int n = 0; n < 256; ++n) {
            crc ^= bytes[n];
#ifdef BENCH_LOOP
            for (int bit = 0; bit < 8; ++bit) {
                STEP
            }
#else
            STEP STEP STEP STEP STEP STEP STEP STEP
            MIX(a, b, c)
            MIX(b, c, a)
#endif
            bytes[n] = (uint8_t)(crc ^ a);
        }
        bench_sink = ~crc;
        ++bench_rounds;
    }
}
