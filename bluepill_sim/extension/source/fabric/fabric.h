/* The chip around its core: devices, the queue of their events, lines, pins, and who has subscribed to them.
 *
 * It knows nothing of the core but what `struct host` says, and no device by name: a device is a file with a
 * `DEVICE_KIND`.
 */
#ifndef BLUEPILL_FABRIC_H
#define BLUEPILL_FABRIC_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "layout.h"

#define NO_TIME UINT64_MAX
#define NS_PER_S UINT64_C(1000000000)
#define UNLIKELY(x) __builtin_expect(!!(x), 0)
/* Kept out of its callers, which stay short enough to need no stack. */
#define RARELY __attribute__((noinline, cold))

enum { SLOTS = 128, LINES = 192, SUBSCRIBERS = 16, OUTPUTS = 24, SINKS = 8, WORDS = 8192, MEMORIES = 4, MOST_ROWS = 32768, COUNTERS = 8, LINE_WORDS = LINES / 64 };
/* The first lines are those of interrupts, by their numbers. */
enum { GATE_REGISTERS = 3 }; /* AHB, APB2, APB1 */
enum { IRQ_LINES_END = 64, NO_LINE = 255 };
enum { LOW, HIGH, FLOATING };
/* What is reached as registers. */
enum { PERIPHERALS = 0x40000000, PERIPHERALS_END = 0x40024000 };

struct fabric;
struct device;

/* An access of a bus master that is not the core. */
struct bus_access {
    uint32_t address, bytes, is_write, word;
    bool is_error;
};

/* What the fabric needs of the core around it. */
struct host {
    void *user;
    /* The cycle of the accessing instruction within an access, else that of the boundary. */
    uint64_t (*cycle)(void *user);
    /* The cycle at which the running block began, where that costs less; null: there is none. */
    const uint64_t *boundary;
    /* Returns whether the interrupt is enabled. */
    uint32_t (*set_irq)(void *user, uint32_t irq, uint32_t level);
    /* Ends the slice at the boundary of the running block, and comes back to Python there. */
    void (*end_slice)(void *user);
    /* An event is due at a cycle that may be earlier than the end of the slice. */
    void (*due)(void *user, uint64_t cycle);
    /* The accessing instruction. */
    uint32_t (*pc)(void *user);
    /* Sets the event register of the core. */
    void (*signal)(void *user);
    /* Makes an access to a register for the bus; false: Python has to. Null: it always has. */
    bool (*registers)(void *user, struct bus_access *access);
    /* Whether anything was translated from these bytes of SRAM; null: it may have been. */
    bool (*holds_code)(void *user, uint32_t address, uint32_t bytes);
    /* Up to which cycle the core looks at nothing, unless an event wakes it; null or 0: it is awake. */
    uint64_t (*asleep_until)(void *user);
    /* What `fabric_calls.forced` returns, of which something may be known; null: ask that. */
    uint32_t (*forced)(void *user, uint32_t address);
};

/* What Python is asked: each keeps an exception for later. */
struct fabric_calls {
    /* A slot of Python's is due at a time. */
    void (*event)(uint32_t slot, uint64_t ns);
    /* A device has something to warn of, or a question: its slot, and what the kind's file and Python agree on. */
    uint32_t (*ask)(uint32_t slot, uint32_t what, uint32_t value);
    /* A pin fights against the outside (0), or is shorted to a rail that it drives against (1). */
    void (*electrical)(uint32_t pin, uint32_t what);
    /* A device's words must be taken over now: there is no room for another. */
    void (*deliver)(uint32_t slot);
    /* An access of a bus master to registers: the word; NO_TIME for an error of the bus. */
    uint64_t (*bus)(uint32_t is_write, uint32_t address, uint32_t bytes, uint32_t word);
    /* A bus master has written where code may have been translated from. */
    void (*code_written)(uint32_t address, uint32_t bytes);
    /* Which bits of the register at an address the running store sets whatever was there. `seen` gets what that hangs on
     * beside the code: the count, and pairs of a register's number, or the address of a word of SRAM, and its value. */
    uint32_t (*forced)(uint32_t address, uint32_t *seen);
    /* There is no memory for what the chip shows or sends: some of it is lost, and the run must end. */
    void (*no_memory)(void);
};

/* Room for `seen`; a count above MOST_SEEN: that is not all. */
enum { MOST_SEEN = 8, SEEN_WORDS = 1 + 2 * MOST_SEEN };

