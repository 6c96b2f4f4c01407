/* The sequences of micro-operations that one piece of code runs: the most common of those that were counted over the
 * programs of tools/bench and the example programs; each costs some 100 bytes of code. */
#ifndef BLUEPILL_SEQUENCES_H
#define BLUEPILL_SEQUENCES_H

#if defined(INTERPRETER_PORTABLE) /* a switch gains little by them, and takes a compiler long */
#define PAIRS(X)
#define TRIPLES(X)
#define BRANCHING_PAIRS(X)
#define BRANCHING_TRIPLES(X)
#else
#define PAIRS(X)                                                                                                        \
    X(ADD_I, CMP_I_BY_N) X(ADD_I, CMP_R_BY_N) X(ADD_I, LDR_LITERAL) X(ADD_I, MOV_R) X(ADD_I, MOV_R_BY_M)                \
    X(ADD_IS, STR_I) X(ADD_IS_BY_N, LDR_LITERAL) X(ADD_IS_BY_N, STR_I) X(ADD_IS_BY_N, UXTB_BY_M)                        \
    X(ADD_I_BY_N, SUB_IS_BY_N) X(ADD_R_BY_M, CMP_I) X(ADD_R_BY_N, STR_I) X(ALIGN_SP, LDM) X(AND_I_BY_N, CMP_I_BY_N)     \
    X(AND_R, EOR_LSR_BY_N) X(AND_R, SUB_R) X(AND_R_BY_N, EOR_LSR_BY_N) X(CMP_R, STRB_I) X(EOR_LSR, EOR_LSR)             \
    X(EOR_LSR, SUB_R) X(EOR_LSR_BY_N, SBFX_BY_N) X(EOR_LSR_BY_N, SUB_R) X(EOR_R, SBFX_BY_N)                             \
    X(EOR_R_BY_N, ADD_R_BY_M) X(LDRB_I, ADD_I) X(LDRB_I, MOV_R) X(LDR_I, ADD_I) X(LDR_I, ADD_IS)                        \
    X(LDR_I, ADD_IS_BY_N) X(LDR_I, ADD_I_BY_N) X(LDR_I, ADD_R_BY_M) X(LDR_I, AND_I_BY_N) X(LDR_I, CMP_I_BY_N)           \
    X(LDR_I, CMP_R_BY_M) X(LDR_I, EOR_R_BY_N) X(LDR_I, LDR_I_BY_N) X(LDR_I, LDR_LITERAL) X(LDR_I, LSL_IS_BY_M)          \
    X(LDR_I, SUB_IS_BY_N) X(LDR_I, TST_I) X(LDR_I_BY_N, ADD_IS_BY_N) X(LDR_I_BY_N, AND_I_BY_N) X(LDR_I_BY_N, LDR_I)     \
    X(LDR_I_BY_N, LDR_I_BY_N) X(LDR_I_BY_N, LDR_LITERAL) X(LDR_I_BY_N, SET_C) X(LDR_I_BY_N, STR_I)                      \
    X(LDR_I_BY_N, TST_I_BY_N) X(LDR_LITERAL, ADD_R_BY_N) X(LDR_LITERAL, CMP_R_BY_M) X(LDR_LITERAL, LDR_I_BY_N)          \
    X(LDR_LITERAL, LDR_LITERAL) X(LDR_LITERAL, MOV_I) X(LDR_LITERAL, MOV_IS) X(LDR_LITERAL, STR_I_BY_N)                 \
    X(LSL_IS_BY_M, LDR_I) X(LSR_I, LSR_I) X(MLA, SUB_IS) X(MOV_I, LDR_LITERAL) X(MOV_I, STR_I) X(MOV_IS, STR_I)         \
    X(MOV_IS, SUB_R) X(MOV_R, ALIGN_SP) X(MOV_R, MOV_R) X(MOV_R_BY_M, ALIGN_SP) X(SBFX, SUB_R)                          \
    X(SBFX_BY_N, AND_R_BY_N) X(SET_C, TST_I) X(STM, ADD_I) X(STRB_I, ADD_I) X(STRB_I, STRB_I) X(STR_I, ADD_I)           \
    X(STR_I, LDR_I) X(STR_I, LDR_LITERAL) X(STR_I, STR_I) X(STR_I_BY_N, LDR_LITERAL) X(STR_I_BY_N, MOV_R)               \
    X(SUB_IS, EOR_LSR) X(SUB_IS, STR_I) X(SUB_IS_BY_N, LSL_IS_BY_M) X(SUB_IS_BY_N, STR_I) X(SUB_R, AND_R)               \
    X(SUB_R, SBFX) X(SUB_R, STR_I) X(UMULL, LSR_I)
