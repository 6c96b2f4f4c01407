/* Characters that a USART sends one after the other: their ends, without Python.
 *
 * Python hands a transmission over before a run, where no listener needs each
 * character at its time, and takes it back with what was sent before it looks
 * at anything (`native/streams.py`). Source: RM0008 27.3.2.
 */
#include "core.h"
#include "usart.h"

struct stream *core_stream(struct core *core, uint32_t number) { return &core->streams[number]; }

/* Works out when the present character ends, and the first cycle from then on. */
static void schedule(struct core *core, struct stream *stream)
{
    const struct time_base *time = &core->time;
    const uint32_t baud = stream->words[BRR];
    stream->due_ns = stream->base_ns +
                     (uint64_t)((__uint128_t)stream->half_bits * baud * NS_PER_S / (2 * (uint64_t)stream->clock_hz));
    const __uint128_t cycles = (__uint128_t)(stream->due_ns - time->base_ns) * time->frequency_hz;
    stream->due_cycle = time->base_cycle + (uint64_t)((cycles + NS_PER_S - 1) / NS_PER_S);
}

static void find_next(struct core *core)
{
    core->stream_next = NO_TIME;
    for (uint32_t n = 0; n < STREAMS; ++n) {
        if (core->streams[n].due_cycle < core->stream_next) {
            core->stream_next = core->streams[n].due_cycle;
        }
    }
}

/* Goes on with the transmissions that Python has filled in, those with `half_bits`. */
void core_start_streams(struct core *core, uint32_t frequency_hz, uint64_t base_ns, uint64_t base_cycle)
{
    core->time = (struct time_base){base_ns, base_cycle, frequency_hz};
    for (uint32_t n = 0; n < STREAMS; ++n) {
        core->streams[n].sent_count = 0;
        core->streams[n].due_cycle = NO_TIME;
        if (core->streams[n].half_bits) {
            schedule(core, &core->streams[n]);
        }
    }
    find_next(core);
    core->shared.dirty |= STREAMS_DIRTY;
}

/* Python has them back. */
void core_stop_streams(struct core *core)
{
    for (uint32_t n = 0; n < STREAMS; ++n) {
        core->streams[n].half_bits = 0;
        core->streams[n].due_cycle = NO_TIME;
    }
    core->stream_next = NO_TIME;
}

static void raise_line(struct core *core, uint32_t irq)
{
    const uint64_t line = UINT64_C(1) << irq;
    if (!(core->shared.levels & line)) {
        core->shared.levels |= line;
        pend(core, irq + FIRST_IRQ);
    }
}

static void end_character(struct core *core, struct stream *stream)
{
    uint32_t *words = stream->words;
    if (words[SHIFT] & HELD) {
        stream->sent[stream->sent_count++] = (struct sent){stream->due_ns, words[SHIFT] & WORD, 0};
        if (stream->sent_count == SENT) {
            core->shared.attention = 1;
        }
    }
    words[SHIFT] = words[TDR];
    words[TDR] = 0;
    if (words[SHIFT]) {
        words[SR] |= TXE;
        stream->half_bits += stream->frame_half_bits;
        schedule(core, stream);
    } else {
        words[SR] |= TC;
        stream->due_cycle = NO_TIME;
    }
    if (words[SR] & words[CR1] & ASKING) {
        raise_line(core, stream->irq);
    }
}

/* Ends the characters whose time has come. */
void end_characters(struct core *core)
{
    for (uint32_t n = 0; n < STREAMS; ++n) {
        while (core->shared.cycle >= core->streams[n].due_cycle && core->streams[n].sent_count < SENT) {
            end_character(core, &core->streams[n]);
        }
    }
    find_next(core);
}
