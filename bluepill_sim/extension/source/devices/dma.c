/* DMA1: seven channels that move words between peripherals and memory, one transfer at a time.
 *
 * Its inputs are the requests of the channels, its outputs their interrupts. Theory of operation: a channel asks while
 * its line is high, since a rising edge that came while it was enabled (timers pulse theirs), or always (memory to
 * memory). The highest is chosen when the bus is free, and reads and writes at the end of its transfer.
 * Source: RM0008 13.
 * Invariant: `current` is the channel whose transfer is under way, exactly while an event is scheduled.
 */
#include "../fabric/fabric.h"
#include "../registers/dma.h"

/* The registers of each channel, from those of the first on, and its flags: in ISR at the places of their enable bits. */
enum { FIRST = CCR1, WORDS_EACH = CCR2 - CCR1, CHANNELS = CH7_IRQ + 1 };
enum { CCR, CNDTR = CNDTR1 - CCR1, CPAR = CPAR1 - CCR1, CMAR = CMAR1 - CCR1, FLAGS = TEIF1 | HTIF1 | TCIF1 | GIF1 };
/* `current` besides 1 + the channel's number. */
enum { NONE, ACTING = CHANNELS + 1 };
/* chosen: cycles of HCLK for the arbitration, for an access on the AHB, and on an APB, two of whose own clock come on top. */
enum { ARBITRATION = 1, AHB_ACCESS = 2, BRIDGE = 1, APB_ACCESS = 2 };
/* RM0008 3.3, table 3. */
enum { APB1 = 0x40000000, APB1_BYTES = 0x10000, APB2 = 0x40010000, APB2_BYTES = 0x8000 };

static uint32_t *words_of(const struct device *device, uint32_t n) { return &device->words[FIRST + WORDS_EACH * n]; }

/* What a width field means; chosen: the reserved one is a word. */
static uint32_t bytes_of(uint32_t control, uint32_t at) { return (control >> at & 3) == 3 ? 4 : 1u << (control >> at & 3); }

static bool is_circular(uint32_t control) { return (control & (CIRC | MEM2MEM)) == CIRC; }

static void update_irq(struct device *device, uint32_t n)
{
    const uint32_t flags = device->words[ISR] >> 4 * n & FLAGS;
    output_set(device, n, (flags & words_of(device, n)[CCR] & (TCIE | HTIE | TEIE)) != 0);
}

static void raise(struct device *device, uint32_t n, uint32_t flags)
{
    device->words[ISR] |= (GIF1 | flags) << 4 * n;
    update_irq(device, n);
}

static uint64_t cycles_to(const struct dma *dma, uint32_t address)
{
    return address - APB1 < APB1_BYTES   ? dma->apb1_cycles
           : address - APB2 < APB2_BYTES ? dma->apb2_cycles
                                         : AHB_ACCESS;
}

static uint64_t end_ns(const struct dma *dma)
{
    return dma->base_ns + (uint64_t)((__uint128_t)dma->cycles * NS_PER_S / dma->hz);
}

/* Chooses the channel of the next transfer, and returns when this ends; NO_TIME: none asks. */
static uint64_t choose(struct device *device)
{
    struct dma *dma = device->state;
    uint32_t best = CHANNELS, level = 0;
    dma->current = NONE;
    for (uint32_t left = dma->ready & (dma->lines | dma->latched | dma->unasked); left; left &= left - 1) {
        const uint32_t n = (uint32_t)__builtin_ctz(left), mine = words_of(device, n)[CCR] >> PL_AT & 3;
        if (best == CHANNELS || mine > level) {
            best = n;
            level = mine;
        }
    }
    if (best == CHANNELS) {
        return NO_TIME;
    }
    dma->current = best + 1;
    dma->latched &= ~(1u << best);
    dma->cycles += ARBITRATION + cycles_to(dma, dma->peripheral[best]) + cycles_to(dma, dma->memory[best]);
    return end_ns(dma);
}

/* The bus has become free, or a request has come: goes on, from now where nothing was under way. */
static void start(struct device *device)
{
    struct dma *dma = device->state;
    if (dma->current == NONE) {
        dma->base_ns = now_ns(device->fabric);
        dma->cycles = 0;
        schedule(device, choose(device));
    }
}

