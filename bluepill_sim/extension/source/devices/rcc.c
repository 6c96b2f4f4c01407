/* RCC: oscillators, PLL, the switch of SYSCLK and the dividers; clock gates, and resets of peripherals.
 *
 * Python's are the backup domain (BDCR), MCO, what the crystal and the clock security system do, and warnings. Which bit
 * gates or resets whom stands in the fabric, from the chip's page.
 * Source: RM0008 7.2, 7.3; start-up times from the data sheet DS5319 5.3.6 to 5.3.8.
 * Invariant: `fabric->clocks` is what SWS and the dividers say.
 */
#include <string.h>

#include "../fabric/fabric.h"
#include "../registers/rcc.h"

enum { HSI, HSE, PLL, LSE, LSI, OSCILLATORS };

/* Where the bits of each oscillator are, its ready flag in CIR (the enable is 8 bits above), and how long it takes. */
static const struct {
    uint32_t index, on, ready, flag, start_ns;
} oscillators[OSCILLATORS] = {
    {CR, HSION, HSIRDY, HSIRDYF, HSI_START_NS}, {CR, HSEON, HSERDY, HSERDYF, HSE_START_NS},
    {CR, PLLON, PLLRDY, PLLRDYF, PLL_START_NS}, {BDCR, LSEON, LSERDY, LSERDYF, LSE_START_NS},
    {CSR, LSION, LSIRDY, LSIRDYF, LSI_START_NS},
};
/* By SW: HSI, HSE, PLL. */
static const uint32_t source_ready[] = {HSIRDY, HSERDY, PLLRDY};
enum { FLAGS = PLLRDYF | HSERDYF | HSIRDYF | LSERDYF | LSIRDYF, PLL_SETTINGS = PLLSRC | PLLXTPRE | PLLMUL };
enum { TRIM_MIDDLE = 16, RTC_HSE_DIVIDER = 128 };
#define RESET_FLAGS (LPWRRSTF | WWDGRSTF | IWDGRSTF | SFTRSTF | PORRSTF | PINRSTF)

static uint32_t source_of(const uint32_t *words) { return words[CFGR] >> SWS_AT & 3; }

static void update_irq(struct device *device)
{
    const uint32_t flags = device->words[CIR];
    output_set(device, IRQ, (flags & flags >> 8 & FLAGS) != 0);
}

/* The on bits of CR that SYSCLK hangs on. */
static uint32_t in_use(const uint32_t *words)
{
    const uint32_t source = source_of(words);
    return source == PLL ? PLLON | (words[CFGR] & PLLSRC ? HSEON : HSION) : source == HSE ? HSEON : HSION;
}

/* Whether an oscillator that is on has what it needs to get ready. */
static bool can_start(const struct device *device, uint32_t n)
{
    const struct rcc *rcc = device->state;
    const uint32_t *words = device->words;
    return n == HSE   ? rcc->hse_hz && rcc->crystal_works
           : n == PLL ? (words[CR] & (words[CFGR] & PLLSRC ? HSERDY : HSIRDY)) != 0
                      : true;
}

static uint32_t ahb_divider(uint32_t code) { return code < 8 ? 1 : code < 12 ? 2u << (code - 8) : 64u << (code - 12); }

static uint32_t apb_divider(uint32_t code) { return code < 4 ? 1 : 2u << (code - 4); }

/* The source that RTCSEL chooses; 0 while it does not run, or without RTCEN. */
static uint32_t rtcclk_of(const struct device *device)
{
    static const uint8_t sources[] = {HSI, LSE, LSI, HSE};
    const struct rcc *rcc = device->state;
    const uint32_t backup = device->words[BDCR], source = sources[backup >> RTCSEL_AT & 3];
    const uint32_t hz = source == LSE ? LSE_HZ : source == LSI ? device->fabric->clocks->lsi_hz : rcc->hse_hz / RTC_HSE_DIVIDER;
    const bool runs = backup & RTCEN && source != HSI && device->words[oscillators[source].index] & oscillators[source].ready;
    return runs ? hz : 0;
}

