/* bluepill_sim/extension/source/interpreter/encodings.h: every encoding; made from extension/encodings.py. */
#ifndef BLUEPILL_ENCODINGS_H
#define BLUEPILL_ENCODINGS_H

#include <stdbool.h>
#include <stdint.h>

enum operation { UNDEFINED, MOVS_T2, LSL_T1, LSR_T1, ASR_T1, ADD_R3, SUB_R3, ADD_I3, SUB_I3, MOV_I8, CMP_I8, ADD_I8,
    SUB_I8, AND_T1, EOR_T1, LSL_RT1, LSR_RT1, ASR_RT1, ADC_T1, SBC_T1, ROR_RT1, TST_T1, RSB_T1, CMP_T1, CMN_T1,
    ORR_T1, MUL_T1, BIC_T1, MVN_T1, ADD_PC, ADD_T2, MOV_PC, MOV_T1, BX, BLX, LDR_LITERAL_T1, STR_RT1, STRH_RT1,
    STRB_RT1, LDRSB_RT1, LDR_RT1, LDRH_RT1, LDRB_RT1, LDRSH_RT1, STR_I5, LDR_I5, STRB_I5, LDRB_I5, STRH_I5, LDRH_I5,
    STR_SP, LDR_SP, ADR_T1, ADD_SP_T1, ADD_SP_T2, SUB_SP_T1, CBZ, CBNZ, SXTH_T1, SXTB_T1, UXTH_T1, UXTB_T1, PUSH, POP,
    CPS, REV, REV16, REVSH, BKPT, YIELD, WFE, WFI, SEV, NOP, IT, STM_T1, LDM_T1, UDF, SVC, B_T1, B_T2, STM_IA, LDM_IA,
    STM_DB, LDM_DB, STREX, LDREX, STREXB, STREXH, TBB, TBH, LDREXB, LDREXH, STRD_POST, LDRD_POST, STRD, LDRD, TST_I,
    TST_R, AND_I, AND_R, BIC_I, BIC_R, MOV_I, MOV_R, ORR_I, ORR_R, MVN_I, MVN_R, ORN_I, ORN_R, TEQ_I, TEQ_R, EOR_I,
    EOR_R, CMN_I, CMN_R, ADD_I, ADD_R, ADC_I, ADC_R, SBC_I, SBC_R, CMP_I, CMP_R, SUB_I, SUB_R, RSB_I, RSB_R, ADR_ADD,
    ADR_SUB, ADDW, SUBW, MOVW, MOVT, SSAT, USAT, SBFX, UBFX, BFC, BFI, MSR, CLREX, DSB, DMB, ISB, MRS, B_T3, B_T4, BL,
    STRB_I, STRBT, STRB_X, STRB_N, STRB_R, STRH_I, STRHT, STRH_X, STRH_N, STRH_R, STR_I, STRT, STR_X, STR_N, STR_R,
    LDRB_LITERAL, LDRB_I, LDRBT, LDRB_X, LDRB_N, LDRB_R, LDRH_LITERAL, LDRH_I, LDRHT, LDRH_X, LDRH_N, LDRH_R,
    LDR_LITERAL, LDR_I, LDRT, LDR_X, LDR_N, LDR_R, LDRSB_LITERAL, LDRSB_I, LDRSBT, LDRSB_X, LDRSB_N, LDRSB_R,
    LDRSH_LITERAL, LDRSH_I, LDRSHT, LDRSH_X, LDRSH_N, LDRSH_R, LSL, LSR, ASR, ROR, SXTH, UXTH, SXTB, UXTB, RBIT, CLZ,
    MUL, MLA, MLS, SMULL, SDIV, UMULL, UDIV, SMLAL, UMLAL, NO_COPROCESSOR };

/* Classes of instructions that cost alike: cycles, refill, and whether an exception may come in one. */
enum kind { KIND_PLAIN, KIND_MULTIPLY_ACCUMULATE, KIND_MULTIPLY_LONG, KIND_MULTIPLY_ACCUMULATE_LONG, KIND_DIVIDE,
    KIND_LOAD, KIND_LOAD_LITERAL, KIND_LOAD_PC, KIND_STORE, KIND_STORE_INDEXED, KIND_LOAD_MULTIPLE,
    KIND_STORE_MULTIPLE, KIND_LOAD_DUAL, KIND_STORE_DUAL, KIND_EXCLUSIVE, KIND_BRANCH, KIND_CALL,
    KIND_BRANCH_REGISTER, KIND_TABLE_BRANCH, KIND_MASK_CHANGE, KIND_READ_SPECIAL, KIND_BARRIER, KIND_SYNCHRONISE,
    KIND_SEND_EVENT, KIND_WAIT_EVENT, KIND_WAIT_INTERRUPT, KIND_YIELD, KIND_IF_THEN, KIND_SUPERVISOR_CALL,
    KIND_BREAKPOINT };
static const uint8_t kind_cycles[] = {1, 2, 4, 5, 7, 2, 2, 2, 1, 2, 1, 1, 1, 1, 2, 1, 1, 1, 1, 2, 1, 1, 4, 1, 1, 1, 1, 1, 1, 1};
static const uint8_t kind_refill[] = {0, 0, 0, 0, 0, 0, 0, 3, 0, 0, 3, 0, 0, 0, 0, 1, 1, 2, 3, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0};
static const bool kind_gives_up[] = {false, false, true, true, true, false, false, false, false, false, true, true,
    false, false, false, false, false, false, false, false, false, false, false, false, false, false, false, false,
    false, false};

