/* An SPI, master or slave: words at the speed of its clock, exchanged as a whole when they end.
 *
 * Theory of operation. DR hides two buffers. A write fills the one that sends (TXE falls); a free shift register takes it
 * over (TXE rises), and the word is exchanged with whoever is selected when its last bit ends: RXNE rises then, and the next
 * word begins without a gap. Parts outside are Python's (peripherals/spi.py); a wire from MOSI to MISO is here.
 * Bits show on SCK and MOSI of a master while somebody is subscribed or listens to one of them, in steps of half a bit.
 * Source: RM0008 25.3, 25.5, figure 240.
 * Invariant: a word ends floor(ticks * 10**9 / rate) ns after the point from which its run of words is counted.
 */
#include "../fabric/fabric.h"
#include "../registers/spi.h"

/* What `shift`, `tdr` and `far` hold besides a word: that they do, that it is the CRC, and that nobody listens. */
enum { HELD = 1 << 16, IS_CRC = 1 << 17, IS_DEAF = 1 << 18 };
/* Its pins, in the order of its alternate functions. */
enum { MISO, MOSI, NSS, SCK, SPI_PINS };

static uint32_t bits_of(const struct device *device) { return device->words[CR1] & DFF ? 16 : 8; }

static uint32_t mask_of(const struct device *device) { return (1u << bits_of(device)) - 1; }

static bool is_master(const struct device *device) { return device->words[CR1] & MSTR; }

/* The one-wire modes, and reception without transmission. */
static bool only_sends(const struct device *device)
{
    return (device->words[CR1] & (BIDIMODE | BIDIOE)) == (BIDIMODE | BIDIOE);
}

static bool only_receives(const struct device *device)
{
    const uint32_t control = device->words[CR1];
    return control & BIDIMODE ? !(control & BIDIOE) : (control & RXONLY) != 0;
}

static bool is_high(const struct device *device, uint32_t which)
{
    const struct spi *spi = device->state;
    return port_input(device->fabric, spi->pins[which] / PINS) >> spi->pins[which] % PINS & 1;
}

/* Whether the wire shows what this puts on it. */
static bool carries(const struct device *device, uint32_t which)
{
    const struct spi *spi = device->state;
    const struct port *port = &device->fabric->ports[spi->pins[which] / PINS];
    const uint32_t at = spi->pins[which] % PINS;
    const uint64_t sources = port->sources[at];
    return port->alternate & port->bonded & ~port->held & 1u << at && (sources & -sources) >> (spi->source + which) & 1;
}

static bool is_watched(const struct device *device, uint32_t which)
{
    const struct spi *spi = device->state;
    const uint32_t port = spi->pins[which] / PINS;
    return (device->fabric->subscribed[port] | device->fabric->listened[port]) >> spi->pins[which] % PINS & 1;
}

static bool is_slave_selected(const struct device *device)
{
    return device->words[CR1] & SSM ? !(device->words[CR1] & SSI) : !is_high(device, NSS);
}

static void update_outputs(struct device *device)
{
    const uint32_t status = device->words[SR], control = device->words[CR2];
    output_set(device, RX_DMA, status & RXNE && control & RXDMAEN);
    output_set(device, TX_DMA, status & TXE && control & TXDMAEN);
    output_set(device, IRQ,
               (device->words[SR] & RXNE && control & RXNEIE) || (device->words[SR] & TXE && control & TXEIE) ||
                   (device->words[SR] & (CRCERR | MODF | OVR) && control & ERRIE));
}

/* Pins. */

static bool runs_ahead(const struct device *device) { return device->fabric->ahead.device == device; }

static void stop_running_ahead(struct device *device)
{
    if (runs_ahead(device)) {
        leave_ahead(device->fabric);
    }
}

static void put(struct device *device, uint32_t which, uint32_t level)
{
    struct spi *spi = device->state;
    if (spi->offered[which] != level) {
        spi->offered[which] = level;
        offer(device->fabric, spi->pins[which], spi->source + which, level);
    }
}

static void connect(struct device *device)
{
    struct spi *spi = device->state;
    const uint32_t control = device->words[CR1];
    const bool is_on = control & SPE || spi->shift, masters = is_on && is_master(device);
    spi->half = masters ? spi->half : 0;
    if (!spi->half) {
        put(device, SCK, !masters ? FLOATING : control & CPOL ? HIGH : LOW);
    }
    if (!spi->half || only_receives(device)) {
        put(device, MOSI, masters && !only_receives(device) ? LOW : FLOATING);
    }
    put(device, NSS, masters && !(control & SSM) && device->words[CR2] & SSOE ? LOW : FLOATING);
    put(device, MISO, is_on && !masters && !only_receives(device) && is_slave_selected(device) ? LOW : FLOATING);
}

