"""CRC: the remainder of 32-bit words by the polynomial 0x04C11DB7 of Ethernet.

Modelled: DR, the byte of IDR that a RESET leaves alone, RESET. Not modelled: the four cycles that a word takes.
What it does is `extension/source/devices/crc.c`: a program checks its flash with thousands of writes.
Chosen: a write of 8 or 16 bits to DR, which the manual does not allow, counts as the word of its copies.

Source: RM0008 section 4.
Invariant: DR is the remainder of all words since the last RESET, which began with 0xFFFFFFFF.
"""

from bluepill_sim.fabric.registers import NATIVE, WORD, Peripheral, Register, bits


class Crc(Peripheral):
    """CRC calculation unit."""

    KIND = "crc"
    SOURCE = "RM0008 4.4"
    REGISTERS = (
        Register(name="DR", offset=0x00, reset=WORD, on_write=NATIVE, fields="DR 31:0"),
        Register(name="IDR", offset=0x04, fields="IDR 7:0"),
        Register(name="CR", offset=0x08, readable=0, writable=bits(0), on_write=NATIVE, fields="RESET 0"),
    )
