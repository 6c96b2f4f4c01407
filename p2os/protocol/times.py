"""The times of P2OS that more than one part lives by: one table, for Python and, generated, for the adapter's C++.

Not here: what one part alone has chosen (its settings), and a robot's own times, which its FLASH may set.
Invariant: PULSE and LIVENESS are below WATCHDOG, so that a link that lives never lets the robot stop.
Source: Pioneer 2 manual, tables of CONFIGpac and of client commands; # chosen: what has no source there.
"""

from simbase.timing import NS_PER_MS, NS_PER_S, Nanos

#: Between two standard packets, as shipped (CONFIGpac sipcycle).
CYCLE_NS: Nanos = 100 * NS_PER_MS
#: A robot that hears no sound frame for so long stops, as shipped (CONFIGpac watchdog).
WATCHDOG_NS: Nanos = 2 * NS_PER_S
#: chosen: a client that sends nothing else sends PULSE so often; a quarter of the watchdog.
PULSE_NS: Nanos = 500 * NS_PER_MS
#: chosen: a session without a sound packet for so long is lost; three cycles and a frame.
LIVENESS_NS: Nanos = 3 * CYCLE_NS + 50 * NS_PER_MS
