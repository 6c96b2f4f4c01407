/* Integer arithmetic that the compiler calls by name; its own library comes without it on this target.
 *
 * Slow and plain, a bit at a time: only the self-test runs on it. The names and
 * meanings are those of GCC's libgcc manual ("Routines for integer arithmetic"). */
#include <stdint.h>

uint64_t __umulsidi3(uint32_t one, uint32_t other);
int64_t __muldi3(int64_t one, int64_t other);
uint64_t __udivmoddi4(uint64_t numerator, uint64_t denominator, uint64_t *rest);
uint64_t __udivdi3(uint64_t numerator, uint64_t denominator);
uint64_t __umoddi3(uint64_t numerator, uint64_t denominator);
int64_t __divdi3(int64_t numerator, int64_t denominator);
int64_t __moddi3(int64_t numerator, int64_t denominator);
uint32_t __udivsi3(uint32_t numerator, uint32_t denominator);
uint32_t __umodsi3(uint32_t numerator, uint32_t denominator);
int32_t __divsi3(int32_t numerator, int32_t denominator);
int32_t __modsi3(int32_t numerator, int32_t denominator);

uint64_t __umulsidi3(uint32_t one, uint32_t other)
{
    uint64_t sum = 0, shifted = one;
    for (; other != 0; other >>= 1, shifted <<= 1) {
        if (other & 1u) {
            sum += shifted;
        }
    }
    return sum;
}

int64_t __muldi3(int64_t one, int64_t other)
{
    uint64_t sum = 0, shifted = (uint64_t)one, factor = (uint64_t)other;
    for (; factor != 0; factor >>= 1, shifted <<= 1) {
        if (factor & 1u) {
            sum += shifted;
        }
    }
    return (int64_t)sum;
}

uint64_t __udivmoddi4(uint64_t numerator, uint64_t denominator, uint64_t *rest)
{
    uint64_t quotient = 0, left = 0;
    for (int bit = 63; bit >= 0; --bit) {
        left = left << 1 | (numerator >> 63);
        numerator <<= 1;
        quotient <<= 1;
        if (left >= denominator) {
            left -= denominator;
            quotient |= 1u;
        }
    }
    if (rest != 0) {
        *rest = left;
    }
    return quotient;
}

uint64_t __udivdi3(uint64_t numerator, uint64_t denominator) { return __udivmoddi4(numerator, denominator, 0); }

uint64_t __umoddi3(uint64_t numerator, uint64_t denominator)
{
    uint64_t rest;
    (void)__udivmoddi4(numerator, denominator, &rest);
    return rest;
}

static uint64_t size_of(int64_t value) { return value < 0 ? 0u - (uint64_t)value : (uint64_t)value; }

int64_t __divdi3(int64_t numerator, int64_t denominator)
{
    uint64_t quotient = __udivmoddi4(size_of(numerator), size_of(denominator), 0);
    return (numerator < 0) != (denominator < 0) ? (int64_t)(0u - quotient) : (int64_t)quotient;
}

int64_t __moddi3(int64_t numerator, int64_t denominator)
{
    uint64_t rest;
    (void)__udivmoddi4(size_of(numerator), size_of(denominator), &rest);
    return numerator < 0 ? (int64_t)(0u - rest) : (int64_t)rest;
}

uint32_t __udivsi3(uint32_t numerator, uint32_t denominator) { return (uint32_t)__udivdi3(numerator, denominator); }
uint32_t __umodsi3(uint32_t numerator, uint32_t denominator) { return (uint32_t)__umoddi3(numerator, denominator); }
int32_t __divsi3(int32_t numerator, int32_t denominator) { return (int32_t)__divdi3(numerator, denominator); }
int32_t __modsi3(int32_t numerator, int32_t denominator) { return (int32_t)__moddi3(numerator, denominator); }
