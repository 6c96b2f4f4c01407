/* Subscribers: the rows that each has waiting, and the edges of waves among them, which are made in bulk.
 *
 * Invariant: the rows of a subscriber are in order of time; of a wave that it gets the edges of, those up to `expanded_ns`.
 */
#include <stdlib.h>

#include "fabric.h"
#include "waves.h"

enum { EDGE_ROW, WAVE_ROW };
/* Room for rows at first. */
enum { FIRST_ROOM = 256 };

/* Returns false without memory for them. */
RARELY bool make_room(struct fabric *fabric, struct subscriber *subscriber, uint32_t count)
{
    while (subscriber->count + count > subscriber->room) {
        const size_t room = subscriber->room ? 2 * subscriber->room : FIRST_ROOM;
        struct edge *rows = realloc(subscriber->rows, room * sizeof *rows);
        if (rows == NULL) {
            fabric->calls.no_memory();
            return false;
        }
        subscriber->rows = rows;
        subscriber->room = room;
    }
    return true;
}

bool wants(const struct subscriber *subscriber, const struct shown *shown, uint32_t pin)
{
    const uint32_t bit = 1u << pin % PINS;
    return (subscriber->drive[pin / PINS] & bit && shown->drive[0] != shown->drive[1]) ||
           (subscriber->wire[pin / PINS] & bit && shown->wire[0] != shown->wire[1]);
}

bool has_subscribed(const struct subscriber *subscriber, uint32_t pin)
{
    return (subscriber->drive[pin / PINS] | subscriber->wire[pin / PINS]) >> pin % PINS & 1;
}

void expand(struct fabric *fabric, struct subscriber *subscriber, uint32_t pin, uint64_t ns)
{
    const struct shown *shown = &fabric->shown[pin];
    if (!subscriber->expanded_count) {
        subscriber->expanded_ns = ns;
    }
    struct expanded *one = &subscriber->expanded[subscriber->expanded_count++];
    const uint64_t tick = wave_tick(&shown->wave, ns);
    one->pin = (uint8_t)pin;
    one->level = position(&shown->wave, tick) < shown->wave.high;
    one->tick = next_edge(&shown->wave, tick);
    one->next_ns = wave_ns(&shown->wave, one->tick);
}

static RARELY void make_rows(struct fabric *fabric, struct subscriber *subscriber, uint64_t until_ns)
{
    for (;;) {
        struct expanded *first = &subscriber->expanded[0];
        for (uint32_t n = 1; n < subscriber->expanded_count; ++n) {
            struct expanded *one = &subscriber->expanded[n];
            if (one->next_ns < first->next_ns || (one->next_ns == first->next_ns && one->pin < first->pin)) {
                first = one;
            }
        }
        if (first->next_ns > until_ns) {
            break;
        }
        const struct shown *shown = &fabric->shown[first->pin];
        const struct wave *wave = &shown->wave;
        first->level ^= 1;
        const struct edge row = {.ns = first->next_ns, .pin = first->pin, .drive = shown->drive[first->level],
                                 .wire = shown->wire[first->level]};
        first->tick += first->level ? wave->high : wave->period - wave->high;
        first->next_ns = wave_ns(wave, first->tick);
        put_row(fabric, subscriber, &row);
    }
    if (subscriber->expanded_ns < until_ns) {
        subscriber->expanded_ns = until_ns;
    }
}

void expand_waves(struct fabric *fabric, struct subscriber *subscriber, uint64_t until_ns)
{
    if (UNLIKELY(subscriber->expanded_count)) {
        make_rows(fabric, subscriber, until_ns);
    }
}

void expand_all(struct fabric *fabric, uint64_t ns)
{
    for (uint32_t n = 0; n < fabric->subscribers_end; ++n) {
        expand_waves(fabric, &fabric->subscribers[n], ns);
    }
}

bool stop_expanding(struct subscriber *subscriber, uint32_t pin)
{
    for (uint32_t n = 0; n < subscriber->expanded_count; ++n) {
        if (subscriber->expanded[n].pin == pin) {
            const bool level = subscriber->expanded[n].level;
            subscriber->expanded[n] = subscriber->expanded[--subscriber->expanded_count];
            return level;
        }
    }
    return false;
}

void put_wave(struct fabric *fabric, struct subscriber *subscriber, uint32_t pin, uint64_t ns)
{
    const struct shown *shown = &fabric->shown[pin];
    struct edge rows[1 + sizeof shown->wave / sizeof(struct edge)];
    rows[0] = (struct edge){.ns = ns, .pin = (uint8_t)pin, .drive = (uint8_t)(shown->drive[0] | shown->drive[1] << 4),
                              .wire = (uint8_t)(shown->wire[0] | shown->wire[1] << 4), .kind = WAVE_ROW};
    memcpy(&rows[1], &shown->wave, sizeof shown->wave);
    put_rows(fabric, subscriber, rows, sizeof rows / sizeof *rows);
}

/* The rows of a subscriber, which has them then: they stand until the chip goes on. */
const struct edge *fabric_take_rows(struct fabric *fabric, uint32_t number)
{
    fabric->subscribers[number].count = 0;
    return fabric->subscribers[number].rows;
}
