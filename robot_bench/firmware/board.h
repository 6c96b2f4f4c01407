/* The 22 wires between the BluePill and the adapter, as the BluePill sees them.
 *
 * A fixed contract: these are the pins of the thesis's table 3 and a binary
 * never changes with the revision of the adapter. Three-bit values have their
 * most significant bit last (s3, comm3). Motors are two's complement, -4 to +3,
 * one step is 62.5 mm/s of the wheel's rim; encoders are absolute, eight codes
 * a turn of the wheel.
 */
#ifndef BOARD_H
#define BOARD_H

#define HCLK_HZ 72000000u
#define HSI_HZ 8000000u

/* X(name, port letter, bit) */
#define DISTANCE_WIRES(X) /* inputs, high = nearer than the threshold; DD1 looks to +90 degrees (left), DD8 to -90 */ \
    X(DD1, A, 4) \
    X(DD2, A, 5) \
    X(DD3, A, 6) \
    X(DD4, A, 7) \
    X(DD5, B, 0) \
    X(DD6, B, 1) \
    X(DD7, B, 10) \
    X(DD8, B, 11)

#define LEFT_ENCODER_WIRES(X) /* inputs */ \
    X(encoder1_s1, B, 4) \
    X(encoder1_s2, B, 3) \
    X(encoder1_s3, B, 15)

#define RIGHT_ENCODER_WIRES(X) /* inputs */ \
    X(encoder2_s1, C, 13) \
    X(encoder2_s2, C, 14) \
    X(encoder2_s3, C, 15)

#define LEFT_MOTOR_WIRES(X) /* outputs, all on one port: a code changes in one write */ \
    X(motor1_comm1, B, 7) \
    X(motor1_comm2, B, 6) \
    X(motor1_comm3, B, 5)

#define RIGHT_MOTOR_WIRES(X) /* outputs, all on one port */ \
    X(motor2_comm1, A, 1) \
    X(motor2_comm2, A, 2) \
    X(motor2_comm3, A, 3)

#define CONTROL_WIRES(X) /* outputs: p2dx_con high asks for the link, rst high holds the adapter in reset */ \
    X(p2dx_con, B, 12) \
    X(rst, B, 13)

/* No wire tells that the link is up: every program waits this long first. */
#define LINK_WAIT_S 3u

/* Brings up pins, clock, tick and USART1, asks for the link, and returns at once. */
void board_start(void);

/* 72 MHz from the crystal; board_start does it. */
void clock_start(void);

/* Sits out LINK_WAIT_S. */
void board_wait_for_link(void);

#endif
