/* What a wave is at a time: its ticks, its level, its next edge. `waves.c` has the theory of operation. */
#ifndef BLUEPILL_WAVES_H
#define BLUEPILL_WAVES_H

#include "fabric.h"

static inline struct ticks ticks_of(const struct wave *wave) { return (struct ticks){.ns = wave->ns, .hz = wave->hz}; }

static inline uint64_t wave_tick(const struct wave *wave, uint64_t ns)
{
    const struct ticks ticks = ticks_of(wave);
    return tick_at(&ticks, ns);
}

static inline uint64_t wave_ns(const struct wave *wave, uint64_t tick)
{
    const struct ticks ticks = ticks_of(wave);
    return ns_of_tick(&ticks, tick);
}

static inline uint64_t position(const struct wave *wave, uint64_t tick) { return (wave->at + tick) % wave->period; }

static inline bool wave_level(const struct wave *wave, uint64_t ns) { return position(wave, wave_tick(wave, ns)) < wave->high; }

/* The tick of the first edge after a tick. */
static inline uint64_t next_edge(const struct wave *wave, uint64_t tick)
{
    const uint64_t at = position(wave, tick);
    return tick + (at < wave->high ? wave->high : wave->period) - at;
}

static inline uint64_t next_edge_ns(const struct wave *wave, uint64_t ns)
{
    return wave_ns(wave, next_edge(wave, wave_tick(wave, ns)));
}

#endif
