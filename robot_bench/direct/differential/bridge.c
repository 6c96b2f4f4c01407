/* An H-bridge over a span: for how long each combination of its pins' levels is there. bridge.py has the theory.

   Times are in ns, in integers. A wave's own time is brought within a second of what is asked first, by whole seconds,
   which are whole ticks: so products of ticks and ns fit into 64 bits for periods up to 2^33 ticks. */
#include "bridge.h"

#include <stddef.h>

#define NS_PER_S INT64_C(1000000000)
#define NEVER INT64_MAX

static int64_t floor_div(int64_t value, int64_t by)
{
    return value / by - (value % by < 0);
}

static int64_t modulo(int64_t value, int64_t by)
{
    int64_t rest = value % by;
    return rest < 0 ? rest + by : rest;
}

static int is_wave(const struct output *output)
{
    return output->period != 0;
}

/* The same wave, its beginning moved to less than a second before a time. */
static struct output near_to(struct output wave, int64_t at_ns)
{
    int64_t seconds = floor_div(at_ns - wave.ns, NS_PER_S);
    wave.ns += seconds * NS_PER_S;
    wave.at = modulo(wave.at + seconds * wave.ticks_hz, wave.period);
    return wave;
}

/* How many ticks of a wave that is near have begun at a time, from its beginning on. */
static int64_t ticks_at(const struct output *wave, int64_t at_ns)
{
    return floor_div((at_ns - wave->ns + 1) * wave->ticks_hz - 1, NS_PER_S);
}

static int64_t begin_of(const struct output *wave, int64_t tick)
{
    return wave->ns + floor_div(tick * NS_PER_S, wave->ticks_hz);
}

/* For how long a wave is high between two times, its rising edges so much later: by fractions of a tick of 10^-9 from
   the wave's own beginning on, one division at the end. */
static double high_ns(const struct output *given, int64_t begin, int64_t end, int64_t dead_ns)
{
    const struct output wave = near_to(*given, begin);
    int64_t period = wave.period * NS_PER_S, high = wave.high * NS_PER_S, dead = dead_ns * wave.ticks_hz;
    if (dead > high)
        dead = high;
    high -= dead;
    int64_t first = modulo(wave.at * NS_PER_S - dead + (begin - wave.ns) * wave.ticks_hz, period);
    int64_t whole = first + (end - begin) * wave.ticks_hz, last = whole % period;
    int64_t sum = whole / period * high + (last < high ? last : high) - (first < high ? first : high);
    return (double)sum / (double)wave.ticks_hz;
}

/* A wave's level where its rising edges come later: high now, and at every time since `dead_ns` ago. */
static int is_high(const struct output *given, int64_t at_ns, int64_t dead_ns)
{
    int64_t seen_ns = at_ns > given->ns ? at_ns : given->ns;
    struct output wave = near_to(*given, seen_ns);
    if (modulo(wave.at + ticks_at(&wave, seen_ns), wave.period) >= wave.high)
        return 0;
    wave = near_to(*given, at_ns);
    int64_t place = wave.at + ticks_at(&wave, at_ns);
    return at_ns >= begin_of(&wave, place - place % wave.period - wave.at) + dead_ns;
}

/* The first time after another at which a wave's rising edge acts, or it falls. */
static int64_t next_edge(const struct output *given, int64_t after_ns, int64_t dead_ns)
{
    struct output wave = near_to(*given, after_ns - dead_ns);
    int64_t place = wave.at + ticks_at(&wave, after_ns - dead_ns);
    int64_t rise = begin_of(&wave, place - place % wave.period + wave.period - wave.at) + dead_ns;
    wave = near_to(*given, after_ns);
    place = wave.at + ticks_at(&wave, after_ns);
    int64_t turn = place - place % wave.period, fall = turn + wave.high;
    fall = begin_of(&wave, (fall > place ? fall : fall + wave.period) - wave.at);
    return rise < fall ? rise : fall;
}

/* Add a span in which several pins have a wave, from edge to edge: whole ns of each combination, the first first. */
static void walk(const struct bridge *bridge, double *times, int64_t begin, int64_t end)
{
    int64_t found[COMBINATIONS] = {0};
    unsigned order[COMBINATIONS], combinations = 0;
    while (begin < end) {
        int64_t next = end;
        unsigned levels = 0;
        for (int64_t pin = 0; pin < bridge->pins; ++pin) {
            const struct output *now = &bridge->now[pin];
            int level = is_wave(now) ? is_high(now, begin, bridge->dead_ns) : now->high != 0;
            levels |= (unsigned)level << pin;
            int64_t edge = is_wave(now) ? next_edge(now, begin, bridge->dead_ns) : NEVER;
            next = edge < next ? edge : next;
        }
        if (!found[levels])
            order[combinations++] = levels;
        found[levels] += next - begin;
        begin = next;
    }
    for (unsigned i = 0; i < combinations; ++i)
        times[bridge->does[order[i]]] += (double)found[order[i]];
}

/* Add a span in which no pin changes what it does. */
static void add(const struct bridge *bridge, double *times, int64_t begin, int64_t end)
{
    unsigned levels = 0, waves = 0;
    int64_t waving = 0;
    if (begin == end)
        return;
    for (int64_t pin = 0; pin < bridge->pins; ++pin) {
        if (is_wave(&bridge->now[pin])) {
            ++waves;
            waving = pin;
        } else if (bridge->now[pin].high) {
            levels |= 1u << pin;
        }
    }
    if (waves > 1) {
        walk(bridge, times, begin, end);
    } else if (waves == 1) {
        double high = high_ns(&bridge->now[waving], begin, end, bridge->dead_ns);
        times[bridge->does[levels | 1u << waving]] += high;
        times[bridge->does[levels]] += (double)(end - begin) - high;
    } else {
        times[bridge->does[levels]] += (double)(end - begin);
    }
}

/* Take a span with its changes, the earliest first, and work out the shares; return whether each wave has whole
   periods in it. */
int bridge_pass(struct bridge *bridge, const struct change *changes, size_t count, int64_t begin, int64_t end)
{
    double times[ACTIONS] = {0};
    int64_t last = begin, span = end - begin;
    for (size_t i = 0; i < count; ++i) {
        add(bridge, times, last, changes[i].from_ns);
        last = changes[i].from_ns;
        bridge->now[changes[i].pin] = changes[i].output;
    }
    add(bridge, times, last, end);
    for (int does = FORWARD; does < OFF; ++does)
        bridge->shares[does] = times[does] / (double)span;
    for (int64_t pin = 0; pin < bridge->pins; ++pin) {
        const struct output *now = &bridge->now[pin];
        if (is_wave(now) && span * now->ticks_hz % (now->period * NS_PER_S))
            return 0;
    }
    return 1;
}