#define TRIPLES(X)                                                                                                      \
    X(AND_R, EOR_LSR_BY_N, EOR_LSR) X(AND_R, EOR_LSR_BY_N, SUB_R) X(AND_R_BY_N, EOR_LSR_BY_N, SBFX_BY_N)                \
    X(EOR_LSL_BY_N, SBFX, SUB_R) X(EOR_LSL_BY_N, SUB_R, SBFX) X(EOR_LSR, EOR_R_BY_M, CMP_R)                             \
    X(EOR_LSR_BY_N, EOR_LSR, SUB_R) X(EOR_LSR_BY_N, SBFX_BY_N, AND_R_BY_N) X(EOR_R, SBFX_BY_N, AND_R_BY_N)              \
    X(EOR_R_BY_M, CMP_R, STRB_I) X(LDR_I, ADD_IS, STR_I) X(LDR_I, ADD_IS_BY_N, STR_I)                                   \
    X(LDR_I_BY_N, ADD_IS_BY_N, STR_I) X(LDR_LITERAL, LDR_I_BY_N, ADD_IS_BY_N) X(MLA, SUB_IS, EOR_LSR)                   \
    X(SBFX, SUB_R, AND_R) X(SBFX_BY_N, AND_R_BY_N, EOR_LSR_BY_N) X(STR_I, LDR_I, ADD_IS)                                \
    X(STR_I, LDR_I, ADD_IS_BY_N) X(STR_I, STR_I, LDR_I) X(STR_I, STR_I, STR_I) X(SUB_IS, STR_I, ADD_I)                  \
    X(SUB_R, AND_R, EOR_LSR_BY_N) X(SUB_R, EOR_LSL_BY_N, SBFX) X(SUB_R, SBFX, SUB_R)                                    \
    X(SUB_R_BY_N, EOR_LSL_BY_N, SUB_R)

/* Those that a conditional branch ends. */
#define BRANCHING_PAIRS(X)                                                                                              \
    X(ADD_I, B_EQ) X(ADD_I, B_NE) X(ADD_R, B_NE) X(CMP_I, B_EQ) X(CMP_I, B_LS) X(CMP_I, B_NE) X(CMP_I_BY_N, B_EQ)       \
    X(CMP_I_BY_N, B_GT) X(CMP_I_BY_N, B_HI) X(CMP_I_BY_N, B_LE) X(CMP_I_BY_N, B_LS) X(CMP_I_BY_N, B_NE)                 \
    X(CMP_R_BY_M, B_CC) X(CMP_R_BY_M, B_EQ) X(CMP_R_BY_M, B_LT) X(CMP_R_BY_N, B_CC) X(CMP_R_BY_N, B_EQ)                 \
    X(CMP_R_BY_N, B_LT) X(CMP_R_BY_N, B_NE) X(EOR_LSR, B_NE) X(LDR_I, CBZ) X(LSL_IS_BY_M, B_MI) X(LSL_IS_BY_M, B_PL)    \
    X(LSR_I, B_NE) X(MOV_R, B_GT) X(MOV_R, B_HI) X(MOV_R, B_NE) X(TST_I, B_EQ) X(TST_I_BY_N, B_EQ)                      \
    X(TST_R_BY_M, B_EQ)
#define BRANCHING_TRIPLES(X)                                                                                            \
    X(ADD_I, CMP_I_BY_N, B_LS) X(ADD_I, CMP_R_BY_N, B_NE) X(ADD_I, MOV_R, B_HI) X(AND_I_BY_N, CMP_I_BY_N, B_HI)         \
    X(CMP_I_BY_N, MOV_R, B_NE) X(CMP_R_BY_N, ADD_R, B_NE) X(LDR_I, CMP_R_BY_M, B_LT) X(LDR_I, LSL_IS_BY_M, B_PL)        \
    X(LDR_I_BY_N, LSL_IS_BY_M, B_PL) X(LDR_LITERAL, CMP_R_BY_M, B_CC) X(SET_C, TST_I, B_EQ) X(STRB_I, ADD_I, B_NE)      \
    X(STRB_I, LSR_I, B_NE) X(STR_I, ADD_I, B_EQ) X(STR_I, ADD_I, B_NE) X(SUB_IS, EOR_LSR, B_NE)

#endif

#endif
