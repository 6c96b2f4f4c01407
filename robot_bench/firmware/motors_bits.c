/* Motor codes in two's complement, a wire a bit; a write is one store to BSRR. */
#include "board.h"
#include "motors.h"
#include "pins.h"
#include "wires.h"

static const struct wire left_wires[] = {LEFT_MOTOR_WIRES(WIRE)};
static const struct wire right_wires[] = {RIGHT_MOTOR_WIRES(WIRE)};

/* All wires of a motor share a port. */
static void write_code(const struct wire *wires, int code)
{
    if (code < MOTOR_MIN) {
        code = MOTOR_MIN;
    }
    if (code > MOTOR_MAX) {
        code = MOTOR_MAX;
    }
    uint32_t set_and_reset = 0;
    for (unsigned i = 0; i < 3; i++) {
        int high = (unsigned)code >> i & 1u;
        set_and_reset |= 1u << (high ? wires[i].bit : wires[i].bit + 16u);
    }
    ports[wires[0].port]->BSRR = set_and_reset;
}

void motors_start(void)
{
    pins_motors(0, 0);
    set_modes(left_wires, COUNT(left_wires), GPIO_OUTPUT_PUSH_PULL_2MHZ);
    set_modes(right_wires, COUNT(right_wires), GPIO_OUTPUT_PUSH_PULL_2MHZ);
}

void pins_motors(int left, int right)
{
    write_code(left_wires, left);
    write_code(right_wires, right);
}
