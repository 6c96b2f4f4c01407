/* A USART: characters at the speed of the line. What is warned of, and lines whose far end has another
 * speed, are Python's business (peripherals/usart.py, which has the theory of operation).
 *
 * Source: RM0008 27.
 * Invariant: a character ends floor(frame half-bits * BRR * 10**9 / (2 * PCLK)) ns after the point from which its run
 * of characters is counted.
 */
#include "../fabric/fabric.h"
#include "../registers/usart.h"

/* SEEN is SR at its last read (half of the sequence that clears a flag), TDR stands behind the shift register, SHIFT is
 * what is in it (0: nothing), RDR what DR reads. Flags of SR, and what enables the first of them in CR1 at the same places. */
enum { ASKING = TXE | TC | RXNE | IDLE, READ_SEQUENCE = 0x1F };
/* How far its alternate functions RTS and CK stand before TX; bits of a break in LIN mode. */
enum { RTS_FROM_TX = 2, CK_FROM_TX = 3, LIN_BREAK_BITS = 13 };
/* A data word, what marks one in TDR and SHIFT, and what SHIFT holds besides. */
enum { WORD = 0x1FF, HELD = 1 << 16, PREAMBLE = 1 << 17, BREAK = 1 << 18, FLAGS_AT = 16 };
static bool is_transmitting(const struct device *device) { return (device->words[CR1] & (UE | TE)) == (UE | TE); }

static bool carries(const struct device *device)
{
    const struct usart *usart = device->state;
    const struct port *port = &device->fabric->ports[usart->tx_pin / PINS];
    const uint32_t at = usart->tx_pin % PINS;
    const uint64_t sources = port->sources[at];
    return port->alternate & port->bonded & ~port->held & 1u << at && (sources & -sources) >> usart->source & 1;
}

/* Whether the receiver hears the line. The input of a pin is on in every mode but analog (RM0008 9.1); what the chip
 * itself drives there, the far end cannot change. */
static bool can_receive(const struct device *device)
{
    const struct usart *usart = device->state;
    const bool is_one_wire = device->words[CR3] & HDSEL;
    const uint32_t pin = is_one_wire ? usart->tx_pin : usart->rx_pin;
    const struct port *port = &device->fabric->ports[pin / PINS];
    /* On one wire the USART itself drives its pin; else nobody of the chip may. */
    const uint32_t deaf = is_one_wire ? ~port->alternate & (port->output | port->analog)
                                      : port->analog | port->low | port->high;
    const uint32_t listening = port->bonded & ~(port->held | deaf);
    return (device->words[CR1] & (UE | RE)) == (UE | RE) && device->words[BRR] && listening >> pin % PINS & 1;
}

static uint64_t frame_half_bits(const struct device *device)
{
    static const uint8_t stop_half_bits[4] = {2, 1, 4, 3};
    const uint32_t data_bits = device->words[CR1] & M ? 9 : 8;
    return 2 * (1 + data_bits) + stop_half_bits[device->words[CR2] >> 12 & 3];
}

/* Whether the far end lets us send: nCTS is low, or does not matter. */
static bool may_send(const struct device *device)
{
    const struct usart *usart = device->state;
    const bool is_high = port_now(device->fabric, usart->cts_pin / PINS)->input >> usart->cts_pin % PINS & 1;
    return !(device->words[CR3] & CTSE && is_high);
}

static uint64_t span_ns(const struct device *device, uint64_t half_bits)
{
    const struct usart *usart = device->state;
    return (uint64_t)((__uint128_t)half_bits * device->words[BRR] * NS_PER_S / (2 * (uint64_t)usart->clock_hz));
}