/* A kind of device: what it does. A null is nothing. */
struct device_kind {
    const char *name;
    const struct device_kind *next;
    /* Whether an access needs to know its time, or may do what needs to; null: it always does. */
    bool (*needs_time)(const struct device *device, uint32_t index, bool is_write);
    /* The same of the store of a word, where that decides it; null: as `needs_time` says. */
    bool (*store_needs_time)(const struct device *device, uint32_t index, uint32_t written);
    /* A register that is declared as native: what is read; what follows a store of `written` over `previous`. */
    uint32_t (*read)(struct device *device, uint32_t index);
    void (*write)(struct device *device, uint32_t index, uint32_t written, uint32_t previous);
    /* Its slot is due at a time; null: that is Python's business. */
    void (*event)(struct device *device, uint64_t ns);
    /* Whether it would do anything about an input now; null: always. It tells of changes with `hearing_changed`. */
    bool (*hears)(const struct device *device, uint32_t input);
    /* One of its inputs has changed. */
    void (*line)(struct device *device, uint32_t input, bool level);
    /* Pins of a port that it listens to have changed their input. */
    void (*pins)(struct device *device, uint32_t port, uint32_t changed);
    /* Makes the edges that it runs ahead of (ahead.c), up to a time, and waits for what comes next. */
    void (*show)(struct device *device, uint64_t until_ns);
    /* What Python has it do: one of `enum command`, or one of its own from `OWN_COMMANDS` on. */
    uint32_t (*command)(struct device *device, uint32_t what, uint32_t one, uint32_t other);
};

enum command {
    RESET, /* the registers have their reset values */
    CLOCK, /* its clock may have another frequency: `one`, in Hz; an ADC's is divided by `other` */
    ROUTE, /* AFIO has changed what concerns it */
    HEARD, /* somebody hears its outputs, or no longer does */
    SETTLE, /* returns the word of the register with the index `one` as a read would find it now, and changes nothing */
    STOPPED = 8, /* its clock stands still from now on: the chip is in Stop mode */
    RESUMED, /* it goes on, `one` + 2^32 * `other` ns later */
    OWN_COMMANDS = 16
};

struct device {
    const struct device_kind *kind;
    struct fabric *fabric;
    uint32_t *words; /* Python's: its registers */
    void *state;     /* Python's: what it holds beside them */
    uint32_t slot;
    uint8_t outputs[OUTPUTS]; /* their lines, */
    uint8_t drivers[OUTPUTS]; /* and which of the outputs on the line each is */
    uint32_t initial_count;     /* registers, */
    const uint32_t (*initial)[2]; /* their indices, and their words after a reset: Python's */
    uint32_t clock;             /* 1 + the word of `struct clocks` that it counts; 0: none */
    uint32_t resets_alone;      /* nothing of it that a reset puts back is Python's */
    uint64_t heard[SLOTS / 64]; /* the slots whose outputs lead to its inputs, a bit each */
    uint32_t ends_slice; /* somebody waits for each word */
    uint32_t word_count;
    struct sent *words_out; /* room for WORDS of them; null: it sends none */
};

struct slot {
    uint64_t ns, cycle;
    uint32_t is_acting;
    struct device *device; /* null: Python's */
    void (*event)(struct device *, uint64_t); /* of its kind; null: Python acts */
};

struct sink {
    struct device *device;
    uint32_t input;
};

struct line {
    uint8_t high; /* the outputs on it that are 1, a bit each: their OR is its level */
    uint8_t driver_count, sink_count;
    struct sink sinks[SINKS];
};

/* A subscriber to pins and lines. */
struct subscriber {
    uint32_t drive[PORTS], wire[PORTS], stop[PORTS];
    uint64_t lines[LINE_WORDS];
    uint32_t is_used, takes_waves;
    struct edge *rows;
    size_t count, room;
    /* Waves of which it gets the edges, in bulk. */
    uint32_t expanded_count;
    uint64_t expanded_ns; /* up to when they are made */
    struct expanded {
        uint64_t tick, next_ns; /* the next edge */
        uint8_t pin, level;     /* before it */
    } expanded[PORTS * PINS];
};

/* What a pin shows: a level (that of index 0), or a wave. */
struct shown {
    struct wave wave;
    uint8_t drive[2], wire[2], is_wave, is_made;
    uint64_t next_ns; /* the next edge, where each is made at its time */
};

