/* The rover's hardware as its program sees it: two motors, two encoders, four voltages, a tick of 1 ms.
 *
 * The pins are those of robot_bench/direct/robots/rover.toml; a test compares them.
 */
#ifndef ROVER_BOARD_H
#define ROVER_BOARD_H

#include <stdint.h>

#define TICKS_PER_S 1000u
#define PWM_PERIOD 3600 /* 20 kHz of 72 MHz */

enum rover_side { LEFT, RIGHT, SIDES };
enum rover_voltage { BATTERY, FRONT, ASIDE_LEFT, ASIDE_RIGHT, VOLTAGES };

/* X(signal of the robot, port letter, bit) */
#define ROVER_OUTPUTS(X) X(left_in1, B, 12) X(left_in2, B, 13) X(right_in1, B, 14) X(right_in2, B, 15)
#define ROVER_PWM(X) X(left_pwm, A, 8) X(right_pwm, A, 11)
#define ROVER_ENCODERS(X) X(left_a, A, 6) X(left_b, A, 7) X(right_a, B, 6) X(right_b, B, 7)
#define ROVER_VOLTAGES(X) X(battery, A, 0) X(distance_front, A, 1) X(distance_left, A, 4) X(distance_right, A, 5)

/* 72 MHz, motors off, tick, timers, ADC and USART1. */
void rover_start(void);

/* Sleeps until the next tick, and starts the conversions whose results the tick after next sees. */
void rover_wait(void);

/* Edges of an encoder since rover_start, forward positive. */
int32_t rover_counts(enum rover_side side);

/* A motor's volts as a part of the battery's: -PWM_PERIOD to PWM_PERIOD. */
void rover_drive(enum rover_side side, int32_t duty);

/* Millivolts at a pin, at the last tick. */
uint32_t rover_millivolts(enum rover_voltage which);

#endif
