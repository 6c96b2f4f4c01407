/* The data register of a USART while characters follow each other: what needs neither time nor Python.
 *
 * A write while the shift register is busy fills TDR, a read empties RDR; both
 * only clear flags, so that the interrupt line can fall but not rise. All else
 * is the business of bluepill_sim/usart.py, which has these words too.
 * Source: RM0008 27.6.
 */
#include "core.h"

enum { SR = 0, BRR = 2, CR1 = 3, SEEN = 7, TDR = 8, SHIFT = 9, RDR = 10 };
enum { ORE = 1 << 3, IDLE = 1 << 4, RXNE = 1 << 5, TC = 1 << 6, TXE = 1 << 7 };
enum { TE = 1 << 3, RXNEIE = 1 << 5, UE = 1 << 13 };
#define WORD 0x1FFu
#define HELD 0x10000u
#define READ_SEQUENCE_FLAGS 0x1Fu

static void update_irq(struct core *core, const struct page *page)
{
    const uint32_t status = page->words[SR], control = page->words[CR1];
    const bool asks = status & control & (TXE | TC | RXNE | IDLE) || (status & ORE && control & RXNEIE);
    if (!asks) {
        core->shared.levels &= ~(UINT64_C(1) << page->irq);
    }
}

bool write_usart_data(struct core *core, const struct page *page, uint32_t value)
{
    uint32_t *words = page->words;
    if (core->shared.tells_irqs || (words[CR1] & (UE | TE)) != (UE | TE) || words[BRR] == 0 || words[SHIFT] == 0 ||
        words[TDR] != 0) {
        return false;
    }
    if (words[SEEN] & TC) {
        words[SEEN] &= ~(uint32_t)TC;
        words[SR] &= ~(uint32_t)TC;
    }
    words[TDR] = HELD | (value & WORD);
    words[SR] &= ~(uint32_t)TXE;
    update_irq(core, page);
    return true;
}

bool read_usart_data(struct core *core, const struct page *page, uint32_t *word)
{
    if (core->shared.tells_irqs) {
        return false;
    }
    uint32_t *words = page->words;
    words[SR] &= ~(RXNE | (words[SEEN] & READ_SEQUENCE_FLAGS));
    words[SEEN] &= ~READ_SEQUENCE_FLAGS;
    update_irq(core, page);
    *word = words[RDR];
    return true;
}
