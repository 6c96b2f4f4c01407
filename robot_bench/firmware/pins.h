/* The wires as values: eight distances, two encoder codes, two motor codes. */
#ifndef PINS_H
#define PINS_H

#include <stdint.h>

#define MOTOR_MIN (-4)
#define MOTOR_MAX 3

/* Motors to 0, rst low, p2dx_con high; then the pins become outputs and inputs. */
void pins_start(void);

/* Bit 0 = DD1 (leftmost) ... bit 7 = DD8 (rightmost); 1 = obstacle. */
uint8_t pins_distances(void);

/* 0 to 7, rising as the wheel rolls forward. */
uint8_t pins_left_encoder(void);
uint8_t pins_right_encoder(void);

/* Codes from MOTOR_MIN to MOTOR_MAX; values beyond are cut to the limits. motors_duty.c approaches them call by call. */
void pins_motors(int left, int right);

#endif