/* A device that listens to inputs of pins. */
struct pin_listener {
    struct device *device;
    uint32_t pins[PORTS];
};

/* A device that runs ahead of the edges that it puts on pins of a port. */
struct ahead {
    struct device *device; /* null: none does */
    uint32_t number, pins; /* the port, and its pins */
    uint32_t drives, wires; /* those at which what the chip drives, and the wire, follow the level */
    uint64_t boundary; /* of a block that began it; NO_TIME: an event did */
    struct port low, high; /* the port with all of the pins at 0, and at 1 */
};

/* Where cycles and nanoseconds are tied together. */
struct time_base {
    uint64_t ns, cycle;
    uint32_t hz;
    uint64_t most_s; /* seconds whose cycles are a number */
    uint64_t second_ns, second_cycle; /* the whole second since then that was worked out last */
    uint64_t asked_cycle, asked_ns;   /* a cycle since then, and its time, that was */
};

/* A register that reads what a ramp of time is: a loop that polls it is worked out (`core/polling.c`). */
struct counter {
    uint32_t address;
    const struct ramp *ramp;
    const struct ticks *ticks; /* null: it counts cycles of the core */
};

/* A memory, as a bus master sees it. */
struct memory {
    uint8_t *bytes;
    uint32_t base, size, is_writable;
};

struct fabric {
    struct host host;
    struct fabric_calls calls;
    struct time_base time;
    uint32_t wants_stop; /* a subscriber wants the slice to end */
    uint64_t event_ns;   /* the time of the event that is acted on; NO_TIME for none */
    uint64_t next_cycle; /* at which the first event is due */
    uint32_t slot_count, listener_count;
    /* The cycle of the block in which the chip last changed what it drives; NO_TIME: see the nanoseconds. */
    uint64_t last_output, last_output_ns;
    uint32_t subscribed[PORTS], listened[PORTS];
    uint64_t subscribed_lines[LINE_WORDS];
    uint32_t watches_lines; /* somebody has subscribed to a line: each access needs its time */
    struct slot slots[SLOTS];
    uint32_t ordered;     /* how many slots have an event, */
    uint8_t order[SLOTS]; /* and which, in order of time, then of their numbers */
    struct line lines[LINES];
    /* By register of RCC and bit: the slot of the device that the bit gives its clock, or resets; 0: none. */
    uint8_t gated[GATE_REGISTERS][32];
    struct port *ports; /* Python's: PORTS of them */
    struct wave *waves; /* Python's: one a source */
    struct shown shown[PORTS * PINS];
    struct counter counters[COUNTERS];
    uint32_t counter_count;
    struct clocks *clocks;               /* Python's, */
    const struct analog *analog;         /* this too, */
    const int32_t *samples[ANALOG_PINS]; /* and these */
    struct memory memories[MEMORIES];
    uint32_t memory_count;
    uint32_t master; /* the slot of the device that makes an access; SLOTS for none */
    struct subscriber subscribers[SUBSCRIBERS];
    uint32_t subscribers_end; /* none is used from here on */
    bool may_run_ahead; /* the core is in C */
    struct ahead ahead;
    struct pin_listener listeners[SLOTS]; /* a device has a slot */
    struct device devices[SLOTS];
};

/* Also for Python: pins.c. */
bool fabric_is_watched(const struct fabric *fabric, uint32_t pin);

/* Services. */
#pragma GCC visibility push(hidden)

/* ramp.c */
/* What a counter reads at a time. */
uint32_t ramp_at(const struct ramp *ramp, uint64_t now);
/* Makes `now` the time that it counts from; the phase of its divider is kept. */
void ramp_rebase(struct ramp *ramp, uint64_t now);
/* When a ramp that falls next comes to 0. */
uint64_t ramp_zero(const struct ramp *ramp);

/* queue.c */
static inline uint64_t ns_of(const struct fabric *fabric, uint64_t cycle)
{
    const struct time_base *time = &fabric->time;
    const uint64_t cycles = cycle - time->cycle; /* by whole seconds, so that 64 bits are enough */
    return time->ns + cycles / time->hz * NS_PER_S + cycles % time->hz * NS_PER_S / time->hz;
}

