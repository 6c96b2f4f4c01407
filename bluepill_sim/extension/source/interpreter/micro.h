/* The micro-operations by their numbers: those that go on, those that may end at a fault, and those that end a block. */
#ifndef BLUEPILL_MICRO_H
#define BLUEPILL_MICRO_H

#include "sequences.h"

/* Four ways each, in this order: of a constant, of a register, and both with flags. */
#define FOUR_WAYS(X, name) X(name##_I) X(name##_R) X(name##_IS) X(name##_RS)
/* And three of a shifted register behind them. */
#define SEVEN_WAYS(X, name) FOUR_WAYS(X, name) X(name##_LSL) X(name##_LSR) X(name##_ASR)

#define STRAIGHT(X)                                                                                                     \
    X(NOP) X(MOV_I) X(MOV_R) X(MOV_IS) X(MOV_RS) X(MVN_R) X(MVN_RS) X(MOVT) X(SET_C) X(ALIGN_SP)                        \
    SEVEN_WAYS(X, AND) SEVEN_WAYS(X, BIC) SEVEN_WAYS(X, ORR) FOUR_WAYS(X, ORN) SEVEN_WAYS(X, EOR)                       \
    SEVEN_WAYS(X, ADD) SEVEN_WAYS(X, SUB) SEVEN_WAYS(X, RSB) FOUR_WAYS(X, ADC) FOUR_WAYS(X, SBC)                        \
    X(TST_I) X(TST_R) X(TEQ_I) X(TEQ_R) X(CMP_I) X(CMP_R) X(CMN_I) X(CMN_R)                                             \
    X(LSL_I) X(LSR_I) X(ASR_I) X(ROR_I) X(RRX_I) X(LSL_IC) X(LSR_IC) X(ASR_IC) X(ROR_IC) X(RRX_IC)                      \
    X(LSL_IS) X(LSR_IS) X(ASR_IS) X(LSL_R) X(LSR_R) X(ASR_R) X(ROR_R) X(LSL_RS) X(LSR_RS) X(ASR_RS) X(ROR_RS)           \
    X(MUL) X(MUL_S) X(MLA) X(MLS) X(SMULL) X(UMULL) X(SMLAL) X(UMLAL)                                                   \
    X(SXTB) X(SXTH) X(UXTB) X(UXTH) X(REV) X(REV16) X(REVSH) X(CLZ) X(RBIT) X(UBFX) X(SBFX) X(BFI) X(SSAT) X(USAT)      \
    X(MRS) X(MSR) X(CPS) X(CLREX)

#define ACCESSING(X)                                                                                                    \
    X(LDR_I) X(LDR_R) X(LDRH_I) X(LDRH_R) X(LDRB_I) X(LDRB_R) X(LDRSH_I) X(LDRSH_R) X(LDRSB_I) X(LDRSB_R)               \
    X(STR_I) X(STR_R) X(STRH_I) X(STRH_R) X(STRB_I) X(STRB_R) X(LDR_LITERAL) X(LDRD) X(STRD) X(LDM) X(STM)              \
    X(LDREX) X(STREX) X(TABLE) X(UDIV) X(SDIV)

/* The fourteen conditions, by their numbers. */
#define CONDITIONS(X, name)                                                                                             \
    X(name##_EQ) X(name##_NE) X(name##_CS) X(name##_CC) X(name##_MI) X(name##_PL) X(name##_VS) X(name##_VC)             \
    X(name##_HI) X(name##_LS) X(name##_GE) X(name##_LT) X(name##_GT) X(name##_LE)

/* SKIP: over `imm` micro-operations where its condition does not hold. HOOK: calls the hooks of its instruction.
 * STRAIGHT_ON ends a block that no branch ends; JUMP goes to R(d), BX does so with its lowest bit as T, BLX with a link;
 * TABLE_JUMP goes R(d) halfwords on; LEAVE goes to `imm`, inside the block. ABORT, SVC and so on end the run. */
#define ENDING(X)                                                                                                       \
    CONDITIONS(X, SKIP) CONDITIONS(X, B) X(HOOK) X(STRAIGHT_ON) X(B) X(CBZ) X(CBNZ) X(JUMP) X(BX) X(BLX) X(TABLE_JUMP)  \
    X(LEAVE) X(SVC) X(BKPT) X(UDF) X(NO_COPROCESSOR) X(WAIT) X(HINT)

/* Those that have a second and a third code, where R(n), or R(m), is what was put into a register just before: from there
 * it need not be read again, which is what long chains of arithmetic wait for. */
#define CHAINED_BY_N(X)                                                                                                 \
    X(AND_I) X(AND_R) X(AND_IS) X(BIC_I) X(ORR_I) X(ORR_R) X(EOR_I) X(EOR_R) X(ADD_I) X(ADD_R) X(ADD_IS) X(ADD_RS)      \
    X(SUB_I) X(SUB_R) X(SUB_IS) X(SUB_RS) X(RSB_I) X(EOR_LSL) X(EOR_LSR) X(ORR_LSL) X(ADD_LSL) X(ADD_LSR) X(SUB_LSL)    \
    X(AND_LSR) X(CMP_I) X(CMP_R) X(TST_I) X(UBFX) X(SBFX) X(MUL) X(LSL_R) X(LDR_I) X(LDRB_I) X(LDRH_I) X(STR_I) X(STRB_I)
#define CHAINED_BY_M(X)                                                                                                 \
    X(AND_R) X(ORR_R) X(EOR_R) X(ADD_R) X(SUB_R) X(ADD_RS) X(SUB_RS) X(RSB_R) X(MOV_R) X(MOV_RS) X(LSL_I) X(LSR_I)      \
    X(ASR_I) X(LSL_IS) X(LSR_IS) X(UXTB) X(UXTH) X(SXTB) X(SXTH) X(CMP_R) X(TST_R) X(LDR_R) X(LDRB_R) X(EOR_LSL)        \
    X(EOR_LSR) X(ORR_LSL) X(ADD_LSL) X(SUB_LSL) X(MUL)

#define NUMBER(name) OP_##name,
#define BY_N_NUMBER(name) OP_##name##_BY_N,
#define BY_M_NUMBER(name) OP_##name##_BY_M,
#define PAIR(first, second) OP_##first##__##second
#define PAIR_NUMBER(first, second) PAIR(first, second),
#define TRIPLE(first, second, third) OP_##first##__##second##__##third
#define TRIPLE_NUMBER(first, second, third) TRIPLE(first, second, third),
/* Chained ones, pairs and triples are numbers of code alone: a micro-operation has its own number. */
enum micro {
    STRAIGHT(NUMBER) ACCESSING(NUMBER) ENDING(NUMBER) MICRO_COUNT,
    LAST_MICRO = MICRO_COUNT - 1,
    CHAINED_BY_N(BY_N_NUMBER) CHAINED_BY_M(BY_M_NUMBER)
    PAIRS(PAIR_NUMBER) BRANCHING_PAIRS(PAIR_NUMBER) TRIPLES(TRIPLE_NUMBER) BRANCHING_TRIPLES(TRIPLE_NUMBER) CODE_COUNT
};

#endif
