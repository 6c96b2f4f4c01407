/* An I2C, master or slave: conditions and bytes at the speed of SCL, each acted on when its last bit has ended.
 *
 * Theory of operation. `phase` is what is on the bus. A condition lasts one bit, a byte nine. Behind each of them the next
 * follows at once where the software has left nothing to wait for, else SCL is held low (HOLD) until it has: SB wants the
 * address, ADDR a read of both status registers, BTF a byte or room for one. `go_on` is the one place that decides.
 * Parts, and a master outside (FAR phases), are Python's (peripherals/i2c.py), asked once a byte; what happens between is
 * here since drivers poll these flags millions of times a second, and DMA serves them.
 * While somebody looks at SCL or SDA, each bit is shown there (`show_step`): what the chip sends as its own, what a part
 * or a master outside sends as a line that is held low from outside. Nothing follows from what is shown: who holds a line
 * really, a finger or another board, is `is_low`.
 * Source: RM0008 26.3, 26.6; UM10204 (I2C) 3.1.
 * Invariant: what is under way ends floor(ticks * 10**9 / rate) ns after the last time that SCL was let go.
 */
#include "../fabric/fabric.h"
#include "../registers/i2c.h"

enum { EVENTS = SB | ADDR | BTF | ADD10 | STOPF, ERRORS = BERR | ARLO | AF | OVR | PECERR | TIMEOUT | SMBALERT };
/* Bits of a condition, of data, and of a byte with its acknowledge; that a byte is held; SCL low for so long is a timeout (RM0008 26.3.8). */
enum { CONDITION = 1, DATA = 8, ACKNOWLEDGE = 1, BYTE = 9, HELD = 1 << 8, TIMEOUT_NS = 25000000 };
enum phase { FREE, STARTING, ADDRESSING, SENDING, RECEIVING, STOPPING, HOLD, OTHERS, FAR, FAR_HOLD };
/* Its pins. */
enum { SCL, SDA, SMBA, I2C_PINS };
/* An answer to a question has HELD for an acknowledge. */
/* `far` holds one of FAR_START to FAR_STOP times 2 * HELD. */
enum { FAR_AT = 9 };
/* What a row for subscribers tells: one of these times 2 * HELD, a byte and its acknowledge below (`I2cStep` of i2c.py). */
enum { TELL_START, TELL_BYTE, TELL_STOP, TELL_LOST, TELL_CUT, TELL_AT = 9 };
/* Of `answer`, beside HELD: they were asked; another master has won. */
enum { ANSWERED = 1 << 9, HAS_LOST = 1 << 10 };
/* Of `is_stopped`. */
enum { CLOCK_STOPPED = 1, TIMEOUT_STOPPED = 2 };

static void begin_to_show(struct device *device);
static void show_rest(struct device *device, enum phase phase);
static void go_on(struct device *device, uint64_t ns);
static void go_on_far(struct device *device, uint64_t ns);

static void update_outputs(struct device *device)
{
    const uint32_t status = device->words[SR1], control = device->words[CR2];
    output_set(device, RX_DMA, status & RXNE && control & DMAEN);
    output_set(device, TX_DMA, status & TXE && !(status & ADDR) && control & DMAEN);
    const uint32_t now = device->words[SR1];
    output_set(device, EVENT_IRQ, control & ITEVTEN && (now & EVENTS || (now & (TXE | RXNE) && control & ITBUFEN)));
    output_set(device, ERROR_IRQ, control & ITERREN && now & ERRORS);
}

/* TxE comes with a transmitter's ADDR: ST's libraries wait for both at once (events 0x70082 and 0x60082). */
static void ask_for_byte(struct device *device)
{
    const struct i2c *i2c = device->state;
    device->words[SR1] |= device->words[SR2] & TRA && !i2c->tdr ? TXE : 0;
}

static void tell(struct device *device, uint64_t ns, uint32_t what, uint32_t byte)
{
    const struct i2c *i2c = device->state;
    if (UNLIKELY(i2c->wants_words)) {
        const struct sent row = {.ns = ns, .word = what << TELL_AT | byte, .clock_hz = i2c->rate_hz};
        send_word(device, &row);
    }
}

/* Pins. */

static bool is_low(const struct device *device, uint32_t which)
{
    const struct i2c *i2c = device->state;
    const struct port *port = port_now(device->fabric, i2c->pins[which] / PINS);
    const uint32_t bit = 1u << i2c->pins[which] % PINS;
    if (i2c->show && (i2c->offered[which] == LOW || port->bus_low & bit)) { /* what is shown hides all but a hard driver */
        return (port->rail & ~port->rail_high & bit) || (port->outside & ~port->outside_high & ~port->rail & bit);
    }
    return !((port->level | port->floating) & bit); /* chosen: a line without a pull is high */
}

static uint32_t low_lines(const struct device *device)
{
    return (uint32_t)is_low(device, SCL) | (uint32_t)is_low(device, SDA) << SDA | (uint32_t)is_low(device, SMBA) << SMBA;
}

static bool carries(const struct device *device, uint32_t which)
{
    const struct i2c *i2c = device->state;
    const struct port *port = &device->fabric->ports[i2c->pins[which] / PINS];
    const uint32_t at = i2c->pins[which] % PINS;
    const uint64_t sources = port->sources[at];
    return port->alternate & port->bonded & ~port->held & 1u << at && (sources & -sources) >> (i2c->source + which) & 1;
}

static void put(struct device *device, uint32_t which, uint32_t level)
{
    struct i2c *i2c = device->state;
    if (i2c->offered[which] != level) {
        i2c->offered[which] = level;
        offer(device->fabric, i2c->pins[which], which == SMBA ? i2c->smba_source : i2c->source + which, level);
    }
}