static inline uint64_t now_ns(struct fabric *fabric)
{
    if (fabric->event_ns != NO_TIME) {
        return fabric->event_ns;
    }
    struct time_base *time = &fabric->time;
    const uint64_t cycle = fabric->host.cycle(fabric->host.user);
    if (cycle != time->asked_cycle) {
        const uint64_t cycles = cycle - time->second_cycle;
        time->asked_ns = cycles < time->hz ? time->second_ns + cycles * NS_PER_S / time->hz : ns_of(fabric, cycle);
        time->asked_cycle = cycle;
    }
    return time->asked_ns;
}

/* The last tick of a clock that begins at or before a time. */
static inline uint64_t tick_at(const struct ticks *ticks, uint64_t ns)
{
    if (ns < ticks->ns) {
        return ticks->tick;
    }
    const uint64_t seconds = (ns - ticks->ns) / NS_PER_S, rest = (ns - ticks->ns) % NS_PER_S;
    return ticks->tick + seconds * ticks->hz + ((rest + 1) * ticks->hz + NS_PER_S - 1) / NS_PER_S - 1;
}

/* `x` modulo `period`, which is seldom to be worked out. */
static inline uint64_t within(uint64_t x, uint64_t period) { return x < period ? x : x % period; }

/* How far it is from one place of a period to another. */
static inline uint64_t distance(uint64_t from, uint64_t to, uint64_t period)
{
    return to >= from ? to - from : to + period - from;
}

/* When a tick begins. */
static inline uint64_t ns_of_tick(const struct ticks *ticks, uint64_t tick)
{
    const uint64_t ticks_since = tick - ticks->tick;
    return ticks->ns + ticks_since / ticks->hz * NS_PER_S + ticks_since % ticks->hz * NS_PER_S / ticks->hz;
}

/* The first cycle that begins at or after a time. */
uint64_t cycle_at(struct fabric *fabric, uint64_t ns);
/* Has the device's event come at a time; NO_TIME takes it back. */
void schedule(struct device *device, uint64_t ns);
static inline uint64_t due_ns(const struct device *device) { return device->fabric->slots[device->slot].ns; }
/* Up to when, but not at which, nothing but this device acts, or looks at memory. */
uint64_t quiet_ns(const struct device *device);
/* Acts on all that is due at or before a time, in order of time, then of slots. */
void run_events(struct fabric *fabric, uint64_t until_ns);
/* The same up to a cycle. */
void run_due(struct fabric *fabric, uint64_t cycle);
/* Whether anything due at or before a cycle is Python's business. */
bool waits_for_python(const struct fabric *fabric, uint64_t cycle);
/* Up to when nothing changes any more. */
uint64_t settled_ns(struct fabric *fabric);

/* lines.c */
/* Whether a change of an output would be seen by anyone. */
bool is_heard(const struct device *device, uint32_t output);
/* Tells the devices whose outputs lead to inputs of this one that what it `hears` has changed. */
void hearing_changed(struct device *device);
void output_set(struct device *device, uint32_t output, bool level);

/* ahead.c */
void make_edges_ahead(struct fabric *fabric, bool is_left);
/* Has edges of pins made up to now, of a device that runs ahead of them. */
static inline void show_ahead(struct fabric *fabric)
{
    if (UNLIKELY(fabric->ahead.device != NULL)) {
        make_edges_ahead(fabric, false);
    }
}
/* The same, and from now on each is made at its time: Python, or what else knows nothing of it, may look at the pins. */
static inline void leave_ahead(struct fabric *fabric)
{
    if (UNLIKELY(fabric->ahead.device != NULL)) {
        make_edges_ahead(fabric, true);
    }
}
/* Before a store to a register of such a device. */
static inline void leave_for_store(struct device *device, uint32_t index)
{
    if (UNLIKELY(device->fabric->ahead.device == device) && device->kind->needs_time(device, index, true)) {
        make_edges_ahead(device->fabric, true);
    }
}
/* A port as it is now, for who looks at what is on its pins. */
static inline const struct port *port_now(struct fabric *fabric, uint32_t number)
{
    if (UNLIKELY(fabric->ahead.device != NULL) && fabric->ahead.number == number) {
        make_edges_ahead(fabric, true);
    }
    return &fabric->ports[number];
}
/* Has a device run ahead of the edges of pins on which it is the only driver, of one port; false: it must not. */
bool run_ahead(struct device *device, uint32_t number, uint32_t pins);
/* It has put a level on one of them. */
void put_ahead(struct fabric *fabric, uint32_t bit, bool level, uint64_t ns, bool is_first);
/* It has come to that level, as the alternate function with a number offers it. */
void come_to(struct fabric *fabric, uint32_t bit, uint32_t source, bool level);

