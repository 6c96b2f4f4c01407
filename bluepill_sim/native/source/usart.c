/* The data register of a USART while characters follow each other: what needs neither time nor Python.
 *
 * A write while the shift register is busy fills TDR, a read empties RDR; both
 * only clear flags, so that the interrupt line can fall but not rise. All else
 * is the business of bluepill_sim/peripherals/usart.py.
 */
#include "core.h"
#include "usart.h"

static void update_irq(struct core *core, const struct page *page)
{
    const uint32_t status = page->words[SR], control = page->words[CR1];
    const bool asks = status & control & ASKING || (status & ORE && control & RXNEIE) || (status & PE && control & PEIE);
    if (!asks) {
        core->shared.levels &= ~(UINT64_C(1) << page->irq);
    }
}

bool write_usart_data(struct core *core, const struct page *page, uint32_t value)
{
    uint32_t *words = page->words;
    if (core->shared.has_irq_listeners || (words[CR1] & (UE | TE)) != (UE | TE) || words[BRR] == 0 || words[SHIFT] == 0 ||
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
    if (core->shared.has_irq_listeners) {
        return false;
    }
    uint32_t *words = page->words;
    words[SR] &= ~(RXNE | (words[SEEN] & READ_SEQUENCE_FLAGS));
    words[SEEN] &= ~READ_SEQUENCE_FLAGS;
    update_irq(core, page);
    *word = words[RDR];
    return true;
}
