/* bluepill_sim/extension/source/registers/spi.h: RM0008 25.5; made from peripherals/spi.py. */
#ifndef BLUEPILL_REGISTERS_SPI_H
#define BLUEPILL_REGISTERS_SPI_H

/* Registers by offset / 4. */
enum { CR1 = 0, CR2 = 1, SR = 2, DR = 3, CRCPR = 4, RXCRCR = 5, TXCRCR = 6, I2SCFGR = 7, I2SPR = 8 };

/* Of CR1. */
enum { BIDIMODE = 1 << 15, BIDIOE = 1 << 14, CRCEN = 1 << 13, CRCNEXT = 1 << 12, DFF = 1 << 11, RXONLY = 1 << 10,
       SSM = 1 << 9, SSI = 1 << 8, LSBFIRST = 1 << 7, SPE = 1 << 6, BR = 0x7 << 3, BR_AT = 3, MSTR = 1 << 2,
       CPOL = 1 << 1, CPHA = 1 << 0 };

/* Of CR2. */
enum { TXEIE = 1 << 7, RXNEIE = 1 << 6, ERRIE = 1 << 5, SSOE = 1 << 2, TXDMAEN = 1 << 1, RXDMAEN = 1 << 0 };

/* Of SR. */
enum { BSY = 1 << 7, OVR = 1 << 6, MODF = 1 << 5, CRCERR = 1 << 4, UDR = 1 << 3, CHSIDE = 1 << 2, TXE = 1 << 1,
       RXNE = 1 << 0 };

/* Of DR. */
enum { DR_DR = 0xffff << 0, DR_DR_AT = 0 };

/* Of CRCPR. */
enum { CRCPOLY = 0xffff << 0, CRCPOLY_AT = 0 };

/* Of RXCRCR. */
enum { RXCRC = 0xffff << 0, RXCRC_AT = 0 };

/* Of TXCRCR. */
enum { TXCRC = 0xffff << 0, TXCRC_AT = 0 };

/* Its outputs. */
enum { IRQ = 0, RX_DMA = 1, TX_DMA = 2 };

/* What Python is asked: those from NO_SCK on are warnings. */
enum { EXCHANGE = 0, SELECT = 1, NEXT_WORD = 2, NO_SCK = 3, NO_MOSI = 4, NO_MISO = 5, WORD_LOST = 6, MODE_FAULT = 7 };

/* A command of its own. */
enum { MOVE = 16, LISTEN = 17, CLOCK_IN = 18 };

#endif