static inline uint32_t forced_bits(struct fabric *fabric, uint32_t address)
{
    uint32_t seen[SEEN_WORDS];
    return fabric->host.forced != NULL ? fabric->host.forced(fabric->host.user, address)
                                       : fabric->calls.forced(address, seen);
}

static inline uint32_t ask(struct device *device, uint32_t what, uint32_t value)
{
    leave_ahead(device->fabric);
    return device->fabric->calls.ask(device->slot, what, value);
}
/* The same of what has no value. */
static inline uint32_t ask_about(struct device *device, uint32_t what) { return ask(device, what, 0); }

/* devices.c */
/* Makes the register of a counter known; `ramp` and `ticks` stay where they are, and are right up to the next event. */
void add_counter(struct fabric *fabric, uint32_t address, const struct ramp *ramp, const struct ticks *ticks);
void add_kind(struct device_kind *kind);
void send_word(struct device *device, const struct sent *row);
/* Puts a device back to its state after a reset, but for what of it is Python's. */
void reset_device(struct device *device);

/* listener.c: what a device in Python hears of lines and pins, and how it asks for pins. */
/* What Python is told, as `fabric/registers.py` has it; a kind's own come after these. */
enum { HEARS_LINE, HEARS_PINS, OWN_ANSWERS };
void hand_on_line(struct device *device, uint32_t input, bool level);
void hand_on_pins(struct device *device, uint32_t port, uint32_t changed);
uint32_t obey_listen(struct device *device, uint32_t what, uint32_t one, uint32_t other);

/* port.c */
/* Of one pin: LOW, HIGH or FLOATING; an index of `PinDrive`. */
uint8_t wire_of(const struct port *port, uint32_t bit);
uint8_t drive_of(const struct port *port, uint32_t bit);
/* Works out what the pins of a port are. */
void work_out(struct port *port);
/* Works a port out for both levels of its waves; what is electrically wrong in one of them is wrong. */
void work_out_both(struct port *port, struct port *low, struct port *high);
/* The wave that drives a pin which shows one. */
const struct wave *wave_of(const struct fabric *fabric, const struct port *port, uint32_t at);
/* Puts pins that show a wave at its level at a time; `work_out` follows. */
void sample_waves(const struct fabric *fabric, struct port *port, uint32_t pins, uint64_t ns);
/* Notes when the chip has changed what it drives. */
void note_output(struct fabric *fabric);
void tell_listeners(struct fabric *fabric, uint32_t number, uint32_t changed);

/* subscribers.c */
bool make_room(struct fabric *fabric, struct subscriber *subscriber, uint32_t count);
static inline void put_rows(struct fabric *fabric, struct subscriber *subscriber, const struct edge *rows, uint32_t count)
{
    if (UNLIKELY(subscriber->count + count > subscriber->room) && !make_room(fabric, subscriber, count)) {
        return;
    }
    memcpy(&subscriber->rows[subscriber->count], rows, count * sizeof *rows);
    subscriber->count += count;
    if (UNLIKELY(subscriber->count >= MOST_ROWS)) {
        fabric->host.end_slice(fabric->host.user);
    }
}
static inline void put_row(struct fabric *fabric, struct subscriber *subscriber, const struct edge *row)
{
    put_rows(fabric, subscriber, row, 1);
}
/* Puts a wave that a pin shows from a time on, as it is. */
void put_wave(struct fabric *fabric, struct subscriber *subscriber, uint32_t pin, uint64_t ns);
/* Whether the edges of a wave that a pin shows are any to it; whether it has subscribed to a pin. */
bool wants(const struct subscriber *subscriber, const struct shown *shown, uint32_t pin);
bool has_subscribed(const struct subscriber *subscriber, uint32_t pin);
/* Gives it the edges of the wave that a pin shows, from a time on. */
void expand(struct fabric *fabric, struct subscriber *subscriber, uint32_t pin, uint64_t ns);
/* Takes that back; returns the level that the wave had there. */
bool stop_expanding(struct subscriber *subscriber, uint32_t pin);
/* Makes the edges that a subscriber has waiting; that all have, of what is about to be another wave. */
void expand_waves(struct fabric *fabric, struct subscriber *subscriber, uint64_t until_ns);
void expand_all(struct fabric *fabric, uint64_t ns);