/* Interrupt and DMA requests. */
static void update_outputs(struct device *device)
{
    const uint32_t status = device->words[SR], control = device->words[CR1], dma = device->words[CR3];
    /* TXEIE, TCIE and IDLEIE sit at the places of their flags; ORE shares RXNEIE. */
    output_set(device, IRQ,
               (status & control & ASKING) || (status & ORE && control & RXNEIE) || (status & PE && control & PEIE) ||
                   (status & (FE | NE | ORE) && (dma & (EIE | DMAR)) == (EIE | DMAR)) ||
                   (status & LBD && device->words[CR2] & LBDIE) || (status & CTS && dma & CTSIE));
    output_set(device, TX_DMA, dma & DMAT && status & TXE && is_transmitting(device));
    output_set(device, RX_DMA, dma & DMAR && status & RXNE);
    struct usart *usart = device->state;
    const uint32_t ready = dma & RTSE && control & UE ? (status & RXNE ? HIGH : LOW) : FLOATING;
    if (ready != usart->rts) {
        usart->rts = ready;
        offer(device->fabric, usart->rts_pin, usart->source - RTS_FROM_TX, ready);
    }
}

/* Works out all deadlines from what is on the line. */
static void find_deadlines(struct device *device)
{
    struct usart *usart = device->state;
    usart->tx_due_ns = device->words[SHIFT] ? usart->tx_base_ns + span_ns(device, usart->tx_half_bits) : NO_TIME;
    usart->rx_due_ns = usart->rx_count && !usart->rx_waits ? usart->rx_base_ns + span_ns(device, usart->rx_half_bits) : NO_TIME;
    usart->bit_due_ns = usart->bits ? usart->tx_base_ns + span_ns(device, usart->bit_half_bits) : NO_TIME;
    usart->ck_due_ns = usart->ck_edges ? usart->tx_base_ns + span_ns(device, usart->ck_half_bits) : NO_TIME;
    uint64_t due = usart->tx_due_ns;
    due = usart->ck_due_ns < due ? usart->ck_due_ns : due;
    due = usart->bit_due_ns < due ? usart->bit_due_ns : due;
    due = usart->rx_due_ns < due ? usart->rx_due_ns : due;
    due = usart->idle_due_ns < due ? usart->idle_due_ns : due;
    schedule(device, due);
}

/* A word with its parity, where it has one. */
static uint32_t with_parity(const struct device *device, uint32_t word)
{
    const uint32_t control = device->words[CR1], top = control & M ? 8 : 7;
    if (!(control & PCE)) {
        return word;
    }
    const uint32_t data = word & ((1u << top) - 1);
    return data | ((uint32_t)__builtin_parity(data) ^ (control & PS ? 1u : 0u)) << top;
}

/* How many bits at 0 a break has; one at 1 follows. */
static uint32_t break_bits(const struct device *device)
{
    return device->words[CR2] & LINEN ? LIN_BREAK_BITS : device->words[CR1] & M ? 11 : 10;
}

/* Has somebody who looks at the TX pin see the bits of an item, from `before` half-bits on.
 *
 * `bits` are those to come, the next one at bit 0, and above the last of them a mark. */
static void show_bits(struct device *device, uint32_t item, uint64_t before)
{
    struct usart *usart = device->state;
    const struct fabric *fabric = device->fabric;
    const uint32_t port = usart->tx_pin / PINS, count = device->words[CR1] & M ? 9 : 8;
    const bool is_seen = (fabric->subscribed[port] | fabric->listened[port]) >> usart->tx_pin % PINS & 1;
    usart->bits = 0;
    if (!is_seen || item == PREAMBLE) {
        return;
    }
    usart->bits = item == BREAK ? 3u << break_bits(device) : (with_parity(device, item & WORD) & ((1u << count) - 1)) << 1 | 3u << (count + 1);
    usart->bit_half_bits = before;
}

/* Puts the next bit on the pin, and finds the one behind it that differs. */
static void show_next_bit(struct device *device)
{
    struct usart *usart = device->state;
    const uint32_t level = usart->bits & 1;
    offer(device->fabric, usart->tx_pin, usart->source, level ? HIGH : LOW);
    do {
        usart->bits >>= 1;
        usart->bit_half_bits += 2;
    } while (usart->bits > 1 && (usart->bits & 1) == level);
    usart->bits = usart->bits > 1 ? usart->bits : 0;
}

static void set_ck(struct device *device, uint32_t level)
{
    struct usart *usart = device->state;
    if (usart->ck != level) {
        usart->ck = level;
        offer(device->fabric, usart->ck_pin, usart->source - CK_FROM_TX, level);
    }
}