/* Works out all frequencies; whether one is another now. */
static bool frequencies_changed(struct device *device)
{
    struct rcc *rcc = device->state;
    struct clocks *clocks = device->fabric->clocks;
    const struct clocks before = *clocks;
    const uint32_t *words = device->words, cfgr = words[CFGR], factor = (cfgr >> PLLMUL_AT & 15) + 2;
    rcc->hsi_hz = HSI_HZ + ((words[CR] >> HSITRIM_AT & 0x1F) - TRIM_MIDDLE) * TRIM_STEP_HZ;
    rcc->pll_hz = (cfgr & PLLSRC ? rcc->hse_hz / (cfgr & PLLXTPRE ? 2 : 1) : rcc->hsi_hz / 2) * (factor < 16 ? factor : 16);
    const uint32_t source = source_of(words), pll = words[CR] & PLLRDY ? rcc->pll_hz : 0;
    const uint32_t divider1 = apb_divider(cfgr >> PPRE1_AT & 7), divider2 = apb_divider(cfgr >> PPRE2_AT & 7);
    clocks->sysclk_hz = source == PLL ? rcc->pll_hz : source == HSI ? rcc->hsi_hz : rcc->hse_hz ? rcc->hse_hz : HSI_HZ;
    clocks->hclk_hz = clocks->sysclk_hz / ahb_divider(cfgr >> HPRE_AT & 15);
    clocks->pclk1_hz = clocks->hclk_hz / divider1;
    clocks->pclk2_hz = clocks->hclk_hz / divider2;
    clocks->adc_divider = 2 * ((cfgr >> ADCPRE_AT & 3) + 1);
    clocks->usb_hz = cfgr & USBPRE ? pll : pll * 2 / 3;
    clocks->timer1_hz = clocks->pclk1_hz * (divider1 == 1 ? 1 : 2);
    clocks->timer2_hz = clocks->pclk2_hz * (divider2 == 1 ? 1 : 2);
    clocks->rtcclk_hz = rtcclk_of(device);
    return memcmp(clocks, &before, sizeof before) != 0;
}

static void schedule_next(struct device *device)
{
    const struct rcc *rcc = device->state;
    uint64_t due = rcc->python_ns;
    for (uint32_t n = 0; n < OSCILLATORS; ++n) {
        due = rcc->ready_at[n] < due ? rcc->ready_at[n] : due;
    }
    schedule(device, due);
}

/* Starts and stops oscillators, switches SYSCLK, and brings the clocks up to date. */
static void settle(struct device *device)
{
    struct rcc *rcc = device->state;
    uint32_t *words = device->words;
    const uint64_t now = now_ns(device->fabric);
    words[CSR] |= rcc->keeps_lsi ? LSION : 0;
    for (uint32_t n = 0; n < OSCILLATORS; ++n) {
        uint32_t *word = &words[oscillators[n].index];
        if (!(*word & oscillators[n].on) || !can_start(device, n)) {
            *word &= ~oscillators[n].ready;
            rcc->ready_at[n] = NO_TIME;
        } else if (!(*word & oscillators[n].ready) && rcc->ready_at[n] == NO_TIME) {
            rcc->ready_at[n] = now + oscillators[n].start_ns;
        }
    }
    const uint32_t wanted = words[CFGR] & SW;
    if (words[CR] & source_ready[wanted]) {
        words[CFGR] = (words[CFGR] & ~(uint32_t)SWS) | wanted << SWS_AT;
    }
    if (frequencies_changed(device)) {
        ask_about(device, CLOCKS);
    }
    if (words[CFGR] & MCO || rcc->shows_clock) {
        ask_about(device, SHOWS);
    }
    schedule_next(device);
}

static void event(struct device *device, uint64_t ns)
{
    struct rcc *rcc = device->state;
    uint32_t *words = device->words;
    for (uint32_t n = 0; n < OSCILLATORS; ++n) {
        if (rcc->ready_at[n] <= ns) {
            words[oscillators[n].index] |= oscillators[n].ready;
            words[CIR] |= oscillators[n].flag;
            rcc->ready_at[n] = NO_TIME;
            settle(device);
            update_irq(device);
        }
    }
    if (rcc->python_ns <= ns) { /* last: then nothing of it is due any more */
        leave_ahead(device->fabric);
        device->fabric->calls.event(device->slot, ns);
    }
    schedule_next(device);
}

