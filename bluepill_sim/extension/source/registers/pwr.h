/* bluepill_sim/extension/source/registers/pwr.h: RM0008 5.4; made from peripherals/pwr.py. */
#ifndef BLUEPILL_REGISTERS_PWR_H
#define BLUEPILL_REGISTERS_PWR_H

/* Registers by offset / 4. */
enum { CR = 0, CSR = 1 };

/* Of CR. */
enum { DBP = 1 << 8, PLS = 0x7 << 5, PLS_AT = 5, PVDE = 1 << 4, CSBF = 1 << 3, CWUF = 1 << 2, PDDS = 1 << 1,
       LPDS = 1 << 0 };

/* Of CSR. */
enum { EWUP = 1 << 8, PVDO = 1 << 2, SBF = 1 << 1, WUF = 1 << 0 };

/* Its outputs. */
enum { PVD = 0 };

/* What Python is notified of beside what a listener hears. */
enum { BACKUP = 2, SUPPLY = 3, WAKE_PIN = 4 };

#endif