/* Leaves CK at its idle level, or to others. */
static void rest_clock(struct device *device)
{
    struct usart *usart = device->state;
    const uint32_t control = device->words[CR2];
    usart->ck_edges = 0;
    set_ck(device, !(control & CLKEN && device->words[CR1] & UE) ? FLOATING : control & CPOL ? HIGH : LOW);
}

/* Has somebody who looks at CK see the clock of a character: a pulse each data bit, the last one's where LBCL says so, and
 * none of its start and stop bits. The bit stands still at the first edge, with CPHA at the second (RM0008 27.3.9). */
static void show_clock(struct device *device, uint32_t item, uint64_t before)
{
    struct usart *usart = device->state;
    const struct fabric *fabric = device->fabric;
    const uint32_t *words = device->words, port = usart->ck_pin / PINS;
    const bool is_seen = (fabric->subscribed[port] | fabric->listened[port]) >> usart->ck_pin % PINS & 1;
    usart->ck_count = usart->ck_word = 0;
    if (is_seen && item & HELD && words[CR2] & CLKEN) {
        usart->ck_edges = 2 * ((words[CR1] & M ? 9u : 8u) - (words[CR2] & LBCL ? 0 : 1));
        usart->ck_half_bits = before + (words[CR2] & CPHA ? 2 : 3);
    }
}

/* Makes an edge of CK; at the one at which the bit stands still RX is taken. */
static void show_next_edge(struct device *device)
{
    struct usart *usart = device->state;
    const bool is_second = usart->ck_edges-- & 1;
    if (is_second == !!(device->words[CR2] & CPHA)) {
        const uint32_t level = port_input(device->fabric, usart->rx_pin / PINS) >> usart->rx_pin % PINS & 1;
        usart->ck_word |= level << usart->ck_count++;
    }
    ++usart->ck_half_bits;
    set_ck(device, usart->ck == HIGH ? LOW : HIGH);
}

/* Puts an item into the shift register, `before` half-bits after `base_ns`. */
static void load(struct device *device, uint32_t item, uint64_t base_ns, uint64_t before)
{
    struct usart *usart = device->state;
    device->words[SHIFT] = item;
    usart->tx_base_ns = base_ns;
    usart->tx_half_bits = before + (item == BREAK ? 2 * break_bits(device) + 2 : frame_half_bits(device));
    show_bits(device, item, before);
    show_clock(device, item, before);
}

static void connect(struct device *device, bool is_on)
{
    const struct usart *usart = device->state;
    offer(device->fabric, usart->tx_pin, usart->source, is_on ? HIGH : FLOATING);
}

static void emit(struct device *device, uint32_t word, uint64_t ns)
{
    struct usart *usart = device->state;
    if (!carries(device)) {
        ask_about(device, TX_PIN);
        return;
    }
    if (usart->judged_hz != usart->clock_hz || usart->judged_brr != device->words[BRR]) {
        usart->judged_hz = usart->clock_hz;
        usart->judged_brr = device->words[BRR];
        ask_about(device, JUDGE_SPEED);
    }
    const uint32_t format = device->words[CR1] | (device->words[CR2] >> 12 & 3) << 16;
    const struct sent row = {ns, word, usart->clock_hz, device->words[BRR], format};
    send_word(device, &row);
}

/* A character that is in: the flags that it brings stand above it. */
static void arrive(struct device *device, uint32_t arrived)
{
    uint32_t *words = device->words;
    const uint32_t flags = arrived >> FLAGS_AT & ~(words[CR2] & LINEN ? 0u : (uint32_t)LBD);
    if (words[CR1] & WAKE && arrived >> (words[CR1] & M ? 8 : 7) & 1) { /* an address */
        words[CR1] = (arrived & ADD) == (words[CR2] & ADD) ? words[CR1] & ~(uint32_t)RWU : words[CR1] | RWU;
    }
    if (words[CR1] & RWU) {
        return;
    }
    if (words[SR] & RXNE) {
        words[SR] |= ORE | (flags & LBD);
    } else {
        words[RDR] = arrived & WORD;
        words[SR] |= RXNE | flags;
    }
}