static void connect(struct device *device)
{
    const struct i2c *i2c = device->state;
    const uint32_t control = device->words[CR1];
    for (uint32_t n = SCL; n <= SDA; ++n) {
        put(device, n, !(control & PE) ? FLOATING : i2c->show && i2c->offered[n] == LOW ? LOW : HIGH);
    }
    put(device, SMBA, (control & (PE | SMBUS)) != (PE | SMBUS) ? FLOATING : control & ALERT ? LOW : HIGH);
}

static void listen(struct device *device)
{
    const struct i2c *i2c = device->state;
    for (uint32_t port = 0; port < PORTS; ++port) {
        uint32_t mask = 0;
        for (uint32_t n = 0; n < I2C_PINS; ++n) {
            const bool is_wanted = n != SMBA || device->words[CR1] & SMBUS;
            mask |= is_wanted && i2c->pins[n] / PINS == port ? 1u << i2c->pins[n] % PINS : 0;
        }
        listen_to_pins(device, port, device->words[CR1] & PE ? mask : 0);
    }
}

/* Time. */

static void wait_for_events(struct device *device)
{
    const struct i2c *i2c = device->state;
    const uint64_t shown = i2c->show_ns < i2c->due_ns ? i2c->show_ns : i2c->due_ns;
    const uint64_t due = i2c->is_stopped & CLOCK_STOPPED ? NO_TIME : shown;
    const uint64_t timeout = i2c->is_stopped ? NO_TIME : i2c->timeout_ns;
    schedule(device, due < timeout ? due : timeout);
}

/* The time that counts for what follows from now: that of the stop, where a clock stands still. */
static uint64_t counted_ns(const struct device *device, uint32_t clocks)
{
    const struct i2c *i2c = device->state;
    return i2c->is_stopped & clocks ? i2c->stopped_ns : now_ns(device->fabric);
}

static void stop(struct device *device, uint32_t clocks)
{
    struct i2c *i2c = device->state;
    i2c->stopped_ns = now_ns(device->fabric);
    i2c->is_stopped = clocks;
    wait_for_events(device);
}

static void resume(struct device *device, uint64_t span)
{
    struct i2c *i2c = device->state;
    if (i2c->is_stopped & CLOCK_STOPPED) {
        i2c->base_ns += span;
        i2c->due_ns += i2c->due_ns == NO_TIME ? 0 : span;
        i2c->show_ns += i2c->show_ns == NO_TIME ? 0 : span;
    }
    i2c->timeout_ns += i2c->timeout_ns == NO_TIME ? 0 : span;
    i2c->is_stopped = 0;
    wait_for_events(device);
}

/* RM0008 26.6.8: SCL high and low take CCR each, or in fast mode one and two, or nine and sixteen of them. */
static uint64_t bit_ticks(const struct device *device)
{
    const struct i2c *i2c = device->state;
    const uint32_t control = device->words[CCR], count = control & CCR_CCR ? control & CCR_CCR : 1;
    return i2c->phase >= FAR ? 1 : (uint64_t)count * (!(control & FS) ? 2 : control & DUTY ? 25 : 3);
}

static uint64_t end_ns(const struct i2c *i2c)
{
    return i2c->base_ns + (uint64_t)((__uint128_t)i2c->ticks * NS_PER_S / i2c->rate_hz);
}

static void go_on_for(struct device *device, uint32_t bits)
{
    struct i2c *i2c = device->state;
    i2c->ticks += bits * bit_ticks(device);
    i2c->due_ns = end_ns(i2c);
}

static void begin(struct device *device, enum phase phase, uint32_t bits)
{
    struct i2c *i2c = device->state;
    i2c->phase = phase;
    i2c->shown_from = i2c->ticks;
    i2c->answer = 0;
    go_on_for(device, bits);
    begin_to_show(device);
}

static void rest(struct device *device, enum phase phase)
{
    struct i2c *i2c = device->state;
    show_rest(device, phase);
    i2c->phase = phase;
    i2c->due_ns = NO_TIME;
    i2c->is_late = false;
}

static void run_from(struct device *device, uint64_t ns)
{
    struct i2c *i2c = device->state;
    i2c->base_ns = ns;
    i2c->ticks = 0;
    i2c->rate_hz = i2c->phase == FAR || i2c->phase == FAR_HOLD ? i2c->rate_hz : i2c->clock_hz;
}

/* PEC (RM0008 26.3.6): x^8 + x^2 + x + 1 over all bytes, addresses too. */
static uint32_t pec_of(const struct device *device) { return device->words[SR2] >> SR2_PEC_AT & 0xFF; }

static void set_pec(struct device *device, uint32_t pec) { device->words[SR2] = (device->words[SR2] & 0xFF) | pec << SR2_PEC_AT; }

static void add_to_pec(struct device *device, uint32_t byte)
{
    uint32_t crc = pec_of(device) ^ byte;
    for (int n = 0; n < 8; ++n) {
        crc = crc & 0x80 ? (crc << 1 ^ 0x07) & 0xFF : crc << 1;
    }
    if (device->words[CR1] & ENPEC) {
        set_pec(device, crc);
    }
}

/* Bytes. */

/* A byte has come: into DR, or behind it, where it holds SCL. */
static void take(struct device *device, uint32_t byte)
{
    struct i2c *i2c = device->state;
    if (!(device->words[SR1] & RXNE)) {
        i2c->rdr = byte;
        device->words[SR1] |= RXNE;
    } else if (device->words[CR1] & NOSTRETCH && !(device->words[SR2] & MSL)) {
        device->words[SR1] |= OVR;
    } else {
        i2c->received = HELD | byte;
        device->words[SR1] |= BTF;
    }
}