/* Pins that select parts, and NSS where it is an input. */
static void listen(struct device *device)
{
    const struct spi *spi = device->state;
    const uint32_t control = device->words[CR1];
    const bool hears_nss = control & SPE && !(control & SSM) && !(control & MSTR && device->words[CR2] & SSOE);
    for (uint32_t port = 0; port < PORTS; ++port) {
        const uint32_t nss = hears_nss && spi->pins[NSS] / PINS == port ? 1u << spi->pins[NSS] % PINS : 0;
        listen_to_pins(device, port, spi->selects[port] | nss);
    }
}

/* A master that is selected is none any more (RM0008 25.3.10). */
static void check_mode_fault(struct device *device)
{
    const uint32_t control = device->words[CR1];
    if ((control & (SPE | MSTR)) != (SPE | MSTR) || (!(control & SSM) && device->words[CR2] & SSOE)) {
        return;
    }
    if (is_slave_selected(device)) {
        struct spi *spi = device->state;
        device->words[CR1] &= ~(uint32_t)(SPE | MSTR);
        device->words[SR] = (device->words[SR] | MODF) & ~(uint32_t)BSY;
        spi->shift = spi->half = 0;
        schedule(device, NO_TIME);
        ask_about(device, MODE_FAULT);
    }
}

static void pins(struct device *device, uint32_t port, uint32_t changed)
{
    stop_running_ahead(device);
    const struct spi *spi = device->state;
    for (uint32_t left = changed & spi->selects[port]; left; left &= left - 1) {
        ask(device, SELECT, PINS * port + (uint32_t)__builtin_ctz(left));
    }
    if (spi->pins[NSS] / PINS == port && changed >> spi->pins[NSS] % PINS & 1) {
        check_mode_fault(device);
        listen(device);
        connect(device);
        update_outputs(device);
    }
}

/* Words. */

/* The order in which bits are on the wire decides: RM0008 25.3.6. */
static uint32_t crc_of(const struct device *device, uint32_t crc, uint32_t word)
{
    const uint32_t bits = bits_of(device), top = 1u << (bits - 1);
    for (uint32_t n = 0; n < bits; ++n) {
        const uint32_t bit = device->words[CR1] & LSBFIRST ? word >> n & 1 : word >> (bits - 1 - n) & 1;
        crc = (crc & top ? 1 : 0) ^ bit ? crc << 1 ^ device->words[CRCPR] : crc << 1;
    }
    return crc & mask_of(device);
}

/* What the wires make of a word that this sends as a master. */
static uint32_t exchange(struct device *device, uint32_t sent)
{
    struct spi *spi = device->state;
    const uint32_t mask = mask_of(device), data = device->words[CR1] & BIDIMODE ? MOSI : MISO;
    const struct port *port = &device->fabric->ports[spi->pins[data] / PINS];
    const bool is_readable = port->bonded & ~port->analog & ~port->held & 1u << spi->pins[data] % PINS;
    if (!carries(device, SCK)) {
        ask_about(device, NO_SCK);
        return is_high(device, data) ? mask : 0;
    }
    if (!only_receives(device) && !carries(device, MOSI)) {
        ask_about(device, NO_MOSI);
        sent = is_high(device, MOSI) ? mask : 0;
    }
    uint32_t got = !only_sends(device) && is_high(device, data) ? mask : 0; /* its own bits may be on the wire */
    if (spi->is_looped) {
        got = sent;
    } else if (spi->selected) {
        const bool holds = spi->ahead_cr1 == device->words[CR1] && (spi->ahead_sent > 0xFF || spi->ahead_sent == sent);
        got = spi->ahead_at < spi->ahead_count && holds ? spi->ahead[spi->ahead_at++] : ask(device, EXCHANGE, sent) & mask;
    }
    if (!is_readable && !only_sends(device)) {
        ask_about(device, NO_MISO);
        return 0;
    }
    return got;
}

static uint64_t word_ticks(const struct device *device)
{
    const struct spi *spi = device->state;
    return spi->far ? bits_of(device) : (uint64_t)bits_of(device) << ((device->words[CR1] >> BR_AT & 7) + 1);
}

static uint64_t ns_after(const struct spi *spi, uint64_t ticks)
{
    const struct ticks since = {.ns = spi->base_ns, .hz = spi->rate_hz};
    return ns_of_tick(&since, ticks);
}