/* waves.c */
/* What a port's inputs are now, those that show waves too. */
uint32_t port_input(struct fabric *fabric, uint32_t number);
/* Follows the waves of a port that may have changed; returns the pins whose wave has. */
uint32_t show_waves(struct fabric *fabric, uint32_t number, const struct port *before);
/* The next time at which edges must be made. */
void schedule_edges(struct fabric *fabric);
/* Who wants edges at their time has changed. */
void make_edges_where_wanted(struct fabric *fabric);
/* Tells those who have subscribed to a pin what it shows from now on; up to now it was this at either level. */
void tell_all(struct fabric *fabric, uint32_t pin, const uint8_t drive[2], const uint8_t wire[2], uint64_t ns);
/* Begins a subscription with the waves that are there. */
void show_to(struct fabric *fabric, struct subscriber *subscriber);
extern struct device_kind waves_kind;

/* pins.c */
/* Indices of `PinMode`. */
enum pin_mode { PIN_ANALOG, PIN_FLOATING, PIN_PULLED, PIN_PUSH_PULL, PIN_OPEN_DRAIN, PIN_ALTERNATE, PIN_ALTERNATE_OPEN_DRAIN };
/* Gives a pin what GPIO has configured: its mode, and its bit of ODR. */
void configure_pin(struct fabric *fabric, uint32_t pin, uint32_t mode, bool is_high);
/* Works out what the pins of a port are, and tells whoever has to know. */
void pins_changed(struct fabric *fabric, uint32_t port);
void listen_to_pins(struct device *device, uint32_t port, uint32_t pins);

/* offers.c */
/* The level that an alternate function offers on a pin: 0, 1, or 2 for none any more. */
void offer(struct fabric *fabric, uint32_t pin, uint32_t source, uint32_t level);
/* Has an alternate function offer a wave on a pin, in place of what it offered before: it is `position` of `period`
 * ticks after a rising edge now, and `high` ticks long at 1. A tick is one of `hz`, which are counted from where the
 * core's clock was last changed: so an edge comes exactly where a count of this clock puts it. */
void wave_set(struct fabric *fabric, uint32_t pin, uint32_t source, uint32_t hz, uint64_t period, uint64_t high,
              uint64_t position);
/* Has the wave that is offered be `high` ticks long at 1, and come `later` ticks of its period later; false: it is not
 * counted in these ticks. */
bool wave_change(struct fabric *fabric, uint32_t pin, uint32_t source, const struct ticks *ticks, uint64_t high, uint64_t later);

/* analog.c */
/* Microvolts on the pin of an ADC channel, which may be an earlier time's. */
int64_t channel_uv(struct fabric *fabric, uint32_t channel, uint64_t ns);

/* bus.c */
/* Reads or writes 1, 2 or 4 bytes for a device, at the time of its event; false: an error of the bus. */
bool bus_read(struct device *master, uint32_t address, uint32_t bytes, uint32_t *word);
bool bus_write(struct device *master, uint32_t address, uint32_t bytes, uint32_t word);
/* Whether an access there reaches memory. */
bool is_memory(const struct fabric *fabric, uint32_t address, bool is_write);

#pragma GCC visibility pop

/* queue.c: Python calls it too. */
void fabric_schedule(struct fabric *fabric, uint32_t number, uint64_t ns);

uint64_t fabric_next_ns(const struct fabric *fabric);
void fabric_catch_up(struct fabric *fabric, uint32_t number, uint64_t until_ns);
uint32_t fabric_command(struct fabric *fabric, uint32_t slot, uint32_t what, uint32_t one, uint32_t other);

/* A kind of device, which the library knows from when it is loaded on. */
#define DEVICE_KIND(kind)                                                                                              \
    static struct device_kind kind;                                                                                    \
    __attribute__((constructor)) static void add_##kind(void) { add_kind(&kind); }                                     \
    static struct device_kind kind

/* Whether outputs of a port may change without their time: nobody looks at them, and none has to be warned of. */
static inline bool is_unwatched(const struct fabric *fabric, uint32_t number, uint32_t pins)
{
    const struct port *port = &fabric->ports[number];
    const uint32_t driven = (port->outside & ~port->outside_weak) | port->rail;
    return !(pins & (fabric->subscribed[number] | fabric->listened[number] | (driven & (port->output | port->alternate))));
}

#endif
