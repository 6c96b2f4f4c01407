/* The words and bits of a USART that this core knows, as bluepill_sim/peripherals/usart.py has them. Source: RM0008 27.6. */
#ifndef BLUEPILL_USART_H
#define BLUEPILL_USART_H

/* Registers by offset / 4, and the hidden words behind them. */
enum usart_word { SR = 0, BRR = 2, CR1 = 3, SEEN = 7, TDR = 8, SHIFT = 9, RDR = 10 };

/* Of SR, and of what it enables in CR1 at the same places. */
enum usart_flag { PE = 1 << 0, ORE = 1 << 3, IDLE = 1 << 4, RXNE = 1 << 5, TC = 1 << 6, TXE = 1 << 7, ASKING = TXE | TC | RXNE | IDLE };
#define READ_SEQUENCE_FLAGS 0x1Fu

/* Of CR1. */
enum usart_control { TE = 1 << 3, RXNEIE = 1 << 5, PEIE = 1 << 8, UE = 1 << 13 };

/* A data word, and what marks one in TDR and SHIFT. */
#define WORD 0x1FFu
#define HELD 0x10000u

#endif
