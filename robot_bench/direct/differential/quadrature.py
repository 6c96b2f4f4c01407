"""A quadrature encoder: two wires whose edges follow the wheel, A first when it turns forward.

The edges of a step of the body are known when the step has been made; they are put on the wires during the step
that follows, one step late, each where the wheel came to it if it turned evenly within its step.

Invariant: after the edges of a step, the wires show the wheel's angle at the end of that step.
"""

import math
from array import array

from robot_bench.wires.nets import Net, Strength
from simbase.state import Stateful
from simbase.timing import Nanos

#: The name under which a robot drives wires.
OWNER = "robot"
_CODES = Strength.PUSH_PULL.codes
#: The levels of A and B in the four quarters of a line.
QUARTERS = ((False, False), (True, False), (True, True), (False, True))


class Quadrature(Stateful):
    """One wheel's encoder.

    Args:
        a: The channel that leads when the wheel turns forward.
        b: The other one.
        edges_per_turn: Of both together.
    """

    STATE = ("_angle",)

    def __init__(self, a: Net, b: Net, edges_per_turn: float) -> None:
        self._nets = (a, b)
        self._per_rad = edges_per_turn / (2 * math.pi)
        #: In edges since the start.
        self._angle = 0.0

    def start(self) -> None:
        """Show the wheel as it stands at time 0."""
        for net, level in zip(self._nets, QUARTERS[math.floor(self._angle) % 4], strict=True):
            net.drive(OWNER, level, Strength.PUSH_PULL, 0)

    def turn_to(self, angle_rad: float, begin: Nanos, span_ns: int) -> None:
        """Put the edges on the wires that lie between the last angle and this one, over a span from `begin` on."""
        before, after = self._angle, angle_rad * self._per_rad
        self._angle = after
        first, last = math.floor(before), math.floor(after)
        if first == last:
            return
        times, codes = (array("q"), array("q")), (bytearray(), bytearray())
        way = after - before
        # An edge lies where the angle is a whole number: forward the one that is reached, in reverse the one left.
        table, edges = (_FORWARD, range(first + 1, last + 1)) if last > first else (_REVERSE, range(first, last, -1))
        for edge in edges:
            channel, code = table[edge & 3]
            times[channel].append(begin + min(max(round((edge - before) / way * span_ns), 1), span_ns))
            codes[channel].append(code)
        for net, when, what in zip(self._nets, times, codes, strict=True):
            if when:
                net.drive_in_turn(OWNER, when, bytes(what))


#: What the edge at a number of edges does, modulo four: the channel, and the code of its level behind the edge.
_FORWARD = tuple((1 - edge % 2, _CODES[QUARTERS[edge][1 - edge % 2]]) for edge in range(4))
_REVERSE = tuple((1 - edge % 2, _CODES[QUARTERS[edge - 1][1 - edge % 2]]) for edge in range(4))
