/* A timer: one idea in four files, which call each other and share `struct tim`. `tim.c` has its theory of operation.
 *
 * In the hardware, too, each of them acts on the others: an input may reset or clock the counter, a match of the counter
 * changes an output, an output's level may be an input's trigger, and a store to a register any of them. `tim.c` has
 * the registers and brings the three others to a time in the order in which things happen.
 */
#ifndef BLUEPILL_TIM_H
#define BLUEPILL_TIM_H

#include "../fabric/fabric.h"
#include "../registers/tim.h"

enum { REGISTERS = DMAR + 1, OIS_AT = 8 };
enum { CHANNELS = 4, PAIRS = 3 };
/* Of CR2, MMS. */
enum { MASTER_RESET, MASTER_ENABLE, MASTER_UPDATE, MASTER_COMPARE, MASTER_REFERENCE };
/* Of SMCR, SMS and TS. */
enum { SLAVE_OFF, ENCODER_TI2, ENCODER_TI1, ENCODER_BOTH, SLAVE_RESET, SLAVE_GATED, SLAVE_TRIGGER, SLAVE_CLOCK };
enum { TRIGGER_ED = 4, TRIGGER_TI1, TRIGGER_TI2, TRIGGER_ETRF };
/* Of SR, of DIER at the same places, and of EGR. The flag of overcapture stands OVER bits above that of its channel,
 * and requests of DMA in DIER stand DMA_AT bits above. */
enum { OVER = 8, DMA_AT = 8 };
enum { FLAGS = 0x1EFF, CCIFS = 0x1E, INTERRUPTS = 0xFF };
/* OCxM. */
enum { FROZEN, SET_ON_MATCH, CLEAR_ON_MATCH, TOGGLE, FORCE_LOW, FORCE_HIGH, PWM1, PWM2 };
/* Inputs behind their filters. */
enum { ETR = 4, INPUTS };
/* `pins` of the struct. */
enum { PIN_COMPLEMENT = 4, PIN_ETR = 7, PIN_BKIN, PIN_COUNT };
/* Its last input: the clock security system has found HSE failed. The first four are the internal triggers. */
enum { CSS = 4 };
enum { SHOWS_NOTHING, SHOWS_LOW, SHOWS_HIGH, SHOWS_WAVE, SHOWS_UNKNOWN };
/* What has happened within some counts: an update event may be due, and matches of the channels. */
enum { OVERFLOWED = 1 << 0, MATCHED = 1 << 1 };

#pragma GCC visibility push(hidden)

static inline struct tim *tim_of(const struct device *device) { return device->state; }
static inline uint32_t bits_of(const struct device *device, uint32_t index, uint32_t at, uint32_t mask)
{
    return device->words[index] >> at & mask;
}
/* CCMRx of a channel, as it is in effect, shifted to its lowest bit. */
static inline uint32_t ccmr_of(const struct device *device, uint32_t channel)
{
    return tim_of(device)->ccmr[channel / 2] >> 8 * (channel % 2) & 0xFF;
}
static inline bool is_input(const struct device *device, uint32_t channel) { return ccmr_of(device, channel) & 3; }
static inline uint32_t mode_of(const struct device *device, uint32_t channel) { return ccmr_of(device, channel) >> 4 & 7; }
static inline bool is_preloaded(const struct device *device, uint32_t channel) { return ccmr_of(device, channel) >> 3 & 1; }
static inline bool is_on(const struct device *device, uint32_t channel)
{
    return tim_of(device)->ccer >> 4 * channel & 1;
}
static inline bool is_inverted(const struct device *device, uint32_t channel)
{
    return tim_of(device)->ccer >> 4 * channel & 2;
}
static inline uint32_t slave_mode(const struct device *device) { return device->words[SMCR] & SMS; }
static inline bool is_encoder(const struct device *device)
{
    return slave_mode(device) - ENCODER_TI2 <= ENCODER_BOTH - ENCODER_TI2;
}
static inline uint32_t master_mode(const struct device *device) { return bits_of(device, CR2, MMS_AT, 7); }
static inline bool etrf(const struct device *device) { return tim_of(device)->filters[ETR].out; }
static inline uint64_t earlier(uint64_t one, uint64_t other) { return one < other ? one : other; }

