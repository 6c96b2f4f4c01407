/* Offers: the level or the wave that an alternate function has for a pin, and which of several the pin takes.
 *
 * Invariant: of the functions that offer something on a pin, the one with the lowest number drives it.
 */
#include <string.h>

#include "fabric.h"
#include "waves.h"

static void take_offer(struct fabric *fabric, uint32_t pin, uint32_t source, uint32_t level)
{
    struct port *port = &fabric->ports[pin / PINS];
    const uint32_t at = pin % PINS, bit = 1u << at;
    const uint64_t mask = UINT64_C(1) << source;
    port->sources[at] = level == FLOATING ? port->sources[at] & ~mask : port->sources[at] | mask;
    port->source_levels[at] = level == HIGH ? port->source_levels[at] | mask : port->source_levels[at] & ~mask;
    const uint64_t first = port->sources[at] & -port->sources[at];
    port->offered = first ? port->offered | bit : port->offered & ~bit;
    port->offered_high = port->source_levels[at] & first ? port->offered_high | bit : port->offered_high & ~bit;
    const struct wave *wave = first ? &fabric->waves[__builtin_ctzll(first)] : NULL;
    port->waving = wave != NULL && wave->period && wave->pin == pin ? port->waving | bit : port->waving & ~bit;
    sample_waves(fabric, port, port->waving & bit, now_ns(fabric));
    pins_changed(fabric, pin / PINS);
}

void offer(struct fabric *fabric, uint32_t pin, uint32_t source, uint32_t level)
{
    if (fabric->waves[source].pin == pin) {
        fabric->waves[source].period = 0;
    }
    take_offer(fabric, pin, source, level);
}

void fabric_offer(struct fabric *fabric, uint32_t pin, uint32_t source, uint32_t level)
{
    offer(fabric, pin, source, level);
}

/* Has a pin that shows a wave, and goes on showing it, follow what has become of that; false: more than it may change. */
static bool follow_wave(struct fabric *fabric, uint32_t pin, uint32_t source, bool level, uint64_t now)
{
    struct port *port = &fabric->ports[pin / PINS];
    struct shown *shown = &fabric->shown[pin];
    const struct wave *wave = &fabric->waves[source];
    const uint32_t at = pin % PINS, bit = 1u << at;
    const uint64_t mask = UINT64_C(1) << source;
    if (!(port->shown & bit) || !shown->is_wave || shown->is_made || (port->sources[at] & -port->sources[at]) != mask ||
        (port->fighting | port->shorted) & bit || fabric->ahead.device != NULL) {
        return false;
    }
    port->source_levels[at] = level ? port->source_levels[at] | mask : port->source_levels[at] & ~mask;
    if (!(port->offered_high & bit) == level) {
        const uint32_t fighting = port->fighting & port->shown, shorted = port->shorted & port->shown;
        port->offered_high ^= bit;
        work_out(port);
        port->fighting |= fighting;
        port->shorted |= shorted;
    }
    if (shown->wave.high == wave->high && shown->wave.at == wave->at && memcmp(&shown->wave, wave, sizeof *wave) == 0) {
        return true;
    }
    note_output(fabric);
    expand_all(fabric, now);
    shown->wave = *wave;
    tell_all(fabric, pin, shown->drive, shown->wire, now);
    for (uint32_t n = 0; n < fabric->subscribers_end; ++n) {
        if (fabric->subscribers[n].expanded_count) {
            schedule_edges(fabric);
            break;
        }
    }
    return true;
}

bool wave_change(struct fabric *fabric, uint32_t pin, uint32_t source, const struct ticks *ticks, uint64_t high, uint64_t later)
{
    struct wave *wave = &fabric->waves[source];
    if (!wave->period || wave->pin != pin || wave->ns != ticks->ns || wave->hz != ticks->hz || wave->ns != fabric->time.ns) {
        return false;
    }
    const uint64_t now = now_ns(fabric);
    if (now < wave->ns || (wave->high == high && !later)) {
        return now >= wave->ns;
    }
    wave->high = high;
    wave->at = distance(later, wave->at, wave->period);
    const bool level = wave_level(wave, now);
    if (!follow_wave(fabric, pin, source, level, now)) {
        take_offer(fabric, pin, source, level);
    }
    return true;
}

void wave_set(struct fabric *fabric, uint32_t pin, uint32_t source, uint32_t hz, uint64_t period, uint64_t high,
              uint64_t at)
{
    struct wave *wave = &fabric->waves[source];
    if (wave->period && wave->pin != pin) {
        offer(fabric, wave->pin, source, FLOATING);
    }
    if (!high || high >= period) {
        offer(fabric, pin, source, high != 0);
        return;
    }
    const bool was_offered = wave->period != 0;
    const uint64_t now = now_ns(fabric), ns = now < fabric->time.ns ? now : fabric->time.ns;
    *wave = (struct wave){.ns = ns, .period = period, .high = high, .hz = hz, .pin = pin};
    at = within(at, period);
    wave->at = distance(wave_tick(wave, now) % period, at, period);
    if (!was_offered || !follow_wave(fabric, pin, source, at < high, now)) {
        take_offer(fabric, pin, source, at < high);
    }
}

void fabric_set_wave(struct fabric *fabric, uint32_t pin, uint32_t source, uint32_t hz, uint64_t period, uint64_t high,
                     uint64_t at)
{
    wave_set(fabric, pin, source, hz, period, high, at);
}