/* What a character that goes out brings in: itself on the one wire of half-duplex, the other way in synchronous mode. */
static void hear_own(struct device *device, uint32_t word)
{
    if (!can_receive(device)) {
        return;
    }
    if (device->words[CR2] & CLKEN) {
        arrive(device, ask(device, EXCHANGE, word) & WORD);
    } else if (device->words[CR3] & HDSEL) {
        arrive(device, with_parity(device, word));
    }
}

/* Sends what waits behind the shift register. */
static void send_next(struct device *device, uint64_t base_ns, uint64_t before)
{
    const uint32_t item = device->words[TDR];
    device->words[TDR] = 0;
    device->words[SR] |= TXE;
    load(device, item, base_ns, before);
}

static void end_transmission(struct device *device, uint64_t ns)
{
    struct usart *usart = device->state;
    uint32_t *words = device->words;
    const uint32_t ended = words[SHIFT];
    words[SHIFT] = 0;
    if (ended & HELD) {
        emit(device, ended & WORD, ns);
        hear_own(device, ended & WORD);
    }
    if (ended == BREAK) {
        words[CR1] &= ~(uint32_t)SBK;
    }
    if (!is_transmitting(device)) {
        connect(device, false);
        words[SR] |= TC;
    } else if (words[CR1] & SBK) {
        load(device, BREAK, usart->tx_base_ns, usart->tx_half_bits);
    } else if (!words[TDR]) {
        words[SR] |= TC;
    } else if (may_send(device)) {
        send_next(device, usart->tx_base_ns, usart->tx_half_bits);
    }
}

static void end_reception(struct device *device, uint64_t ns)
{
    struct usart *usart = device->state;
    uint32_t *words = device->words;
    const uint32_t arrived = usart->rx[usart->rx_first];
    usart->rx_first = (usart->rx_first + 1) % RECEIVED;
    if (!--usart->rx_count && usart->rx_more) {
        ask_about(device, GIVE_MORE);
    }
    usart->rx_half_bits += frame_half_bits(device);
    if (!can_receive(device)) {
        ask_about(device, RX_OFF);
        return;
    }
    arrive(device, arrived);
    usart->rx_waits = words[CR3] & RTSE && words[SR] & RXNE; /* the far end waits for nRTS */
    if (!usart->rx_count) {
        usart->idle_due_ns = ns + span_ns(device, frame_half_bits(device));
    }
}

static void event(struct device *device, uint64_t until)
{
    struct usart *usart = device->state;
    uint64_t ns;
    while ((ns = due_ns(device)) <= until) {
        if (usart->bit_due_ns == ns) {
            show_next_bit(device);
        } else if (usart->ck_due_ns == ns) {
            show_next_edge(device);
        } else if (usart->tx_due_ns == ns) {
            end_transmission(device, ns);
        } else if (usart->rx_due_ns == ns) {
            end_reception(device, ns);
        } else {
            usart->idle_due_ns = NO_TIME;
            if (!(device->words[CR1] & RWU)) {
                device->words[SR] |= IDLE;
            } else if (!(device->words[CR1] & WAKE)) {
                device->words[CR1] &= ~(uint32_t)RWU;
            }
        }
        find_deadlines(device);
        update_outputs(device);
    }
}

static void write_data(struct device *device, uint32_t word)
{
    uint32_t *words = device->words;
    if (words[SEEN] & TC) {
        words[SEEN] &= ~(uint32_t)TC;
        words[SR] &= ~(uint32_t)TC;
    }
    if (!is_transmitting(device)) {
        ask_about(device, TX_OFF);
    } else if (!words[BRR]) {
        ask_about(device, NO_RATE);
    } else if (!words[SHIFT] && may_send(device)) {
        load(device, HELD | word, now_ns(device->fabric), 0);
        find_deadlines(device);
    } else {
        if (words[TDR]) {
            ask_about(device, CHARACTER_LOST);
        }
        words[TDR] = HELD | word;
        words[SR] &= ~(uint32_t)TXE;
    }
    update_outputs(device);
}

