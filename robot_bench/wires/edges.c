/* Edges of wires in bulk: rows of the chip to one track a wire, tracks to the trace's blocks, and back.

   What each function does stands in edges.py, whose Python version gives the same results. Nothing here allocates or
   keeps anything; every buffer is the caller's and is as long as edges.py says. */
#include <stddef.h>
#include <stdint.h>
#include <string.h>

enum { ROW_BYTES = 16, PIN_AT = 8, DRIVE_AT = 9, NO_WIRE = 255, MOST_BITS = 63 };

/* Make of how many there are of each wire where each one begins. */
static void begin(size_t *starts, size_t wires)
{
    size_t sum = 0;
    for (size_t wire = 0; wire <= wires; ++wire) {
        size_t of_wire = starts[wire];
        starts[wire] = sum;
        sum += of_wire;
    }
}

/* Sort rows by wire, each wire's in their order: starts[w] to starts[w + 1] are those of wire w. */
void edges_split(const uint8_t *rows, size_t count, const uint8_t *wire_of_pin, const uint8_t *code_of_drive,
                 size_t wires, int64_t *times, uint8_t *codes, size_t *starts)
{
    memset(starts, 0, (wires + 1) * sizeof *starts);
    for (size_t i = 0; i < count; ++i) {
        uint8_t wire = wire_of_pin[rows[i * ROW_BYTES + PIN_AT]];
        if (wire != NO_WIRE)
            ++starts[wire];
    }
    begin(starts, wires);
    for (size_t i = 0; i < count; ++i) {
        const uint8_t *row = rows + i * ROW_BYTES;
        uint8_t wire = wire_of_pin[row[PIN_AT]];
        if (wire == NO_WIRE)
            continue;
        size_t at = starts[wire]++;
        memcpy(times + at, row, sizeof *times);
        codes[at] = code_of_drive[row[DRIVE_AT]];
    }
    memmove(starts + 1, starts, wires * sizeof *starts);
    starts[0] = 0;
}

/* Keep, in place, the last level of each instant where it differs from the level before; return how many. */
size_t edges_changes(int64_t *times, uint8_t *levels, size_t count, uint8_t level)
{
    size_t kept = 0;
    for (size_t i = 0; i < count; ++i) {
        if (i + 1 < count && times[i + 1] == times[i])
            continue;
        if (levels[i] != level) {
            level = levels[i];
            times[kept] = times[i];
            levels[kept++] = level;
        }
    }
    return kept;
}

/* The wire whose next edge comes first, the first of those of one instant; `wires` for none. */
static size_t earliest(size_t wires, const int64_t *const *times, const size_t *counts, const size_t *at)
{
    size_t next = wires;
    for (size_t wire = 0; wire < wires; ++wire)
        if (at[wire] < counts[wire] && (next == wires || times[wire][at[wire]] < times[next][at[next]]))
            next = wire;
    return next;
}

/* Merge tracks into at most `most` edges as variable-length integers of (ns since the edge before) * wires + wire. */
size_t edges_pack(size_t wires, const int64_t *const *times, const size_t *counts, size_t *at, size_t most,
                  uint8_t *out, size_t *edges, int64_t *first)
{
    uint8_t *to = out;
    size_t done = 0;
    int64_t last = 0;
    while (done < most) {
        size_t next = earliest(wires, times, counts, at);
        if (next == wires)
            break;
        int64_t now = times[next][at[next]++];
        if (done++ == 0)
            last = *first = now;
        uint64_t value = (uint64_t)(now - last) * wires + next;
        last = now;
        for (; value > 127; value >>= 7)
            *to++ = (uint8_t)(value | 128);
        *to++ = (uint8_t)value;
    }
    *edges = done;
    return (size_t)(to - out);
}

/* Read one number of a block at *i, which goes on; return whether it is whole. */
static int number(const uint8_t *data, size_t bytes, size_t *i, uint64_t *value)
{
    *value = 0;
    for (unsigned shift = 0; *i < bytes && shift < MOST_BITS; shift += 7) {
        uint8_t byte = data[(*i)++];
        *value |= (uint64_t)(byte & 127) << shift;
        if (byte < 128)
            return 1;
    }
    return 0;
}

