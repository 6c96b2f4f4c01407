/* The system control space: what its registers do, for both cores. */
#ifndef BLUEPILL_SYSTEM_H
#define BLUEPILL_SYSTEM_H

#include <stdbool.h>
#include <stdint.h>

#include "../fabric/layout.h"

/* What an access to it was, and what is left to whoever made it. */
enum system_answer {
    SYSTEM_KNOWN = 1,    /* there is such a register */
    SYSTEM_WRITTEN = 2,  /* and it takes writes */
    SYSTEM_TICKED = 4,   /* SysTick has come to 0 before, and makes its exception pending */
    SYSTEM_RESET = 8,    /* SYSRESETREQ */
    SYSTEM_DEBUGGER = 16, /* bits of a debugger's */
    SYSTEM_TRAPS = 32,   /* CCR: what traps may be another */
    SYSTEM_STIMULUS = 64, /* a word for the trace */
    SYSTEM_LOOK_OUT = 128 /* what comparators look out for may be another */
};

#pragma GCC visibility push(hidden)
/* Registers whose value moves, or whose read does something: an access needs its exact time. */
bool system_needs_time(uint32_t address);
/* exceptions.c */
unsigned first_pending(const struct shared *s);
#pragma GCC visibility pop

/* systick.c, scs.c: for Python as well. */
/* What is not 0 before the first reset, of both cores. */
void system_init(struct shared *s);
/* After a power cut: what belongs to the debugger, too. */
void system_power_up(struct shared *s);
/* After a reset; DEMCR, DBGMCU, DWT, FPB, ITM and TPIU belong to the debugger and stay. */
void system_reset(struct shared *s);
bool systick_advance(struct shared *s, uint64_t now);
uint32_t systick_read(struct shared *s, uint32_t word, uint64_t now);
void systick_write(struct shared *s, uint32_t word, uint32_t value, uint64_t now);
bool system_has(uint32_t address);
uint32_t system_read(struct shared *s, uint32_t address, uint64_t now, uint32_t *word);
uint32_t system_write(struct shared *s, uint32_t address, uint32_t value, uint32_t mask, uint64_t now);

#endif
