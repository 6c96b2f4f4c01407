/* bluepill_sim/extension/source/registers/usb.h: RM0008 23.5; made from peripherals/usb.py. */
#ifndef BLUEPILL_REGISTERS_USB_H
#define BLUEPILL_REGISTERS_USB_H

/* Registers by offset / 4. */
enum { EP0R = 0, EP1R = 1, EP2R = 2, EP3R = 3, EP4R = 4, EP5R = 5, EP6R = 6, EP7R = 7, CNTR = 16, ISTR = 17, FNR = 18,
       DADDR = 19, BTABLE = 20, PMA_000 = 256 };

/* Of EP0R. */
enum { CTR_RX = 1 << 15, DTOG_RX = 1 << 14, STAT_RX = 0x3 << 12, STAT_RX_AT = 12, SETUP = 1 << 11, EP_TYPE = 0x3 << 9,
       EP_TYPE_AT = 9, EP_KIND = 1 << 8, CTR_TX = 1 << 7, DTOG_TX = 1 << 6, STAT_TX = 0x3 << 4, STAT_TX_AT = 4,
       EA = 0xf << 0, EA_AT = 0 };

/* Of CNTR. */
enum { CTRM = 1 << 15, PMAOVRM = 1 << 14, ERRM = 1 << 13, WKUPM = 1 << 12, SUSPM = 1 << 11, RESETM = 1 << 10,
       SOFM = 1 << 9, ESOFM = 1 << 8, RESUME = 1 << 4, FSUSP = 1 << 3, LP_MODE = 1 << 2, PDWN = 1 << 1,
       FRES = 1 << 0 };

/* Of ISTR. */
enum { CTR = 1 << 15, PMAOVR = 1 << 14, ERR = 1 << 13, WKUP = 1 << 12, SUSP = 1 << 11, ISTR_RESET = 1 << 10,
       SOF = 1 << 9, ESOF = 1 << 8, DIR = 1 << 4, EP_ID = 0xf << 0, EP_ID_AT = 0 };

/* Of FNR. */
enum { RXDP = 1 << 15, RXDM = 1 << 14, LCK = 1 << 13, LSOF = 0x3 << 11, LSOF_AT = 11, FN = 0x7ff << 0, FN_AT = 0 };

/* Of DADDR. */
enum { EF = 1 << 7, ADD = 0x7f << 0, ADD_AT = 0 };

/* Of BTABLE. */
enum { BTABLE_BTABLE = 0x1fff << 3, BTABLE_BTABLE_AT = 3 };

/* Of PMA_000. */
enum { DATA = 0xffff << 0, DATA_AT = 0 };

/* Its outputs. */
enum { HP_IRQ = 0, LP_IRQ = 1, WAKEUP = 2 };

/* What Python is told beside what a listener hears. */
enum { WRITTEN = 2 };

#endif
