/* A log of edges in order of time, and its text as the body of a value change dump.
 *
 * Signals have numbers in the order in which a person reads them; a row that
 * comes late is put where it belongs, behind those of its time and number.
 * Source: IEEE 1364-2005, chapter 18 (four-state VCD).
 */
#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include "fabric.h"

#define SIGNALS 256

struct logged {
    uint64_t ns;
    uint32_t signal;
    uint32_t value;
};

struct edge_log {
    struct logged *rows;
    size_t count, room;
};

struct edge_log *edge_log_new(void) { return calloc(1, sizeof(struct edge_log)); }

void edge_log_free(struct edge_log *log)
{
    free(log->rows);
    free(log);
}

size_t edge_log_count(const struct edge_log *log) { return log->count; }

const struct logged *edge_log_rows(const struct edge_log *log) { return log->rows; }

/* Sets the flag of each signal that has a row. */
void edge_log_used(const struct edge_log *log, uint8_t *flags)
{
    for (size_t n = 0; n < log->count; ++n) {
        flags[log->rows[n].signal % SIGNALS] = 1;
    }
}

static bool comes_after(const struct logged *one, const struct logged *other)
{
    return one->ns > other->ns || (one->ns == other->ns && one->signal > other->signal);
}

/* Returns false without memory for it. */
bool edge_log_put(struct edge_log *log, uint64_t ns, uint32_t signal, uint32_t value)
{
    if (log->count == log->room) {
        const size_t room = log->room ? 2 * log->room : 4096;
        struct logged *rows = realloc(log->rows, room * sizeof *rows);
        if (rows == NULL) {
            return false;
        }
        log->rows = rows;
        log->room = room;
    }
    const struct logged edge = {ns, signal, value};
    size_t at = log->count++;
    while (at > 0 && comes_after(&log->rows[at - 1], &edge)) {
        log->rows[at] = log->rows[at - 1];
        --at;
    }
    log->rows[at] = edge;
    return true;
}

/* Takes rows of a subscription over; `signals` has the number of each pin's and line's signal, `last` its value.
 * Returns false without memory for it. */
bool edge_log_take(struct edge_log *log, const struct edge *rows, size_t count, const uint8_t *signals, uint8_t *last)
{
    for (size_t n = 0; n < count; ++n) {
        const uint32_t signal = signals[rows[n].pin];
        if (rows[n].wire != last[signal]) {
            last[signal] = rows[n].wire;
            if (!edge_log_put(log, rows[n].ns, signal, rows[n].wire)) {
                return false;
            }
        }
    }
    return true;
}

static char *put_number(char *to, uint64_t number)
{
    char digits[20];
    int count = 0;
    do {
        digits[count++] = (char)('0' + number % 10);
        number /= 10;
    } while (number);
    while (count) {
        *to++ = digits[--count];
    }
    return to;
}

static char *put_text(char *to, const char *text)
{
    while (*text) {
        *to++ = *text++;
    }
    return to;
}

/* `b101`, without leading zeros. */
static char *put_word(char *to, uint32_t word)
{
    *to++ = 'b';
    for (int bit = word ? 31 - __builtin_clz(word) : 0; bit >= 0; --bit) {
        *to++ = (char)('0' + (word >> bit & 1));
    }
    return to;
}

/* Appends the changes to a file that holds the head of the dump; returns 0 or an error number.
 *
 * `codes` has the identifier of each signal; those from `first_word` on are words. */
int edge_log_write(const struct edge_log *log, const char *path, const char *const *codes, uint32_t first_word,
                   uint64_t start_ns, uint64_t end_ns)
{
    static const char letters[] = {[LOW] = '0', [HIGH] = '1', [FLOATING] = 'z'};
    FILE *file = fopen(path, "ab");
    if (file == NULL) {
        return errno;
    }
    uint64_t now = start_ns;
    char line[80];
    for (size_t n = 0; n < log->count; ++n) {
        const struct logged *edge = &log->rows[n];
        char *to = line;
        if (edge->ns > now) {
            now = edge->ns;
            *to++ = '#';
            to = put_number(to, now);
            *to++ = '\n';
        }
        if (edge->signal >= first_word) {
            to = put_word(to, edge->value);
            *to++ = ' ';
        } else {
            *to++ = letters[edge->value];
        }
        to = put_text(to, codes[edge->signal]);
        *to++ = '\n';
        if (fwrite(line, 1, (size_t)(to - line), file) != (size_t)(to - line)) {
            break;
        }
    }
    if (end_ns > now) {
        fprintf(file, "#%" PRIu64 "\n", end_ns);
    }
    const int failed = ferror(file) ? errno : 0;
    return fclose(file) != 0 && !failed ? errno : failed;
}
