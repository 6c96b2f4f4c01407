/* Motor codes as duty and sign, for an adapter whose motor_command is "duty".
 *
 * The first wire of a motor carries the magnitude, 1 kHz by a timer, all of it at
 * MOTOR_MIN; the last one is high for backward, the one between stays low.
 *
 * Theory of operation: each call moves a motor by at most SLEW towards its code, and
 * through 0 where the sign changes: the sign is written while the duty is 0. A call a
 * tick of 10 ms is 0.2 m/s^2 at the rim.
 */
#include "board.h"
#include "f103_timers.h"
#include "motors.h"
#include "pins.h"
#include "wires.h"

enum { SIDES = 2, FULL = 1000, SLEW = 8, TIMER_HZ = 1000000, WAVE_HZ = 1000 };

static const struct wire wires[SIDES][3] = {{LEFT_MOTOR_WIRES(WIRE)}, {RIGHT_MOTOR_WIRES(WIRE)}};
/* Whose channel 2 the first wires are: PB7 and PA1. */
static struct tim *const timers[SIDES] = {TIM4, TIM2};
static int duties[SIDES]; /* of FULL, signed */

void motors_start(void)
{
    RCC->APB1ENR |= RCC_APB1ENR_TIM2EN | RCC_APB1ENR_TIM4EN;
    (void)RCC->APB1ENR;
    for (unsigned side = 0; side < SIDES; side++) {
        struct tim *timer = timers[side];
        timer->PSC = HCLK_HZ / TIMER_HZ - 1u;
        timer->ARR = TIMER_HZ / WAVE_HZ - 1u;
        timer->CCMR1 = TIM_CCMR_PWM1_SECOND;
        timer->CCER = TIM_CCER_CC2E;
        timer->EGR = TIM_EGR_UG;
        timer->CR1 = TIM_CR1_ARPE | TIM_CR1_CEN;
        duties[side] = 0;
        set_modes(wires[side], 1, GPIO_ALTERNATE_PUSH_PULL_2MHZ);
        for (unsigned i = 1; i < COUNT(wires[side]); i++) {
            write_wire(wires[side][i], 0);
        }
        set_modes(wires[side] + 1, COUNT(wires[side]) - 1u, GPIO_OUTPUT_PUSH_PULL_2MHZ);
    }
}

static int approach(int duty, int wanted)
{
    if (duty != 0 && (duty < 0) != (wanted < 0)) {
        wanted = 0;
    }
    return wanted > duty + SLEW ? duty + SLEW : wanted < duty - SLEW ? duty - SLEW : wanted;
}

static void write_duty(unsigned side, int code)
{
    code = code < MOTOR_MIN ? MOTOR_MIN : code > MOTOR_MAX ? MOTOR_MAX : code;
    int duty = duties[side] = approach(duties[side], code * (FULL / -MOTOR_MIN));
    timers[side]->CCR2 = (uint32_t)(duty < 0 ? -duty : duty);
    if (duty == 0) {
        write_wire(wires[side][COUNT(wires[side]) - 1u], code < 0);
    }
}

void pins_motors(int left, int right)
{
    write_duty(0, left);
    write_duty(1, right);
}