/* Puts what is to be sent into the shift register; false: there is nothing. */
static bool load(struct device *device)
{
    struct i2c *i2c = device->state;
    const bool is_pec = (device->words[CR1] & (CR1_PEC | ENPEC)) == (CR1_PEC | ENPEC);
    i2c->is_pec = !i2c->tdr && is_pec;
    if (!i2c->tdr && !is_pec) {
        return false;
    }
    i2c->shift = i2c->tdr ? i2c->tdr : HELD | pec_of(device);
    i2c->tdr = 0;
    device->words[CR1] &= i2c->is_pec ? ~(uint32_t)CR1_PEC : ~0u;
    device->words[SR1] = (device->words[SR1] & ~(uint32_t)BTF) | (i2c->is_pec ? 0 : TXE);
    return true;
}

/* Whether the byte that has just come is the last that DMA takes (RM0008 26.3.7): its channel has so many to go. */
static bool is_last_of_dma(struct device *device)
{
    const struct i2c *i2c = device->state;
    uint32_t left = 0;
    if ((device->words[CR2] & (DMAEN | LAST)) != (DMAEN | LAST) || !bus_read(device, i2c->counter, 4, &left)) {
        return false;
    }
    return left == (device->words[SR1] & RXNE ? 2 : 1);
}

static bool checks_pec(const struct device *device) { return (device->words[CR1] & (CR1_PEC | ENPEC)) == (CR1_PEC | ENPEC); }

static bool will_acknowledge(struct device *device, uint32_t byte)
{
    const struct i2c *i2c = device->state;
    const uint32_t *words = device->words;
    if (checks_pec(device)) {
        return !(words[SR2] & MSL) && byte == pec_of(device);
    }
    return (words[CR1] & POS ? i2c->next_ack : words[CR1] & ACK) && !is_last_of_dma(device);
}

/* Takes a received byte with its PEC; returns whether it is acknowledged. */
static bool receive(struct device *device, uint32_t byte)
{
    struct i2c *i2c = device->state;
    uint32_t *words = device->words;
    const bool is_ack = will_acknowledge(device, byte);
    if (checks_pec(device)) {
        words[SR1] |= byte != pec_of(device) ? PECERR : 0;
        words[CR1] &= ~(uint32_t)CR1_PEC;
    }
    add_to_pec(device, byte);
    take(device, byte);
    i2c->next_ack = words[CR1] & ACK;
    return is_ack;
}

/* The master. */

static void begin_start(struct device *device, uint64_t ns)
{
    struct i2c *i2c = device->state;
    if (i2c->phase == FREE && (device->words[CR1] & (PE | START)) == (PE | START) && !(device->words[SR2] & BUSY)) {
        if (!carries(device, SCL) || !carries(device, SDA)) {
            ask_about(device, NO_PINS);
        }
        run_from(device, ns);
        begin(device, STARTING, CONDITION);
    }
}

/* What the master does next, where the software lets it; else it holds SCL. */
static void go_on(struct device *device, uint64_t ns)
{
    struct i2c *i2c = device->state;
    uint32_t *words = device->words;
    if (i2c->phase == HOLD) {
        run_from(device, ns);
    }
    const bool waits_for_address = words[SR1] & (SB | ADD10);
    if (words[CR1] & (START | STOP) && words[SR2] & TRA && i2c->has_sent && words[SR1] & TXE) {
        words[SR1] |= BTF; /* until the condition has gone out (RM0008 26.6.6): drivers look for it who ask for that early */
    }
    if (words[SR1] & ADDR) {
        rest(device, HOLD);
    } else if (words[CR1] & STOP) {
        begin(device, STOPPING, CONDITION);
    } else if (words[CR1] & START && !(words[SR1] & SB)) {
        begin(device, STARTING, CONDITION);
    } else if (waits_for_address || i2c->was_refused) {
        rest(device, HOLD);
    } else if (words[SR2] & TRA) {
        if (load(device)) {
            begin(device, SENDING, DATA);
        } else {
            words[SR1] |= i2c->has_sent ? BTF | TXE : TXE;
            rest(device, HOLD);
        }
    } else if (i2c->received) {
        rest(device, HOLD);
    } else {
        i2c->incoming = i2c->has_parts && carries(device, SDA) ? ask_about(device, READ) & 0xFF : 0xFF;
        begin(device, RECEIVING, BYTE);
    }
}

static void end_start(struct device *device, uint64_t ns)
{
    struct i2c *i2c = device->state;
    uint32_t *words = device->words;
    tell(device, ns, TELL_START, 0);
    if (!(words[SR2] & MSL)) {
        set_pec(device, 0);
    }
    words[CR1] &= ~(uint32_t)START;
    words[SR1] = (words[SR1] & ~(uint32_t)(TXE | BTF)) | SB;
    words[SR2] = (words[SR2] & ~(uint32_t)TRA) | MSL | BUSY;
    i2c->was_refused = i2c->is_second = i2c->has_sent = i2c->tdr = 0;
}

static void lose_arbitration(struct device *device, uint64_t ns)
{
    struct i2c *i2c = device->state;
    tell(device, ns, TELL_LOST, 0);
    device->words[SR1] = (device->words[SR1] & ~(uint32_t)(TXE | BTF)) | ARLO;
    device->words[SR2] &= ~(uint32_t)(MSL | TRA);
    i2c->tdr = 0;
    if (i2c->is_lost) { /* chosen: who has won sends one byte more */
        begin(device, OTHERS, BYTE);
    } else {
        rest(device, FREE);
    }
    i2c->is_lost = false;
}