/* Where an instruction has its fields, as the table of encodings draws it. */
enum form { FORM_mmmddd, FORM_iiiiimmmddd, FORM_mmmnnnddd, FORM_iiinnnddd, FORM_dddiiiiiiii, FORM_nnnddd,
    FORM_mmmm___, FORM_dmmmmddd, FORM_tttiiiiiiii, FORM_mmmnnnttt, FORM_iiiiinnnttt, FORM_iiiiiii, FORM_i_iiiiinnn,
    FORM_rrrrrrrrr, FORM_u__ii, FORM_iiiiiiii, FORM_NONE, FORM_nnnrrrrrrrr, FORM_cccciiiiiiii, FORM_iiiiiiiiiii,
    FORM_w_nnnnrrrrrrrrrrrrrrrr, FORM_nnnnttttddddiiiiiiii, FORM_nnnntttt____iiiiiiii, FORM_nnnntttt________dddd,
    FORM_nnnn____________mmmm, FORM_nnnntttt____________, FORM_u___nnnnttttaaaaiiiiiiii,
    FORM_u_w_nnnnttttaaaaiiiiiiii, FORM_i______nnnn_iii____iiiiiiii, FORM_nnnn_iii____iihhmmmm,
    FORM_i_____snnnn_iiiddddiiiiiiii, FORM_snnnn_iiiddddiihhmmmm, FORM_i_____s_____iiiddddiiiiiiii,
    FORM_s_____iiiddddiihhmmmm, FORM_i___________iiiddddiiiiiiii, FORM_i______nnnn_iiiddddiiiiiiii,
    FORM_i______jjjj_iiiddddiiiiiiii, FORM_h_nnnn_iiiddddii_bbbbb, FORM_nnnn_iiiddddii_bbbbb, FORM_iiiddddii_bbbbb,
    FORM_nnnn____bb__iiiiiiii, FORM_ddddiiiiiiii, FORM_scccciiiiii__j_jiiiiiiiiiii, FORM_siiiiiiiiii__j_jiiiiiiiiiii,
    FORM_nnnnttttiiiiiiiiiiii, FORM_nnnntttt_pu_iiiiiiii, FORM_nnnntttt______iimmmm, FORM_nnnn________________,
    FORM_u_______ttttiiiiiiiiiiii, FORM_snnnn____dddd____mmmm, FORM_dddd__iimmmm, FORM_dddd____mmmm,
    FORM_nnnn____dddd____mmmm, FORM_nnnnaaaadddd____mmmm, FORM_nnnnddddaaaa____mmmm };

struct encoding {
    uint32_t mask, value;
    uint8_t operation, form, kind;
};