static uint64_t end_ns(const struct spi *spi)
{
    return ns_after(spi, spi->ticks);
}

static uint64_t half_ns(const struct spi *spi)
{
    const uint64_t ticks = spi->word_at_ticks + (uint64_t)spi->half * spi->half_ticks;
    return ns_after(spi, ticks);
}

/* Waits for the end of the word, or for a half-bit before it that is shown. */
static void wait(struct device *device)
{
    const struct spi *spi = device->state;
    schedule(device, !runs_ahead(device) && spi->half && spi->half < spi->halves ? half_ns(spi) : end_ns(spi));
}

/* The levels in a half of a bit: data change at the first, and are sampled at the second. */
static uint32_t mosi_at(const struct device *device, uint32_t half)
{
    const struct spi *spi = device->state;
    const uint32_t bit = half / 2, at = device->words[CR1] & LSBFIRST ? bit : spi->halves / 2 - 1 - bit;
    return spi->shift >> at & 1 ? HIGH : LOW;
}

static uint32_t sck_at(const struct device *device, uint32_t half)
{
    const uint32_t control = device->words[CR1];
    return ((half & 1) != (control & CPHA)) != !!(control & CPOL) ? HIGH : LOW;
}

/* Puts the next half of a bit on the pins. */
static void show_half(struct device *device)
{
    struct spi *spi = device->state;
    const uint32_t n = spi->half++;
    if (!(n & 1) && !only_receives(device)) {
        put(device, MOSI, mosi_at(device, n));
    }
    put(device, SCK, sck_at(device, n));
}

/* Runs ahead of the edges of a word; false: each must come at its time. */
static bool runs_ahead_of_word(struct device *device)
{
    const struct spi *spi = device->state;
    const uint32_t number = spi->pins[SCK] / PINS;
    uint32_t shown = 1u << spi->pins[SCK] % PINS;
    if (!carries(device, SCK) || spi->offered[SCK] == FLOATING) {
        return false;
    }
    if (!only_receives(device)) {
        if (!carries(device, MOSI) || spi->offered[MOSI] == FLOATING || spi->pins[MOSI] / PINS != number) {
            return false;
        }
        shown |= 1u << spi->pins[MOSI] % PINS;
    }
    return run_ahead(device, number, shown);
}

static void put_level_ahead(struct device *device, uint32_t which, uint32_t level, uint64_t ns, bool is_first)
{
    struct spi *spi = device->state;
    if (spi->offered[which] != level) {
        spi->offered[which] = level;
        put_ahead(device->fabric, 1u << spi->pins[which] % PINS, level == HIGH, ns, is_first);
    }
}

/* The first half of all begins with the word. */
static void show_due(struct device *device, uint64_t until_ns)
{
    struct spi *spi = device->state;
    const uint32_t first = spi->half;
    uint64_t ns;
    while (spi->half < spi->halves && ((ns = half_ns(spi)) <= until_ns || !spi->half)) {
        const uint32_t n = spi->half++;
        if (!(n & 1) && !only_receives(device)) {
            put_level_ahead(device, MOSI, mosi_at(device, n), ns, !n);
        }
        put_level_ahead(device, SCK, sck_at(device, n), ns, !n);
    }
    if (spi->half == first) {
        return;
    }
    come_to(device->fabric, 1u << spi->pins[SCK] % PINS, spi->source + SCK, spi->offered[SCK] == HIGH);
    if (!only_receives(device)) {
        come_to(device->fabric, 1u << spi->pins[MOSI] % PINS, spi->source + MOSI, spi->offered[MOSI] == HIGH);
    }
}

static void show(struct device *device, uint64_t until_ns)
{
    show_due(device, until_ns);
    wait(device);
}

static void show_word(struct device *device)
{
    struct spi *spi = device->state;
    const uint32_t was_shown = spi->half;
    spi->half = 0;
    if (is_master(device) && !spi->far && (is_watched(device, SCK) || is_watched(device, MOSI))) {
        spi->halves = 2 * bits_of(device);
        spi->half_ticks = 1u << (device->words[CR1] >> BR_AT & 7);
        if (!runs_ahead_of_word(device)) {
            show_half(device);
        }
    } else if (was_shown) {
        connect(device);
    }
}