/* The eight bits of an address or a byte have gone out: who is meant acknowledges them, or another master has won. */
static void ask_parts(struct device *device)
{
    struct i2c *i2c = device->state;
    const uint32_t byte = i2c->shift & 0xFF;
    const bool can_be_heard = i2c->has_parts && carries(device, SCL) && carries(device, SDA);
    i2c->answer = ANSWERED;
    if (i2c->is_lost || (is_low(device, SDA) && byte != 0)) {
        i2c->answer |= HAS_LOST;
    } else if (can_be_heard) {
        i2c->answer |= ask(device, i2c->phase == ADDRESSING ? ADDRESS : WRITE, byte) & HELD;
    }
    go_on_for(device, ACKNOWLEDGE);
}

/* An address or a byte has gone out, with its acknowledge. */
static void end_sent(struct device *device, uint64_t ns)
{
    struct i2c *i2c = device->state;
    uint32_t *words = device->words;
    const uint32_t byte = i2c->shift & 0xFF;
    const bool is_address = i2c->phase == ADDRESSING, is_ack = i2c->answer & HELD;
    if (i2c->answer & HAS_LOST) {
        lose_arbitration(device, ns);
        return;
    }
    tell(device, ns, TELL_BYTE, (is_ack ? HELD : 0) | byte);
    add_to_pec(device, byte);
    i2c->was_refused = !is_ack;
    if (!is_ack) {
        words[SR1] = (words[SR1] & ~(uint32_t)TXE) | AF;
    } else if (is_address && (byte & 0xF9) == 0xF0 && !i2c->is_second) {
        words[SR1] |= ADD10;
    } else if (is_address) {
        words[SR1] |= ADDR;
        words[SR2] = byte & 1 && !i2c->is_second ? words[SR2] & ~(uint32_t)TRA : words[SR2] | TRA;
        ask_for_byte(device);
        i2c->next_ack = words[CR1] & ACK;
    }
    i2c->has_sent = !is_address;
    go_on(device, ns);
}

static void end_stop(struct device *device, uint64_t ns)
{
    struct i2c *i2c = device->state;
    uint32_t *words = device->words;
    tell(device, ns, TELL_STOP, 0);
    if (i2c->has_parts) {
        ask_about(device, END);
    }
    words[CR1] &= ~(uint32_t)(STOP | CR1_PEC);
    words[SR1] &= ~(uint32_t)(SB | ADD10 | TXE | (words[SR2] & TRA ? BTF : 0));
    words[SR2] &= ~(uint32_t)(MSL | BUSY | TRA);
    i2c->tdr = 0;
    rest(device, FREE);
    begin_start(device, ns);
    if (i2c->phase == FREE && i2c->far_waits) {
        i2c->far_waits = false;
        device->kind->command(device, CALL, 0, 0);
    }
}

/* A master outside. */

/* Whether an address is its own: 1, or the flag of SR2 that says which of them; 0: it is not. */
static uint32_t which_address(const struct device *device, uint32_t byte)
{
    const struct i2c *i2c = device->state;
    const uint32_t *words = device->words;
    const uint32_t own = words[OAR1], dual = words[OAR2];
    if (byte == 0 && words[CR1] & ENGC) {
        return GENCALL;
    }
    if (own >> 15 & 1) { /* ten bits: the header, to read the second time */
        return byte == (0xF1 | (own >> 7 & 6)) && i2c->header;
    }
    if (byte >> 1 == (own >> 1 & 0x7F)) {
        return 1;
    }
    return dual & 1 && byte >> 1 == (dual >> 1 & 0x7F) ? DUALF : 0;
}

static bool listens(const struct device *device) { return (device->words[CR1] & (PE | ACK)) == (PE | ACK); }

static bool is_my_header(const struct device *device, uint32_t byte)
{
    const uint32_t own = device->words[OAR1];
    return own >> 15 && byte == (0xF0 | (own >> 7 & 6));
}

static uint32_t called(struct device *device, bool is_read)
{
    struct i2c *i2c = device->state;
    device->words[SR1] |= ADDR;
    device->words[SR2] |= is_read ? TRA : 0;
    ask_for_byte(device);
    i2c->is_own = true;
    i2c->next_ack = device->words[CR1] & ACK;
    return HELD;
}

static uint32_t end_far_start(struct device *device, uint32_t byte)
{
    struct i2c *i2c = device->state;
    uint32_t *words = device->words;
    const uint32_t which = listens(device) ? which_address(device, byte) : 0;
    words[SR1] &= ~(uint32_t)(BTF | TXE);
    words[SR2] = (words[SR2] & ~(uint32_t)(TRA | GENCALL | DUALF)) | BUSY;
    if (!(i2c->is_own || i2c->header)) {
        set_pec(device, 0);
    }
    i2c->is_own = i2c->tdr = i2c->was_refused = false;
    add_to_pec(device, byte);
    if (which) {
        words[SR2] |= which & (GENCALL | DUALF);
        return called(device, byte & 1);
    }
    const bool is_header = listens(device) && is_my_header(device, byte);
    i2c->header = is_header;
    i2c->is_second = is_header;
    return is_header ? HELD : 0;
}

