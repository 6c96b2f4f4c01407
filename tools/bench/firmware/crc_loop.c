/* CRC-32 bit by bit in a loop of five instructions, without end and without I/O. */
#include <stdint.h>

#include "board.h"

volatile uint32_t bench_rounds;
volatile uint32_t bench_sink;
static uint8_t bytes[256];

int main(void)
{
#ifndef BENCH_NO_CLOCK
    clock_start();
#endif
    for (;;) {
        uint32_t crc = 0xFFFFFFFFu;
        for (int n = 0; n < 256; ++n) {
            crc ^= bytes[n];
            for (int bit = 0; bit < 8; ++bit) {
                crc = crc >> 1 ^ (0xEDB88320u & (0u - (crc & 1)));
            }
        }
        bench_sink = ~crc;
        ++bench_rounds;
        bytes[bench_rounds & 255] = (uint8_t)crc;
    }
}