static void write_cr(struct device *device, uint32_t written, uint32_t previous)
{
    uint32_t *words = device->words;
    const uint32_t stopped = in_use(words) & previous & ~written;
    if (stopped) {
        words[CR] |= stopped;
        ask_about(device, IN_USE);
    }
    if (previous & HSEON && (written ^ previous) & HSEBYP) {
        words[CR] ^= HSEBYP;
    }
    settle(device);
}

static void write_cfgr(struct device *device, uint32_t written, uint32_t previous)
{
    uint32_t *words = device->words;
    const uint32_t changed = (written ^ previous) & PLL_SETTINGS;
    if (changed && words[CR] & PLLON) {
        words[CFGR] ^= changed;
        ask_about(device, PLL_IS_ON);
    }
    if ((written & SW) == SW) {
        words[CFGR] = (words[CFGR] & ~(uint32_t)SW) | (previous & SW);
        ask_about(device, NO_SOURCE);
    }
    settle(device);
}

static void write_cir(struct device *device, uint32_t written)
{
    device->words[CIR] &= ~(written >> 16 & (FLAGS | CSSF));
    if (written & CSSC) {
        ask_about(device, CSS_CLEARED);
    }
    update_irq(device);
}

/* The registers of the enables follow those of the resets in the same order, behind that of the AHB. */
static void write_resets(struct device *device, uint32_t index, uint32_t previous)
{
    struct fabric *fabric = device->fabric;
    for (uint32_t left = device->words[index] & ~previous; left; left &= left - 1) {
        const uint32_t slot = fabric->gated[index - APB2RSTR + 1][__builtin_ctz(left)];
        if (slot && fabric->devices[slot].resets_alone) {
            reset_device(&fabric->devices[slot]);
        } else if (slot) {
            ask(device, RESETS, slot);
        }
    }
}

static void write(struct device *device, uint32_t index, uint32_t written, uint32_t previous)
{
    switch (index) {
    case CR: write_cr(device, written, previous); break;
    case CFGR: write_cfgr(device, written, previous); break;
    case CIR: write_cir(device, written); break;
    case APB2RSTR:
    case APB1RSTR: write_resets(device, index, previous); break;
    case CSR:
        device->words[CSR] &= written & RMVF ? ~RESET_FLAGS : UINT32_MAX;
        settle(device);
        break;
    default:
        if (((const struct rcc *)device->state)->watches_gates) {
            ask_about(device, GATES);
        }
    }
}

static bool needs_time(const struct device *device, uint32_t index, bool is_write)
{
    (void)is_write; /* its reads are plain */
    return index < AHBENR || index > APB1ENR || ((const struct rcc *)device->state)->watches_gates;
}

/* A line: IWDG keeps LSI on. It ends with a reset, as what a program has set does. */
static void line(struct device *device, uint32_t input, bool level)
{
    (void)input; /* there is one */
    ((struct rcc *)device->state)->keeps_lsi = level;
    device->words[CSR] &= ~(uint32_t)LSION;
    settle(device);
}

static uint32_t command(struct device *device, uint32_t what, uint32_t one, uint32_t other)
{
    struct rcc *rcc = device->state;
    (void)one;
    (void)other;
    if (what == RESET) {
        for (uint32_t n = 0; n < OSCILLATORS; ++n) {
            rcc->ready_at[n] = NO_TIME;
        }
        output_set(device, IRQ, false);
    } else if (what == SETTLE_CLOCKS) {
        settle(device);
    } else if (what == WAIT) {
        schedule_next(device);
    }
    return 0;
}

DEVICE_KIND(rcc_kind) = {.name = "rcc", .needs_time = needs_time, .write = write, .event = event, .line = line,
                         .command = command};
