"""A quadrature encoder: two wires whose edges follow the wheel, A first when it turns forward.

The edges of a step of the body are known when the step has been made; they are put on the wires during the step
that follows, one step late, each where the wheel came to it if it turned evenly within its step.

Invariant: after the edges of a step, the wires show the wheel's angle at the end of that step.
"""

import ctypes
import math
from array import array

from robot_bench.direct.differential.native import EncoderStruct, functions, in_struct
from robot_bench.wires.nets import Net, Strength
from simbase.state import Stateful
from simbase.timing import Nanos

#: The name under which a robot drives wires.
OWNER = "robot"
_CODES = Strength.PUSH_PULL.codes
#: The levels of A and B in the four quarters of a line.
QUARTERS = ((False, False), (True, False), (True, True), (False, True))
#: chosen: as many edges of a step as an encoder has room for at first.
_ROOM = 64


class Quadrature(Stateful):
    """One wheel's encoder.

    Args:
        a: The channel that leads when the wheel turns forward.
        b: The other one.
        edges_per_turn: Of both together.
    """

    STATE = ("_angle",)
    _angle: float = in_struct("angle", "In edges since the start.")
    #: What a step has written is read at once.
    DERIVED = ("_times", "_codes")

    def __init__(self, a: Net, b: Net, edges_per_turn: float) -> None:
        self._nets = (a, b)
        self.struct = EncoderStruct(edges_per_turn / (2 * math.pi), 0.0, _CODES)
        self._address = ctypes.addressof(self.struct)
        self._turn = functions().encoder_turn
        self._make_room(_ROOM)

    def start(self) -> None:
        """Show the wheel as it stands at time 0."""
        for net, level in zip(self._nets, QUARTERS[math.floor(self._angle) % 4], strict=True):
            net.drive(OWNER, level, Strength.PUSH_PULL, 0)

    def turn_to(self, angle_rad: float, begin: Nanos, span_ns: int) -> None:
        """Put the edges on the wires that lie between the last angle and this one, over a span from `begin` on."""
        edges = self._turn(self._address, angle_rad, begin, span_ns)
        if edges > self.struct.room:
            self._make_room(edges)
            self._turn(self._address, angle_rad, begin, span_ns)
        if edges:
            struct, (a, b) = self.struct, self._nets
            if count := struct.of_a:
                a.drive_in_turn(OWNER, self._times[:count], bytes(self._codes[:count]))
            if count := struct.of_b:
                first = struct.room
                b.drive_in_turn(OWNER, self._times[first : first + count], bytes(self._codes[first : first + count]))

    def _make_room(self, edges: int) -> None:
        """Have room for so many edges of each channel in a step."""
        self._times = array("q", bytes(8 * 2 * edges))
        self._codes = array("B", bytes(2 * edges))
        self.struct.room = edges
        self.struct.times, self.struct.codes = self._times.buffer_info()[0], self._codes.buffer_info()[0]
