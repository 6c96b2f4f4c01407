/* A quadrature encoder's edges within a step: quadrature.py has what they are. */
#include <stddef.h>
#include <stdint.h>

enum { CHANNELS = 2, QUARTERS = 4 };

struct encoder {
    double edges_per_rad;
    /* In edges since the start. */
    double angle;
    /* The codes of a low and a high level. */
    uint8_t level_codes[2];
    /* Of a step: how many edges of each channel there is room for, how many there are, and these. */
    size_t room, counts[CHANNELS];
    int64_t *times;
    uint8_t *codes;
};

/* The levels of A (bit 0) and B in the four quarters of a line. */
static const uint8_t LEVELS[QUARTERS] = {0, 1, 3, 2};

static int64_t whole_below(double value)
{
    int64_t whole = (int64_t)value;
    return whole - ((double)whole > value);
}

/* The nearest whole number, of two as near the even one. */
static int64_t nearest(double value)
{
    int64_t whole = whole_below(value);
    double rest = value - (double)whole;
    return whole + (rest > 0.5 || (rest == 0.5 && whole % 2 != 0));
}

/* Turn to an angle within a span from `begin` on, and write the edges of each channel.

   Returns how many there are of both; where that is more than there is room for, nothing is done. */
size_t encoder_turn(struct encoder *encoder, double angle_rad, int64_t begin, int64_t span_ns)
{
    double before = encoder->angle, after = angle_rad * encoder->edges_per_rad;
    int64_t first = whole_below(before), last = whole_below(after);
    size_t edges = (size_t)(last > first ? last - first : first - last);
    encoder->counts[0] = encoder->counts[1] = 0;
    if (edges > encoder->room)
        return edges;
    encoder->angle = after;
    double way = after - before;
    /* An edge lies where the angle is a whole number: forward the one that is reached, in reverse the one left. */
    int64_t step = last > first ? 1 : -1, edge = last > first ? first + 1 : first;
    for (size_t i = 0; i < edges; ++i, edge += step) {
        size_t channel = edge & 1 ? 0 : 1;
        unsigned behind = LEVELS[(step > 0 ? edge : edge - 1) & (QUARTERS - 1)];
        int64_t at = nearest(((double)edge - before) / way * (double)span_ns);
        size_t place = channel * encoder->room + encoder->counts[channel]++;
        encoder->times[place] = begin + (at < 1 ? 1 : at > span_ns ? span_ns : at);
        encoder->codes[place] = encoder->level_codes[behind >> channel & 1];
    }
    return edges;
}
