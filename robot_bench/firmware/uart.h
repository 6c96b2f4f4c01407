/* Text on USART1 (PA9, 115200 8N1), sent by interrupt from a ring. */
#ifndef UART_H
#define UART_H

#include <stdint.h>

#define UART_BAUD 115200u

void uart_start(void);

/* Queues; sleeps only while the ring is full. Not for interrupt handlers. */
void uart_text(const char *text);

/* Decimal, with a minus sign where needed. */
void uart_number(int32_t number);

#endif
