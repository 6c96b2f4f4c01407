/* The functions that GCC may call in any program, even a freestanding one. */
#include <stddef.h>

void *memcpy(void *restrict to, const void *restrict from, size_t count);
void *memset(void *to, int value, size_t count);

void *memcpy(void *restrict to, const void *restrict from, size_t count)
{
    unsigned char *out = to;
    const unsigned char *in = from;
    while (count-- > 0) {
        *out++ = *in++;
    }
    return to;
}

void *memset(void *to, int value, size_t count)
{
    unsigned char *out = to;
    while (count-- > 0) {
        *out++ = (unsigned char)value;
    }
    return to;
}
