/* Reads and writes the 22 wires of board.h. A read takes each port once, so that
 * the bits of one value belong to one instant. The motors' stand in motors_bits.c or motors_duty.c. */
#include "pins.h"

#include "board.h"
#include "f103.h"
#include "motors.h"
#include "wires.h"

static const struct wire distance_wires[] = {DISTANCE_WIRES(WIRE)};
static const struct wire left_encoder_wires[] = {LEFT_ENCODER_WIRES(WIRE)};
static const struct wire right_encoder_wires[] = {RIGHT_ENCODER_WIRES(WIRE)};
static const struct wire control_wires[] = {CONTROL_WIRES(WIRE)};
enum { P2DX_CON, RST };

struct gpio *const ports[PORTS] = {GPIOA, GPIOB, GPIOC};

static void set_mode(struct wire wire, uint32_t mode)
{
    volatile uint32_t *half = wire.bit < 8 ? &ports[wire.port]->CRL : &ports[wire.port]->CRH;
    unsigned shift = 4u * (wire.bit % 8u);
    *half = (*half & ~(0xFu << shift)) | mode << shift;
}

void set_modes(const struct wire *wires, unsigned count, uint32_t mode)
{
    for (unsigned i = 0; i < count; i++) {
        set_mode(wires[i], mode);
    }
}

void write_wire(struct wire wire, int high)
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

void pins_start(void)
{
    RCC->APB2ENR |= RCC_APB2ENR_AFIOEN | RCC_APB2ENR_IOPAEN | RCC_APB2ENR_IOPBEN | RCC_APB2ENR_IOPCEN;
    (void)RCC->APB2ENR; /* the clock is on two cycles later (RM0008 7.3.7) */

    /* PB3 and PB4 are JTDO and NJTRST after reset; serial-wire debugging stays.
     * The field reads as anything: write the register whole. */
    AFIO->MAPR = AFIO_MAPR_SWJ_CFG_JTAG_OFF;

    write_wire(control_wires[RST], 0);
    write_wire(control_wires[P2DX_CON], 1);
    motors_start();
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
