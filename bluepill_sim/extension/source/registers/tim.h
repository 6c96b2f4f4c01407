/* bluepill_sim/extension/source/registers/tim.h: RM0008 14.4, RM0008 15.4; made from peripherals/tim.py. */
#ifndef BLUEPILL_REGISTERS_TIM_H
#define BLUEPILL_REGISTERS_TIM_H

/* Registers by offset / 4. */
enum { CR1 = 0, CR2 = 1, SMCR = 2, DIER = 3, SR = 4, EGR = 5, CCMR1 = 6, CCMR2 = 7, CCER = 8, CNT = 9, PSC = 10,
       ARR = 11, RCR = 12, CCR1 = 13, CCR2 = 14, CCR3 = 15, CCR4 = 16, BDTR = 17, DCR = 18, DMAR = 19 };

/* Of CR1. */
enum { CKD = 0x3 << 8, CKD_AT = 8, ARPE = 1 << 7, CMS = 0x3 << 5, CMS_AT = 5, DIR = 1 << 4, OPM = 1 << 3,
       URS = 1 << 2, UDIS = 1 << 1, CEN = 1 << 0 };

/* Of CR2. */
enum { OIS4 = 1 << 14, OIS3N = 1 << 13, OIS3 = 1 << 12, OIS2N = 1 << 11, OIS2 = 1 << 10, OIS1N = 1 << 9,
       OIS1 = 1 << 8, TI1S = 1 << 7, MMS = 0x7 << 4, MMS_AT = 4, CCDS = 1 << 3, CCUS = 1 << 2, CCPC = 1 << 0 };

/* Of SMCR. */
enum { ETP = 1 << 15, ECE = 1 << 14, ETPS = 0x3 << 12, ETPS_AT = 12, ETF = 0xf << 8, ETF_AT = 8, MSM = 1 << 7,
       TS = 0x7 << 4, TS_AT = 4, SMS = 0x7 << 0, SMS_AT = 0 };

/* Of DIER. */
enum { TDE = 1 << 14, COMDE = 1 << 13, CC4DE = 1 << 12, CC3DE = 1 << 11, CC2DE = 1 << 10, CC1DE = 1 << 9,
       UDE = 1 << 8, BIE = 1 << 7, TIE = 1 << 6, COMIE = 1 << 5, CC4IE = 1 << 4, CC3IE = 1 << 3, CC2IE = 1 << 2,
       CC1IE = 1 << 1, UIE = 1 << 0 };

/* Of SR. */
enum { CC4OF = 1 << 12, CC3OF = 1 << 11, CC2OF = 1 << 10, CC1OF = 1 << 9, BIF = 1 << 7, TIF = 1 << 6, COMIF = 1 << 5,
       CC4IF = 1 << 4, CC3IF = 1 << 3, CC2IF = 1 << 2, CC1IF = 1 << 1, UIF = 1 << 0 };

/* Of EGR. */
enum { BG = 1 << 7, TG = 1 << 6, COMG = 1 << 5, CC4G = 1 << 4, CC3G = 1 << 3, CC2G = 1 << 2, CC1G = 1 << 1,
       UG = 1 << 0 };

/* Of CCMR1. */
enum { OC2CE = 1 << 15, OC2M = 0x7 << 12, OC2M_AT = 12, OC2PE = 1 << 11, OC2FE = 1 << 10, CC2S = 0x3 << 8,
       CC2S_AT = 8, OC1CE = 1 << 7, OC1M = 0x7 << 4, OC1M_AT = 4, OC1PE = 1 << 3, OC1FE = 1 << 2, CC1S = 0x3 << 0,
       CC1S_AT = 0 };

/* Of CCMR2. */
enum { OC4CE = 1 << 15, OC4M = 0x7 << 12, OC4M_AT = 12, OC4PE = 1 << 11, OC4FE = 1 << 10, CC4S = 0x3 << 8,
       CC4S_AT = 8, OC3CE = 1 << 7, OC3M = 0x7 << 4, OC3M_AT = 4, OC3PE = 1 << 3, OC3FE = 1 << 2, CC3S = 0x3 << 0,
       CC3S_AT = 0 };

/* Of CCER. */
enum { CC4P = 1 << 13, CC4E = 1 << 12, CC3NP = 1 << 11, CC3NE = 1 << 10, CC3P = 1 << 9, CC3E = 1 << 8, CC2NP = 1 << 7,
       CC2NE = 1 << 6, CC2P = 1 << 5, CC2E = 1 << 4, CC1NP = 1 << 3, CC1NE = 1 << 2, CC1P = 1 << 1, CC1E = 1 << 0 };

/* Of CNT. */
enum { CNT_CNT = 0xffff << 0, CNT_CNT_AT = 0 };

/* Of PSC. */
enum { PSC_PSC = 0xffff << 0, PSC_PSC_AT = 0 };

/* Of ARR. */
enum { ARR_ARR = 0xffff << 0, ARR_ARR_AT = 0 };

/* Of RCR. */
enum { REP = 0xff << 0, REP_AT = 0 };

/* Of CCR1. */
enum { CCR1_CCR1 = 0xffff << 0, CCR1_CCR1_AT = 0 };

/* Of CCR2. */
enum { CCR2_CCR2 = 0xffff << 0, CCR2_CCR2_AT = 0 };

/* Of CCR3. */
enum { CCR3_CCR3 = 0xffff << 0, CCR3_CCR3_AT = 0 };

/* Of CCR4. */
enum { CCR4_CCR4 = 0xffff << 0, CCR4_CCR4_AT = 0 };

/* Of BDTR. */
enum { MOE = 1 << 15, AOE = 1 << 14, BKP = 1 << 13, BKE = 1 << 12, OSSR = 1 << 11, OSSI = 1 << 10, LOCK = 0x3 << 8,
       LOCK_AT = 8, DTG = 0xff << 0, DTG_AT = 0 };

/* Of DCR. */
enum { DBL = 0x1f << 8, DBL_AT = 8, DBA = 0x1f << 0, DBA_AT = 0 };

/* Of DMAR. */
enum { DMAB = 0xffff << 0, DMAB_AT = 0 };

/* Its outputs. */
enum { TRGO = 0, CC1 = 1, CC2 = 2, CC3 = 3, CC4 = 4, UP_DMA = 5, CC1_DMA = 6, CC2_DMA = 7, CC3_DMA = 8, CC4_DMA = 9,
       COM_DMA = 10, TRIG_DMA = 11, BRK_IRQ = 12, IRQ = 12, UP_IRQ = 13, TRG_COM_IRQ = 14, CC_IRQ = 15 };

/* A command of its own. */
enum { MOVE = 16, RESUME = 17, INTRODUCE = 18 };

#endif
