/* Sort, divide, call: what a control loop computes, without end and without I/O. */
#include <stdint.h>

#include "board.h"

static int32_t values[64];
volatile uint32_t bench_rounds;
volatile int32_t bench_sink;

static uint32_t next(uint32_t *state)
{
    *state = *state * 1664525u + 1013904223u;
    return *state >> 8;
}

static void sort(int32_t *row, int count)
{
    for (int i = 1; i < count; ++i) {
        int32_t value = row[i];
        int j = i;
        for (; j > 0 && row[j - 1] > value; --j) {
            row[j] = row[j - 1];
        }
        row[j] = value;
    }
}

static __attribute__((noinline)) int32_t gcd(int32_t a, int32_t b) { return b == 0 ? a : gcd(b, a % b); }

static __attribute__((noinline)) int32_t fibonacci(int n) { return n < 2 ? n : fibonacci(n - 1) + fibonacci(n - 2); }

int main(void)
{
#ifndef BENCH_NO_CLOCK
    clock_start();
#endif
    uint32_t state = 1;
    for (;;) {
        for (int i = 0; i < 64; ++i) {
            values[i] = (int32_t)(next(&state) & 0xFFFFu);
        }
        sort(values, 64);
        bench_sink = values[32] + gcd(values[40] | 1, values[20] | 1) + fibonacci(8);
        ++bench_rounds;
    }
}
