/* Volts on pins: what an ADC samples, in integers of microvolts, at any nanosecond.
 *
 * A pin has a signal that the outside gives (a constant, an oscillation, samples), else it is at its logic level:
 * 0 V or VDDA; a floating wire is low. Signals are numbered as the ADC's channels are: PA0 to PA7, PB0, PB1.
 * Invariant: the same time gives the same volts, whoever asks and how often.
 */
#include "fabric.h"

/* Shapes, as `Waveform` of signals.py. */
enum { LOGIC, CONSTANT, SINE, TRIANGLE, SAWTOOTH, SQUARE, SAMPLES, HELD };
enum { ONE_AT = 30 };

/* Makes the analog side known; it is Python's and stays where it is. */
void fabric_set_analog(struct fabric *fabric, const struct analog *analog) { fabric->analog = analog; }

/* Gives the samples of a signal, in microvolts; they stay where they are as long as the signal uses them. */
void fabric_set_samples(struct fabric *fabric, uint32_t number, const int32_t *samples)
{
    fabric->samples[number] = samples;
}

/* The sine of a part of a turn (2^32 is a whole one), in units of 2^-30: Taylor's series, in integers so that it is the
 * same on every machine; off by less than 2e-9. */
static int64_t sine_of(uint32_t turn)
{
    static const int64_t terms[] = {61, -3864, 172272, -5026995, 85569305, -693598668, 1686629713};
    const uint32_t quarter = turn >> 30, in_quarter = turn & ((1u << 30) - 1);
    const int64_t x = quarter & 1 ? (INT64_C(1) << 30) - in_quarter : in_quarter, square = (x * x) >> ONE_AT;
    int64_t sum = 0;
    for (uint32_t n = 0; n < sizeof terms / sizeof *terms; ++n) {
        sum = terms[n] + (sum * square >> ONE_AT);
    }
    sum = sum * x >> ONE_AT;
    return quarter & 2 ? -sum : sum;
}

static int64_t sampled(const struct signal *signal, const int32_t *samples, uint64_t at)
{
    const uint64_t index = at / signal->interval_ns, within = at % signal->interval_ns, last = signal->count - 1;
    if (index >= last && !signal->is_repeated) {
        return samples[last];
    }
    const int64_t here = samples[index], next = samples[index == last ? 0 : index + 1];
    return signal->shape == HELD ? here : here + (next - here) * (int64_t)within / (int64_t)signal->interval_ns;
}

static int64_t signal_uv(const struct signal *signal, const int32_t *samples, uint64_t ns)
{
    uint64_t at = (ns > signal->start_ns ? ns - signal->start_ns : 0) + signal->phase_ns;
    if (signal->shape == CONSTANT) {
        return signal->low_uv;
    }
    at = signal->is_repeated ? at % signal->period_ns : at;
    if (signal->shape >= SAMPLES) {
        return sampled(signal, samples, at);
    }
    const uint64_t turn = (uint64_t)(((__uint128_t)at << 32) / signal->period_ns);
    const int64_t span = (int64_t)signal->high_uv - signal->low_uv;
    switch (signal->shape) {
    case SINE: return signal->low_uv + (span * ((INT64_C(1) << ONE_AT) + sine_of((uint32_t)turn)) >> (ONE_AT + 1));
    case TRIANGLE:
        return signal->low_uv + (span * (int64_t)(2 * (turn < 1u << 31 ? turn : (UINT64_C(1) << 32) - turn)) >> 32);
    case SAWTOOTH: return signal->low_uv + (span * (int64_t)turn >> 32);
    default: return at < signal->interval_ns ? signal->high_uv : signal->low_uv;
    }
}

/* The logic level of a pin at a time, where it shows a wave too. */
static bool level_at(struct fabric *fabric, uint32_t number, uint32_t bit, uint64_t ns)
{
    struct port port = *port_now(fabric, number);
    if (port.shown & bit) {
        sample_waves(fabric, &port, bit, ns);
        work_out(&port);
    }
    return port.level & bit;
}

int64_t channel_uv(struct fabric *fabric, uint32_t number, uint64_t ns)
{
    const struct signal *signal = &fabric->analog->signals[number];
    if (signal->shape != LOGIC) {
        return signal_uv(signal, fabric->samples[number], ns);
    }
    return level_at(fabric, number / 8, 1u << number % 8, ns) ? fabric->analog->vdda_uv : 0;
}

/* For Python. */
int64_t fabric_channel_uv(struct fabric *fabric, uint32_t number, uint64_t ns)
{
    return channel_uv(fabric, number, ns);
}
