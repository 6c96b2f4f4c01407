/* bluepill_sim/extension/source/registers/exti.h: RM0008 10.3; made from peripherals/exti.py. */
#ifndef BLUEPILL_REGISTERS_EXTI_H
#define BLUEPILL_REGISTERS_EXTI_H

/* Registers by offset / 4. */
enum { IMR = 0, EMR = 1, RTSR = 2, FTSR = 3, SWIER = 4, PR = 5 };

/* Of IMR. */
enum { MR18 = 1 << 18, MR17 = 1 << 17, MR16 = 1 << 16, MR15 = 1 << 15, MR14 = 1 << 14, MR13 = 1 << 13, MR12 = 1 << 12,
       MR11 = 1 << 11, MR10 = 1 << 10, MR9 = 1 << 9, MR8 = 1 << 8, MR7 = 1 << 7, MR6 = 1 << 6, MR5 = 1 << 5,
       MR4 = 1 << 4, MR3 = 1 << 3, MR2 = 1 << 2, MR1 = 1 << 1, MR0 = 1 << 0 };

/* Of RTSR. */
enum { TR18 = 1 << 18, TR17 = 1 << 17, TR16 = 1 << 16, TR15 = 1 << 15, TR14 = 1 << 14, TR13 = 1 << 13, TR12 = 1 << 12,
       TR11 = 1 << 11, TR10 = 1 << 10, TR9 = 1 << 9, TR8 = 1 << 8, TR7 = 1 << 7, TR6 = 1 << 6, TR5 = 1 << 5,
       TR4 = 1 << 4, TR3 = 1 << 3, TR2 = 1 << 2, TR1 = 1 << 1, TR0 = 1 << 0 };

/* Of SWIER. */
enum { SWIER18 = 1 << 18, SWIER17 = 1 << 17, SWIER16 = 1 << 16, SWIER15 = 1 << 15, SWIER14 = 1 << 14,
       SWIER13 = 1 << 13, SWIER12 = 1 << 12, SWIER11 = 1 << 11, SWIER10 = 1 << 10, SWIER9 = 1 << 9, SWIER8 = 1 << 8,
       SWIER7 = 1 << 7, SWIER6 = 1 << 6, SWIER5 = 1 << 5, SWIER4 = 1 << 4, SWIER3 = 1 << 3, SWIER2 = 1 << 2,
       SWIER1 = 1 << 1, SWIER0 = 1 << 0 };

/* Of PR. */
enum { PR18 = 1 << 18, PR17 = 1 << 17, PR16 = 1 << 16, PR15 = 1 << 15, PR14 = 1 << 14, PR13 = 1 << 13, PR12 = 1 << 12,
       PR11 = 1 << 11, PR10 = 1 << 10, PR9 = 1 << 9, PR8 = 1 << 8, PR7 = 1 << 7, PR6 = 1 << 6, PR5 = 1 << 5,
       PR4 = 1 << 4, PR3 = 1 << 3, PR2 = 1 << 2, PR1 = 1 << 1, PR0 = 1 << 0 };

/* Its outputs. */
enum { OUTPUT_0 = 0, OUTPUT_1 = 1, OUTPUT_2 = 2, OUTPUT_3 = 3, OUTPUT_4 = 4, OUTPUT_9_5 = 5, OUTPUT_15_10 = 6,
       PVD_IRQ = 7, RTC_ALARM_IRQ = 8, USB_WAKEUP_IRQ = 9, LINE11 = 10, LINE15 = 11 };

#endif