/* Takes an instruction of a row apart into its fields; `to` is a pointer to a struct that has them. */
#define extract(row, word, to) \
    do { \
        switch ((enum form)(row)->form) { \
        case FORM_mmmddd: (to)->m = (word) >> 3 & 0x7; (to)->d = (word) & 0x7; break; \
        case FORM_iiiiimmmddd: (to)->i = (word) >> 6 & 0x1f; (to)->m = (word) >> 3 & 0x7; (to)->d = (word) & 0x7; break; \
        case FORM_mmmnnnddd: (to)->m = (word) >> 6 & 0x7; (to)->n = (word) >> 3 & 0x7; (to)->d = (word) & 0x7; break; \
        case FORM_iiinnnddd: (to)->i = (word) >> 6 & 0x7; (to)->n = (word) >> 3 & 0x7; (to)->d = (word) & 0x7; break; \
        case FORM_dddiiiiiiii: (to)->d = (word) >> 8 & 0x7; (to)->i = (word) & 0xff; break; \
        case FORM_nnnddd: (to)->n = (word) >> 3 & 0x7; (to)->d = (word) & 0x7; break; \
        case FORM_mmmm___: (to)->m = (word) >> 3 & 0xf; break; \
        case FORM_dmmmmddd: (to)->d = ((word) & 0x7) | ((word) >> 7 & 0x1) << 3; (to)->m = (word) >> 3 & 0xf; break; \
        case FORM_tttiiiiiiii: (to)->t = (word) >> 8 & 0x7; (to)->i = (word) & 0xff; break; \
        case FORM_mmmnnnttt: (to)->m = (word) >> 6 & 0x7; (to)->n = (word) >> 3 & 0x7; (to)->t = (word) & 0x7; break; \
        case FORM_iiiiinnnttt: (to)->i = (word) >> 6 & 0x1f; (to)->n = (word) >> 3 & 0x7; (to)->t = (word) & 0x7; break; \
        case FORM_iiiiiii: (to)->i = (word) & 0x7f; break; \
        case FORM_i_iiiiinnn: (to)->i = ((word) >> 3 & 0x1f) | ((word) >> 9 & 0x1) << 5; (to)->n = (word) & 0x7; break; \
        case FORM_rrrrrrrrr: (to)->r = (word) & 0x1ff; break; \
        case FORM_u__ii: (to)->u = (word) >> 4 & 0x1; (to)->i = (word) & 0x3; break; \
        case FORM_iiiiiiii: (to)->i = (word) & 0xff; break; \
        case FORM_NONE: break; \
        case FORM_nnnrrrrrrrr: (to)->n = (word) >> 8 & 0x7; (to)->r = (word) & 0xff; break; \
        case FORM_cccciiiiiiii: (to)->c = (word) >> 8 & 0xf; (to)->i = (word) & 0xff; break; \
        case FORM_iiiiiiiiiii: (to)->i = (word) & 0x7ff; break; \
        case FORM_w_nnnnrrrrrrrrrrrrrrrr: (to)->w = (word) >> 21 & 0x1; (to)->n = (word) >> 16 & 0xf; (to)->r = (word) & 0xffff; break; \
        case FORM_nnnnttttddddiiiiiiii: (to)->n = (word) >> 16 & 0xf; (to)->t = (word) >> 12 & 0xf; (to)->d = (word) >> 8 & 0xf; (to)->i = (word) & 0xff; break; \
        case FORM_nnnntttt____iiiiiiii: (to)->n = (word) >> 16 & 0xf; (to)->t = (word) >> 12 & 0xf; (to)->i = (word) & 0xff; break; \
        case FORM_nnnntttt________dddd: (to)->n = (word) >> 16 & 0xf; (to)->t = (word) >> 12 & 0xf; (to)->d = (word) & 0xf; break; \
        case FORM_nnnn____________mmmm: (to)->n = (word) >> 16 & 0xf; (to)->m = (word) & 0xf; break; \
        case FORM_nnnntttt____________: (to)->n = (word) >> 16 & 0xf; (to)->t = (word) >> 12 & 0xf; break; \
        case FORM_u___nnnnttttaaaaiiiiiiii: (to)->u = (word) >> 23 & 0x1; (to)->n = (word) >> 16 & 0xf; (to)->t = (word) >> 12 & 0xf; (to)->a = (word) >> 8 & 0xf; (to)->i = (word) & 0xff; break; \
        case FORM_u_w_nnnnttttaaaaiiiiiiii: (to)->u = (word) >> 23 & 0x1; (to)->w = (word) >> 21 & 0x1; (to)->n = (word) >> 16 & 0xf; (to)->t = (word) >> 12 & 0xf; (to)->a = (word) >> 8 & 0xf; (to)->i = (word) & 0xff; break; \
        case FORM_i______nnnn_iii____iiiiiiii: (to)->i = ((word) & 0xff) | ((word) >> 12 & 0x7) << 8 | ((word) >> 26 & 0x1) << 11; (to)->n = (word) >> 16 & 0xf; break; \
        case FORM_nnnn_iii____iihhmmmm: (to)->n = (word) >> 16 & 0xf; (to)->i = ((word) >> 6 & 0x3) | ((word) >> 12 & 0x7) << 2; (to)->h = (word) >> 4 & 0x3; (to)->m = (word) & 0xf; break; \
        case FORM_i_____snnnn_iiiddddiiiiiiii: (to)->i = ((word) & 0xff) | ((word) >> 12 & 0x7) << 8 | ((word) >> 26 & 0x1) << 11; (to)->s = (word) >> 20 & 0x1; (to)->n = (word) >> 16 & 0xf; (to)->d = (word) >> 8 & 0xf; break; \
        case FORM_snnnn_iiiddddiihhmmmm: (to)->s = (word) >> 20 & 0x1; (to)->n = (word) >> 16 & 0xf; (to)->i = ((word) >> 6 & 0x3) | ((word) >> 12 & 0x7) << 2; (to)->d = (word) >> 8 & 0xf; (to)->h = (word) >> 4 & 0x3; (to)->m = (word) & 0xf; break; \
        case FORM_i_____s_____iiiddddiiiiiiii: (to)->i = ((word) & 0xff) | ((word) >> 12 & 0x7) << 8 | ((word) >> 26 & 0x1) << 11; (to)->s = (word) >> 20 & 0x1; (to)->d = (word) >> 8 & 0xf; break; \
        case FORM_s_____iiiddddiihhmmmm: (to)->s = (word) >> 20 & 0x1; (to)->i = ((word) >> 6 & 0x3) | ((word) >> 12 & 0x7) << 2; (to)->d = (word) >> 8 & 0xf; (to)->h = (word) >> 4 & 0x3; (to)->m = (word) & 0xf; break; \
        case FORM_i___________iiiddddiiiiiiii: (to)->i = ((word) & 0xff) | ((word) >> 12 & 0x7) << 8 | ((word) >> 26 & 0x1) << 11; (to)->d = (word) >> 8 & 0xf; break; \
        case FORM_i______nnnn_iiiddddiiiiiiii: (to)->i = ((word) & 0xff) | ((word) >> 12 & 0x7) << 8 | ((word) >> 26 & 0x1) << 11; (to)->n = (word) >> 16 & 0xf; (to)->d = (word) >> 8 & 0xf; break; \
        case FORM_i______jjjj_iiiddddiiiiiiii: (to)->i = ((word) & 0xff) | ((word) >> 12 & 0x7) << 8 | ((word) >> 26 & 0x1) << 11; (to)->j = (word) >> 16 & 0xf; (to)->d = (word) >> 8 & 0xf; break; \
        case FORM_h_nnnn_iiiddddii_bbbbb: (to)->h = (word) >> 21 & 0x1; (to)->n = (word) >> 16 & 0xf; (to)->i = ((word) >> 6 & 0x3) | ((word) >> 12 & 0x7) << 2; (to)->d = (word) >> 8 & 0xf; (to)->b = (word) & 0x1f; break; \
        case FORM_nnnn_iiiddddii_bbbbb: (to)->n = (word) >> 16 & 0xf; (to)->i = ((word) >> 6 & 0x3) | ((word) >> 12 & 0x7) << 2; (to)->d = (word) >> 8 & 0xf; (to)->b = (word) & 0x1f; break; \
        case FORM_iiiddddii_bbbbb: (to)->i = ((word) >> 6 & 0x3) | ((word) >> 12 & 0x7) << 2; (to)->d = (word) >> 8 & 0xf; (to)->b = (word) & 0x1f; break; \
        case FORM_nnnn____bb__iiiiiiii: (to)->n = (word) >> 16 & 0xf; (to)->b = (word) >> 10 & 0x3; (to)->i = (word) & 0xff; break; \
        case FORM_ddddiiiiiiii: (to)->d = (word) >> 8 & 0xf; (to)->i = (word) & 0xff; break; \
        case FORM_scccciiiiii__j_jiiiiiiiiiii: (to)->s = (word) >> 26 & 0x1; (to)->c = (word) >> 22 & 0xf; (to)->i = ((word) & 0x7ff) | ((word) >> 16 & 0x3f) << 11; (to)->j = ((word) >> 11 & 0x1) | ((word) >> 13 & 0x1) << 1; break; \
        case FORM_siiiiiiiiii__j_jiiiiiiiiiii: (to)->s = (word) >> 26 & 0x1; (to)->i = ((word) & 0x7ff) | ((word) >> 16 & 0x3ff) << 11; (to)->j = ((word) >> 11 & 0x1) | ((word) >> 13 & 0x1) << 1; break; \
        case FORM_nnnnttttiiiiiiiiiiii: (to)->n = (word) >> 16 & 0xf; (to)->t = (word) >> 12 & 0xf; (to)->i = (word) & 0xfff; break; \
        case FORM_nnnntttt_pu_iiiiiiii: (to)->n = (word) >> 16 & 0xf; (to)->t = (word) >> 12 & 0xf; (to)->p = (word) >> 10 & 0x1; (to)->u = (word) >> 9 & 0x1; (to)->i = (word) & 0xff; break; \
        case FORM_nnnntttt______iimmmm: (to)->n = (word) >> 16 & 0xf; (to)->t = (word) >> 12 & 0xf; (to)->i = (word) >> 4 & 0x3; (to)->m = (word) & 0xf; break; \
        case FORM_nnnn________________: (to)->n = (word) >> 16 & 0xf; break; \
        case FORM_u_______ttttiiiiiiiiiiii: (to)->u = (word) >> 23 & 0x1; (to)->t = (word) >> 12 & 0xf; (to)->i = (word) & 0xfff; break; \
        case FORM_snnnn____dddd____mmmm: (to)->s = (word) >> 20 & 0x1; (to)->n = (word) >> 16 & 0xf; (to)->d = (word) >> 8 & 0xf; (to)->m = (word) & 0xf; break; \
        case FORM_dddd__iimmmm: (to)->d = (word) >> 8 & 0xf; (to)->i = (word) >> 4 & 0x3; (to)->m = (word) & 0xf; break; \
        case FORM_dddd____mmmm: (to)->d = (word) >> 8 & 0xf; (to)->m = (word) & 0xf; break; \
        case FORM_nnnn____dddd____mmmm: (to)->n = (word) >> 16 & 0xf; (to)->d = (word) >> 8 & 0xf; (to)->m = (word) & 0xf; break; \
        case FORM_nnnnaaaadddd____mmmm: (to)->n = (word) >> 16 & 0xf; (to)->a = (word) >> 12 & 0xf; (to)->d = (word) >> 8 & 0xf; (to)->m = (word) & 0xf; break; \
        case FORM_nnnnddddaaaa____mmmm: (to)->n = (word) >> 16 & 0xf; (to)->d = (word) >> 12 & 0xf; (to)->a = (word) >> 8 & 0xf; (to)->m = (word) & 0xf; break; \
        } \
    } while (0)

