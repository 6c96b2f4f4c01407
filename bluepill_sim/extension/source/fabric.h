/* The chip around its core: devices, the queue of their events, lines, pins, and who has subscribed to them.
 *
 * It knows nothing of the core but what `struct host` says, and no device by name: a device is a file with a
 * `struct device_kind`, and a row in `kinds` of devices.c.
 */
#ifndef BLUEPILL_FABRIC_H
#define BLUEPILL_FABRIC_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "layout.h"

#define NO_TIME UINT64_MAX
#define NS_PER_S UINT64_C(1000000000)
#define UNLIKELY(x) __builtin_expect(!!(x), 0)
/* Kept out of its callers, which stay short enough to need no stack. */
#define RARELY __attribute__((noinline, cold))

enum { SLOTS = 128, LINES = 192, SUBSCRIBERS = 16, LISTENERS = 16, DEVICE_LINES = 8, SINKS = 4, WORDS = 1024, LINE_WORDS = LINES / 64 };
/* The first lines are those of interrupts, by their numbers. */
enum { IRQ_LINES_END = 64, NO_LINE = 255 };
enum { LOW, HIGH, FLOATING };

struct fabric;
struct device;

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
};

/* A kind of device: what it does. A null is nothing. */
struct device_kind {
    const char *name;
    /* Whether an access needs to know its time, or may do what needs to; null: it always does. */
    bool (*needs_time)(const struct device *device, uint32_t index, bool is_write);
    /* A register that is declared as native: what is read; what follows a store of `written` over `previous`. */
    uint32_t (*read)(struct device *device, uint32_t index);
    void (*write)(struct device *device, uint32_t index, uint32_t written, uint32_t previous);
    /* Its slot is due at a time; null: that is Python's business. */
    void (*event)(struct device *device, uint64_t ns);
    /* One of its inputs has changed. */
    void (*line)(struct device *device, uint32_t input, bool level);
    /* Pins of a port that it listens to have changed their input. */
    void (*pins)(struct device *device, uint32_t port, uint32_t changed);
    /* What Python has it do: one of `enum command`, or one of its own from `OWN_COMMANDS` on. */
    uint32_t (*command)(struct device *device, uint32_t what, uint32_t one, uint32_t other);
};

enum command {
    RESET, /* the registers have their reset values */
    CLOCK, /* its clock has another frequency: `one`, in Hz */
    ROUTE, /* AFIO has changed what concerns it */
    OWN_COMMANDS = 16
};

struct device {
    const struct device_kind *kind;
    struct fabric *fabric;
    uint32_t *words; /* Python's: its registers */
    void *state;     /* Python's: what it holds beside them */
    uint32_t slot;
    uint8_t outputs[DEVICE_LINES + 2];
    uint32_t ends_slice; /* somebody waits for each word */
    uint32_t word_count;
    struct sent *words_out; /* room for WORDS of them; null: it sends none */
};

struct slot {
    uint64_t ns, cycle;
    struct device *device; /* null: Python's */
};

struct sink {
    struct device *device;
    uint32_t input;
};

struct line {
    uint8_t level, sink_count;
    struct sink sinks[SINKS];
};

/* A subscriber to pins and lines. */
struct subscriber {
    uint32_t drive[PORTS], wire[PORTS], stop[PORTS];
    uint64_t lines[LINE_WORDS];
    uint32_t is_used;
    struct edge *rows;
    size_t count, room;
};

/* A device that listens to inputs of pins. */
struct pin_listener {
    struct device *device;
    uint32_t pins[PORTS];
};

/* Where cycles and nanoseconds are tied together. */
struct time_base {
    uint64_t ns, cycle;
    uint32_t hz;
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
    struct line lines[LINES];
    struct port *ports; /* Python's: PORTS of them */
    uint32_t *inputs[PORTS]; /* the word that reads as a port's input, if any */
    struct subscriber subscribers[SUBSCRIBERS];
    struct pin_listener listeners[LISTENERS];
    struct device devices[SLOTS];
};

/* Services. */
#pragma GCC visibility push(hidden)

/* queue.c */
static inline uint64_t ns_of(const struct fabric *fabric, uint64_t cycle)
{
    const struct time_base *time = &fabric->time;
    return time->ns + (uint64_t)((__uint128_t)(cycle - time->cycle) * NS_PER_S / time->hz);
}

static inline uint64_t now_ns(struct fabric *fabric)
{
    return fabric->event_ns != NO_TIME ? fabric->event_ns : ns_of(fabric, fabric->host.cycle(fabric->host.user));
}

/* Has the device's event come at a time; NO_TIME takes it back. */
void schedule(struct device *device, uint64_t ns);
/* Acts on all that is due at or before a time, in order of time, then of slots. */
void run_events(struct fabric *fabric, uint64_t until_ns);

/* lines.c */
void line_set(struct fabric *fabric, uint32_t number, bool level);

static inline void output_set(struct device *device, uint32_t output, bool level)
{
    line_set(device->fabric, device->outputs[output], level);
}

static inline uint32_t ask(struct device *device, uint32_t what, uint32_t value)
{
    return device->fabric->calls.ask(device->slot, what, value);
}

/* devices.c */
void send_word(struct device *device, const struct sent *row);

/* pins.c */
void offer(struct fabric *fabric, uint32_t pin, uint32_t source, uint32_t level);
void put_row(struct fabric *fabric, struct subscriber *subscriber, const struct edge *row);
void pins_changed(struct fabric *fabric, uint32_t port);
void listen_to_pins(struct device *device, uint32_t port, uint32_t pins);

#pragma GCC visibility pop

/* Whether a port's outputs may change without their time: nobody looks at them, and none has to be warned of. */
static inline bool is_unwatched(const struct fabric *fabric, uint32_t number)
{
    const struct port *port = &fabric->ports[number];
    const uint32_t driven = (port->outside & ~port->outside_weak) | port->rail;
    return !(fabric->subscribed[number] | fabric->listened[number] | (driven & (port->output | port->alternate)));
}

#endif
