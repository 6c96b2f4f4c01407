/* The pairs of micro-operations that one piece of code runs: the most common of those that were counted over the programs
 * of tools/bench and the example programs; each costs some 100 bytes of code. */
#ifndef BLUEPILL_PAIRS_H
#define BLUEPILL_PAIRS_H

#define PAIRS(X)                                                                                                        \
    X(ADD_I, ADD_I) X(ADD_I, CMP_I) X(ADD_I, CMP_R) X(ADD_I, EOR_R) X(ADD_I, LDR_LITERAL) X(ADD_I, MOV_R)               \
    X(ADD_I, SUB_IS) X(ADD_IS, LDM) X(ADD_IS, LDR_LITERAL) X(ADD_IS, STRD) X(ADD_IS, STR_I) X(ADD_IS, UXTB)             \
    X(ADD_R, ADD_IS) X(ADD_R, CMP_I) X(ADD_R, CMP_R) X(ADD_R, LDR_I) X(ADD_R, LSL_I) X(ADD_R, LSR_I) X(ADD_R, STR_I)    \
    X(ADD_R, SUB_R) X(ALIGN_SP, LDM) X(AND_I, CMP_I) X(AND_I, LDR_R) X(AND_I, LSL_I) X(AND_R, LSR_I) X(AND_R, SUB_R)    \
    X(CMP_I, MOV_R) X(CMP_I, STRB_I) X(CMP_R, STRB_I) X(CMP_R, STR_I) X(EOR_R, ADD_R) X(EOR_R, CMP_R)                   \
    X(EOR_R, EOR_R) X(EOR_R, LDR_I) X(EOR_R, LSL_I) X(EOR_R, LSR_I) X(EOR_R, SBFX) X(EOR_R, SUB_R) X(EOR_RS, STR_I)     \
    X(LDM, STM) X(LDRB_I, ADD_I) X(LDRB_I, AND_I) X(LDRB_I, CMP_I) X(LDRB_I, LDR_LITERAL) X(LDRB_I, MOV_R)              \
    X(LDR_I, ADD_I) X(LDR_I, ADD_IS) X(LDR_I, ADD_R) X(LDR_I, AND_I) X(LDR_I, CMP_I) X(LDR_I, CMP_R) X(LDR_I, EOR_R)    \
    X(LDR_I, EOR_RS) X(LDR_I, LDR_I) X(LDR_I, LDR_LITERAL) X(LDR_I, LSL_IS) X(LDR_I, LSR_IS) X(LDR_I, MOV_I)            \
    X(LDR_I, ORR_I) X(LDR_I, SET_C) X(LDR_I, STM) X(LDR_I, STR_I) X(LDR_I, SUB_IS) X(LDR_I, SUB_R) X(LDR_I, TST_I)      \
    X(LDR_I, UXTB) X(LDR_LITERAL, ADD_R) X(LDR_LITERAL, CMP_R) X(LDR_LITERAL, LDR_I) X(LDR_LITERAL, LDR_LITERAL)        \
    X(LDR_LITERAL, LDR_R) X(LDR_LITERAL, MOV_I) X(LDR_LITERAL, MOV_IS) X(LDR_LITERAL, MUL) X(LDR_LITERAL, STR_I)        \
    X(LDR_LITERAL, UMULL) X(LDR_R, MOV_I) X(LSL_I, ADD_R) X(LSL_I, EOR_R) X(LSL_I, ORR_R) X(LSL_I, SUB_R)               \
    X(LSL_IS, LDR_I) X(LSR_I, CMP_I) X(LSR_I, EOR_R) X(LSR_I, LSR_I) X(LSR_I, MLS) X(LSR_I, MOV_I) X(LSR_I, MOV_R)      \
    X(LSR_IS, LDR_I) X(MLA, SUB_IS) X(MLA, UBFX) X(MLS, ADD_IS) X(MOV_I, LDR_LITERAL) X(MOV_I, LSL_R)                   \
    X(MOV_I, MOV_I) X(MOV_I, MUL) X(MOV_I, STR_I) X(MOV_I, TABLE) X(MOV_I, TST_R) X(MOV_IS, STR_I) X(MOV_IS, SUB_R)     \
    X(MOV_R, ALIGN_SP) X(MOV_R, AND_I) X(MOV_R, LSL_I) X(MOV_R, LSR_I) X(MOV_R, MOV_I) X(MOV_R, MOV_R)                  \
    X(MOV_R, STRB_I) X(MOV_R, UMULL) X(MUL, LDR_LITERAL) X(MUL, SUB_R) X(ORR_I, STR_I) X(ORR_RS, STR_I)                 \
    X(SBFX, AND_R) X(SBFX, SUB_R) X(SET_C, TST_I) X(STM, ADD_I) X(STM, LDRB_I) X(STM, UMULL) X(STRB_I, ADD_I)           \
    X(STRB_I, LSR_I) X(STRB_I, STRB_I) X(STRB_I, STRH_I) X(STRD, STR_I) X(STRH_I, STRH_I) X(STRH_I, STR_I)              \
    X(STR_I, ADD_I) X(STR_I, LDR_I) X(STR_I, LDR_LITERAL) X(STR_I, LSR_I) X(STR_I, MOV_IS) X(STR_I, MOV_R)              \
    X(STR_I, STR_I) X(SUB_IS, LSL_IS) X(SUB_IS, LSR_I) X(SUB_IS, STR_I) X(SUB_R, ADD_I) X(SUB_R, AND_R)                 \
    X(SUB_R, CMP_I) X(SUB_R, EOR_R) X(SUB_R, LSL_I) X(SUB_R, LSR_I) X(SUB_R, SBFX) X(SUB_R, STR_I) X(SUB_R, SUB_R)      \
    X(SUB_RS, LDR_I) X(UBFX, STR_I) X(UMULL, LSR_I) X(UXTB, LDR_LITERAL) X(UXTB, STR_I)

/* Those that a conditional branch ends. */
#define BRANCHING_PAIRS(X)                                                                                              \
    X(ADD_I, B_EQ) X(ADD_I, B_NE) X(ADD_R, B_NE) X(CMN_I, B_LT) X(CMP_I, B_EQ) X(CMP_I, B_GE) X(CMP_I, B_GT)            \
    X(CMP_I, B_HI) X(CMP_I, B_LE) X(CMP_I, B_LS) X(CMP_I, B_NE) X(CMP_R, B_CC) X(CMP_R, B_CS) X(CMP_R, B_EQ)            \
    X(CMP_R, B_LS) X(CMP_R, B_LT) X(CMP_R, B_NE) X(EOR_R, B_NE) X(LDR_I, CBZ) X(LSL_IS, B_MI) X(LSL_IS, B_PL)           \
    X(MOV_R, B_GT) X(MOV_R, B_HI) X(MOV_R, B_NE) X(MOV_R, CBNZ) X(STRH_I, CBZ) X(STR_I, B_CS) X(STR_I, B_EQ)            \
    X(TST_I, B_EQ) X(TST_I, B_NE) X(TST_R, B_EQ)

#endif