/* Chooses what goes out next: the buffer, the CRC, for a slave what stands in the shift register; false: nothing. */
static bool load(struct device *device)
{
    struct spi *spi = device->state;
    uint32_t *words = device->words;
    const bool is_crc = (words[CR1] & (CRCEN | CRCNEXT)) == (CRCEN | CRCNEXT);
    if (!(words[CR1] & SPE)) {
        return false;
    }
    if (only_receives(device)) {
        spi->shift = HELD | mask_of(device) | (is_crc ? IS_CRC : 0);
    } else if (spi->tdr) {
        spi->shift = spi->tdr;
        spi->tdr = 0;
        words[SR] |= TXE;
    } else if (is_crc) {
        spi->shift = HELD | IS_CRC | words[TXCRCR];
    } else if (!is_master(device)) {
        spi->shift = HELD | spi->rdr;
    } else {
        return false;
    }
    return true;
}

static void begin(struct device *device, uint64_t ns)
{
    struct spi *spi = device->state;
    spi->word_ns = ns;
    spi->word_at_ticks = spi->ticks;
    spi->ticks += word_ticks(device);
    /* RM0008 25.3.7: not in the one-wire mode that receives */
    const bool is_shown = !(is_master(device) && device->words[CR1] & BIDIMODE && only_receives(device));
    device->words[SR] = is_shown && !(spi->shift & IS_DEAF) ? device->words[SR] | BSY : device->words[SR] & ~(uint32_t)BSY;
    show_word(device);
    wait(device);
}

/* As a master: begins where there is something to send or to clock in. */
static void start(struct device *device)
{
    struct spi *spi = device->state;
    if (is_master(device) && !spi->shift && load(device)) {
        spi->base_ns = now_ns(device->fabric);
        spi->rate_hz = spi->clock_hz;
        spi->ticks = 0;
        begin(device, spi->base_ns);
    }
}

/* As a slave: whether or not it listens, the master outside goes on. */
static void load_slave(struct device *device)
{
    struct spi *spi = device->state;
    if (is_master(device) || !is_slave_selected(device) || !load(device)) {
        spi->shift = HELD | IS_DEAF | mask_of(device);
    }
}

static void account(struct device *device, uint32_t ended, uint32_t sent, uint32_t got)
{
    uint32_t *words = device->words;
    if (words[CR1] & CRCEN && ended & IS_CRC) {
        words[CR1] &= ~(uint32_t)CRCNEXT;
        if (!only_sends(device) && got != words[RXCRCR]) {
            words[SR] |= CRCERR;
        }
    } else if (words[CR1] & CRCEN) {
        words[TXCRCR] = only_receives(device) ? words[TXCRCR] : crc_of(device, words[TXCRCR], sent);
        words[RXCRCR] = only_sends(device) ? words[RXCRCR] : crc_of(device, words[RXCRCR], got);
    }
}

static void end_word(struct device *device, uint64_t ns)
{
    struct spi *spi = device->state;
    uint32_t *words = device->words;
    const uint32_t ended = spi->shift, sent = ended & mask_of(device), far = spi->far;
    const uint32_t got = far ? far & mask_of(device) : exchange(device, sent);
    if (spi->wants_words) {
        const struct sent row = {ns, far ? got | sent << 16 : sent | got << 16, spi->rate_hz, (uint32_t)word_ticks(device), words[CR1]};
        send_word(device, &row);
    }
    if (!(ended & IS_DEAF)) {
        account(device, ended, sent, got);
        if (only_sends(device)) {
            /* nothing is received */
        } else if (words[SR] & RXNE) {
            words[SR] |= OVR;
        } else {
            spi->rdr = got;
            words[SR] |= RXNE;
        }
    }
    spi->far = far ? ask(device, NEXT_WORD, sent) : 0;
    spi->shift = 0;
    if (spi->far) {
        load_slave(device);
    }
    if (spi->shift || (!far && load(device))) {
        begin(device, ns);
    } else {
        words[SR] &= ~(uint32_t)BSY;
        spi->half = 0;
        schedule(device, NO_TIME);
        connect(device);
    }
}

static void event(struct device *device, uint64_t until)
{
    const struct spi *spi = device->state;
    uint64_t ns;
    if (runs_ahead(device) && due_ns(device) <= until) {
        device->fabric->ahead.device = NULL;
        show_due(device, NO_TIME);
    }
    while ((ns = due_ns(device)) <= until) {
        if (spi->half && spi->half < spi->halves) {
            show_half(device);
            wait(device);
        } else {
            end_word(device, ns);
        }
    }
    update_outputs(device);
}

/* Registers. */

static uint32_t read(struct device *device, uint32_t index)
{
    struct spi *spi = device->state;
    const uint32_t status = device->words[SR];
    if (index == SR) { /* a read of DR, then of SR clears OVR; a read of SR, then a write of CR1 clears MODF */
        device->words[SR] &= ~(spi->seen & OVR);
        spi->seen = status & MODF;
        if (device->words[SR] != status) {
            update_outputs(device);
        }
        return status;
    }
    spi->seen |= status & OVR;
    device->words[SR] &= ~(uint32_t)RXNE;
    update_outputs(device);
    return spi->rdr;
}