/* Uses the new rate from the next character on. */
static void write_rate(struct device *device, uint64_t tx_end_ns, uint64_t rx_end_ns)
{
    struct usart *usart = device->state;
    if (usart->tx_due_ns != NO_TIME) {
        usart->tx_base_ns = tx_end_ns;
        usart->tx_half_bits = 0;
        usart->bits = 0; /* the rest of the character is not shown */
        connect(device, true);
        rest_clock(device);
    }
    if (usart->rx_due_ns != NO_TIME) {
        usart->rx_base_ns = rx_end_ns;
        usart->rx_half_bits = 0;
    }
    find_deadlines(device);
}

/* Listens to nCTS, where that matters. */
static void listen(struct device *device)
{
    const struct usart *usart = device->state;
    for (uint32_t port = 0; port < PORTS; ++port) {
        const bool is_there = device->words[CR3] & CTSE && usart->cts_pin / PINS == port;
        listen_to_pins(device, port, is_there ? 1u << usart->cts_pin % PINS : 0);
    }
}

static void pins(struct device *device, uint32_t port, uint32_t changed)
{
    (void)port, (void)changed; /* nCTS */
    uint32_t *words = device->words;
    words[SR] |= CTS;
    if (words[TDR] && !words[SHIFT] && is_transmitting(device) && may_send(device)) {
        send_next(device, now_ns(device->fabric), 0);
        find_deadlines(device);
    }
    update_outputs(device);
}

/* Follows UE, TE and SBK. */
static void write_control(struct device *device)
{
    struct usart *usart = device->state;
    uint32_t *words = device->words;
    const bool is_on = is_transmitting(device), has_rate = words[BRR] > 0;
    ask_about(device, CHECK_MODES);
    if (is_on && !usart->was_enabled) {
        connect(device, true);
        if (!words[SHIFT] && has_rate) {
            load(device, PREAMBLE, now_ns(device->fabric), 0);
        }
    } else if (!(words[CR1] & TE) && words[SHIFT]) {
        /* UE lets the present character end; TE cuts it off (RM0008 27.3.2). */
        if ((words[SHIFT] | words[TDR]) & HELD) { /* an idle character or a break says nothing */
            ask_about(device, CUT_OFF);
        }
        words[SHIFT] = words[TDR] = usart->bits = 0;
        words[SR] |= TXE | TC;
    }
    if (!(words[SHIFT] & HELD && usart->ck_edges)) {
        rest_clock(device);
    }
    if (!is_on && !words[SHIFT]) {
        connect(device, false);
    }
    usart->was_enabled = is_on;
    listen(device);
    if (is_on && words[CR1] & SBK && !words[SHIFT] && has_rate) {
        load(device, BREAK, now_ns(device->fabric), 0);
    }
    find_deadlines(device);
    update_outputs(device);
}

static uint32_t read(struct device *device, uint32_t index)
{
    uint32_t *words = device->words;
    (void)index; /* DR */
    words[SR] &= ~(RXNE | (words[SEEN] & READ_SEQUENCE));
    words[SEEN] &= ~(uint32_t)READ_SEQUENCE;
    struct usart *usart = device->state;
    if (usart->rx_waits) {
        usart->rx_waits = 0;
        usart->rx_base_ns = now_ns(device->fabric);
        usart->rx_half_bits = frame_half_bits(device);
        find_deadlines(device);
    }
    update_outputs(device);
    return words[RDR];
}

static void write(struct device *device, uint32_t index, uint32_t written, uint32_t previous)
{
    struct usart *usart = device->state;
    (void)previous;
    if (index == DR) {
        write_data(device, written & WORD);
    } else if (index == BRR) {
        usart->rate_pc = device->fabric->host.pc(device->fabric->host.user);
        write_rate(device, usart->tx_due_ns, usart->rx_due_ns);
    } else if (index == SR) {
        update_outputs(device);
    } else {
        write_control(device);
    }
}

/* Flags only fall and TDR is filled behind a character that is going out: neither needs time. */
static bool needs_time(const struct device *device, uint32_t index, bool is_write)
{
    const uint32_t *words = device->words;
    if (words[CR3] & RTSE) {
        return true;
    }
    const bool is_behind = is_transmitting(device) && words[BRR] && words[SHIFT] && !words[TDR];
    return !(index == SR || (index == DR && (!is_write || is_behind)));
}

