/* A bit of everything that firmware does between its accesses to peripherals, without end and without I/O: a state machine
 * by a jump table, calls by pointers, text of numbers, fixed-point control, 64-bit products, copies, bit fields.
 */
#include <stdint.h>

#include "board.h"

struct packet {
    uint8_t kind, length, flags, spare;
    int16_t speed, angle;
    uint32_t stamp;
};

volatile uint32_t bench_rounds;
volatile int32_t bench_sink;
static struct packet queue[16];
static char text[64];
static int32_t integral, last_error;

static uint32_t next(uint32_t *state)
{
    *state ^= *state << 13;
    *state ^= *state >> 17;
    *state ^= *state << 5;
    return *state;
}

static __attribute__((noinline)) int number(char *to, int32_t value)
{
    char digits[12];
    int count = 0, written = 0;
    uint32_t left = value < 0 ? 0u - (uint32_t)value : (uint32_t)value;
    do {
        digits[count++] = (char)('0' + left % 10);
        left /= 10;
    } while (left);
    if (value < 0) {
        to[written++] = '-';
    }
    while (count) {
        to[written++] = digits[--count];
    }
    return written;
}

static __attribute__((noinline)) int32_t control(int32_t wanted, int32_t seen)
{
    const int32_t error = wanted - seen;
    integral += error;
    integral = integral > 100000 ? 100000 : integral < -100000 ? -100000 : integral;
    const int64_t sum = (int64_t)error * 3277 + (int64_t)integral * 131 + (int64_t)(error - last_error) * 819;
    last_error = error;
    return (int32_t)(sum >> 12);
}

static int32_t add(int32_t a, int32_t b) { return a + b; }
static int32_t scale(int32_t a, int32_t b) { return (int32_t)(((int64_t)a * b) >> 8); }
static int32_t limit(int32_t a, int32_t b) { return a > b ? b : a < -b ? -b : a; }
static int32_t (*const ways[4])(int32_t, int32_t) = {add, scale, limit, control};

static __attribute__((noinline)) int32_t act(const struct packet *one)
{
    switch (one->kind & 7) {
    case 0: return one->speed;
    case 1: return one->angle * 2;
    case 2: return one->speed - one->angle;
    case 3: return (int32_t)(one->stamp >> 7 & 0x1FF);
    case 4: return (int32_t)__builtin_clz(one->stamp | 1);
    case 5: return (int32_t)__builtin_bswap32(one->stamp) >> 20;
    case 6: return one->flags & 1 ? one->length : -one->length;
    default: return 1;
    }
}

int main(void)
{
#ifndef BENCH_NO_CLOCK
    clock_start();
#endif
    uint32_t state = 2463534242u;
    for (;;) {
        for (int n = 0; n < 16; ++n) {
            const uint32_t word = next(&state);
            queue[n] = (struct packet){.kind = (uint8_t)word, .length = (uint8_t)(word >> 8), .flags = (uint8_t)(word >> 16),
                                       .speed = (int16_t)word, .angle = (int16_t)(word >> 12), .stamp = word};
        }
        int32_t sum = 0;
        for (int n = 0; n < 16; ++n) {
            const struct packet one = queue[(n * 5 + 3) & 15];
            sum = ways[one.length & 3](sum, act(&one));
        }
        int at = number(text, sum);
        text[at++] = ',';
        at += number(text + at, integral);
        bench_sink = sum + at;
        ++bench_rounds;
    }
}