static void write_control(struct device *device, uint32_t previous)
{
    struct spi *spi = device->state;
    uint32_t *words = device->words;
    words[SR] &= ~(spi->seen & MODF);
    spi->seen &= ~(uint32_t)MODF;
    if (words[SR] & MODF) { /* neither can be set meanwhile */
        words[CR1] &= ~(uint32_t)(SPE | MSTR);
    }
    if (words[CR1] & ~previous & CRCEN) {
        words[RXCRCR] = words[TXCRCR] = 0;
    }
}

static void write(struct device *device, uint32_t index, uint32_t written, uint32_t previous)
{
    struct spi *spi = device->state;
    if (index == DR) {
        if (spi->tdr) {
            ask_about(device, WORD_LOST);
        }
        spi->tdr = HELD | (written & mask_of(device));
        device->words[SR] &= ~(uint32_t)TXE;
        start(device);
    } else if (index == SR) {
        spi->seen |= device->words[SR] & MODF;
    } else {
        if (index == CR1) {
            write_control(device, previous);
        }
        check_mode_fault(device);
        connect(device);
        listen(device);
        start(device);
    }
    update_outputs(device);
}

/* Flags only fall, and a buffer is filled behind a word that is going out, or that waits for SPE or a master. */
static bool needs_time(const struct device *device, uint32_t index, bool is_write)
{
    const struct spi *spi = device->state;
    return is_write && index != SR && !(index == DR && (spi->shift || (device->words[CR1] & (SPE | MSTR)) != (SPE | MSTR)));
}

static uint32_t clock_in(struct device *device, uint32_t word, uint32_t hz)
{
    struct spi *spi = device->state;
    if (spi->shift || spi->is_stopped) {
        return 0;
    }
    spi->far = HELD | word;
    spi->base_ns = now_ns(device->fabric);
    spi->rate_hz = hz;
    spi->ticks = 0;
    load_slave(device);
    begin(device, spi->base_ns);
    update_outputs(device);
    return 1;
}

static void clear(struct device *device)
{
    struct spi *spi = device->state;
    for (uint32_t n = 0; n < SPI_PINS; ++n) {
        put(device, n, FLOATING);
    }
    spi->shift = spi->tdr = spi->rdr = spi->seen = spi->far = spi->is_stopped = spi->half = 0;
    schedule(device, NO_TIME);
    listen(device);
    update_outputs(device);
}

static uint32_t command(struct device *device, uint32_t what, uint32_t one, uint32_t other)
{
    struct spi *spi = device->state;
    stop_running_ahead(device);
    const uint64_t now = now_ns(device->fabric);
    switch (what) {
    case SETTLE: return one == SR ? device->words[SR] : spi->rdr;
    case RESET: clear(device); break;
    case CLOCK:
        event(device, now);
        if (spi->shift && !spi->far && one != spi->clock_hz) { /* what is left of the word goes on at the other speed */
            spi->base_ns = now + (uint64_t)((__uint128_t)(end_ns(spi) - now) * spi->clock_hz / one);
            spi->ticks = 0;
            spi->rate_hz = one;
            spi->half = 0; /* the rest of the word is not shown */
            connect(device);
            schedule(device, spi->base_ns);
        }
        spi->clock_hz = one;
        break;
    case STOPPED:
        event(device, now);
        spi->is_stopped = true;
        schedule(device, NO_TIME);
        break;
    case RESUMED:
        spi->is_stopped = false;
        spi->base_ns += (uint64_t)other << 32 | one;
        spi->word_ns += (uint64_t)other << 32 | one;
        if (spi->shift) {
            wait(device);
        }
        break;
    case MOVE:
        for (uint32_t n = 0; n < SPI_PINS; ++n) {
            const uint32_t pin = (n < NSS ? one : other) >> 8 * (n % 2) & 0xFF;
            if (pin != spi->pins[n]) {
                put(device, n, FLOATING);
                spi->pins[n] = pin;
            }
        }
        connect(device);
        listen(device);
        break;
    case LISTEN: listen(device); break;
    case CLOCK_IN: return clock_in(device, one, other);
    default: break;
    }
    return 0;
}

DEVICE_KIND(spi_kind) = {.name = "spi", .needs_time = needs_time, .read = read, .write = write, .event = event, .pins = pins, .show = show, .command = command};