static const struct encoding narrow[] = {
    {0xffc0, 0x0, MOVS_T2, FORM_mmmddd, KIND_PLAIN},
    {0xf800, 0x0, LSL_T1, FORM_iiiiimmmddd, KIND_PLAIN},
    {0xf800, 0x800, LSR_T1, FORM_iiiiimmmddd, KIND_PLAIN},
    {0xf800, 0x1000, ASR_T1, FORM_iiiiimmmddd, KIND_PLAIN},
    {0xfe00, 0x1800, ADD_R3, FORM_mmmnnnddd, KIND_PLAIN},
    {0xfe00, 0x1a00, SUB_R3, FORM_mmmnnnddd, KIND_PLAIN},
    {0xfe00, 0x1c00, ADD_I3, FORM_iiinnnddd, KIND_PLAIN},
    {0xfe00, 0x1e00, SUB_I3, FORM_iiinnnddd, KIND_PLAIN},
    {0xf800, 0x2000, MOV_I8, FORM_dddiiiiiiii, KIND_PLAIN},
    {0xf800, 0x2800, CMP_I8, FORM_dddiiiiiiii, KIND_PLAIN},
    {0xf800, 0x3000, ADD_I8, FORM_dddiiiiiiii, KIND_PLAIN},
    {0xf800, 0x3800, SUB_I8, FORM_dddiiiiiiii, KIND_PLAIN},
    {0xffc0, 0x4000, AND_T1, FORM_mmmddd, KIND_PLAIN},
    {0xffc0, 0x4040, EOR_T1, FORM_mmmddd, KIND_PLAIN},
    {0xffc0, 0x4080, LSL_RT1, FORM_mmmddd, KIND_PLAIN},
    {0xffc0, 0x40c0, LSR_RT1, FORM_mmmddd, KIND_PLAIN},
    {0xffc0, 0x4100, ASR_RT1, FORM_mmmddd, KIND_PLAIN},
    {0xffc0, 0x4140, ADC_T1, FORM_mmmddd, KIND_PLAIN},
    {0xffc0, 0x4180, SBC_T1, FORM_mmmddd, KIND_PLAIN},
    {0xffc0, 0x41c0, ROR_RT1, FORM_mmmddd, KIND_PLAIN},
    {0xffc0, 0x4200, TST_T1, FORM_mmmddd, KIND_PLAIN},
    {0xffc0, 0x4240, RSB_T1, FORM_nnnddd, KIND_PLAIN},
    {0xffc0, 0x4280, CMP_T1, FORM_mmmddd, KIND_PLAIN},
    {0xffc0, 0x42c0, CMN_T1, FORM_mmmddd, KIND_PLAIN},
    {0xffc0, 0x4300, ORR_T1, FORM_mmmddd, KIND_PLAIN},
    {0xffc0, 0x4340, MUL_T1, FORM_mmmddd, KIND_PLAIN},
    {0xffc0, 0x4380, BIC_T1, FORM_mmmddd, KIND_PLAIN},
    {0xffc0, 0x43c0, MVN_T1, FORM_mmmddd, KIND_PLAIN},
    {0xff87, 0x4487, ADD_PC, FORM_mmmm___, KIND_BRANCH_REGISTER},
    {0xff00, 0x4400, ADD_T2, FORM_dmmmmddd, KIND_PLAIN},
    {0xff00, 0x4500, CMP_T1, FORM_dmmmmddd, KIND_PLAIN},
    {0xff87, 0x4687, MOV_PC, FORM_mmmm___, KIND_BRANCH_REGISTER},
    {0xff00, 0x4600, MOV_T1, FORM_dmmmmddd, KIND_PLAIN},
    {0xff87, 0x4700, BX, FORM_mmmm___, KIND_BRANCH_REGISTER},
    {0xff87, 0x4780, BLX, FORM_mmmm___, KIND_BRANCH_REGISTER},
    {0xf800, 0x4800, LDR_LITERAL_T1, FORM_tttiiiiiiii, KIND_LOAD_LITERAL},
    {0xfe00, 0x5000, STR_RT1, FORM_mmmnnnttt, KIND_STORE_INDEXED},
    {0xfe00, 0x5200, STRH_RT1, FORM_mmmnnnttt, KIND_STORE_INDEXED},
    {0xfe00, 0x5400, STRB_RT1, FORM_mmmnnnttt, KIND_STORE_INDEXED},
    {0xfe00, 0x5600, LDRSB_RT1, FORM_mmmnnnttt, KIND_LOAD},
    {0xfe00, 0x5800, LDR_RT1, FORM_mmmnnnttt, KIND_LOAD},
    {0xfe00, 0x5a00, LDRH_RT1, FORM_mmmnnnttt, KIND_LOAD},
    {0xfe00, 0x5c00, LDRB_RT1, FORM_mmmnnnttt, KIND_LOAD},
    {0xfe00, 0x5e00, LDRSH_RT1, FORM_mmmnnnttt, KIND_LOAD},
    {0xf800, 0x6000, STR_I5, FORM_iiiiinnnttt, KIND_STORE},
    {0xf800, 0x6800, LDR_I5, FORM_iiiiinnnttt, KIND_LOAD},
    {0xf800, 0x7000, STRB_I5, FORM_iiiiinnnttt, KIND_STORE},
    {0xf800, 0x7800, LDRB_I5, FORM_iiiiinnnttt, KIND_LOAD},
    {0xf800, 0x8000, STRH_I5, FORM_iiiiinnnttt, KIND_STORE},
    {0xf800, 0x8800, LDRH_I5, FORM_iiiiinnnttt, KIND_LOAD},
    {0xf800, 0x9000, STR_SP, FORM_tttiiiiiiii, KIND_STORE},
    {0xf800, 0x9800, LDR_SP, FORM_tttiiiiiiii, KIND_LOAD},
    {0xf800, 0xa000, ADR_T1, FORM_dddiiiiiiii, KIND_PLAIN},
    {0xf800, 0xa800, ADD_SP_T1, FORM_dddiiiiiiii, KIND_PLAIN},
    {0xff80, 0xb000, ADD_SP_T2, FORM_iiiiiii, KIND_PLAIN},
    {0xff80, 0xb080, SUB_SP_T1, FORM_iiiiiii, KIND_PLAIN},
    {0xfd00, 0xb100, CBZ, FORM_i_iiiiinnn, KIND_BRANCH},
    {0xfd00, 0xb900, CBNZ, FORM_i_iiiiinnn, KIND_BRANCH},
    {0xffc0, 0xb200, SXTH_T1, FORM_mmmddd, KIND_PLAIN},
    {0xffc0, 0xb240, SXTB_T1, FORM_mmmddd, KIND_PLAIN},
    {0xffc0, 0xb280, UXTH_T1, FORM_mmmddd, KIND_PLAIN},
    {0xffc0, 0xb2c0, UXTB_T1, FORM_mmmddd, KIND_PLAIN},
    {0xfe00, 0xb400, PUSH, FORM_rrrrrrrrr, KIND_STORE_MULTIPLE},
    {0xfe00, 0xbc00, POP, FORM_rrrrrrrrr, KIND_LOAD_MULTIPLE},
    {0xffec, 0xb660, CPS, FORM_u__ii, KIND_MASK_CHANGE},
    {0xffc0, 0xba00, REV, FORM_mmmddd, KIND_PLAIN},
    {0xffc0, 0xba40, REV16, FORM_mmmddd, KIND_PLAIN},
    {0xffc0, 0xbac0, REVSH, FORM_mmmddd, KIND_PLAIN},
    {0xff00, 0xbe00, BKPT, FORM_iiiiiiii, KIND_BREAKPOINT},
    {0xffff, 0xbf10, YIELD, FORM_NONE, KIND_YIELD},
    {0xffff, 0xbf20, WFE, FORM_NONE, KIND_WAIT_EVENT},
    {0xffff, 0xbf30, WFI, FORM_NONE, KIND_WAIT_INTERRUPT},
    {0xffff, 0xbf40, SEV, FORM_NONE, KIND_SEND_EVENT},
    {0xff0f, 0xbf00, NOP, FORM_NONE, KIND_PLAIN},
    {0xff00, 0xbf00, IT, FORM_iiiiiiii, KIND_IF_THEN},
    {0xf800, 0xc000, STM_T1, FORM_nnnrrrrrrrr, KIND_STORE_MULTIPLE},
    {0xf800, 0xc800, LDM_T1, FORM_nnnrrrrrrrr, KIND_LOAD_MULTIPLE},
    {0xff00, 0xde00, UDF, FORM_NONE, KIND_PLAIN},
    {0xff00, 0xdf00, SVC, FORM_iiiiiiii, KIND_SUPERVISOR_CALL},
    {0xf000, 0xd000, B_T1, FORM_cccciiiiiiii, KIND_BRANCH},
    {0xf800, 0xe000, B_T2, FORM_iiiiiiiiiii, KIND_BRANCH},
};

