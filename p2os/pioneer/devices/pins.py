"""Digital and analog pins, servo outputs, and the bumper ring.

Source: Pioneer 3 manual p. 49 and 50 (DIGOUT, IOpac); Pioneer 2 manual (ADSEL,
PTUPOS). What nothing drives reads as in the one packet captured from a P2-DX.
"""

from dataclasses import dataclass

from p2os.protocol.packets import IoPacket
from simbase.timing import NS_PER_MS, Nanos

#: Digital inputs and outputs of the captured P2-DX.
CAPTURED_IN, CAPTURED_OUT = 0x30, 0xF0
ANALOG_PORTS = 9
#: Selected until a client selects another (Pioneer 2 manual, ADSEL).
ANALOG_PORT = 5
#: Analog full scale, 5 V.
FULL_SCALE = 1023
#: chosen: the battery reaches the last analog port through a divider of 4.
BATTERY_DIVIDER = 4
SERVOS = 4


@dataclass(slots=True)
class Pins:
    """The robot's user pins."""

    digital_in: int = CAPTURED_IN
    digital_out: int = CAPTURED_OUT
    #: Ports 1 to 9, 0 to 1023 for 0 to 5 V.
    analog: tuple[int, ...] = (0,) * ANALOG_PORTS
    selected: int = ANALOG_PORT
    #: Widths of the servo pulses, ports 1 to 4, 10 us.
    servos: tuple[int, ...] = (0,) * SERVOS
    #: Pressed segments, bit 0 is segment 1, by live inputs and faults.
    front_pressed: int = 0
    rear_pressed: int = 0

    #: Until when KICK holds the first output.
    kicked_until: Nanos = -1

    def kick(self, milliseconds: int, now: Nanos) -> None:
        """Hold the first output for so long, once (KICK)."""
        self.kicked_until = now + max(milliseconds, 0) * NS_PER_MS

    def output(self, now: Nanos) -> int:
        """Return the outputs, bit 0 is the first."""
        return self.digital_out | (now < self.kicked_until)

    def drive(self, mask: int, states: int) -> None:
        """Set the outputs that `mask` names (DIGOUT)."""
        self.digital_out = self.digital_out & ~mask & 0xFF | states & mask

    def select(self, port: int) -> None:
        """Show an analog port in the packet (ADSEL); ports that do not exist are ignored."""
        if 1 <= port <= ANALOG_PORTS:
            self.selected = port

    def set_analog(self, port: int, raw: int) -> None:
        """Put a voltage on a port, 0 to 1023."""
        values = list(self.analog)
        values[port - 1] = min(max(raw, 0), FULL_SCALE)
        self.analog = tuple(values)

    def set_servo(self, port: int, width: int) -> None:
        """Set a servo's pulse (PTUPOS); ports that do not exist are ignored."""
        if 1 <= port <= SERVOS:
            self.servos = tuple(width if number == port else old for number, old in enumerate(self.servos, 1))

    @property
    def raw_analog(self) -> int:
        """The selected port as the packet carries it, 0 to 255."""
        return self.analog[self.selected - 1] >> 2

    def packet(self, *, digital_in: int, front: int, rear: int, infrared: int, decivolts: int, now: Nanos) -> IoPacket:
        """Return the answer to IOREQUEST.

        Args:
            digital_in: The user's inputs, with what hangs at them.
            front: Pressed front segments; in this packet low is pressed.
            rear: Pressed rear segments.
            infrared: Eyes that see something, bit 0 is eye 0; as the bumpers.
            now: The time, ns.
            decivolts: The battery, which the last analog port shows.
        """
        battery = min(round(decivolts / 10 / BATTERY_DIVIDER / 5 * FULL_SCALE), FULL_SCALE)
        return IoPacket(
            digital_in=(digital_in, ~front & 0xFF, ~rear & 0xFF, ~infrared & 0xFF),
            digital_out=(self.output(now),),
            raw_analog=(*self.analog[:-1], battery),
        )
