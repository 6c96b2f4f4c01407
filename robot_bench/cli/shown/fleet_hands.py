"""What hands do to robots that share a world, while they run: each at the first moment that none of them has come to.

Nothing is gone back over: the state before is kept only while it is not known whether something can be done.

Invariant: the traces are those of a run whose `[[hand]]` tables do the same at the same times.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from p2os.cli.robots.drive_deadman import DriveDeadman
from p2os.view.run_control import MOST_DPS, MOST_MPS, RunCommand
from robot_bench.bench import Bench, run_of
from robot_bench.cli.debugging.hands import drive_words, driven_by, hand_of
from robot_bench.scenario.hands.timed import Hand
from simbase.errors import P2osError, UsageError, nearest
from simbase.timing import Nanos


class FleetHands:
    """Hands on robots of one world.

    Args:
        benches: Theirs, by name, in the scenario's order.
        end: When the run is over at the latest.
    """

    def __init__(self, benches: Mapping[str, Bench], end: Nanos) -> None:
        self._benches, self._end = benches, end
        #: Who is driven from pages, and how.
        self._drives: dict[str, DriveDeadman] = {}
        #: What was done, the earliest first.
        self.done: Sequence[Hand] = ()

    def do(self, robot: str, words: str) -> None:
        """Do what words mean to a robot (empty: the first), now; bring all to that moment.

        Raises:
            UsageError: There is no such robot, they mean nothing that can be done, or the run is over.
            P2osError: It cannot be done; nothing has changed.
        """
        name = self._named(robot)
        bench, first = self._benches[name], next(iter(self._benches.values()))
        at = max(one.now for one in self._benches.values()) + 1
        if at >= min(first.end, self._end):
            raise UsageError("the run is over", hint="run it again: p2os view SCENARIO")
        hand = replace(hand_of(words, at, bench), robot=name)
        before = first.snapshot()
        run_of(bench).schedule(hand.doing)
        try:
            first.run_until(at)
        except P2osError:
            first.restore(before)
            raise
        self.done = (*self.done, hand)
        if words.split()[:1] == ["let"]:
            self._drives.pop(name, None)

    def ask(self, command: RunCommand, clock_ns: Nanos) -> None:
        """Take how a page wants a robot driven, which has to come again and again; `stop` is for all.

        Raises:
            UsageError: There is no such robot.
        """
        if command.do == "stop":
            for one in self._drives.values():
                one.stop()
        else:
            drive = self._drives.setdefault(self._named(command.robot), DriveDeadman(MOST_MPS, MOST_DPS))
            drive.ask(command.forward_mps, command.turn_dps, clock_ns)

    def drive_on(self, clock_ns: Nanos) -> None:
        """Have those driven as pages want that are driven otherwise; who was not heard of for too long stands.

        Raises:
            P2osError: As of `do`.
        """
        for name, drive in [*self._drives.items()]:
            drive.advance_to(clock_ns)
            speeds = round(drive.speeds[0], 3), round(drive.speeds[1], 1)
            driven = driven_by((one for one in self.done if one.robot == name), self._benches[name].now)
            if speeds != driven:
                self.do(name, drive_words(speeds))

    def _named(self, robot: str) -> str:
        if not robot:
            return next(iter(self._benches))
        if robot not in self._benches:
            raise UsageError(f"no robot with a program is called {robot!r}", hint=nearest(robot, self._benches))
        return robot
