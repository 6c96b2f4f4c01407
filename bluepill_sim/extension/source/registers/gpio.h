/* bluepill_sim/extension/source/registers/gpio.h: RM0008 9.2; made from peripherals/gpio.py. */
#ifndef BLUEPILL_REGISTERS_GPIO_H
#define BLUEPILL_REGISTERS_GPIO_H

/* Registers by offset / 4. */
enum { CRL = 0, CRH = 1, IDR = 2, ODR = 3, BSRR = 4, BRR = 5, LCKR = 6 };

/* Of CRL. */
#define CNF7 0xc0000000u
enum { CNF7_AT = 30, MODE7 = 0x3 << 28, MODE7_AT = 28, CNF6 = 0x3 << 26, CNF6_AT = 26, MODE6 = 0x3 << 24,
       MODE6_AT = 24, CNF5 = 0x3 << 22, CNF5_AT = 22, MODE5 = 0x3 << 20, MODE5_AT = 20, CNF4 = 0x3 << 18,
       CNF4_AT = 18, MODE4 = 0x3 << 16, MODE4_AT = 16, CNF3 = 0x3 << 14, CNF3_AT = 14, MODE3 = 0x3 << 12,
       MODE3_AT = 12, CNF2 = 0x3 << 10, CNF2_AT = 10, MODE2 = 0x3 << 8, MODE2_AT = 8, CNF1 = 0x3 << 6, CNF1_AT = 6,
       MODE1 = 0x3 << 4, MODE1_AT = 4, CNF0 = 0x3 << 2, CNF0_AT = 2, MODE0 = 0x3 << 0, MODE0_AT = 0 };

/* Of CRH. */
#define CNF15 0xc0000000u
enum { CNF15_AT = 30, MODE15 = 0x3 << 28, MODE15_AT = 28, CNF14 = 0x3 << 26, CNF14_AT = 26, MODE14 = 0x3 << 24,
       MODE14_AT = 24, CNF13 = 0x3 << 22, CNF13_AT = 22, MODE13 = 0x3 << 20, MODE13_AT = 20, CNF12 = 0x3 << 18,
       CNF12_AT = 18, MODE12 = 0x3 << 16, MODE12_AT = 16, CNF11 = 0x3 << 14, CNF11_AT = 14, MODE11 = 0x3 << 12,
       MODE11_AT = 12, CNF10 = 0x3 << 10, CNF10_AT = 10, MODE10 = 0x3 << 8, MODE10_AT = 8, CNF9 = 0x3 << 6,
       CNF9_AT = 6, MODE9 = 0x3 << 4, MODE9_AT = 4, CNF8 = 0x3 << 2, CNF8_AT = 2, MODE8 = 0x3 << 0, MODE8_AT = 0 };

/* Of IDR. */
enum { IDR15 = 1 << 15, IDR14 = 1 << 14, IDR13 = 1 << 13, IDR12 = 1 << 12, IDR11 = 1 << 11, IDR10 = 1 << 10,
       IDR9 = 1 << 9, IDR8 = 1 << 8, IDR7 = 1 << 7, IDR6 = 1 << 6, IDR5 = 1 << 5, IDR4 = 1 << 4, IDR3 = 1 << 3,
       IDR2 = 1 << 2, IDR1 = 1 << 1, IDR0 = 1 << 0 };

/* Of ODR. */
enum { ODR15 = 1 << 15, ODR14 = 1 << 14, ODR13 = 1 << 13, ODR12 = 1 << 12, ODR11 = 1 << 11, ODR10 = 1 << 10,
       ODR9 = 1 << 9, ODR8 = 1 << 8, ODR7 = 1 << 7, ODR6 = 1 << 6, ODR5 = 1 << 5, ODR4 = 1 << 4, ODR3 = 1 << 3,
       ODR2 = 1 << 2, ODR1 = 1 << 1, ODR0 = 1 << 0 };

/* Of BSRR. */
#define BSRR_BR15 0x80000000u
enum { BSRR_BR14 = 1 << 30, BSRR_BR13 = 1 << 29, BSRR_BR12 = 1 << 28, BSRR_BR11 = 1 << 27, BSRR_BR10 = 1 << 26,
       BSRR_BR9 = 1 << 25, BSRR_BR8 = 1 << 24, BSRR_BR7 = 1 << 23, BSRR_BR6 = 1 << 22, BSRR_BR5 = 1 << 21,
       BSRR_BR4 = 1 << 20, BSRR_BR3 = 1 << 19, BSRR_BR2 = 1 << 18, BSRR_BR1 = 1 << 17, BSRR_BR0 = 1 << 16,
       BS15 = 1 << 15, BS14 = 1 << 14, BS13 = 1 << 13, BS12 = 1 << 12, BS11 = 1 << 11, BS10 = 1 << 10, BS9 = 1 << 9,
       BS8 = 1 << 8, BS7 = 1 << 7, BS6 = 1 << 6, BS5 = 1 << 5, BS4 = 1 << 4, BS3 = 1 << 3, BS2 = 1 << 2, BS1 = 1 << 1,
       BS0 = 1 << 0 };

/* Of BRR. */
enum { BRR_BR15 = 1 << 15, BRR_BR14 = 1 << 14, BRR_BR13 = 1 << 13, BRR_BR12 = 1 << 12, BRR_BR11 = 1 << 11,
       BRR_BR10 = 1 << 10, BRR_BR9 = 1 << 9, BRR_BR8 = 1 << 8, BRR_BR7 = 1 << 7, BRR_BR6 = 1 << 6, BRR_BR5 = 1 << 5,
       BRR_BR4 = 1 << 4, BRR_BR3 = 1 << 3, BRR_BR2 = 1 << 2, BRR_BR1 = 1 << 1, BRR_BR0 = 1 << 0 };

/* Of LCKR. */
enum { LCKK = 1 << 16, LCK15 = 1 << 15, LCK14 = 1 << 14, LCK13 = 1 << 13, LCK12 = 1 << 12, LCK11 = 1 << 11,
       LCK10 = 1 << 10, LCK9 = 1 << 9, LCK8 = 1 << 8, LCK7 = 1 << 7, LCK6 = 1 << 6, LCK5 = 1 << 5, LCK4 = 1 << 4,
       LCK3 = 1 << 3, LCK2 = 1 << 2, LCK1 = 1 << 1, LCK0 = 1 << 0 };

/* What Python is told beside what a listener hears. */
enum { LOCKED = 2 };

/* A command of its own. */
enum { CHECK = 16 };

#endif