/* tim_counter.c: CNT, update events, compare matches. */
/* Puts the counter at a value. */
void place(struct device *device, uint32_t count, bool falls);
/* Has it start or stop, as the registers now say. */
void set_running(struct device *device);
/* Counts so many times; returns what has happened. */
uint32_t count_on(struct device *device, uint64_t counts);
/* Does what follows from it: the matches are those of the lap that ends with an update event. */
void take_events(struct device *device, uint32_t happened);
/* An edge of a clock that is not CK_INT. */
void count_edge(struct device *device);
/* Makes an update event, of the counter or by software or a trigger. */
void update_event(struct device *device, bool is_by_counter);
/* Starts counter and prescaler anew, with an update event. */
void reinitialize(struct device *device);
/* A compare match, or a capture. */
void channel_event(struct device *device, uint32_t channel);
/* Ticks at which something happens that somebody sees; NO_TIME for none. */
uint64_t next_count_stop(const struct device *device);
/* Whether anybody sees a match of a channel, or its OCxREF by TRGO. */
bool sees_channel(const struct device *device, uint32_t channel);
/* The first and the number of the phases at which OCxREF of PWM is 1, in a lap of the counter. */
struct lap {
    uint64_t period, phase, first, active;
};
struct lap lap_of(const struct ramp *ramp);
void find_active(const struct device *device, uint32_t channel, struct lap *lap);
/* Phases at which the counter comes to a value by a direction that counts; returns how many of the two. */
uint32_t match_phases(const struct device *device, uint32_t value, bool is_output, uint64_t phases[2]);
uint64_t counts_until(const struct lap *lap, uint64_t phase);
/* The tick of the count that comes after so many. */
static inline uint64_t tick_after(const struct tim *tim, uint64_t counts)
{
    return tim->ramp.base + counts * tim->ramp.divider;
}

/* tim_outputs.c: OCxREF, dead time, idle states, pins. */
/* OCxREF at the tick up to which all is worked out. */
bool reference(const struct device *device, uint32_t channel);
void note_references(struct device *device);
void show_outputs(struct device *device);
/* Of one channel of PWM alone, without its complement: its CCRx in effect becomes another one. */
void show_duty(struct device *device, uint32_t channel, uint32_t ccr);
uint64_t next_output_stop(const struct device *device);
/* Takes outputs to their idle states, or back. */
void set_moe(struct device *device, bool is_on);
/* From now on, nothing is known of what the pins show. */
void forget_outputs(struct device *device);

/* tim_inputs.c: filters, captures, triggers, encoder, break. */
void take_pins(struct device *device, uint32_t port, uint32_t changed);
void take_line(struct device *device, uint32_t input, bool level);
bool hears_line(const struct device *device, uint32_t input);
/* Takes the levels of the pins that are listened to: TI1S, ETP or ETPS may make another one of them. */
void take_levels(struct device *device);
/* Listens to the pins that matter now; `is_restored`: their levels are known. */
void listen(struct device *device, bool is_restored);
uint64_t next_filter_stop(const struct device *device);
/* Takes what has come to the inputs while the clock stood still. */
void take_what_waits(struct device *device);
/* Takes levels that its own outputs have changed, a tick later. */
void take_late_levels(struct device *device);
/* Lets through what filters have seen for long enough. */
void flip_filters(struct device *device);
void set_filters(struct device *device);
void capture(struct device *device, uint32_t channel);
/* Takes the trigger's level anew, without an edge. */
void look_at_trigger(struct device *device);
void trigger_event(struct device *device);
void commutation_event(struct device *device);
/* Has the registers of modes and enables take effect; with CCPC those of the pairs only by a commutation event. */
void take_modes(struct device *device, bool is_commutation);
bool is_break_active(const struct device *device);
void check_break(struct device *device);
void trigger_break(struct device *device);

/* tim.c */
/* Brings everything up to a tick. */
void synchronize(struct device *device, uint64_t tick);
uint64_t tick_now(const struct device *device);
/* Puts out what has changed: pins, interrupts, TRGO, the time of the next event, then pulses. */
void refresh(struct device *device);
/* Has an output give a pulse at the end of what happens now. */
void pulse(struct device *device, uint32_t output);
/* The same of a request of DMA, with the burst that it may begin. */
void request(struct device *device, uint32_t output);

#pragma GCC visibility pop
#endif
