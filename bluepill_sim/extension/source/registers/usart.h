/* bluepill_sim/extension/source/registers/usart.h: RM0008 27.6; made from peripherals/usart.py. */
#ifndef BLUEPILL_REGISTERS_USART_H
#define BLUEPILL_REGISTERS_USART_H

/* Registers by offset / 4. */
enum { SR = 0, DR = 1, BRR = 2, CR1 = 3, CR2 = 4, CR3 = 5, GTPR = 6 };

/* The words behind them. */
enum { SEEN = 7, TDR = 8, SHIFT = 9, RDR = 10 };

/* Of SR. */
enum { CTS = 1 << 9, LBD = 1 << 8, TXE = 1 << 7, TC = 1 << 6, RXNE = 1 << 5, IDLE = 1 << 4, ORE = 1 << 3, NE = 1 << 2,
       FE = 1 << 1, PE = 1 << 0 };

/* Of DR. */
enum { DR_DR = 0x1ff << 0, DR_DR_AT = 0 };

/* Of BRR. */
enum { DIV_MANTISSA = 0xfff << 4, DIV_MANTISSA_AT = 4, DIV_FRACTION = 0xf << 0, DIV_FRACTION_AT = 0 };

/* Of CR1. */
enum { UE = 1 << 13, M = 1 << 12, WAKE = 1 << 11, PCE = 1 << 10, PS = 1 << 9, PEIE = 1 << 8, TXEIE = 1 << 7,
       TCIE = 1 << 6, RXNEIE = 1 << 5, IDLEIE = 1 << 4, TE = 1 << 3, RE = 1 << 2, RWU = 1 << 1, SBK = 1 << 0 };

/* Of CR2. */
enum { LINEN = 1 << 14, STOP = 0x3 << 12, STOP_AT = 12, CLKEN = 1 << 11, CPOL = 1 << 10, CPHA = 1 << 9, LBCL = 1 << 8,
       LBDIE = 1 << 6, LBDL = 1 << 5, ADD = 0xf << 0, ADD_AT = 0 };

/* Of CR3. */
enum { CTSIE = 1 << 10, CTSE = 1 << 9, RTSE = 1 << 8, DMAT = 1 << 7, DMAR = 1 << 6, SCEN = 1 << 5, NACK = 1 << 4,
       HDSEL = 1 << 3, IRLP = 1 << 2, IREN = 1 << 1, EIE = 1 << 0 };

/* Of GTPR. */
enum { GT = 0xff << 8, GT_AT = 8, PSC = 0xff << 0, PSC_AT = 0 };

/* Its outputs. */
enum { IRQ = 0, TX_DMA = 1, RX_DMA = 2 };

/* What Python is asked: all but the last four are warnings. */
enum { TX_PIN = 0, TX_OFF = 1, NO_RATE = 2, CHARACTER_LOST = 3, RX_OFF = 4, CUT_OFF = 5, CHECK_MODES = 6,
       JUDGE_SPEED = 7, GIVE_MORE = 8, EXCHANGE = 9 };

/* A command of its own. */
enum { MOVE = 16, HEAR = 17, CAN_HEAR = 18, LISTEN = 19, CONTROL = 20, MOVE_CK = 21 };

#endif