static uint32_t end_far_write(struct device *device, uint32_t byte)
{
    struct i2c *i2c = device->state;
    if (i2c->is_second) { /* of a 10-bit address */
        i2c->is_second = false;
        add_to_pec(device, byte);
        i2c->header = byte == (device->words[OAR1] & 0xFF);
        return i2c->header ? called(device, false) : 0;
    }
    return i2c->is_own && device->words[CR1] & PE && receive(device, byte) ? HELD : 0;
}

static uint32_t end_far_read(struct device *device, uint32_t acknowledges)
{
    struct i2c *i2c = device->state;
    const uint32_t byte = i2c->shift & 0xFF;
    add_to_pec(device, byte);
    if (!acknowledges && i2c->is_own) {
        device->words[SR1] = (device->words[SR1] & ~(uint32_t)TXE) | AF;
        i2c->was_refused = true;
    }
    return byte;
}

static uint32_t end_far_stop(struct device *device)
{
    struct i2c *i2c = device->state;
    uint32_t *words = device->words;
    words[SR1] = (words[SR1] & ~(uint32_t)(TXE | (words[SR2] & TRA ? BTF : 0))) | (i2c->is_own && !(words[SR2] & TRA) ? STOPF : 0);
    words[SR2] &= ~(uint32_t)(BUSY | TRA | GENCALL | DUALF);
    words[CR1] &= ~(uint32_t)CR1_PEC;
    i2c->is_own = i2c->is_second = i2c->header = 0;
    return 0;
}

/* The next step of a master outside, which waits where the software has to read or write first. */
static void go_on_far(struct device *device, uint64_t ns)
{
    struct i2c *i2c = device->state;
    uint32_t *words = device->words;
    const uint32_t step = i2c->far >> FAR_AT;
    const bool sends = step == FAR_READ && i2c->is_own && words[SR2] & TRA;
    const bool waits = words[SR1] & ADDR || i2c->received || (sends && !i2c->tdr && !(words[CR1] & CR1_PEC));
    if (i2c->phase == FAR_HOLD) {
        run_from(device, ns);
    }
    if (step == FAR_NOTHING) {
        rest(device, FREE);
        begin_start(device, ns);
        return;
    }
    if (i2c->is_own && waits && !(words[CR1] & NOSTRETCH)) {
        words[SR1] |= sends && i2c->has_sent && !(words[SR1] & ADDR) ? BTF : 0;
        rest(device, FAR_HOLD);
        return;
    }
    if (sends) {
        words[SR1] |= load(device) ? 0 : OVR;
        i2c->has_sent = true;
    } else if (step == FAR_READ) {
        i2c->shift = 0xFF;
    }
    i2c->has_sent = step == FAR_READ && i2c->has_sent;
    begin(device, FAR, step == FAR_STOP ? CONDITION : step == FAR_START ? BYTE + CONDITION : BYTE);
}

static void end_far(struct device *device, uint64_t ns)
{
    struct i2c *i2c = device->state;
    const uint32_t byte = i2c->far & 0xFF, step = i2c->far >> FAR_AT;
    const uint32_t answer = step == FAR_START   ? end_far_start(device, byte)
                            : step == FAR_WRITE ? end_far_write(device, byte)
                            : step == FAR_READ  ? end_far_read(device, byte)
                                                : end_far_stop(device);
    if (step == FAR_START) {
        tell(device, ns, TELL_START, 0);
    }
    if (step == FAR_STOP) {
        tell(device, ns, TELL_STOP, 0);
    } else {
        tell(device, ns, TELL_BYTE, step == FAR_READ ? answer | (byte ? HELD : 0) : byte | (answer & HELD));
    }
    i2c->far = ask(device, NEXT_STEP, answer);
    if (step == FAR_STOP && i2c->rate_hz != i2c->far_hz) { /* the next master has another clock */
        run_from(device, ns);
        i2c->rate_hz = i2c->far_hz;
    }
    go_on_far(device, ns);
}

/* What is shown on the pins. */

static bool is_watched(const struct device *device, uint32_t which)
{
    const struct i2c *i2c = device->state;
    const struct fabric *fabric = device->fabric;
    const uint32_t port = i2c->pins[which] / PINS, bit = 1u << i2c->pins[which] % PINS;
    bool is_listened = false;
    for (uint32_t n = 0; n < fabric->listener_count; ++n) {
        is_listened |= fabric->listeners[n].device != device && fabric->listeners[n].pins[port] & bit;
    }
    return is_listened || fabric->subscribed[port] & bit;
}

/* Has a line held low from outside, or let go. */
static void hold(struct device *device, uint32_t which, bool is_held)
{
    const struct i2c *i2c = device->state;
    struct port *port = &device->fabric->ports[i2c->pins[which] / PINS];
    const uint32_t bit = 1u << i2c->pins[which] % PINS;
    if (!(port->bus_low & bit) == is_held) {
        port->bus_low ^= bit;
        pins_changed(device->fabric, i2c->pins[which] / PINS);
    }
}

/* Puts a level on a line for the chip, or for who is outside: the new driver begins before the old one lets go. */
static void show(struct device *device, uint32_t which, bool is_high, bool is_outside)
{
    if (is_outside) {
        hold(device, which, !is_high);
        put(device, which, HIGH);
    } else {
        put(device, which, is_high ? HIGH : LOW);
        hold(device, which, false);
    }
}

static bool is_far(const struct i2c *i2c) { return i2c->phase >= FAR; }

static bool is_stop(const struct i2c *i2c)
{
    return i2c->phase == STOPPING || (i2c->phase == FAR && i2c->far >> FAR_AT == FAR_STOP);
}

/* Steps of a condition, quarters of a bit, before the steps of a byte, two a bit. */
static uint32_t condition_steps(const struct i2c *i2c)
{
    return i2c->phase == STARTING || is_stop(i2c) || (i2c->phase == FAR && i2c->far >> FAR_AT == FAR_START) ? 3 : 0;
}

