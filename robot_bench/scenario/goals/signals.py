"""Goals on wires: the values of the motors' pins, a level that holds, a wave in bounds."""

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Annotated, Literal

from adapter_sim.codec import motor_value
from adapter_sim.pinout import load_pinout
from p2os.errors import ScenarioError
from p2os.toml_record import Record
from p2os.toml_schema import LONGEST_S, Key
from robot_bench.events.kinds import Event, PinEdge, Wave
from robot_bench.events.selection import wire_named
from robot_bench.scenario.goals.watch import From, GoalKind, GoalOutcome, OfEvents, To, Watch, seconds, window_in_words
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos, nanos

#: chosen: two motor values that follow each other within this are one change (two ports are written in turn).
SKEW_NS: Nanos = 1 * NS_PER_MS
_SIDES = ("motor1", "motor2")
_Hz = Annotated[float | None, Key(above=0, most=1e8, doc="of each period")]
_Duty = Annotated[float | None, Key(least=0, most=1, doc="the high part of each period")]


class MotorSequenceTable(Record):
    """Values of the motors' pins, one pair after the other."""

    values: Annotated[tuple[tuple[int, int], ...], Key(doc="`[[left, right], …]`")]
    held_s: Annotated[float, Key(least=0, most=LONGEST_S, doc="each is held so long")] = 0.0

    def __post_init__(self) -> None:
        if not all(_is_pair(pair) for pair in self.values):
            hint = "of -128 to 127"
            raise ScenarioError("values must be pairs of motor values, [[left, right], ...]", hint=hint)


def _is_pair(pair: object) -> bool:
    return isinstance(pair, tuple) and len(pair) == 2 and all(type(one) is int and -128 <= one <= 127 for one in pair)


class MotorSequence(Watch):
    """The motor pins show exactly these values, each held long enough."""

    STATE = ("_bits", "_seen", "_is_decided")
    kinds = (PinEdge,)

    def __init__(self, table: MotorSequenceTable) -> None:
        self._wanted: list[tuple[int, ...]] = list(table.values)
        self._held_ns = nanos(table.held_s)
        pinout = load_pinout()
        self._nets = [pinout.value(side).wires for side in _SIDES]
        self._place_of = {net: (side, bit) for side, nets in enumerate(self._nets) for bit, net in enumerate(nets)}
        self.wires = tuple(self._place_of)
        self._bits = [0, 0]
        #: Since when, and the values of both motors.
        self._seen: list[tuple[Nanos, tuple[int, ...]]] = []
        self._is_decided = False

    def feed(self, event: Event) -> GoalOutcome | None:
        if isinstance(event, PinEdge) and event.wire in self._place_of:
            side, bit = self._place_of[event.wire]
            self._bits[side] = self._bits[side] & ~(1 << bit) | event.level << bit
            at = event.t
            if self._seen and at - self._seen[-1][0] < SKEW_NS:
                at = self._seen.pop()[0]  # the change began with the first of its edges
            pair = tuple(motor_value(bits, len(nets)) for bits, nets in zip(self._bits, self._nets, strict=True))
            if not self._seen or self._seen[-1][1] != pair:
                self._seen.append((at, pair))
        return None

    def advance_to(self, limit: Nanos) -> GoalOutcome | None:
        """Decide by what has settled: a value that is wrong, or was not held."""
        settled = [item for item in self._seen if item[0] <= limit - SKEW_NS]
        pairs = [pair for _, pair in settled]
        if self._is_decided or (pairs == self._wanted[: len(pairs)] and not self._short(settled)):
            return None
        self._is_decided = True
        return self.finish(limit)

    def finish(self, end: Nanos) -> GoalOutcome:
        pairs = [pair for _, pair in self._seen]
        if pairs == self._wanted[: len(pairs)] and (says := self._short(self._seen)):
            return GoalOutcome(met=False, says=says)
        if pairs != self._wanted:
            return GoalOutcome(
                met=False, says=f"the motor pins said {shown_pairs(pairs)}, not {shown_pairs(self._wanted)}"
            )
        says = self._short([*self._seen, (end, ())])
        return GoalOutcome(met=not says, says=says)

    def _short(self, seen: list[tuple[Nanos, tuple[int, ...]]]) -> str:
        for (begin, pair), (end, _) in pairwise(seen):
            if end - begin < self._held_ns:
                held_s = (end - begin) / NS_PER_S
                return f"{pair} was held {held_s:.3f} s, {self._held_ns / NS_PER_S:g} s are wanted"
        return ""


def shown_pairs(pairs: Sequence[tuple[int, ...]]) -> str:
    """Return motor values as a person reads them."""
    return " ".join(f"{left:+d}/{right:+d}" for left, right in pairs)


class OfPin(OfEvents):
    """A wire over a span of time."""

    pin: Annotated[str, Key(doc="the BluePill's pin, or a wire's name")]
    from_s: From = None
    to_s: To = None

    @property
    def wire(self) -> str:
        """The wire's name.

        Raises:
            UsageError: There is none of that name.
        """
        return wire_named(self.pin, self.wires)

    @property
    def span(self) -> tuple[Nanos, Nanos]:
        """When it begins and ends."""
        return nanos(self.from_s or 0.0), nanos(self.to_s or LONGEST_S)