static void follow_control(struct device *device, uint32_t n)
{
    struct dma *dma = device->state;
    const uint32_t *words = words_of(device, n), bit = 1u << n;
    dma->ready = words[CCR] & EN && words[CNDTR] ? dma->ready | bit : dma->ready & ~bit;
    dma->unasked = words[CCR] & MEM2MEM ? dma->unasked | bit : dma->unasked & ~bit;
    if (!(words[CCR] & EN)) {
        dma->latched &= ~bit;
    }
}

/* The end of one transfer's bookkeeping: RM0008 13.3.3. */
static void count(struct device *device, uint32_t n)
{
    struct dma *dma = device->state;
    uint32_t *words = words_of(device, n);
    const uint32_t control = words[CCR], left = --words[CNDTR];
    dma->peripheral[n] += control & PINC ? bytes_of(control, PSIZE_AT) : 0;
    dma->memory[n] += control & MINC ? bytes_of(control, MSIZE_AT) : 0;
    if (!left && is_circular(control)) {
        words[CNDTR] = dma->reload[n];
        dma->peripheral[n] = words[CPAR];
        dma->memory[n] = words[CMAR];
    }
    const uint32_t flags = (left == dma->reload[n] / 2 ? HTIF1 : 0) | (left ? 0 : TCIF1);
    if (flags) {
        follow_control(device, n);
        raise(device, n, flags);
    }
}

/* Reads, packs or truncates (RM0008 table 79: what is wider is cut, what is narrower has zeros above it), writes. */
static bool move(struct device *device, uint32_t n)
{
    const struct dma *dma = device->state;
    const uint32_t control = words_of(device, n)[CCR];
    const uint32_t p_bytes = bytes_of(control, PSIZE_AT), m_bytes = bytes_of(control, MSIZE_AT);
    const uint32_t peripheral = dma->peripheral[n] & ~(p_bytes - 1), memory = dma->memory[n] & ~(m_bytes - 1);
    const uint32_t from_bytes = control & DIR ? m_bytes : p_bytes, to_bytes = control & DIR ? p_bytes : m_bytes;
    uint32_t word;
    if (!bus_read(device, control & DIR ? memory : peripheral, from_bytes, &word)) {
        return false;
    }
    word &= to_bytes == 4 ? UINT32_MAX : (1u << 8 * to_bytes) - 1;
    return bus_write(device, control & DIR ? peripheral : memory, to_bytes, word);
}

static void transfer(struct device *device, uint32_t n)
{
    struct dma *dma = device->state;
    const bool is_done = move(device, n);
    if (!(dma->ready >> n & 1)) {
        return; /* it has written its own CCR */
    }
    if (is_done) {
        count(device, n);
        return;
    }
    words_of(device, n)[CCR] &= ~(uint32_t)EN;
    follow_control(device, n);
    raise(device, n, TEIF1);
    ask(device, FAILED, n);
}

/* Whether the transfer under way moves a word of memory to memory, and changes nothing that anyone is notified of. */
static bool is_silent(const struct device *device)
{
    const struct dma *dma = device->state;
    const uint32_t n = dma->current - 1, left = words_of(device, n)[CNDTR] - 1, control = words_of(device, n)[CCR];
    return left && left != dma->reload[n] / 2 && is_memory(device->fabric, dma->peripheral[n], control & DIR) &&
           is_memory(device->fabric, dma->memory[n], !(control & DIR));
}

static void event(struct device *device, uint64_t ns)
{
    struct dma *dma = device->state;
    uint64_t quiet = NO_TIME;
    for (;;) {
        const uint32_t n = dma->current - 1;
        dma->current = ACTING; /* so that what the accesses cause waits */
        transfer(device, n);
        ns = choose(device);
        if (ns == NO_TIME || !(dma->unasked >> (dma->current - 1) & 1)) {
            break;
        }
        quiet = quiet == NO_TIME ? quiet_ns(device) : quiet;
        if (ns >= quiet || !is_silent(device)) {
            break;
        }
    }
    schedule(device, ns);
}

