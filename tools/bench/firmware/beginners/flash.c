/* Erases the last page and programs it halfword by halfword, as ST's drivers do: PG set and cleared around each, BSY
 * polled, what is written read back.
 */
#include "board.h"
#include "f103.h"

struct controller { volatile uint32_t ACR, KEYR, OPTKEYR, SR, CR, AR; };
#define CONTROLLER ((struct controller *)0x40022000u)
#define PAGE 0x0800FC00u
#define HALFWORDS 512u

enum { PG = 1 << 0, PER = 1 << 1, STRT = 1 << 6, LOCK = 1 << 7, BSY = 1 << 0, EOP = 1 << 5 };

volatile uint32_t bench_rounds;
volatile uint32_t bench_errors;

static void wait(void)
{
    while (CONTROLLER->SR & BSY) {
    }
    if (CONTROLLER->SR & EOP) {
        CONTROLLER->SR = EOP;
    } else {
        ++bench_errors;
    }
}

int main(void)
{
    clock_start();
    for (;;) {
        CONTROLLER->KEYR = 0x45670123u;
        CONTROLLER->KEYR = 0xCDEF89ABu;
        CONTROLLER->CR |= PER;
        CONTROLLER->AR = PAGE;
        CONTROLLER->CR |= STRT;
        wait();
        CONTROLLER->CR &= ~(uint32_t)PER;
        for (uint32_t n = 0; n < HALFWORDS; ++n) {
            volatile uint16_t *at = (volatile uint16_t *)PAGE + n;
            CONTROLLER->CR |= PG;
            *at = (uint16_t)(n ^ bench_rounds);
            wait();
            CONTROLLER->CR &= ~(uint32_t)PG;
            bench_errors += *at != (uint16_t)(n ^ bench_rounds);
        }
        CONTROLLER->CR |= LOCK;
        ++bench_rounds;
    }
}
