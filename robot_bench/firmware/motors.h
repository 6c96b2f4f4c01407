/* The motors' wires: as three bits (motors_bits.c) or as duty and sign (motors_duty.c); a program links one of them. */
#ifndef MOTORS_H
#define MOTORS_H

/* Standing still, then the pins become outputs; pins_start calls it, with the ports' clocks on. */
void motors_start(void);

#endif