class PinHoldsTable(OfPin):
    """A level of a wire."""

    level: Annotated[Literal["high", "low"], Key(doc="which it has all the time")]


class PinHolds(Watch):
    """A wire has one level over a span of time."""

    STATE = ("_level", "_wrong")
    kinds = (PinEdge,)

    def __init__(self, table: PinHoldsTable) -> None:
        self._name = table.pin
        self.wires = (table.wire,)
        self._wanted = table.level == "high"
        self._from, self._to = table.span
        self._level: bool | None = None
        self._wrong: Nanos | None = None

    def feed(self, event: Event) -> GoalOutcome | None:
        if not isinstance(event, PinEdge):
            return None
        outcome = self._look(self._from) if event.t > self._from else None
        # Of what comes after the span nothing is known: it is no level of the span.
        self._level = event.level if event.t <= self._to else None
        return outcome or (self._look(event.t) if self._from <= event.t else None)

    def advance_to(self, limit: Nanos) -> GoalOutcome | None:
        outcome = self._look(self._from) if limit >= self._from else None
        return outcome or (self.finish(limit) if limit >= self._to else None)

    def finish(self, end: Nanos) -> GoalOutcome:
        if self._wrong is None:
            return GoalOutcome(met=True)
        is_at = "low" if self._wanted else "high"
        return GoalOutcome(met=False, says=f"{self._name} was {is_at} at {seconds(self._wrong)}")

    def _look(self, at: Nanos) -> GoalOutcome | None:
        if self._wrong is not None or self._level is None or self._level is self._wanted:
            return None
        self._wrong = at
        return self.finish(at)


class WaveTable(OfPin):
    """Bounds of the periods of a wire."""

    least_hz: _Hz = None
    most_hz: _Hz = None
    least_duty: _Duty = None
    most_duty: _Duty = None
    periods: Annotated[int, Key(least=1, most=1_000_000_000, doc="so many at least")] = 1


class WaveWithin(Watch):
    """Every period of a wire, from its rise to the next, is in bounds."""

    STATE = ("_rise", "_fall", "_count", "_failure", "_hz")
    kinds = (PinEdge, Wave)

    def __init__(self, table: WaveTable) -> None:
        self._name, self._wire = table.pin, table.wire
        self.wires = (self._wire,)
        self._hz_bounds = table.least_hz or 0.0, table.most_hz or math.inf
        self._duty_bounds = table.least_duty or 0.0, math.inf if table.most_duty is None else table.most_duty
        self._periods = table.periods
        self._from, self._to = table.span
        self._rise: Nanos | None = None
        self._fall: Nanos | None = None
        self._count = 0
        self._failure = ""
        self._hz: tuple[float, float] = (math.inf, 0.0)

    def feed(self, event: Event) -> GoalOutcome | None:
        if isinstance(event, Wave) and event.wire == self._wire and self._from <= event.t <= self._to and event.period:
            self._count += self._periods
            return self._take(event.t, event.frequency_hz, event.duty)
        if not isinstance(event, PinEdge):
            return None
        if not event.level:
            self._fall = event.t
            return None
        rise, self._rise = self._rise, event.t
        if rise is None or self._fall is None or rise < self._from or event.t > self._to or self._fall <= rise:
            return None
        self._count += 1
        period_ns = event.t - rise
        return self._take(event.t, NS_PER_S / period_ns, (self._fall - rise) / period_ns)

    def advance_to(self, limit: Nanos) -> GoalOutcome | None:
        return self.finish(limit) if limit >= self._to else None

    def _take(self, at: Nanos, hz: float, duty: float) -> GoalOutcome | None:
        self._hz = min(self._hz[0], hz), max(self._hz[1], hz)
        is_within = (
            self._hz_bounds[0] <= hz <= self._hz_bounds[1] and self._duty_bounds[0] <= duty <= self._duty_bounds[1]
        )
        if is_within or self._failure:
            return None
        self._failure = f"{self._name} had {hz:.4g} Hz and {duty:.1%} duty in the period up to {seconds(at)}"
        return self.finish(at)

    def finish(self, end: Nanos) -> GoalOutcome:
        if self._failure:
            return GoalOutcome(met=False, says=self._failure)
        if self._count < self._periods:
            return GoalOutcome(
                met=False, says=f"{self._name} had {self._count} whole periods, {self._periods} are wanted"
            )
        by = min(self._hz[0] - self._hz_bounds[0], self._hz_bounds[1] - self._hz[1])
        return GoalOutcome(met=True, robustness=by if math.isfinite(by) else None, unit="Hz")


KINDS: Mapping[str, GoalKind] = {
    "motor_sequence": GoalKind(
        MotorSequenceTable, lambda table: f"sets the motors to {shown_pairs(table.values)}", MotorSequence,
        doc="the motor pins showed exactly these values, each held so long", is_scripted=True,
    ),
    "pin_holds": GoalKind(
        PinHoldsTable,
        lambda table: f"holds {table.pin} {table.level}{window_in_words(from_s=table.from_s, to_s=table.to_s)}",
        PinHolds, doc="the wire has this level all the time",
    ),
    "wave": GoalKind(
        WaveTable,
        lambda table: f"has a wave in bounds on {table.pin}{window_in_words(from_s=table.from_s, to_s=table.to_s)}",
        WaveWithin, doc="every period is in bounds, and there are so many",
    ),
}  # fmt: skip
