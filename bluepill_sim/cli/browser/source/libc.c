/* The standard library of a machine without a system: memory, and arithmetic of 128 bits that the compiler asks for.
 *
 * Source: C11 7.22.3 and 7.24; the names of the arithmetic are those of GCC's run-time library.
 * Invariant: a free piece of memory is in the list of its size; pieces are never joined, since the emulator asks for
 * the same sizes over and over.
 */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

/* Sizes of pieces are powers of 2 from the first on; a piece has its number in front. */
enum { FIRST_BITS = 5, SIZES = 27, HEAD = 16, PAGE = 65536 };

struct piece {
    uint32_t number;
    struct piece *next;
};

static struct piece *free_pieces[SIZES];
extern uint8_t __heap_base;
static uintptr_t heap_at;

static struct piece *new_piece(uint32_t number)
{
    const uintptr_t bytes = (uintptr_t)1 << (FIRST_BITS + number);
    const uintptr_t first = heap_at ? heap_at : ((uintptr_t)&__heap_base + HEAD - 1) / HEAD * HEAD;
    const uintptr_t have = (uintptr_t)__builtin_wasm_memory_size(0) * PAGE;
    if (first + bytes > have && __builtin_wasm_memory_grow(0, (first + bytes - have + PAGE - 1) / PAGE) == SIZE_MAX) {
        return NULL;
    }
    heap_at = first + bytes;
    return (struct piece *)first;
}

void *malloc(size_t bytes)
{
    uint32_t number = 0;
    while (((size_t)1 << (FIRST_BITS + number)) < bytes + HEAD) {
        if (++number == SIZES) {
            return NULL;
        }
    }
    struct piece *piece = free_pieces[number];
    if (piece != NULL) {
        free_pieces[number] = piece->next;
    } else if ((piece = new_piece(number)) == NULL) {
        return NULL;
    }
    piece->number = number;
    return (uint8_t *)piece + HEAD;
}

void free(void *at)
{
    if (at != NULL) {
        struct piece *piece = (struct piece *)((uint8_t *)at - HEAD);
        piece->next = free_pieces[piece->number];
        free_pieces[piece->number] = piece;
    }
}

void *calloc(size_t count, size_t bytes)
{
    void *at = bytes && count > SIZE_MAX / bytes ? NULL : malloc(count * bytes);
    return at == NULL ? NULL : memset(at, 0, count * bytes);
}

void *realloc(void *at, size_t bytes)
{
    const size_t room = at == NULL ? 0 : ((size_t)1 << (FIRST_BITS + ((struct piece *)((uint8_t *)at - HEAD))->number)) - HEAD;
    if (at != NULL && bytes <= room) {
        return at;
    }
    void *to = malloc(bytes);
    if (to != NULL && at != NULL) {
        memcpy(to, at, room);
        free(at);
    }
    return to;
}

void *memcpy(void *to, const void *from, size_t bytes) { return memmove(to, from, bytes); }

/* `-mbulk-memory` makes an instruction of each of these two. */
void *memmove(void *to, const void *from, size_t bytes)
{
    __builtin_memmove(to, from, bytes);
    return to;
}

void *memset(void *to, int value, size_t bytes)
{
    __builtin_memset(to, value, bytes);
    return to;
}

void *memchr(const void *at, int value, size_t bytes)
{
    for (const uint8_t *byte = at; bytes; --bytes, ++byte) {
        if (*byte == (uint8_t)value) {
            return (void *)(uintptr_t)byte;
        }
    }
    return NULL;
}

int memcmp(const void *one, const void *other, size_t bytes)
{
    const uint8_t *a = one, *b = other;
    for (; bytes >= sizeof(uint64_t); bytes -= sizeof(uint64_t), a += sizeof(uint64_t), b += sizeof(uint64_t)) {
        uint64_t x, y;
        __builtin_memcpy(&x, a, sizeof x);
        __builtin_memcpy(&y, b, sizeof y);
        if (x != y) {
            break;
        }
    }
    for (; bytes; --bytes, ++a, ++b) {
        if (*a != *b) {
            return *a < *b ? -1 : 1;
        }
    }
    return 0;
}

int strcmp(const char *one, const char *other)
{
    for (; *one && *one == *other; ++one, ++other) {
    }
    return (int)(uint8_t)*one - (int)(uint8_t)*other;
}

typedef unsigned __int128 wide;

wide __multi3(wide one, wide other);
wide __udivti3(wide value, wide divisor);

static wide joined(uint64_t high, uint64_t low)
{
    union {
        uint64_t halves[2];
        wide whole;
    } made = {{low, high}};
    return made.whole;
}

static uint64_t half(wide value, uint32_t number)
{
    const union {
        wide whole;
        uint64_t halves[2];
    } taken = {value};
    return taken.halves[number];
}

/* One times other, modulo 2^128. */
wide __multi3(wide one, wide other)
{
    const uint64_t a = half(one, 0), b = half(other, 0);
    const uint64_t al = a & UINT32_MAX, ah = a >> 32, bl = b & UINT32_MAX, bh = b >> 32;
    const uint64_t low = al * bl, middle = ah * bl + (low >> 32), rest = al * bh + (middle & UINT32_MAX);
    return joined(ah * bh + (middle >> 32) + (rest >> 32) + half(one, 1) * b + a * half(other, 1),
                  rest << 32 | (low & UINT32_MAX));
}

/* A value divided by another, a bit at a time: it is asked for seldom. */
wide __udivti3(wide value, wide divisor)
{
    uint64_t high = half(value, 1), low = half(value, 0), rest_high = 0, rest_low = 0;
    const uint64_t by_high = half(divisor, 1), by_low = half(divisor, 0);
    if (!high && !by_high) {
        return joined(0, low / by_low);
    }
    for (uint32_t n = 0; n < 128; ++n) {
        const uint64_t over = rest_high >> 63;
        rest_high = rest_high << 1 | rest_low >> 63;
        rest_low = rest_low << 1 | high >> 63;
        high = high << 1 | low >> 63;
        low <<= 1;
        if (over || rest_high > by_high || (rest_high == by_high && rest_low >= by_low)) {
            rest_high -= by_high + (rest_low < by_low);
            rest_low -= by_low;
            low |= 1;
        }
    }
    return joined(high, low);
}
