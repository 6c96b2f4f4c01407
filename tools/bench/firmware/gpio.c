/* Reads an input and writes it to an output, as fast as it can. */
#include "board.h"
#include "f103.h"

volatile uint32_t bench_rounds;

int main(void)
{
    clock_start();
    RCC->APB2ENR |= RCC_APB2ENR_IOPAEN | RCC_APB2ENR_IOPBEN;
    GPIOB->CRL = (GPIOB->CRL & ~(0xFu << 20)) | GPIO_OUTPUT_PUSH_PULL_2MHZ << 20;
    for (;;) {
        uint32_t level = GPIOA->IDR;
        GPIOB->BSRR = level & 1u << 4 ? 1u << 5 : 1u << 21;
        ++bench_rounds;
    }
}