static void line(struct device *device, uint32_t input, bool level)
{
    struct dma *dma = device->state;
    const uint32_t bit = 1u << input;
    if (!level) {
        dma->lines &= ~bit;
        return;
    }
    dma->lines |= bit;
    if (words_of(device, input)[CCR] & EN) {
        dma->latched |= bit;
        start(device);
    }
}

static void write_control(struct device *device, uint32_t n, uint32_t previous)
{
    struct dma *dma = device->state;
    const uint32_t *words = words_of(device, n), control = words[CCR];
    if (control & ~previous & EN) {
        dma->peripheral[n] = words[CPAR];
        dma->memory[n] = words[CMAR];
        if ((control & (MEM2MEM | CIRC)) == (MEM2MEM | CIRC)) {
            ask(device, CIRCLES, n);
        }
    }
    follow_control(device, n);
    if (dma->current == n + 1 && !(control & EN)) { /* chosen: what was under way is not made */
        dma->current = NONE;
        schedule(device, NO_TIME);
    }
    start(device);
    update_irq(device, n);
    if ((control ^ previous) & EN) {
        hearing_changed(device);
    }
}

static void write(struct device *device, uint32_t index, uint32_t written, uint32_t previous)
{
    struct dma *dma = device->state;
    if (index == IFCR) {
        for (uint32_t n = 0; n < CHANNELS; ++n) {
            const uint32_t cleared = written >> 4 * n & FLAGS;
            uint32_t flags = device->words[ISR] >> 4 * n & FLAGS & ~(cleared & GIF1 ? FLAGS : cleared | GIF1);
            flags |= flags ? GIF1 : 0;
            device->words[ISR] = (device->words[ISR] & ~((uint32_t)FLAGS << 4 * n)) | flags << 4 * n;
            update_irq(device, n);
        }
        return;
    }
    const uint32_t n = (index - FIRST) / WORDS_EACH, which = (index - FIRST) % WORDS_EACH;
    if (which == CCR) {
        write_control(device, n, previous);
    } else if (words_of(device, n)[CCR] & EN) { /* RM0008 13.4.4 to 13.4.6 */
        device->words[index] = previous;
        ask(device, LOCKED, n);
    } else if (which == CNDTR) {
        dma->reload[n] = device->words[index];
    }
}

static bool hears(const struct device *device, uint32_t input)
{
    return words_of(device, input)[CCR] & EN;
}

static bool needs_time(const struct device *device, uint32_t index, bool is_write)
{
    (void)device;
    return is_write && index >= FIRST && (index - FIRST) % WORDS_EACH == CCR;
}

/* Takes HCLK, and what an access of each bus costs; what is under way ends when it would have. */
static void take_clock(struct dma *dma, uint32_t hz, const struct clocks *clocks)
{
    dma->apb1_cycles = BRIDGE + APB_ACCESS * clocks->hclk_hz / clocks->pclk1_hz;
    dma->apb2_cycles = BRIDGE + APB_ACCESS * clocks->hclk_hz / clocks->pclk2_hz;
    if (hz != dma->hz) {
        dma->base_ns = dma->current == NONE ? dma->base_ns : end_ns(dma);
        dma->cycles = 0;
        dma->hz = hz;
    }
}

static uint32_t command(struct device *device, uint32_t what, uint32_t one, uint32_t other)
{
    struct dma *dma = device->state;
    (void)other;
    if (what == RESET) {
        *dma = (struct dma){
            .hz = dma->hz, .apb1_cycles = dma->apb1_cycles, .apb2_cycles = dma->apb2_cycles, .lines = dma->lines};
        schedule(device, NO_TIME);
        for (uint32_t n = 0; n < CHANNELS; ++n) {
            update_irq(device, n);
        }
    } else if (what == CLOCK) {
        take_clock(dma, one, device->fabric->clocks);
    } else if (what == STOPPED) {
        schedule(device, NO_TIME);
    } else if (what == RESUMED && dma->current != NONE) {
        dma->base_ns += (uint64_t)other << 32 | one;
        schedule(device, end_ns(dma));
    }
    return 0;
}

DEVICE_KIND(dma_kind) = {.name = "dma", .needs_time = needs_time, .write = write, .event = event,
                         .hears = hears, .line = line, .command = command};
