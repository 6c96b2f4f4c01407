/* bluepill_sim/extension/source/registers/i2c.h: RM0008 26.6; made from peripherals/i2c.py. */
#ifndef BLUEPILL_REGISTERS_I2C_H
#define BLUEPILL_REGISTERS_I2C_H

/* Registers by offset / 4. */
enum { CR1 = 0, CR2 = 1, OAR1 = 2, OAR2 = 3, DR = 4, SR1 = 5, SR2 = 6, CCR = 7, TRISE = 8 };

/* The words behind them. */
enum { SEEN = 9 };

/* Of CR1. */
enum { SWRST = 1 << 15, ALERT = 1 << 13, CR1_PEC = 1 << 12, POS = 1 << 11, ACK = 1 << 10, STOP = 1 << 9,
       START = 1 << 8, NOSTRETCH = 1 << 7, ENGC = 1 << 6, ENPEC = 1 << 5, ENARP = 1 << 4, SMBTYPE = 1 << 3,
       SMBUS = 1 << 1, PE = 1 << 0 };

/* Of CR2. */
enum { LAST = 1 << 12, DMAEN = 1 << 11, ITBUFEN = 1 << 10, ITEVTEN = 1 << 9, ITERREN = 1 << 8, FREQ = 0x3f << 0,
       FREQ_AT = 0 };

/* Of OAR1. */
enum { ADDMODE = 1 << 15, ONE = 1 << 14, ADD = 0x3ff << 0, ADD_AT = 0 };

/* Of OAR2. */
enum { ADD2 = 0x7f << 1, ADD2_AT = 1, ENDUAL = 1 << 0 };

/* Of DR. */
enum { DR_DR = 0xff << 0, DR_DR_AT = 0 };

/* Of SR1. */
enum { SMBALERT = 1 << 15, TIMEOUT = 1 << 14, PECERR = 1 << 12, OVR = 1 << 11, AF = 1 << 10, ARLO = 1 << 9,
       BERR = 1 << 8, TXE = 1 << 7, RXNE = 1 << 6, STOPF = 1 << 4, ADD10 = 1 << 3, BTF = 1 << 2, ADDR = 1 << 1,
       SB = 1 << 0 };

/* Of SR2. */
enum { SR2_PEC = 0xff << 8, SR2_PEC_AT = 8, DUALF = 1 << 7, SMBHOST = 1 << 6, SMBDEFAULT = 1 << 5, GENCALL = 1 << 4,
       TRA = 1 << 2, BUSY = 1 << 1, MSL = 1 << 0 };

/* Of CCR. */
enum { FS = 1 << 15, DUTY = 1 << 14, CCR_CCR = 0xfff << 0, CCR_CCR_AT = 0 };

/* Of TRISE. */
enum { TRISE_TRISE = 0x3f << 0, TRISE_TRISE_AT = 0 };

/* Its outputs. */
enum { EVENT_IRQ = 0, ERROR_IRQ = 1, RX_DMA = 2, TX_DMA = 3 };

/* What Python is asked; from NO_PINS on they are warnings. */
enum { ADDRESS = 0, WRITE = 1, READ = 2, END = 3, NEXT_STEP = 4, NO_PINS = 5, SEQUENCE = 6 };

/* A command of its own. */
enum { MOVE = 16, CALL = 17, DISTURB = 18, LISTEN = 19, HOLD_TIMEOUT = 20, GO_ON_TIMEOUT = 21 };

/* What a master outside does, above a byte or, for FAR_READ, its acknowledge. */
enum { FAR_NOTHING = 0, FAR_START = 1, FAR_WRITE = 2, FAR_READ = 3, FAR_STOP = 4 };

#endif
