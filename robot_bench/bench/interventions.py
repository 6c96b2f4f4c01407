"""What a program does to a bench while it runs: things of the world, faults, buttons, what comes in from outside.

Each is what a scenario's table of the same name does, at the present time.
"""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

from bluepill_sim.spans import Span, to_nanos
from p2os.errors import ScenarioError
from robot_bench.bench.waiting import AwaitedRun
from robot_bench.events.stream import EventStream
from robot_bench.scenario.fault_script import LINK_DOWN, FaultChange, FaultScript, load_faults
from robot_bench.scenario.hand_script import Deed, HandScript
from robot_bench.scenario.timeline import TimedAction, Timeline
from robot_bench.scenario.world_script import WorldScript, load_changes
from simbase.errors import UsageError, shown
from simbase.timing import NS_PER_S

T = TypeVar("T", bound=TimedAction)


class Interventions(AwaitedRun):
    """A run that can be changed from outside."""

    script: WorldScript
    faults: FaultScript
    hands: HandScript

    @property
    @abstractmethod
    def events(self) -> EventStream:
        """What happens."""

    @abstractmethod
    def checkpoint(self) -> None:
        """Keep the present state."""

    def place(self, name: str, **keys: object) -> None:
        """Place a thing now, as `[[obstacle]]` of a scenario does: `shape`, `x_m`, `before_sonar`, `hold_s`, ….

        Raises:
            ScenarioError: A key is unknown or missing, or a value is wrong.
            WorldError: There is one of that name.
        """
        self._change_world({"name": name, **keys})

    def move(self, name: str, **keys: object) -> None:
        """Put a thing elsewhere now: `x_m`, `y_m`, `heading_deg`.

        Raises:
            ScenarioError: As of `place`.
            WorldError: There is none of that name, or it cannot be moved.
        """
        self._change_world({"name": name, "op": "move", **keys})

    def remove(self, name: str) -> None:
        """Take a thing away now.

        Raises:
            WorldError: There is none of that name, or it cannot be taken away.
        """
        self._change_world({"name": name, "op": "remove"})

    def inject(self, words: str, during: Span | None = None) -> None:
        """Make something go wrong now: the words of a scenario's `[[fault]]`, such as "sonar-stuck 3 1.2".

        Args:
            words: The fault.
            during: It is cleared after so long; None leaves it.

        Raises:
            ScenarioError: There is no such fault, or the bench is in mode direct.
        """
        self._refuse_faults_in_mode_a()
        table: dict[str, object] = {"at_s": 0, "fault": words}
        if during is not None:
            table["for_s"] = to_nanos(during) / NS_PER_S
        changes = load_faults([table], self.scenario.parameters, "inject")
        self._intervene(self.faults, [replace(change, at=self.now + change.at) for change in changes])

    def clear(self, words: str) -> None:
        """Set right again what `inject` did.

        Raises:
            ScenarioError: The bench is in mode direct.
        """
        self._refuse_faults_in_mode_a()
        self._intervene(self.faults, [FaultChange(self.now, f"clear {words}")])

    def press(self, button: str, during: Span | None = None) -> None:
        """Press a button of the robot now: "stop-button", or a bumper such as "bumper front 1".

        Raises:
            ScenarioError: There is no such button, or the bench is in mode direct.
        """
        if button.split()[:1] not in (["stop-button"], ["bumper"]):
            raise ScenarioError(f"there is no button {shown(button)}", hint='"stop-button", or "bumper front 1"')
        self.inject(button, during)

    def drop_link(self, during: Span | None = None) -> None:
        """Break the P2OS line now, both ways; it is joined again after so long, or by `clear("link-down")`.

        Raises:
            ScenarioError: The bench is in mode direct, which has no such line.
        """
        self.inject(LINK_DOWN, during)

    def _change_world(self, table: dict[str, object]) -> None:
        changes = load_changes([{"at_s": 0, **table}], self.scenario.parameters, str(table["name"]), are_later=True)
        self._intervene(self.script, [replace(change, at=self.now + change.at) for change in changes])

    def _intervene(self, script: Timeline[T], changes: Sequence[T]) -> None:
        """Add changes to what a scenario has; `rewind` will not go on through them, but begin after them."""
        self._refuse_the_ended()
        self._waits.forget()
        script.add(*changes, now=self.now)
        self.checkpoint()

    def take_inputs(self, deeds: Sequence[Deed]) -> None:
        """Take what comes in from outside, to be done at its times, which are after now; the trace notes each.

        `rewind` forgets what came in after the state that it goes back to.

        Raises:
            UsageError: The run has been judged, or finished.
        """
        self._refuse_the_ended()
        self._waits.forget()
        self.hands.add(*deeds)

    def _refuse_the_ended(self) -> None:
        if self.events.released_until >= self.now:
            raise UsageError(f"the run was ended at {self.now / NS_PER_S:g} s", hint="make another Bench")

    def _refuse_faults_in_mode_a(self) -> None:
        if self.scenario.mode == "direct":
            raise ScenarioError(
                "a fault acts on the robot's controller, and mode direct has none", hint='mode="adapter"'
            )