static const struct encoding wide[] = {
    {0xffd00000, 0xe8800000, STM_IA, FORM_w_nnnnrrrrrrrrrrrrrrrr, KIND_STORE_MULTIPLE},
    {0xffd00000, 0xe8900000, LDM_IA, FORM_w_nnnnrrrrrrrrrrrrrrrr, KIND_LOAD_MULTIPLE},
    {0xffd00000, 0xe9000000, STM_DB, FORM_w_nnnnrrrrrrrrrrrrrrrr, KIND_STORE_MULTIPLE},
    {0xffd00000, 0xe9100000, LDM_DB, FORM_w_nnnnrrrrrrrrrrrrrrrr, KIND_LOAD_MULTIPLE},
    {0xfff00000, 0xe8400000, STREX, FORM_nnnnttttddddiiiiiiii, KIND_EXCLUSIVE},
    {0xfff00f00, 0xe8500f00, LDREX, FORM_nnnntttt____iiiiiiii, KIND_EXCLUSIVE},
    {0xfff00ff0, 0xe8c00f40, STREXB, FORM_nnnntttt________dddd, KIND_EXCLUSIVE},
    {0xfff00ff0, 0xe8c00f50, STREXH, FORM_nnnntttt________dddd, KIND_EXCLUSIVE},
    {0xfff0fff0, 0xe8d0f000, TBB, FORM_nnnn____________mmmm, KIND_TABLE_BRANCH},
    {0xfff0fff0, 0xe8d0f010, TBH, FORM_nnnn____________mmmm, KIND_TABLE_BRANCH},
    {0xfff00fff, 0xe8d00f4f, LDREXB, FORM_nnnntttt____________, KIND_EXCLUSIVE},
    {0xfff00fff, 0xe8d00f5f, LDREXH, FORM_nnnntttt____________, KIND_EXCLUSIVE},
    {0xff700000, 0xe8600000, STRD_POST, FORM_u___nnnnttttaaaaiiiiiiii, KIND_STORE_DUAL},
    {0xff700000, 0xe8700000, LDRD_POST, FORM_u___nnnnttttaaaaiiiiiiii, KIND_LOAD_DUAL},
    {0xff500000, 0xe9400000, STRD, FORM_u_w_nnnnttttaaaaiiiiiiii, KIND_STORE_DUAL},
    {0xff500000, 0xe9500000, LDRD, FORM_u_w_nnnnttttaaaaiiiiiiii, KIND_LOAD_DUAL},
    {0xfbf08f00, 0xf0100f00, TST_I, FORM_i______nnnn_iii____iiiiiiii, KIND_PLAIN},
    {0xfff08f00, 0xea100f00, TST_R, FORM_nnnn_iii____iihhmmmm, KIND_PLAIN},
    {0xfbe08000, 0xf0000000, AND_I, FORM_i_____snnnn_iiiddddiiiiiiii, KIND_PLAIN},
    {0xffe08000, 0xea000000, AND_R, FORM_snnnn_iiiddddiihhmmmm, KIND_PLAIN},
    {0xfbe08000, 0xf0200000, BIC_I, FORM_i_____snnnn_iiiddddiiiiiiii, KIND_PLAIN},
    {0xffe08000, 0xea200000, BIC_R, FORM_snnnn_iiiddddiihhmmmm, KIND_PLAIN},
    {0xfbef8000, 0xf04f0000, MOV_I, FORM_i_____s_____iiiddddiiiiiiii, KIND_PLAIN},
    {0xffef8000, 0xea4f0000, MOV_R, FORM_s_____iiiddddiihhmmmm, KIND_PLAIN},
    {0xfbe08000, 0xf0400000, ORR_I, FORM_i_____snnnn_iiiddddiiiiiiii, KIND_PLAIN},
    {0xffe08000, 0xea400000, ORR_R, FORM_snnnn_iiiddddiihhmmmm, KIND_PLAIN},
    {0xfbef8000, 0xf06f0000, MVN_I, FORM_i_____s_____iiiddddiiiiiiii, KIND_PLAIN},
    {0xffef8000, 0xea6f0000, MVN_R, FORM_s_____iiiddddiihhmmmm, KIND_PLAIN},
    {0xfbe08000, 0xf0600000, ORN_I, FORM_i_____snnnn_iiiddddiiiiiiii, KIND_PLAIN},
    {0xffe08000, 0xea600000, ORN_R, FORM_snnnn_iiiddddiihhmmmm, KIND_PLAIN},
    {0xfbf08f00, 0xf0900f00, TEQ_I, FORM_i______nnnn_iii____iiiiiiii, KIND_PLAIN},
    {0xfff08f00, 0xea900f00, TEQ_R, FORM_nnnn_iii____iihhmmmm, KIND_PLAIN},
    {0xfbe08000, 0xf0800000, EOR_I, FORM_i_____snnnn_iiiddddiiiiiiii, KIND_PLAIN},
    {0xffe08000, 0xea800000, EOR_R, FORM_snnnn_iiiddddiihhmmmm, KIND_PLAIN},
    {0xfbf08f00, 0xf1100f00, CMN_I, FORM_i______nnnn_iii____iiiiiiii, KIND_PLAIN},
    {0xfff08f00, 0xeb100f00, CMN_R, FORM_nnnn_iii____iihhmmmm, KIND_PLAIN},
    {0xfbe08000, 0xf1000000, ADD_I, FORM_i_____snnnn_iiiddddiiiiiiii, KIND_PLAIN},
    {0xffe08000, 0xeb000000, ADD_R, FORM_snnnn_iiiddddiihhmmmm, KIND_PLAIN},
    {0xfbe08000, 0xf1400000, ADC_I, FORM_i_____snnnn_iiiddddiiiiiiii, KIND_PLAIN},
    {0xffe08000, 0xeb400000, ADC_R, FORM_snnnn_iiiddddiihhmmmm, KIND_PLAIN},
    {0xfbe08000, 0xf1600000, SBC_I, FORM_i_____snnnn_iiiddddiiiiiiii, KIND_PLAIN},
    {0xffe08000, 0xeb600000, SBC_R, FORM_snnnn_iiiddddiihhmmmm, KIND_PLAIN},
    {0xfbf08f00, 0xf1b00f00, CMP_I, FORM_i______nnnn_iii____iiiiiiii, KIND_PLAIN},
    {0xfff08f00, 0xebb00f00, CMP_R, FORM_nnnn_iii____iihhmmmm, KIND_PLAIN},
    {0xfbe08000, 0xf1a00000, SUB_I, FORM_i_____snnnn_iiiddddiiiiiiii, KIND_PLAIN},
    {0xffe08000, 0xeba00000, SUB_R, FORM_snnnn_iiiddddiihhmmmm, KIND_PLAIN},
    {0xfbe08000, 0xf1c00000, RSB_I, FORM_i_____snnnn_iiiddddiiiiiiii, KIND_PLAIN},
    {0xffe08000, 0xebc00000, RSB_R, FORM_snnnn_iiiddddiihhmmmm, KIND_PLAIN},
    {0xfbff8000, 0xf20f0000, ADR_ADD, FORM_i___________iiiddddiiiiiiii, KIND_PLAIN},
    {0xfbff8000, 0xf2af0000, ADR_SUB, FORM_i___________iiiddddiiiiiiii, KIND_PLAIN},
    {0xfbf08000, 0xf2000000, ADDW, FORM_i______nnnn_iiiddddiiiiiiii, KIND_PLAIN},
    {0xfbf08000, 0xf2a00000, SUBW, FORM_i______nnnn_iiiddddiiiiiiii, KIND_PLAIN},
    {0xfbf08000, 0xf2400000, MOVW, FORM_i______jjjj_iiiddddiiiiiiii, KIND_PLAIN},
    {0xfbf08000, 0xf2c00000, MOVT, FORM_i______jjjj_iiiddddiiiiiiii, KIND_PLAIN},
    {0xfff0f0c0, 0xf3200000, UNDEFINED, FORM_NONE, KIND_PLAIN},
    {0xfff0f0c0, 0xf3a00000, UNDEFINED, FORM_NONE, KIND_PLAIN},
    {0xffd08020, 0xf3000000, SSAT, FORM_h_nnnn_iiiddddii_bbbbb, KIND_PLAIN},
    {0xffd08020, 0xf3800000, USAT, FORM_h_nnnn_iiiddddii_bbbbb, KIND_PLAIN},
    {0xfff08020, 0xf3400000, SBFX, FORM_nnnn_iiiddddii_bbbbb, KIND_PLAIN},
    {0xfff08020, 0xf3c00000, UBFX, FORM_nnnn_iiiddddii_bbbbb, KIND_PLAIN},
    {0xffff8020, 0xf36f0000, BFC, FORM_iiiddddii_bbbbb, KIND_PLAIN},
    {0xfff08020, 0xf3600000, BFI, FORM_nnnn_iiiddddii_bbbbb, KIND_PLAIN},
    {0xfff0f300, 0xf3808000, MSR, FORM_nnnn____bb__iiiiiiii, KIND_MASK_CHANGE},
    {0xffffffff, 0xf3af8001, YIELD, FORM_NONE, KIND_YIELD},
    {0xffffffff, 0xf3af8002, WFE, FORM_NONE, KIND_WAIT_EVENT},
    {0xffffffff, 0xf3af8003, WFI, FORM_NONE, KIND_WAIT_INTERRUPT},
    {0xffffffff, 0xf3af8004, SEV, FORM_NONE, KIND_SEND_EVENT},
    {0xffffff00, 0xf3af8000, NOP, FORM_NONE, KIND_PLAIN},
    {0xffffffff, 0xf3bf8f2f, CLREX, FORM_NONE, KIND_BARRIER},
    {0xfffffff0, 0xf3bf8f40, DSB, FORM_NONE, KIND_BARRIER},
    {0xfffffff0, 0xf3bf8f50, DMB, FORM_NONE, KIND_BARRIER},
    {0xfffffff0, 0xf3bf8f60, ISB, FORM_NONE, KIND_SYNCHRONISE},
    {0xfffff000, 0xf3ef8000, MRS, FORM_ddddiiiiiiii, KIND_READ_SPECIAL},
    {0xfff0f000, 0xf7f0a000, UDF, FORM_NONE, KIND_PLAIN},
    {0xfb80d000, 0xf3808000, UNDEFINED, FORM_NONE, KIND_PLAIN},
    {0xf800d000, 0xf0008000, B_T3, FORM_scccciiiiii__j_jiiiiiiiiiii, KIND_BRANCH},
    {0xf800d000, 0xf0009000, B_T4, FORM_siiiiiiiiii__j_jiiiiiiiiiii, KIND_BRANCH},
    {0xf800d000, 0xf000d000, BL, FORM_siiiiiiiiii__j_jiiiiiiiiiii, KIND_CALL},
    {0xff7f0000, 0xf80f0000, UNDEFINED, FORM_NONE, KIND_PLAIN},
    {0xff7f0000, 0xf82f0000, UNDEFINED, FORM_NONE, KIND_PLAIN},
    {0xff7f0000, 0xf84f0000, UNDEFINED, FORM_NONE, KIND_PLAIN},
    {0xfff00000, 0xf8800000, STRB_I, FORM_nnnnttttiiiiiiiiiiii, KIND_STORE},
    {0xfff00f00, 0xf8000e00, STRBT, FORM_nnnntttt____iiiiiiii, KIND_STORE},
    {0xfff00900, 0xf8000900, STRB_X, FORM_nnnntttt_pu_iiiiiiii, KIND_STORE},
    {0xfff00f00, 0xf8000c00, STRB_N, FORM_nnnntttt____iiiiiiii, KIND_STORE},
    {0xfff00fc0, 0xf8000000, STRB_R, FORM_nnnntttt______iimmmm, KIND_STORE_INDEXED},
    {0xfff00000, 0xf8a00000, STRH_I, FORM_nnnnttttiiiiiiiiiiii, KIND_STORE},
    {0xfff00f00, 0xf8200e00, STRHT, FORM_nnnntttt____iiiiiiii, KIND_STORE},
    {0xfff00900, 0xf8200900, STRH_X, FORM_nnnntttt_pu_iiiiiiii, KIND_STORE},
    {0xfff00f00, 0xf8200c00, STRH_N, FORM_nnnntttt____iiiiiiii, KIND_STORE},
    {0xfff00fc0, 0xf8200000, STRH_R, FORM_nnnntttt______iimmmm, KIND_STORE_INDEXED},
    {0xfff00000, 0xf8c00000, STR_I, FORM_nnnnttttiiiiiiiiiiii, KIND_STORE},
    {0xfff00f00, 0xf8400e00, STRT, FORM_nnnntttt____iiiiiiii, KIND_STORE},
    {0xfff00900, 0xf8400900, STR_X, FORM_nnnntttt_pu_iiiiiiii, KIND_STORE},
    {0xfff00f00, 0xf8400c00, STR_N, FORM_nnnntttt____iiiiiiii, KIND_STORE},
    {0xfff00fc0, 0xf8400000, STR_R, FORM_nnnntttt______iimmmm, KIND_STORE_INDEXED},
    {0xff7ff000, 0xf81ff000, NOP, FORM_NONE, KIND_PLAIN},
    {0xfff0f000, 0xf890f000, NOP, FORM_nnnn________________, KIND_PLAIN},
    {0xfff0ff00, 0xf810fc00, NOP, FORM_nnnn________________, KIND_PLAIN},
    {0xfff0ffc0, 0xf810f000, NOP, FORM_nnnn____________mmmm, KIND_PLAIN},
    {0xff7f0000, 0xf81f0000, LDRB_LITERAL, FORM_u_______ttttiiiiiiiiiiii, KIND_LOAD_LITERAL},
    {0xfff00000, 0xf8900000, LDRB_I, FORM_nnnnttttiiiiiiiiiiii, KIND_LOAD},
    {0xfff00f00, 0xf8100e00, LDRBT, FORM_nnnntttt____iiiiiiii, KIND_LOAD},
    {0xfff00900, 0xf8100900, LDRB_X, FORM_nnnntttt_pu_iiiiiiii, KIND_LOAD},
    {0xfff00f00, 0xf8100c00, LDRB_N, FORM_nnnntttt____iiiiiiii, KIND_LOAD},
    {0xfff00fc0, 0xf8100000, LDRB_R, FORM_nnnntttt______iimmmm, KIND_LOAD},
    {0xff7ff000, 0xf83ff000, NOP, FORM_NONE, KIND_PLAIN},
    {0xfff0f000, 0xf8b0f000, NOP, FORM_nnnn________________, KIND_PLAIN},
    {0xfff0ff00, 0xf830fc00, NOP, FORM_nnnn________________, KIND_PLAIN},
    {0xfff0ffc0, 0xf830f000, NOP, FORM_nnnn____________mmmm, KIND_PLAIN},
    {0xff7f0000, 0xf83f0000, LDRH_LITERAL, FORM_u_______ttttiiiiiiiiiiii, KIND_LOAD_LITERAL},
    {0xfff00000, 0xf8b00000, LDRH_I, FORM_nnnnttttiiiiiiiiiiii, KIND_LOAD},
    {0xfff00f00, 0xf8300e00, LDRHT, FORM_nnnntttt____iiiiiiii, KIND_LOAD},
    {0xfff00900, 0xf8300900, LDRH_X, FORM_nnnntttt_pu_iiiiiiii, KIND_LOAD},
    {0xfff00f00, 0xf8300c00, LDRH_N, FORM_nnnntttt____iiiiiiii, KIND_LOAD},
    {0xfff00fc0, 0xf8300000, LDRH_R, FORM_nnnntttt______iimmmm, KIND_LOAD},
    {0xff7f0000, 0xf85f0000, LDR_LITERAL, FORM_u_______ttttiiiiiiiiiiii, KIND_LOAD_LITERAL},
    {0xfff00000, 0xf8d00000, LDR_I, FORM_nnnnttttiiiiiiiiiiii, KIND_LOAD},
    {0xfff00f00, 0xf8500e00, LDRT, FORM_nnnntttt____iiiiiiii, KIND_LOAD},
    {0xfff00900, 0xf8500900, LDR_X, FORM_nnnntttt_pu_iiiiiiii, KIND_LOAD},
    {0xfff00f00, 0xf8500c00, LDR_N, FORM_nnnntttt____iiiiiiii, KIND_LOAD},
    {0xfff00fc0, 0xf8500000, LDR_R, FORM_nnnntttt______iimmmm, KIND_LOAD},
    {0xff7ff000, 0xf91ff000, NOP, FORM_NONE, KIND_PLAIN},
    {0xfff0f000, 0xf990f000, NOP, FORM_nnnn________________, KIND_PLAIN},
    {0xfff0ff00, 0xf910fc00, NOP, FORM_nnnn________________, KIND_PLAIN},
    {0xfff0ffc0, 0xf910f000, NOP, FORM_nnnn____________mmmm, KIND_PLAIN},
    {0xff7f0000, 0xf91f0000, LDRSB_LITERAL, FORM_u_______ttttiiiiiiiiiiii, KIND_LOAD_LITERAL},
    {0xfff00000, 0xf9900000, LDRSB_I, FORM_nnnnttttiiiiiiiiiiii, KIND_LOAD},
    {0xfff00f00, 0xf9100e00, LDRSBT, FORM_nnnntttt____iiiiiiii, KIND_LOAD},
    {0xfff00900, 0xf9100900, LDRSB_X, FORM_nnnntttt_pu_iiiiiiii, KIND_LOAD},
    {0xfff00f00, 0xf9100c00, LDRSB_N, FORM_nnnntttt____iiiiiiii, KIND_LOAD},
    {0xfff00fc0, 0xf9100000, LDRSB_R, FORM_nnnntttt______iimmmm, KIND_LOAD},
    {0xff7ff000, 0xf93ff000, NOP, FORM_NONE, KIND_PLAIN},
    {0xfff0f000, 0xf9b0f000, NOP, FORM_nnnn________________, KIND_PLAIN},
    {0xfff0ff00, 0xf930fc00, NOP, FORM_nnnn________________, KIND_PLAIN},
    {0xfff0ffc0, 0xf930f000, NOP, FORM_nnnn____________mmmm, KIND_PLAIN},
    {0xff7f0000, 0xf93f0000, LDRSH_LITERAL, FORM_u_______ttttiiiiiiiiiiii, KIND_LOAD_LITERAL},
    {0xfff00000, 0xf9b00000, LDRSH_I, FORM_nnnnttttiiiiiiiiiiii, KIND_LOAD},
    {0xfff00f00, 0xf9300e00, LDRSHT, FORM_nnnntttt____iiiiiiii, KIND_LOAD},
    {0xfff00900, 0xf9300900, LDRSH_X, FORM_nnnntttt_pu_iiiiiiii, KIND_LOAD},
    {0xfff00f00, 0xf9300c00, LDRSH_N, FORM_nnnntttt____iiiiiiii, KIND_LOAD},
    {0xfff00fc0, 0xf9300000, LDRSH_R, FORM_nnnntttt______iimmmm, KIND_LOAD},
    {0xffe0f0f0, 0xfa00f000, LSL, FORM_snnnn____dddd____mmmm, KIND_PLAIN},
    {0xffe0f0f0, 0xfa20f000, LSR, FORM_snnnn____dddd____mmmm, KIND_PLAIN},
    {0xffe0f0f0, 0xfa40f000, ASR, FORM_snnnn____dddd____mmmm, KIND_PLAIN},
    {0xffe0f0f0, 0xfa60f000, ROR, FORM_snnnn____dddd____mmmm, KIND_PLAIN},
    {0xfffff0c0, 0xfa0ff080, SXTH, FORM_dddd__iimmmm, KIND_PLAIN},
    {0xfffff0c0, 0xfa1ff080, UXTH, FORM_dddd__iimmmm, KIND_PLAIN},
    {0xfffff0c0, 0xfa4ff080, SXTB, FORM_dddd__iimmmm, KIND_PLAIN},
    {0xfffff0c0, 0xfa5ff080, UXTB, FORM_dddd__iimmmm, KIND_PLAIN},
    {0xfff0f0f0, 0xfa90f080, REV, FORM_dddd____mmmm, KIND_PLAIN},
    {0xfff0f0f0, 0xfa90f090, REV16, FORM_dddd____mmmm, KIND_PLAIN},
    {0xfff0f0f0, 0xfa90f0a0, RBIT, FORM_dddd____mmmm, KIND_PLAIN},
    {0xfff0f0f0, 0xfa90f0b0, REVSH, FORM_dddd____mmmm, KIND_PLAIN},
    {0xfff0f0f0, 0xfab0f080, CLZ, FORM_dddd____mmmm, KIND_PLAIN},
    {0xfff0f0f0, 0xfb00f000, MUL, FORM_nnnn____dddd____mmmm, KIND_PLAIN},
    {0xfff000f0, 0xfb000000, MLA, FORM_nnnnaaaadddd____mmmm, KIND_MULTIPLY_ACCUMULATE},
    {0xfff000f0, 0xfb000010, MLS, FORM_nnnnaaaadddd____mmmm, KIND_MULTIPLY_ACCUMULATE},
    {0xfff000f0, 0xfb800000, SMULL, FORM_nnnnddddaaaa____mmmm, KIND_MULTIPLY_LONG},
    {0xfff0f0f0, 0xfb90f0f0, SDIV, FORM_nnnn____dddd____mmmm, KIND_DIVIDE},
    {0xfff000f0, 0xfba00000, UMULL, FORM_nnnnddddaaaa____mmmm, KIND_MULTIPLY_LONG},
    {0xfff0f0f0, 0xfbb0f0f0, UDIV, FORM_nnnn____dddd____mmmm, KIND_DIVIDE},
    {0xfff000f0, 0xfbc00000, SMLAL, FORM_nnnnddddaaaa____mmmm, KIND_MULTIPLY_ACCUMULATE_LONG},
    {0xfff000f0, 0xfbe00000, UMLAL, FORM_nnnnddddaaaa____mmmm, KIND_MULTIPLY_ACCUMULATE_LONG},
    {0xee000000, 0xec000000, NO_COPROCESSOR, FORM_NONE, KIND_PLAIN},
    {0xef000000, 0xee000000, NO_COPROCESSOR, FORM_NONE, KIND_PLAIN},
};

#endif
