"""Who commands the robot: the BluePill's pins or a game pad, never both.

Invariant: the other master's pins and reports are followed, so that nothing is
stale after a change, but they move nothing.
"""

from enum import StrEnum

from adapter_sim.mixing import CommandedSpeeds, Mixer
from adapter_sim.pins import Inputs
from adapter_sim.settings import AdapterSettings
from p2os.gamepad import Gamepad, PadReport
from simbase.state import Stateful
from simbase.timing import Nanos


class Master(StrEnum):
    """Who commands the robot; never both."""

    BLUEPILL = "bluepill"
    PAD = "pad"


class Masters(Stateful):
    """Both masters, and which of them commands.

    Args:
        inputs: The BluePill's pins.
        mixer: Turns what either asks for into speeds.
        settings: Dead zones and times of the pad.
        master: Who commands at first.
    """

    STATE = ("master", "inputs", "_pad")

    def __init__(self, inputs: Inputs, mixer: Mixer, settings: AdapterSettings, master: Master) -> None:
        self.inputs = inputs
        self.master = master
        self._mixer = mixer
        self._pad = Gamepad(
            trigger_dead=settings.pad_trigger_dead, stick_dead=settings.pad_stick_dead, loss_ns=settings.pad_loss_ns
        )

    @property
    def wants_robot(self) -> bool:
        """Tell whether the master wants the robot."""
        return self._pad.wants_robot if self.master is Master.PAD else self.inputs.wants_robot

    @property
    def speeds(self) -> CommandedSpeeds:
        """Return the speeds that the master asks for."""
        if self.master is Master.PAD:
            return self._mixer.steer(self._pad.forward, self._pad.turn)
        return self._mixer.mix(*self.inputs.motors)

    @property
    def connect_request(self) -> str:
        """Return how the master makes its connect request known."""
        return "Up was pressed" if self.master is Master.PAD else "p2dx_con is high"

    def sample(self, now: Nanos) -> tuple[bool, bool]:
        """Sample the pins; tell whether speeds may have changed, and whether the connect request has just ended."""
        motors_changed, connect_changed = self.inputs.sample(now)
        has_ended = connect_changed and not self.inputs.wants_robot
        return motors_changed, has_ended and self.master is Master.BLUEPILL

    def take_pad(self, report: PadReport, now: Nanos) -> bool:
        """Take a report; tell whether it ended the connect request."""
        wanted = self._pad.wants_robot
        self._pad.take(report, now)
        return self.master is Master.PAD and wanted and not self._pad.wants_robot

    @property
    def pad_lost_at(self) -> Nanos | None:
        """Return when the pad as master counts as lost unless a report comes before."""
        return self._pad.lost_at if self.master is Master.PAD else None

    def lose_pad(self) -> bool:
        """Take note that the pad is gone; tell whether it wanted the robot."""
        wanted = self._pad.wants_robot
        self._pad.lose()
        return wanted

    def forget_request(self) -> None:
        """Forget the pad's connect request; p2dx_con keeps standing as it stands."""
        self._pad.forget_request()

    def switch(self, master: Master) -> None:
        """Take commands from another master; the pad has to report anew."""
        self.master = master
        self._pad.lose()

    def reset(self) -> None:
        """Forget everything but who is master."""
        self.inputs.reset()
        self._pad.lose()