static uint32_t all_steps(const struct i2c *i2c)
{
    return condition_steps(i2c) + (i2c->phase == STARTING || is_stop(i2c) ? 0 : 2 * BYTE);
}

static uint64_t step_ns(const struct device *device, uint32_t step)
{
    const struct i2c *i2c = device->state;
    const uint32_t control = device->words[CCR], conditions = condition_steps(i2c), byte_step = step - conditions;
    const uint64_t bit = bit_ticks(device), is_fast = !is_far(i2c) && control & FS;
    const uint64_t low = !is_fast ? 1 : control & DUTY ? 16 : 2, both = !is_fast ? 2 : control & DUTY ? 25 : 3;
    const bool is_condition = step < conditions;
    const uint64_t parts = is_condition ? 4 : both;
    const uint64_t at = is_condition ? bit * step : bit * (parts * ((conditions ? 1 : 0) + byte_step / 2) + (byte_step % 2 ? low : 0));
    return i2c->base_ns + (uint64_t)((__uint128_t)(i2c->shown_from * parts + at) * NS_PER_S / (parts * i2c->rate_hz));
}

/* Whether the chip acknowledges a byte of a master outside that is under way. */
static bool will_answer(struct device *device)
{
    const struct i2c *i2c = device->state;
    const uint32_t byte = i2c->far & 0xFF;
    if (i2c->far >> FAR_AT == FAR_START) {
        return listens(device) && (which_address(device, byte) || is_my_header(device, byte));
    }
    if (i2c->is_second) {
        return byte == (device->words[OAR1] & 0xFF);
    }
    return i2c->is_own && device->words[CR1] & PE && will_acknowledge(device, byte);
}

static void show_bit(struct device *device, uint32_t n)
{
    const struct i2c *i2c = device->state;
    const bool is_read = i2c->phase == RECEIVING, is_ack = n == DATA;
    const bool far_reads = i2c->phase == FAR && i2c->far >> FAR_AT == FAR_READ;
    const uint32_t byte = is_read ? i2c->incoming : is_far(i2c) && !far_reads ? i2c->far : i2c->shift;
    bool level = byte >> (DATA - 1 - n % DATA) & 1;
    if (is_ack) {
        level = is_read ? !will_acknowledge(device, i2c->incoming) : far_reads ? !(i2c->far & 1)
              : is_far(i2c)                                        ? !will_answer(device)
                                                                   : !(i2c->answer & HELD);
    }
    const bool sender_is_outside = is_read || (is_far(i2c) && !far_reads);
    show(device, SDA, level, sender_is_outside != is_ack);
}

static void show_step(struct device *device)
{
    struct i2c *i2c = device->state;
    const uint32_t step = i2c->show - 1, conditions = condition_steps(i2c);
    const bool is_outside = is_far(i2c);
    if (step >= conditions) {
        const uint32_t half = step - conditions;
        show(device, SCL, half % 2, is_outside);
        if (half % 2 == 0) {
            show_bit(device, half / 2);
        }
    } else if (step == 1) {
        show(device, SCL, true, is_outside);
    } else { /* START is a fall of SDA while SCL is high, STOP a rise */
        show(device, SDA, is_stop(i2c) == (step == 2), is_outside);
    }
    ++i2c->show;
    i2c->show_ns = i2c->show <= all_steps(i2c) ? step_ns(device, i2c->show - 1) : NO_TIME;
}

static void let_go(struct device *device)
{
    struct i2c *i2c = device->state;
    for (uint32_t n = SCL; n <= SDA; ++n) {
        if (i2c->show) {
            show(device, n, true, false);
        }
    }
    i2c->show = 0;
    i2c->show_ns = NO_TIME;
}

static void begin_to_show(struct device *device)
{
    struct i2c *i2c = device->state;
    if (i2c->phase == OTHERS || !(is_watched(device, SCL) || is_watched(device, SDA))) {
        let_go(device);
        return;
    }
    i2c->show = 1;
    show_step(device);
}

/* What is under way ends: SCL is low behind all but a STOP. */
static void show_end(struct device *device)
{
    struct i2c *i2c = device->state;
    i2c->show_ns = NO_TIME;
    if (i2c->show && !is_stop(i2c)) {
        show(device, SCL, false, is_far(i2c));
    }
}

/* Nobody sends until `phase` ends: the chip holds SCL, or the bus is free. */
static void show_rest(struct device *device, enum phase phase)
{
    struct i2c *i2c = device->state;
    i2c->show_ns = NO_TIME;
    if (phase == FREE) {
        let_go(device);
    } else if (i2c->show) {
        show(device, SCL, false, false);
        if (i2c->phase != STARTING) {
            show(device, SDA, true, false);
        }
    }
}

/* Events. */

static void end_phase(struct device *device, uint64_t ns)
{
    struct i2c *i2c = device->state;
    show_end(device);
    switch (i2c->phase) {
    case STARTING:
        end_start(device, ns);
        rest(device, HOLD);
        break;
    case ADDRESSING:
    case SENDING: end_sent(device, ns); break;
    case RECEIVING:
        i2c->was_refused = !receive(device, i2c->incoming);
        tell(device, ns, TELL_BYTE, (i2c->was_refused ? 0 : HELD) | i2c->incoming);
        go_on(device, ns);
        break;
    case STOPPING: end_stop(device, ns); break;
    case OTHERS:
        device->words[SR2] &= ~(uint32_t)BUSY;
        rest(device, FREE);
        begin_start(device, ns);
        break;
    default: end_far(device, ns); break;
    }
}

