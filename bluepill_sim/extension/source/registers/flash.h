/* bluepill_sim/extension/source/registers/flash.h: PM0075 3; made from peripherals/flash.py. */
#ifndef BLUEPILL_REGISTERS_FLASH_H
#define BLUEPILL_REGISTERS_FLASH_H

/* Registers by offset / 4. */
enum { ACR = 0, KEYR = 1, OPTKEYR = 2, SR = 3, CR = 4, AR = 5, OBR = 7, WRPR = 8 };

/* Of ACR. */
enum { PRFTBS = 1 << 5, PRFTBE = 1 << 4, HLFCYA = 1 << 3, LATENCY = 0x7 << 0, LATENCY_AT = 0 };

/* Of SR. */
enum { EOP = 1 << 5, WRPRTERR = 1 << 4, PGERR = 1 << 2, BSY = 1 << 0 };

/* Of CR. */
enum { EOPIE = 1 << 12, ERRIE = 1 << 10, OPTWRE = 1 << 9, LOCK = 1 << 7, STRT = 1 << 6, OPTER = 1 << 5,
       OPTPG = 1 << 4, MER = 1 << 2, PER = 1 << 1, PG = 1 << 0 };

/* Of OBR. */
enum { DATA1 = 0xff << 18, DATA1_AT = 18, DATA0 = 0xff << 10, DATA0_AT = 10, UNUSED = 0x1f << 5, UNUSED_AT = 5,
       NRST_STDBY = 1 << 4, NRST_STOP = 1 << 3, WDG_SW = 1 << 2, RDPRT = 1 << 1, OPTERR = 1 << 0 };

/* Its outputs. */
enum { IRQ = 0 };

/* What Python is told beside what a listener hears. */
enum { WRITTEN = 2, ACCESS = 3, RESERVED = 4 };

#endif
