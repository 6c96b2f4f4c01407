"""Speeds of a P2OS line: which there are, by their code on the wire, and the one at power-on.

Not the time that characters take (`line_time`).
Invariant: a rate's place in `BAUDS` is its code. Source: Pioneer 3 manual, commands HOSTBAUD and AUX1BAUD.
"""

#: bit/s, by the code of HOSTBAUD, AUX1BAUD to AUX3BAUD and of the fields hostbaud and auxbaud.
BAUDS = (9600, 19200, 38400, 57600, 115200)
#: What P2OS speaks at power-on, bit/s.
DEFAULT_BAUD = BAUDS[0]
#: In words, for tables and messages: "9600, 19200, ...".
BAUDS_TEXT = ", ".join(map(str, BAUDS))
