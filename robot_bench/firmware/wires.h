/* Pins one by one: what pins.c and the motors' files share. */
#ifndef WIRES_H
#define WIRES_H

#include <stdint.h>

#include "f103.h"

enum port { PORT_A, PORT_B, PORT_C, PORTS };

struct wire {
    uint8_t port;
    uint8_t bit;
};

#define WIRE(name, letter, bit) {PORT_##letter, bit},
#define COUNT(table) (sizeof(table) / sizeof((table)[0]))

extern struct gpio *const ports[PORTS];

/* The four bits of CRL or CRH. */
void set_modes(const struct wire *wires, unsigned count, uint32_t mode);

void write_wire(struct wire wire, int high);

#endif
