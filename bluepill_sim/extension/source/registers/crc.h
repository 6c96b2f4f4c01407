/* bluepill_sim/extension/source/registers/crc.h: RM0008 4.4; made from peripherals/crc.py. */
#ifndef BLUEPILL_REGISTERS_CRC_H
#define BLUEPILL_REGISTERS_CRC_H

/* Registers by offset / 4. */
enum { DR = 0, IDR = 1, CR = 2 };

/* Of IDR. */
enum { IDR_IDR = 0xff << 0, IDR_IDR_AT = 0 };

/* Of CR. */
enum { CR_RESET = 1 << 0 };

#endif
