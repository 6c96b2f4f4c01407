"""What a program waits for and asserts of a bench: times, events, levels, texts, places.

Waits are counted from the event that was waited for last, where nothing was done since, so that two in a row bound a
latency exactly.
"""

import math
import re
from abc import abstractmethod
from collections.abc import Callable
from typing import Self

from bluepill_sim.spans import Span, to_nanos
from p2os.pioneer.world.model import Pose
from robot_bench.bench.robot_run import RunningBench
from robot_bench.events.codec import events_of
from robot_bench.events.expectation import ExpectationError
from robot_bench.events.kinds import Event
from robot_bench.events.selection import SELECTORS, Wires, bus_of, select, wire_named
from robot_bench.events.words import last_words
from robot_bench.recording.recorder import SAMPLE_NS
from simbase.errors import UsageError
from simbase.timing import NS_PER_S, NS_PER_US, Nanos, Reached


class Expectations(RunningBench):
    """A run of which events, levels, texts and places can be expected."""

    @property
    @abstractmethod
    def end(self) -> Nanos:
        """Return when the run ends, as far as is known now."""

    @property
    @abstractmethod
    def pose(self) -> Pose:
        """Where the robot is now."""

    @abstractmethod
    def _run_to(self, wanted: Nanos, advance: Callable[[int], Reached] | None = None) -> None:
        """Run to a time, or to the end."""

    def level(self, wire: str) -> bool:
        """Return the level on a wire now.

        Args:
            wire: Its name in the pin-out (`motor1_comm1`), or the BluePill's pin (`PB7`).

        Raises:
            UsageError: There is no such wire.
        """
        return self._run.harness[wire_named(wire, self._wires)].level(self.now)

    @property
    def _wires(self) -> Wires | None:
        """The wires of a robot on own pins; None: those of the pin-out."""
        own = self.scenario.own_robot
        return None if own is None else own.wires

    def run_until(
        self,
        end: "Span | str | Callable[[Self], bool]",
        advance: Callable[[int], Reached] | None = None,
        *,
        within: Span | None = None,
    ) -> Event | None:
        """Run to a time or until something happens; no further than the run lasts, nor beyond a debugger's halt.

        Args:
            end: A time counted from the beginning: nanoseconds, or a text such as "2.5 s". Or an event in words, as
                of `robot_bench.events.selection` ("pin PB12 high"). Or a function of the bench, asked each 50 ms.
            advance: As of `RunLoop.run_until`; with a time only.
            within: With a condition: how long to wait for it from now on; None waits to the end of the run.

        Returns:
            The event that was waited for; None where it did not come, and with a time or a function. The bench stands
            up to 50 ms after it.

        Raises:
            UsageError: The run has been judged, or finished; the words mean no events.
            BluePillError: `end` is no time.
        """
        if callable(end):
            asked = end
            self._step_until(lambda: asked(self), self._limit(within, self.now))
            return None
        if isinstance(end, str) and (end.split() or [""])[0] in SELECTORS:
            return self._wait_for(end, within)
        self._run_to(to_nanos(end), advance)
        return None

    def _limit(self, within: Span | None, since: Nanos) -> Nanos:
        return self.end if within is None else since + to_nanos(within)

    def _step_until(
        self, is_done: Callable[[], bool], limit: Nanos, before_step: Callable[[], None] = lambda: None
    ) -> bool:
        """Run in steps of 50 ms until something is so, or to a time; tell whether it is so."""
        while not (so := is_done()) and self.now < min(limit, self.end):
            before_step()
            self._run_to(min(limit, (self.now // SAMPLE_NS + 1) * SAMPLE_NS))
        return so

    def _wait_for(self, words: str, within: Span | None) -> Event | None:
        """Run until an event happens, counted from the last one that was waited for where nothing was done since."""
        selector = select(words, self._wires)
        if (bus := bus_of(words)) and bus not in self.scenario.record:
            raise UsageError(f"{bus} is not recorded", hint=f'record = ["{bus}"] in the scenario')
        limit = self._limit(within, self._run.waits.since(self.now))
        return self._run.waits.wait(selector, limit, lambda: self.now, self._step_until)

    def expect(self, words: str, within: Span | None = None) -> Event:
        """Run until an event happens and return it.

        Args:
            words: As of `robot_bench.events.selection`: "contact", "pin PB12 high", "robot stops".
            within: How long to wait: from the event on that was expected last, where nothing was done since, else from
                now on. So a second `expect` is an exact bound of a latency. None waits to the end of the run.

        Raises:
            ExpectationError: It did not happen; the message has the last events.
            UsageError: The words mean no events.
        """
        since = self._run.waits.since(self.now)
        found = self._wait_for(words, within)
        if found is None:
            raise self._unmet(f"{words!r} did not happen", since, self._limit(within, since))
        return found

    def expect_no(self, words: str, during: Span) -> None:
        """Run for a time in which an event must not happen.

        Raises:
            ExpectationError: It happened.
            UsageError: The words mean no events.
        """
        since = self._run.waits.since(self.now)
        found = self._wait_for(words, during)
        if found is not None:
            raise self._unmet(f"{words!r} happened at {found.t / NS_PER_S:.3f} s", since)

    def expect_text(self, text: str | re.Pattern[str], within: Span | None = None) -> Event:
        """Run until the firmware prints a line that holds a text, or matches a pattern; return it.

        Raises:
            ExpectationError: It did not.
        """
        words = f"sends {text}" if isinstance(text, str) else f"matches {text.pattern}"
        return self.expect(f"usart1 {words}", within)

    def expect_pin(self, pin: str, level: str, within: Span | None = None) -> None:
        """Run until a wire has a level, `high` or `low`; at once where it has it.

        Raises:
            ExpectationError: It had not.
            UsageError: There is no such wire or level.
        """
        select(f"pin {pin} {level}", self._wires)
        if self.level(pin) is not (level == "high"):
            self.expect(f"pin {pin} {level}", within)

    def expect_pose(
        self,
        *,
        x_m: float | None = None,
        y_m: float | None = None,
        heading_deg: float | None = None,
        tolerance_m: float = 0.05,
        tolerance_deg: float = 5.0,
        within: Span | None = None,
    ) -> Pose:
        """Run until the robot is at a place, or has a heading; what is None is not looked at.

        Raises:
            ExpectationError: It was not; the message says where it is.
        """
        since = self.now

        def is_there() -> bool:
            pose = self.pose
            off_m = math.hypot(0 if x_m is None else pose.x_m - x_m, 0 if y_m is None else pose.y_m - y_m)
            turn = 0.0 if heading_deg is None else pose.heading_rad - math.radians(heading_deg)
            return off_m <= tolerance_m and abs(math.remainder(turn, math.tau)) <= math.radians(tolerance_deg)

        if not self._step_until(is_there, self._limit(within, since)):
            rows = (("x", x_m, " m"), ("y", y_m, " m"), ("heading", heading_deg, "°"))
            wanted = ", ".join(f"{name} {value:g}{unit}" for name, value, unit in rows if value is not None)
            pose = self.pose
            here = f"x {pose.x_m:.3f} m, y {pose.y_m:.3f} m, heading {math.degrees(pose.heading_rad):.1f}°"
            raise self._unmet(f"the robot was not at {wanted}; it is at {here}", since)
        return self.pose

    def _unmet(self, what: str, since: Nanos, limit: Nanos | None = None) -> ExpectationError:
        until = self.now if limit is None else min(limit, self.now)
        if limit is not None and limit != self.end and 0 < limit - since < NS_PER_US:
            what = f"{what} within {limit - since} ns (a number without a unit is nanoseconds)"
        is_cut = limit is not None and limit > self.end
        return ExpectationError(
            f"{what}, from {since / NS_PER_S:.3f} s to {until / NS_PER_S:.3f} s", self.last_events(),
            hint=f"the run is over at {self.end / NS_PER_S:g} s: duration_s makes it longer" if is_cut else None,
        )  # fmt: skip

    def last_events(self, count: int = 8) -> list[str]:
        """Return what happened last, a line each with its time; poses, edges, packets and ranges aside."""
        return last_words(events_of(self._run.recorder.lines()), count)