static uint64_t rescaled(uint64_t due, uint64_t now, uint32_t from_hz, uint32_t to_hz)
{
    return due == NO_TIME ? NO_TIME : now + (uint64_t)((__uint128_t)(due - now) * from_hz / to_hz);
}

static void clear(struct device *device)
{
    struct usart *usart = device->state;
    const struct usart fresh = {.tx_due_ns = NO_TIME, .rx_due_ns = NO_TIME, .idle_due_ns = NO_TIME,
                                .bit_due_ns = NO_TIME, .ck_due_ns = NO_TIME, .rts = FLOATING, .ck = FLOATING,
                                .ck_pin = usart->ck_pin, .rts_pin = usart->rts_pin, .cts_pin = usart->cts_pin,
                                .clock_hz = usart->clock_hz, .source = usart->source, .tx_pin = usart->tx_pin,
                                .rx_pin = usart->rx_pin, .judged_hz = usart->judged_hz,
                                .judged_brr = usart->judged_brr};
    connect(device, false);
    offer(device->fabric, usart->rts_pin, usart->source - RTS_FROM_TX, FLOATING);
    set_ck(device, FLOATING);
    *usart = fresh;
    listen(device);
    for (uint32_t n = SEEN; n <= RDR; ++n) {
        device->words[n] = 0;
    }
    schedule(device, NO_TIME);
    update_outputs(device);
}

static bool hear(struct device *device, uint32_t word)
{
    struct usart *usart = device->state;
    if (usart->rx_count == RECEIVED) {
        return false;
    }
    if (!usart->rx_count && usart->rx_due_ns == NO_TIME) {
        usart->rx_base_ns = now_ns(device->fabric);
        usart->rx_half_bits = frame_half_bits(device);
    }
    usart->rx[(usart->rx_first + usart->rx_count++) % RECEIVED] = word;
    usart->idle_due_ns = NO_TIME;
    find_deadlines(device);
    return true;
}

static uint32_t command(struct device *device, uint32_t what, uint32_t one, uint32_t other)
{
    struct usart *usart = device->state;
    const uint64_t now = now_ns(device->fabric);
    switch (what) {
    case RESET: clear(device); break;
    case CLOCK:
        event(device, now);
        if (one != usart->clock_hz) {
            const uint32_t before = usart->clock_hz;
            usart->clock_hz = one;
            write_rate(device, rescaled(usart->tx_due_ns, now, before, one), rescaled(usart->rx_due_ns, now, before, one));
        }
        break;
    case STOPPED: schedule(device, NO_TIME); break;
    case RESUMED: {
        const uint64_t span = (uint64_t)other << 32 | one;
        usart->tx_base_ns += span;
        usart->rx_base_ns += span;
        usart->idle_due_ns += usart->idle_due_ns == NO_TIME ? 0 : span;
        find_deadlines(device);
        break;
    }
    case MOVE:
        if (one != usart->tx_pin) {
            connect(device, false);
            usart->tx_pin = one;
            if (is_transmitting(device)) {
                connect(device, true);
            }
        }
        usart->rx_pin = other;
        break;
    case LISTEN: listen(device); break;
    case CONTROL:
        offer(device->fabric, usart->rts_pin, usart->source - RTS_FROM_TX, FLOATING);
        usart->rts = FLOATING;
        usart->cts_pin = one;
        usart->rts_pin = other;
        listen(device);
        update_outputs(device);
        break;
    case MOVE_CK:
        set_ck(device, FLOATING);
        usart->ck_pin = one;
        rest_clock(device);
        find_deadlines(device);
        break;
    case HEAR: return hear(device, one);
    case SETTLE: return device->words[RDR] & WORD; /* DR */
    case CAN_HEAR: return can_receive(device);
    default: break;
    }
    return 0;
}

DEVICE_KIND(usart_kind) = {
    .name = "usart", .needs_time = needs_time, .read = read, .write = write, .event = event, .pins = pins, .command = command};
