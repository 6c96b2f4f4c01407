/* bluepill_sim/extension/source/registers/adc.h: RM0008 11.12; made from peripherals/adc.py. */
#ifndef BLUEPILL_REGISTERS_ADC_H
#define BLUEPILL_REGISTERS_ADC_H

/* Registers by offset / 4. */
enum { SR = 0, CR1 = 1, CR2 = 2, SMPR1 = 3, SMPR2 = 4, JOFR1 = 5, JOFR2 = 6, JOFR3 = 7, JOFR4 = 8, HTR = 9, LTR = 10,
       SQR1 = 11, SQR2 = 12, SQR3 = 13, JSQR = 14, JDR1 = 15, JDR2 = 16, JDR3 = 17, JDR4 = 18, DR = 19 };

/* Of SR. */
enum { STRT = 1 << 4, JSTRT = 1 << 3, JEOC = 1 << 2, EOC = 1 << 1, AWD = 1 << 0 };

/* Of CR1. */
enum { AWDEN = 1 << 23, JAWDEN = 1 << 22, DUALMOD = 0xf << 16, DUALMOD_AT = 16, DISCNUM = 0x7 << 13, DISCNUM_AT = 13,
       JDISCEN = 1 << 12, DISCEN = 1 << 11, JAUTO = 1 << 10, AWDSGL = 1 << 9, SCAN = 1 << 8, JEOCIE = 1 << 7,
       AWDIE = 1 << 6, EOCIE = 1 << 5, AWDCH = 0x1f << 0, AWDCH_AT = 0 };

/* Of CR2. */
enum { TSVREFE = 1 << 23, SWSTART = 1 << 22, JSWSTART = 1 << 21, EXTTRIG = 1 << 20, EXTSEL = 0x7 << 17,
       EXTSEL_AT = 17, JEXTTRIG = 1 << 15, JEXTSEL = 0x7 << 12, JEXTSEL_AT = 12, ALIGN = 1 << 11, CR2_DMA = 1 << 8,
       RSTCAL = 1 << 3, CAL = 1 << 2, CONT = 1 << 1, ADON = 1 << 0 };

/* Of SMPR1. */
enum { SMP17 = 0x7 << 21, SMP17_AT = 21, SMP16 = 0x7 << 18, SMP16_AT = 18, SMP15 = 0x7 << 15, SMP15_AT = 15,
       SMP14 = 0x7 << 12, SMP14_AT = 12, SMP13 = 0x7 << 9, SMP13_AT = 9, SMP12 = 0x7 << 6, SMP12_AT = 6,
       SMP11 = 0x7 << 3, SMP11_AT = 3, SMP10 = 0x7 << 0, SMP10_AT = 0 };

/* Of SMPR2. */
enum { SMP9 = 0x7 << 27, SMP9_AT = 27, SMP8 = 0x7 << 24, SMP8_AT = 24, SMP7 = 0x7 << 21, SMP7_AT = 21,
       SMP6 = 0x7 << 18, SMP6_AT = 18, SMP5 = 0x7 << 15, SMP5_AT = 15, SMP4 = 0x7 << 12, SMP4_AT = 12,
       SMP3 = 0x7 << 9, SMP3_AT = 9, SMP2 = 0x7 << 6, SMP2_AT = 6, SMP1 = 0x7 << 3, SMP1_AT = 3, SMP0 = 0x7 << 0,
       SMP0_AT = 0 };

/* Of JOFR1. */
enum { JOFFSET1 = 0xfff << 0, JOFFSET1_AT = 0 };

/* Of JOFR2. */
enum { JOFFSET2 = 0xfff << 0, JOFFSET2_AT = 0 };

/* Of JOFR3. */
enum { JOFFSET3 = 0xfff << 0, JOFFSET3_AT = 0 };

/* Of JOFR4. */
enum { JOFFSET4 = 0xfff << 0, JOFFSET4_AT = 0 };

/* Of HTR. */
enum { HT = 0xfff << 0, HT_AT = 0 };

/* Of LTR. */
enum { LT = 0xfff << 0, LT_AT = 0 };

/* Of SQR1. */
enum { L = 0xf << 20, L_AT = 20, SQ16 = 0x1f << 15, SQ16_AT = 15, SQ15 = 0x1f << 10, SQ15_AT = 10, SQ14 = 0x1f << 5,
       SQ14_AT = 5, SQ13 = 0x1f << 0, SQ13_AT = 0 };

/* Of SQR2. */
enum { SQ12 = 0x1f << 25, SQ12_AT = 25, SQ11 = 0x1f << 20, SQ11_AT = 20, SQ10 = 0x1f << 15, SQ10_AT = 15,
       SQ9 = 0x1f << 10, SQ9_AT = 10, SQ8 = 0x1f << 5, SQ8_AT = 5, SQ7 = 0x1f << 0, SQ7_AT = 0 };

/* Of SQR3. */
enum { SQ6 = 0x1f << 25, SQ6_AT = 25, SQ5 = 0x1f << 20, SQ5_AT = 20, SQ4 = 0x1f << 15, SQ4_AT = 15, SQ3 = 0x1f << 10,
       SQ3_AT = 10, SQ2 = 0x1f << 5, SQ2_AT = 5, SQ1 = 0x1f << 0, SQ1_AT = 0 };

/* Of JSQR. */
enum { JL = 0x3 << 20, JL_AT = 20, JSQ4 = 0x1f << 15, JSQ4_AT = 15, JSQ3 = 0x1f << 10, JSQ3_AT = 10, JSQ2 = 0x1f << 5,
       JSQ2_AT = 5, JSQ1 = 0x1f << 0, JSQ1_AT = 0 };

/* Of JDR1. */
enum { JDATA = 0xffff << 0, JDATA_AT = 0 };

/* Of DR. */
#define ADC2DATA 0xffff0000u
enum { ADC2DATA_AT = 16, DATA = 0xffff << 0, DATA_AT = 0 };

/* Its outputs. */
enum { IRQ = 0, OUTPUT_DMA = 1 };

/* What the device warns of, with the number of the channel. */
enum { NOT_ANALOG = 0, NO_PIN = 1, NOT_ENABLED = 2, TOO_FAST = 3, CAL_OFF = 4 };

/* A command of its own. */
enum { INPUTS_CHANGE = 16 };

#endif