/* SCL has been low for too long: nothing is under way any more. */
static void time_out(struct device *device)
{
    struct i2c *i2c = device->state;
    tell(device, i2c->timeout_ns, TELL_CUT, 0);
    i2c->timeout_ns = NO_TIME;
    device->words[SR1] |= TIMEOUT;
    device->words[CR1] &= ~(uint32_t)(START | STOP);
    device->words[SR2] &= ~(uint32_t)(MSL | TRA);
    i2c->tdr = i2c->far = 0;
    if (i2c->phase != FREE && i2c->has_parts) {
        ask_about(device, END);
    }
    rest(device, FREE);
}

static void event(struct device *device, uint64_t until)
{
    struct i2c *i2c = device->state;
    const bool has_timeout = !i2c->is_stopped;
    while (!(i2c->is_stopped & CLOCK_STOPPED) &&
           (i2c->due_ns <= until || i2c->show_ns <= until || (has_timeout && i2c->timeout_ns <= until))) {
        if (i2c->show_ns < i2c->due_ns && !(has_timeout && i2c->timeout_ns <= i2c->show_ns)) {
            show_step(device);
        } else if (has_timeout && i2c->timeout_ns <= i2c->due_ns) {
            time_out(device);
        } else if ((i2c->phase == ADDRESSING || i2c->phase == SENDING) && !i2c->answer) {
            ask_parts(device);
        } else if (low_lines(device) & 1 << SCL) { /* somebody holds the clock: it ends when that lets go */
            i2c->is_late = true;
            i2c->due_ns = NO_TIME;
        } else {
            const uint64_t ns = i2c->due_ns;
            i2c->due_ns = NO_TIME; /* what it puts on the pins comes back by `pins` */
            end_phase(device, ns);
        }
    }
    wait_for_events(device);
    update_outputs(device);
}

static void pins(struct device *device, uint32_t port, uint32_t changed)
{
    struct i2c *i2c = device->state;
    uint32_t *words = device->words;
    const uint64_t ns = counted_ns(device, CLOCK_STOPPED);
    const uint32_t before = i2c->lines, low = low_lines(device);
    (void)port, (void)changed;
    i2c->lines = low;
    if (low & ~before & 1 << SMBA && (words[CR1] & (PE | SMBUS | SMBTYPE)) == (PE | SMBUS | SMBTYPE)) {
        words[SR1] |= SMBALERT;
    }
    if (i2c->phase == FREE) {
        if (low & (1 << SCL | 1 << SDA)) {
            words[SR2] |= BUSY;
        } else if (before & 1 << SDA && !(before & 1 << SCL)) { /* SDA rises while SCL is high: a STOP */
            words[SR2] &= ~(uint32_t)BUSY;
            begin_start(device, ns);
        }
    } else if (i2c->is_late && !(low & 1 << SCL)) {
        i2c->is_late = false;
        i2c->due_ns = ns;
        i2c->base_ns = ns;
        i2c->ticks = 0;
    }
    i2c->timeout_ns = !(low & 1 << SCL) || !(words[CR1] & SMBUS) ? NO_TIME : before & 1 << SCL ? i2c->timeout_ns : counted_ns(device, CLOCK_STOPPED | TIMEOUT_STOPPED) + TIMEOUT_NS;
    if (i2c->due_ns <= ns && device->fabric->event_ns == NO_TIME) {
        event(device, ns);
    }
    wait_for_events(device);
    update_outputs(device);
}

/* Registers. */

static void release(struct device *device)
{
    const struct i2c *i2c = device->state;
    const uint64_t ns = now_ns(device->fabric);
    if (i2c->phase == HOLD) {
        go_on(device, ns);
    } else if (i2c->phase == FAR_HOLD) {
        go_on_far(device, ns);
    } else if (i2c->phase == FREE) {
        begin_start(device, ns);
    }
    wait_for_events(device);
}

static uint32_t read(struct device *device, uint32_t index)
{
    struct i2c *i2c = device->state;
    uint32_t *words = device->words;
    if (index == SR2) {
        const uint32_t status = words[SR2];
        if (words[SR1] & words[SEEN] & ADDR) {
            words[SR1] &= ~(uint32_t)ADDR;
            release(device);
            update_outputs(device);
        }
        return status;
    }
    const uint32_t byte = i2c->rdr;
    words[SR1] &= ~(uint32_t)(RXNE | BTF);
    if (i2c->received) {
        i2c->rdr = i2c->received & 0xFF;
        i2c->received = 0;
        words[SR1] |= RXNE;
        release(device);
    }
    update_outputs(device);
    return byte;
}

static void write_data(struct device *device, uint32_t byte)
{
    struct i2c *i2c = device->state;
    uint32_t *words = device->words;
    if (words[SR1] & (SB | ADD10)) {
        if (!(words[SEEN] & words[SR1] & (SB | ADD10))) {
            ask_about(device, SEQUENCE);
            return;
        }
        i2c->is_second = words[SR1] & ADD10;
        words[SR1] &= ~(uint32_t)(SB | ADD10);
        i2c->shift = HELD | byte;
        run_from(device, now_ns(device->fabric));
        begin(device, ADDRESSING, DATA);
        wait_for_events(device);
    } else if (words[SR2] & TRA) {
        i2c->tdr = HELD | byte;
        words[SR1] &= ~(uint32_t)(TXE | BTF);
        release(device);
    }
}

