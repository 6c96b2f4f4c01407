/* Reads and writes the 22 wires of board.h. A read takes each port once, so that
 * the bits of one value belong to one instant; a write is one store to BSRR. */
#include "pins.h"

#include "board.h"
#include "f103.h"

enum port { PORT_A, PORT_B, PORT_C, PORTS };

struct wire {
    uint8_t port;
    uint8_t bit;
};

#define WIRE(name, letter, bit) {PORT_##letter, bit},
static const struct wire distance_wires[] = {DISTANCE_WIRES(WIRE)};
static const struct wire left_encoder_wires[] = {LEFT_ENCODER_WIRES(WIRE)};
static const struct wire right_encoder_wires[] = {RIGHT_ENCODER_WIRES(WIRE)};
static const struct wire left_motor_wires[] = {LEFT_MOTOR_WIRES(WIRE)};
static const struct wire right_motor_wires[] = {RIGHT_MOTOR_WIRES(WIRE)};
static const struct wire control_wires[] = {CONTROL_WIRES(WIRE)};
enum { P2DX_CON, RST };

#define COUNT(table) (sizeof(table) / sizeof((table)[0]))

static struct gpio *const ports[PORTS] = {GPIOA, GPIOB, GPIOC};

static void set_mode(struct wire wire, uint32_t mode)
{
    volatile uint32_t *half = wire.bit < 8 ? &ports[wire.port]->CRL : &ports[wire.port]->CRH;
    unsigned shift = 4u * (wire.bit % 8u);
    *half = (*half & ~(0xFu << shift)) | mode << shift;
}

static void set_modes(const struct wire *wires, unsigned count, uint32_t mode)
{
    for (unsigned i = 0; i < count; i++) {
        set_mode(wires[i], mode);
    }
}

static void write_wire(struct wire wire, int high)
{
    ports[wire.port]->BSRR = 1u << (high ? wire.bit : wire.bit + 16u);
}

static uint8_t read_value(const struct wire *wires, unsigned count)
{
    uint32_t levels[PORTS];
    for (unsigned i = 0; i < PORTS; i++) {
        levels[i] = ports[i]->IDR;
    }
    unsigned value = 0;
    for (unsigned i = 0; i < count; i++) {
        value |= (levels[wires[i].port] >> wires[i].bit & 1u) << i;
    }
    return (uint8_t)value;
}

/* All wires of a motor share a port. */
static void write_motor(const struct wire *wires, int code)
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

void pins_start(void)
{
    RCC->APB2ENR |= RCC_APB2ENR_AFIOEN | RCC_APB2ENR_IOPAEN | RCC_APB2ENR_IOPBEN | RCC_APB2ENR_IOPCEN;
    (void)RCC->APB2ENR; /* the clock is on two cycles later (RM0008 7.3.7) */

    /* PB3 and PB4 are JTDO and NJTRST after reset; serial-wire debugging stays.
     * The field reads as anything: write the register whole. */
    AFIO->MAPR = AFIO_MAPR_SWJ_CFG_JTAG_OFF;

    pins_motors(0, 0);
    write_wire(control_wires[RST], 0);
    write_wire(control_wires[P2DX_CON], 1);
    set_modes(left_motor_wires, COUNT(left_motor_wires), GPIO_OUTPUT_PUSH_PULL_2MHZ);
    set_modes(right_motor_wires, COUNT(right_motor_wires), GPIO_OUTPUT_PUSH_PULL_2MHZ);
    set_modes(control_wires, COUNT(control_wires), GPIO_OUTPUT_PUSH_PULL_2MHZ);

    /* No pulls of our own: the adapter board holds each line, and two of its lines
     * are strapping pins whose level at boot must stay theirs. */
    set_modes(distance_wires, COUNT(distance_wires), GPIO_INPUT_FLOATING);
    set_modes(left_encoder_wires, COUNT(left_encoder_wires), GPIO_INPUT_FLOATING);
    set_modes(right_encoder_wires, COUNT(right_encoder_wires), GPIO_INPUT_FLOATING);
}

uint8_t pins_distances(void) { return read_value(distance_wires, COUNT(distance_wires)); }
uint8_t pins_left_encoder(void) { return read_value(left_encoder_wires, COUNT(left_encoder_wires)); }
uint8_t pins_right_encoder(void) { return read_value(right_encoder_wires, COUNT(right_encoder_wires)); }

void pins_motors(int left, int right)
{
    write_motor(left_motor_wires, left);
    write_motor(right_motor_wires, right);
}
