/* bluepill_sim/extension/source/registers/dma.h: RM0008 13.4; made from peripherals/dma.py. */
#ifndef BLUEPILL_REGISTERS_DMA_H
#define BLUEPILL_REGISTERS_DMA_H

/* Registers by offset / 4. */
enum { ISR = 0, IFCR = 1, CCR1 = 2, CNDTR1 = 3, CPAR1 = 4, CMAR1 = 5, CCR2 = 7, CNDTR2 = 8, CPAR2 = 9, CMAR2 = 10,
       CCR3 = 12, CNDTR3 = 13, CPAR3 = 14, CMAR3 = 15, CCR4 = 17, CNDTR4 = 18, CPAR4 = 19, CMAR4 = 20, CCR5 = 22,
       CNDTR5 = 23, CPAR5 = 24, CMAR5 = 25, CCR6 = 27, CNDTR6 = 28, CPAR6 = 29, CMAR6 = 30, CCR7 = 32, CNDTR7 = 33,
       CPAR7 = 34, CMAR7 = 35 };

/* Of ISR. */
enum { TEIF7 = 1 << 27, HTIF7 = 1 << 26, TCIF7 = 1 << 25, GIF7 = 1 << 24, TEIF6 = 1 << 23, HTIF6 = 1 << 22,
       TCIF6 = 1 << 21, GIF6 = 1 << 20, TEIF5 = 1 << 19, HTIF5 = 1 << 18, TCIF5 = 1 << 17, GIF5 = 1 << 16,
       TEIF4 = 1 << 15, HTIF4 = 1 << 14, TCIF4 = 1 << 13, GIF4 = 1 << 12, TEIF3 = 1 << 11, HTIF3 = 1 << 10,
       TCIF3 = 1 << 9, GIF3 = 1 << 8, TEIF2 = 1 << 7, HTIF2 = 1 << 6, TCIF2 = 1 << 5, GIF2 = 1 << 4, TEIF1 = 1 << 3,
       HTIF1 = 1 << 2, TCIF1 = 1 << 1, GIF1 = 1 << 0 };

/* Of IFCR. */
enum { CTEIF7 = 1 << 27, CHTIF7 = 1 << 26, CTCIF7 = 1 << 25, CGIF7 = 1 << 24, CTEIF6 = 1 << 23, CHTIF6 = 1 << 22,
       CTCIF6 = 1 << 21, CGIF6 = 1 << 20, CTEIF5 = 1 << 19, CHTIF5 = 1 << 18, CTCIF5 = 1 << 17, CGIF5 = 1 << 16,
       CTEIF4 = 1 << 15, CHTIF4 = 1 << 14, CTCIF4 = 1 << 13, CGIF4 = 1 << 12, CTEIF3 = 1 << 11, CHTIF3 = 1 << 10,
       CTCIF3 = 1 << 9, CGIF3 = 1 << 8, CTEIF2 = 1 << 7, CHTIF2 = 1 << 6, CTCIF2 = 1 << 5, CGIF2 = 1 << 4,
       CTEIF1 = 1 << 3, CHTIF1 = 1 << 2, CTCIF1 = 1 << 1, CGIF1 = 1 << 0 };

/* Of CCR1. */
enum { MEM2MEM = 1 << 14, PL = 0x3 << 12, PL_AT = 12, MSIZE = 0x3 << 10, MSIZE_AT = 10, PSIZE = 0x3 << 8,
       PSIZE_AT = 8, MINC = 1 << 7, PINC = 1 << 6, CIRC = 1 << 5, DIR = 1 << 4, TEIE = 1 << 3, HTIE = 1 << 2,
       TCIE = 1 << 1, EN = 1 << 0 };

/* Of CNDTR1. */
enum { NDT = 0xffff << 0, NDT_AT = 0 };

/* Its outputs. */
enum { CH1_IRQ = 0, CH2_IRQ = 1, CH3_IRQ = 2, CH4_IRQ = 3, CH5_IRQ = 4, CH6_IRQ = 5, CH7_IRQ = 6 };

/* What the device warns of, with the number of the channel from 0 on. */
enum { LOCKED = 0, FAILED = 1, CIRCLES = 2 };

#endif