static void clear(struct device *device, bool keeps_busy)
{
    struct i2c *i2c = device->state;
    device->words[CR1] &= ~(uint32_t)(START | STOP | ACK | CR1_PEC | ALERT);
    device->words[SR1] = 0;
    device->words[SR2] = keeps_busy && i2c->phase == FREE ? device->words[SR2] & BUSY : 0;
    device->words[SEEN] = 0;
    if (i2c->phase != FREE) {
        tell(device, now_ns(device->fabric), TELL_CUT, 0);
    }
    if (i2c->phase != FREE && i2c->has_parts) {
        ask_about(device, END);
    }
    i2c->is_stopped = 0;
    i2c->answer = 0;
    i2c->shift = i2c->tdr = i2c->rdr = i2c->received = i2c->far = i2c->is_own = i2c->header = i2c->is_lost = false;
    i2c->next_ack = i2c->was_refused = i2c->has_sent = i2c->is_second = i2c->is_pec = i2c->lines = 0;
    i2c->timeout_ns = NO_TIME;
    rest(device, FREE);
    schedule(device, NO_TIME);
}

static void write_control(struct device *device, uint32_t previous)
{
    struct i2c *i2c = device->state;
    uint32_t *words = device->words;
    if (words[CR1] & SWRST) { /* RM0008 26.6.1: everything else is in its reset state while it is set */
        for (uint32_t n = CR1; n <= TRISE; ++n) {
            words[n] = n == CR1 ? SWRST : n == TRISE ? 2 : 0;
        }
        clear(device, false);
    } else if (!(words[CR1] & PE)) {
        clear(device, true);
    } else {
        words[SR1] &= ~(words[SEEN] & STOPF); /* a read of SR1, then a write of CR1 */
        words[SEEN] &= ~(uint32_t)STOPF;
    }
    connect(device);
    listen(device);
    if (words[CR1] & ~previous & PE) {
        i2c->lines = (uint32_t)is_low(device, SCL) | (uint32_t)is_low(device, SDA) << SDA;
        words[SR2] |= i2c->lines ? BUSY : 0;
    }
    if (!(words[SR2] & MSL) && !(previous & STOP)) {
        words[CR1] &= i2c->phase == STARTING || words[CR1] & START ? ~0u : ~(uint32_t)STOP;
    }
    release(device);
}

static void write(struct device *device, uint32_t index, uint32_t written, uint32_t previous)
{
    if (index == CR1) {
        write_control(device, previous);
    } else if (index == DR) {
        write_data(device, written & 0xFF);
    }
    update_outputs(device);
}

/* What only fills a buffer or lowers a flag needs none. */
static bool needs_time(const struct device *device, uint32_t index, bool is_write)
{
    const struct i2c *i2c = device->state;
    const uint32_t *words = device->words;
    if (is_write) {
        return index == CR1 || index == CR2 || (index == DR && i2c->phase != SENDING && i2c->phase != FAR);
    }
    return index == SR2 ? (words[SR1] & words[SEEN] & ADDR) != 0 : i2c->received != 0;
}

static uint32_t command(struct device *device, uint32_t what, uint32_t one, uint32_t other)
{
    struct i2c *i2c = device->state;
    const uint64_t now = now_ns(device->fabric);
    switch (what) {
    case SETTLE: return one == SR2 ? device->words[SR2] : i2c->rdr;
    case RESET:
        clear(device, false);
        connect(device);
        listen(device);
        break;
    case CLOCK:
        event(device, now);
        if (i2c->due_ns != NO_TIME && i2c->phase < FAR && one != i2c->clock_hz) {
            i2c->base_ns = now + (uint64_t)((__uint128_t)(i2c->due_ns - now) * i2c->clock_hz / one);
            i2c->ticks = 0;
            i2c->rate_hz = one;
            i2c->due_ns = i2c->base_ns;
            i2c->show_ns = NO_TIME; /* the rest of the byte is not shown */
            wait_for_events(device);
        }
        i2c->clock_hz = one;
        break;
    case MOVE:
        for (uint32_t n = 0; n < I2C_PINS; ++n) {
            const uint32_t pin = one >> 8 * n & 0xFF;
            if (pin != i2c->pins[n]) {
                put(device, n, FLOATING);
                hold(device, n, false);
                i2c->pins[n] = pin;
            }
        }
        connect(device);
        listen(device);
        break;
    case CALL:
        if (i2c->phase != FREE || device->words[SR2] & BUSY || i2c->is_stopped & CLOCK_STOPPED) {
            i2c->far_waits = true;
            break;
        }
        i2c->far = ask_about(device, NEXT_STEP);
        i2c->phase = FAR_HOLD;
        i2c->rate_hz = i2c->far_hz;
        go_on_far(device, now);
        wait_for_events(device);
        break;
    case DISTURB:
        i2c->is_lost = one == ARLO;
        device->words[SR1] |= one & BERR;
        break;
    case STOPPED:
        event(device, now);
        stop(device, CLOCK_STOPPED);
        break;
    case HOLD_TIMEOUT: stop(device, TIMEOUT_STOPPED); return 0;
    case RESUMED:
    case GO_ON_TIMEOUT:
        resume(device, (uint64_t)other << 32 | one);
        if (i2c->phase == FREE && i2c->far_waits && !(device->words[SR2] & BUSY)) {
            i2c->far_waits = false;
            command(device, CALL, 0, 0);
        }
        break;
    case LISTEN: listen(device); return 0;
    default: break;
    }
    update_outputs(device);
    return 0;
}

DEVICE_KIND(i2c_kind) = {.name = "i2c", .needs_time = needs_time, .read = read, .write = write, .event = event, .pins = pins, .command = command};