/* Sort a block's edges by wire: starts[w] to starts[w + 1] of `times` are those of wire w. `times` has room for one
   edge a byte. Return 0 where the block is damaged. */
int edges_unpack(const uint8_t *data, size_t bytes, size_t wires, int64_t first, int64_t *times, size_t *starts)
{
    uint64_t value, now = (uint64_t)first;
    memset(starts, 0, (wires + 1) * sizeof *starts);
    for (size_t i = 0; i < bytes;) {
        if (!number(data, bytes, &i, &value))
            return 0;
        now += value / wires;
        if (now > INT64_MAX)
            return 0;
        ++starts[value % wires];
    }
    begin(starts, wires);
    now = (uint64_t)first;
    for (size_t i = 0; i < bytes;) {
        number(data, bytes, &i, &value);
        now += value / wires;
        times[starts[value % wires]++] = (int64_t)now;
    }
    memmove(starts + 1, starts, wires * sizeof *starts);
    starts[0] = 0;
    return 1;
}

/* Take wires as the bits of a code, the first as bit 0; return how many changes of the code there are. */
size_t edges_codes(size_t wires, const int64_t *const *times, const uint8_t *const *levels, const size_t *counts,
                   size_t *at, int64_t *out_times, uint8_t *out_codes)
{
    size_t found = 0, next;
    uint8_t code = 0;
    while ((next = earliest(wires, times, counts, at)) < wires) {
        int64_t now = times[next][at[next]];
        uint8_t bit = (uint8_t)(1u << next);
        code = levels[next][at[next]++] ? code | bit : code & (uint8_t)~bit;
        if (found && out_times[found - 1] == now)
            --found;
        if (!found || out_codes[found - 1] != code) {
            out_times[found] = now;
            out_codes[found++] = code;
        }
    }
    return found;
}

static uint8_t *put_number(uint8_t *to, uint64_t value)
{
    uint8_t digits[20];
    size_t count = 0;
    do {
        digits[count++] = (uint8_t)('0' + value % 10);
        value /= 10;
    } while (value);
    while (count)
        *to++ = digits[--count];
    return to;
}

enum { LONGEST_CHANGE = 40 };

/* Write changes as a value change dump has them, as many as there is room for; return the bytes. `now` goes on. */
size_t edges_vcd(size_t wires, const int64_t *const *times, const uint8_t *const *levels, const size_t *counts,
                 size_t *at, const char *const *codes, int64_t *now, uint8_t *out, size_t room)
{
    uint8_t *to = out;
    size_t next;
    while ((size_t)(to - out) + LONGEST_CHANGE <= room && (next = earliest(wires, times, counts, at)) < wires) {
        int64_t when = times[next][at[next]];
        if (when != *now) {
            *now = when;
            *to++ = '#';
            to = put_number(to, (uint64_t)when);
            *to++ = '\n';
        }
        *to++ = (uint8_t)('0' + levels[next][at[next]++]);
        for (const char *code = codes[next]; *code; ++code)
            *to++ = (uint8_t)*code;
        *to++ = '\n';
    }
    return (size_t)(to - out);
}

/* Write `count` samples of all wires from sample `first` on, `unit` bytes each, the first wire as bit 0; `bits` goes on.
   A sample at k * 10^9 / rate_hz ns sees the edges up to and at it. */
void edges_samples(size_t wires, const int64_t *const *times, const uint8_t *const *levels, const size_t *counts,
                   size_t *at, uint64_t *bits, int64_t first, size_t count, int64_t rate_hz, size_t unit, uint8_t *out)
{
    const int64_t period_ns = 1000000000 / rate_hz, end = first + (int64_t)count;
    for (int64_t sample = first;;) {
        const size_t next = earliest(wires, times, counts, at);
        const int64_t seen = next == wires ? end : (times[next][at[next]] + period_ns - 1) / period_ns;
        for (; sample < seen && sample < end; ++sample)
            for (size_t byte = 0; byte < unit; ++byte)
                *out++ = (uint8_t)(*bits >> 8 * byte);
        if (sample == end)
            return; /* the edge belongs to the samples that come then */
        const uint64_t bit = (uint64_t)1 << next;
        *bits = levels[next][at[next]++] ? *bits | bit : *bits & ~bit;
    }
}
