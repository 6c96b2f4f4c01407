"""A joint motor that takes its speed from a few wires.

The value of the wires times the speed of a step is the wanted rim speed; with
`MotorCommand.DUTY` it is the duty of the first wire of that of the lowest value, backward where
the last wire is high (adapter_sim/duty.py). The motor approaches it along the ramp that the scenario gives. It reads
its wires at the start of each step of the body, so a change acts from the next step on.

Not modelled: current, load and stall; the body knows those.

Invariant: integers of µm/s throughout, exact at every step.
"""

from collections.abc import Sequence

from adapter_sim.codec import BitOrder, divide_half_away, motor_value
from adapter_sim.duty import FULL, DutyWire
from adapter_sim.settings import MotorCommand
from p2os.errors import LocalProtocolError
from robot_bench.wires.nets import Net
from simbase.state import Stateful
from simbase.timing import NS_PER_S, Nanos


class JointMotor(Stateful):
    """One wheel's motor.

    Args:
        nets: The wires of the value, least significant first.
        step_um_per_s: Rim speed of one step of the value.
        ramp_um_per_s2: Most change of speed a second; None jumps.
        dt_ns: Length of a step of the body; the ramp must come to whole µm/s a step.
        bit_order: Which wire weighs most.
        command: How the wires carry the value.
    """

    STATE = ("speed_um_per_s", "asked", "_duties")
    DERIVED = ("is_known",)

    def __init__(
        self,
        nets: Sequence[Net],
        *,
        step_um_per_s: int,
        ramp_um_per_s2: int | None,
        dt_ns: Nanos,
        bit_order: BitOrder = BitOrder.COMM3_MSB,
        command: MotorCommand = MotorCommand.BITS,
    ) -> None:
        self._nets = tuple(nets)
        self._step_um_per_s = step_um_per_s
        self._bit_order = bit_order
        #: What measures the magnitude, where that is a duty.
        self._duties = tuple(DutyWire(net.course) for net in self._nets[:1] if command is MotorCommand.DUTY)
        self._change: int | None = None
        if ramp_um_per_s2 is not None:
            self._change, rest = divmod(ramp_um_per_s2 * dt_ns, NS_PER_S)
            if rest or self._change <= 0:
                raise LocalProtocolError(f"a ramp of {ramp_um_per_s2} µm/s² is no whole number of µm/s in {dt_ns} ns")
        #: Whether `asked` is the value of all drives that the wires have had: it stays while nobody drives them anew.
        self.is_known = False
        for net in self._nets:
            net.watch(self._note_drive)
        self.speed_um_per_s = 0
        #: The value that the wires had at the last step.
        self.asked = 0

    def value(self, at: Nanos) -> int:
        """Return the signed value on the wires at the instant `at`: steps, or a duty of `FULL`."""
        for wire in self._duties:
            return -wire.duty(at) if self._nets[-1].level(at) else wire.duty(at)
        code = 0
        for bit, net in enumerate(self._nets):
            if net.level(at):
                code |= 1 << bit
        return motor_value(code, len(self._nets), self._bit_order)

    def fastest_um_per_s(self, steps: int) -> int:
        """Return the rim speed that none of so many next steps exceeds, whatever the wires come to say."""
        now, most = abs(self.speed_um_per_s), self._step_um_per_s << len(self._nets) - 1
        return max(now, most if self._change is None else min(most, now + steps * self._change))

    @property
    def is_steady(self) -> bool:
        """Tell whether all later steps have the speed of the last one, unless somebody drives the wires anew."""
        return self.is_known and self.speed_um_per_s == self._wanted

    def step(self, at: Nanos) -> int:
        """Return the rim speed in µm/s for the step of the body that starts at `at`."""
        if not self.is_known:
            self.asked = self.value(at)
            # A duty that has changed shows behind its last edge.
            self.is_known = not self._duties and all(net.last_edge <= at for net in self._nets)
        wanted = self._wanted
        if self._change is None:
            self.speed_um_per_s = wanted
        elif wanted > self.speed_um_per_s:
            self.speed_um_per_s = min(wanted, self.speed_um_per_s + self._change)
        else:
            self.speed_um_per_s = max(wanted, self.speed_um_per_s - self._change)
        return self.speed_um_per_s

    @property
    def _wanted(self) -> int:
        if self._duties:
            return divide_half_away(self.asked * (self._step_um_per_s << len(self._nets) - 1), FULL)
        return self.asked * self._step_um_per_s

    def _note_drive(self, _net: Net, _owner: str, _at: Nanos) -> None:
        self.is_known = False

    def _restored(self) -> None:
        self.is_known = False
