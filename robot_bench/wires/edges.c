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

/* Merge tracks into at most `most` edges as variable-length integers of (ns since the edge before) * wires + wire. */
size_t edges_pack(size_t wires, const int64_t *const *times, const size_t *counts, size_t *at, size_t most,
                  uint8_t *out, size_t *edges, int64_t *first)
{
    uint8_t *to = out;
    size_t done = 0;
    int64_t last = 0;
    while (done < most) {
        size_t next = wires;
        for (size_t wire = 0; wire < wires; ++wire)
            if (at[wire] < counts[wire] && (next == wires || times[wire][at[wire]] < times[next][at[next]]))
                next = wire;
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
