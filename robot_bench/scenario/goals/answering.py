"""Goals on how a program answers to its own inputs: the sensors' pins that it reads against the motors' pins it sets.

They judge by what the program has in its hands, so no world, noise or sensor that lies makes a sound program miss them:
a program that reads that something is near has to slow down, whether or not it is there. Motors are those of the
pin-out, by the values of their pins: `mean` is the mean of both, `turn` the right less the left, positive to the left.

Invariant: levels that follow each other within a millisecond are one change, since two ports are written in turn.
"""

import math
import re
from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from adapter_sim.codec import motor_value
from adapter_sim.pinout import load_pinout
from p2os.toml_record import Record
from p2os.toml_schema import LONGEST_S, Key
from robot_bench.events.kinds import MICRO, Event, PinEdge, Pose, Text
from robot_bench.events.selection import Lines, wire_named
from robot_bench.scenario.goals.signals import SKEW_NS
from robot_bench.scenario.goals.watch import GoalKind, GoalOutcome, InTime, Watch, seconds
from simbase.errors import UsageError, nearest, shown
from simbase.timing import NS_PER_S, Nanos, nanos

_SIDES = ("motor1", "motor2")
#: What the motors may be asked for.
MOTIONS = ("forward", "back", "turn", "stand")
_Pins = Annotated[tuple[str, ...], Key(kind="list", doc="pins of the BluePill, or names of wires")]
_Before = Annotated[tuple[str, ...], Key(kind="list", doc="judges only what comes after one of these")]
_Lingers = Annotated[float, Key(least=0, most=LONGEST_S, doc="a pin of the table counts as high for so long after it")]
_Bound = Annotated[float | None, Key(least=-256, most=256, doc="of the signal, in steps of the motors' values")]


class MotorWatch(Watch):
    """Follows the motors' pins and those of sensors, and is asked about each span in which they stayed as they were.

    Args:
        pins: Those of sensors.
        lingers_s: A pin of them falls so much later than its wire.
    """

    STATE: ClassVar[tuple[str, ...]] = ("_levels", "_changed", "_falls", "_failure")
    DERIVED: ClassVar[tuple[str, ...]] = ("_values", "_motions")
    kinds: tuple[type, ...] = (PinEdge,)

    def __init__(self, *pins: str, lingers_s: float = 0.0) -> None:
        pinout = load_pinout()
        self._motors = [pinout.value(side).wires for side in _SIDES]
        self._names = {pin: wire_named(pin) for pin in pins}
        motors = [net for nets in self._motors for net in nets]
        self.wires: tuple[str, ...] = tuple(dict.fromkeys([*motors, *self._names.values()]))
        self._levels: dict[str, bool] = {}
        #: Wire of a sensor that has become low → when that counts.
        self._falls: dict[str, Nanos] = {}
        self._lingers = nanos(lingers_s)
        #: When the last of them changed.
        self._changed: Nanos = 0
        self._failure = ""
        #: What follows from the levels, worked out once while they stay; None: not since they changed.
        self._values: tuple[int, int] | None = None
        self._motions: str | None = None

    def feed(self, event: Event) -> GoalOutcome | None:
        if not isinstance(event, PinEdge) or event.wire not in self.wires:
            return None
        outcome = self.advance_to(event.t)
        self._falls.pop(event.wire, None)
        if self._lingers and not event.level and self._levels.get(event.wire) and event.wire in self._names.values():
            self._falls[event.wire] = event.t + self._lingers
        else:
            self._change(event.wire, event.level, event.t)
        return outcome

    def _change(self, wire: str, level: bool, at: Nanos) -> None:
        self._levels[wire], self._changed = level, at
        self._restored()

    def _restored(self) -> None:
        self._values = self._motions = None

    def advance_to(self, limit: Nanos) -> GoalOutcome | None:
        had_failed = bool(self._failure)
        while self._falls and (due := min(self._falls.values())) <= limit:
            self._settle(due)
            for wire in [wire for wire, at in self._falls.items() if at == due]:
                del self._falls[wire]
                self._change(wire, False, due)
        self._settle(limit)
        return self.finish(limit) if self._failure and not had_failed else None

    def _settle(self, until: Nanos) -> None:
        if until - self._changed >= SKEW_NS:
            self.stayed(self._changed, until)

    def stayed(self, since: Nanos, until: Nanos) -> None:
        """Take notice that all levels were as they are now from one time to another; it comes again as that goes on."""
        raise NotImplementedError

    def is_high(self, pin: str) -> bool:
        """Tell whether a pin of the table is high."""
        return self._levels.get(self._names[pin], False)

    @property
    def values(self) -> tuple[int, int]:
        """The motors' values, left and right."""
        if self._values is None:
            left, right = (
                motor_value(sum(self._levels.get(net, False) << bit for bit, net in enumerate(nets)), len(nets))
                for nets in self._motors
            )
            self._values = left, right
        return self._values

    @property
    def motion(self) -> str:
        """What the motors are asked for."""
        if self._motions is None:
            left, right = self.values
            moves = "turn" if left + right == 0 else "forward" if left + right > 0 else "back"
            self._motions = "stand" if left == right == 0 else moves
        return self._motions

    def finish(self, end: Nanos) -> GoalOutcome:
        return GoalOutcome(met=not self._failure, says=self._failure)


class AnswersTable(Record):
    """Pins, and what the motors have to be asked for while they are so."""

    high: _Pins = ()
    any_high: _Pins = ()
    low: _Pins = ()
    moving: Annotated[tuple[str, ...], Key(kind="list", doc="judges only while the motors do one of these")] = ()
    signal: Annotated[Literal["mean", "turn"], Key(doc="of the motors' values")]
    least: _Bound = None
    most: _Bound = None
    within_s: InTime
    lingers_s: _Lingers = 0.0

    def __post_init__(self) -> None:
        _refuse_other_motions(self.moving)


class Answers(MotorWatch):
    """While pins are so, the motors' values are in bounds, but for so long."""

    STATE = ("_since", "_longest", "_longest_at")
    DERIVED = ("_wrong",)

    def __init__(self, table: AnswersTable) -> None:
        super().__init__(*table.high, *table.any_high, *table.low, lingers_s=table.lingers_s)
        self._table, self._within = table, nanos(table.within_s)
        #: Whether the levels are out of bounds; None: not worked out since they changed.
        self._wrong: bool | None = None
        #: From when they are out of bounds now.
        self._since: Nanos | None = None
        self._longest: Nanos = 0
        self._longest_at: Nanos = 0

    def _restored(self) -> None:
        super()._restored()
        self._wrong = None

    def stayed(self, since: Nanos, until: Nanos) -> None:
        if self._wrong is None:
            self._wrong = self._is_wrong()
        if not self._wrong:
            self._since = None
            return
        self._since = since if self._since is None else self._since
        if until - self._since > self._longest:
            self._longest, self._longest_at = until - self._since, self._since
        if self._longest > self._within and not self._failure:
            left, right = self.values
            says = f"the motors had {left:+d}, {right:+d} from {seconds(self._since)} on while {_when(self._table)}"
            self._failure = f"{says}, for more than {self._within / NS_PER_S:g} s"

    def _is_wrong(self) -> bool:
        table = self._table
        if table.moving and self.motion not in table.moving:
            return False
        if not all(map(self.is_high, table.high)) or any(map(self.is_high, table.low)):
            return False
        if table.any_high and not any(map(self.is_high, table.any_high)):
            return False
        left, right = self.values
        value = (left + right) / 2 if table.signal == "mean" else right - left
        return (
            not (-math.inf if table.least is None else table.least)
            <= value
            <= (math.inf if table.most is None else table.most)
        )

    def finish(self, end: Nanos) -> GoalOutcome:
        by = 1 - self._longest / self._within
        return GoalOutcome(met=not self._failure, says=self._failure, robustness=by, unit="of what is allowed")


class HasReasonTable(Record):
    """A motion, and the pins without which it must not begin."""

    motion: Annotated[str, Key(choices=MOTIONS, doc="what begins")]
    before: _Before = ()
    given: Annotated[
        tuple[str, ...], Key(kind="list", doc="judges only where each of these pins was high so long")
    ] = ()
    row: Annotated[int, Key(least=0, most=1000, doc="so many in a row need no reason")] = 0
    needs: Annotated[tuple[tuple[str, ...], ...], Key(kind="list", doc="lists of pins, of each of which one was high")]
    within_s: Annotated[float, Key(above=0, most=LONGEST_S, doc="so long before, or since then")]

    def __post_init__(self) -> None:
        _refuse_other_motions(self.before)
        if not self.needs or not all(isinstance(one, tuple) and one for one in self.needs):
            raise UsageError("needs is no list of lists of pins", hint='needs = [["DD4", "DD5"]]')


class HasReason(MotorWatch):
    """A motion begins only where pins were high just before."""

    STATE = ("_motion", "_was_high", "_rose", "_row")

    def __init__(self, table: HasReasonTable) -> None:
        super().__init__(*(pin for one in table.needs for pin in one), *table.given)
        self._table, self._within = table, nanos(table.within_s)
        self._motion: str = "stand"
        #: Pin → when it last changed, and when it last became high.
        self._was_high: dict[str, Nanos] = {}
        self._rose: dict[str, Nanos] = {}
        #: How many began without a reason since one had it.
        self._row = 0

    def feed(self, event: Event) -> GoalOutcome | None:
        outcome = super().feed(event)
        if isinstance(event, PinEdge):
            changed = {pin: event.t for pin, wire in self._names.items() if wire == event.wire}
            self._was_high |= changed
            if event.level:
                self._rose |= changed
        return outcome

    def stayed(self, since: Nanos, until: Nanos) -> None:
        before, self._motion = self._motion, self.motion
        table = self._table
        if self._motion == before or self._motion != table.motion or (table.before and before not in table.before):
            return
        missing = [one for one in table.needs if not any(self._was_high_at(pin, since) for pin in one)]
        is_given = all(self.is_high(pin) and since - self._rose.get(pin, 0) >= self._within for pin in table.given)
        self._row = self._row + 1 if missing and is_given else 0
        if self._row > table.row and not self._failure:
            self._failure = f"{table.motion} began at {seconds(since)} with no pin of {', '.join(missing[0])} high"
            self._failure += f", {self._row} times in a row" if table.row else ""

    def _was_high_at(self, pin: str, at: Nanos) -> bool:
        return self.is_high(pin) or (pin in self._was_high and at - self._was_high[pin] <= self._within)


class TurnEndsTable(Record):
    """What is low where the way is free, and which turns may go on there."""

    low: Annotated[tuple[str, ...], Key(kind="list", doc="pins that are low where the way is free")]
    within_s: InTime
    lingers_s: _Lingers = 0.0
    row: Annotated[int, Key(least=1, most=1000, doc="so many turns in one place end so, and later ones need not")] = 1
    way_m: Annotated[float, Key(least=0, most=100, doc="what begins after so much way is in another place")] = 0.0
    passage: Annotated[
        tuple[str, ...], Key(kind="list", doc="pins of `low`; a turn out of where these alone were high needs not")
    ] = ()
    passage_s: Annotated[float, Key(least=0, most=LONGEST_S, doc="for so long since the last turn")] = 0.0

    def __post_init__(self) -> None:
        if not self.low:
            raise UsageError("low is empty", hint='low = ["DD4", "DD5"]')
        if other := [pin for pin in self.passage if pin not in self.low]:
            raise UsageError(f"{shown(other[0])} of passage is no pin of low", hint=f"one of {', '.join(self.low)}")


class TurnEnds(MotorWatch):
    """A turn that was begun going forward ends soon after its way is free, but for later ones in one place."""

    STATE = (
        "_motion", "_is_judged", "_place", "_way_um", "_turns", "_passing", "_passed", "_since", "_longest",
        "_longest_at",
    )  # fmt: skip
    kinds = (PinEdge, Pose)

    def __init__(self, table: TurnEndsTable) -> None:
        super().__init__(*table.low, lingers_s=table.lingers_s)
        self._table, self._within = table, nanos(table.within_s)
        self._between = [pin for pin in table.low if pin not in table.passage]
        self._motion: str = "stand"
        self._is_judged = False
        self._place: Pose | None = None
        #: Since the last turn; far enough where there was none.
        self._way_um: float = math.inf
        #: How many were begun in this place.
        self._turns = 0
        #: From when it is in a passage, and for how long it was before that, since the last turn.
        self._passing: Nanos | None = None
        self._passed: Nanos = 0
        #: From when it turns though its way is free.
        self._since: Nanos | None = None
        self._longest: Nanos = 0
        self._longest_at: Nanos = 0

    def feed(self, event: Event) -> GoalOutcome | None:
        if not isinstance(event, Pose):
            return super().feed(event)
        outcome = self.advance_to(event.t)
        if self._place is not None:
            self._way_um += math.hypot(event.x - self._place.x, event.y - self._place.y)
        self._place = event
        return outcome

    def stayed(self, since: Nanos, until: Nanos) -> None:
        self._pass(since)
        before, self._motion = self._motion, self.motion
        if self._motion == "turn":
            if before != "turn":
                self._begin(before)
            is_free = self._is_judged and not any(map(self.is_high, self._table.low))
            self._since = (since if self._since is None else self._since) if is_free else None
        elif before == "turn":
            self._way_um, self._passed, self._since = 0.0, 0, None
        if self._since is not None and until - self._since > self._longest:
            self._longest, self._longest_at = until - self._since, self._since
        if self._longest > self._within and not self._failure:
            says = f"it turned on from {seconds(self._longest_at)}, where {', '.join(self._table.low)} were low"
            self._failure = f"{says}, for more than {self._within / NS_PER_S:g} s"

    def _pass(self, since: Nanos) -> None:
        pins = self._table.passage
        is_in = bool(pins) and all(map(self.is_high, pins)) and not any(map(self.is_high, self._between))
        if is_in and self._passing is None:
            self._passing = since
        elif not is_in and self._passing is not None:
            self._passed, self._passing = self._passed + since - self._passing, None

    def _begin(self, before: str) -> None:
        self._is_judged = False
        if before == "forward":
            self._turns = 1 if self._way_um >= self._table.way_m * MICRO else self._turns + 1
            is_out = bool(self._table.passage) and self._passed >= nanos(self._table.passage_s)
            self._is_judged = self._turns <= self._table.row and not is_out

    def finish(self, end: Nanos) -> GoalOutcome:
        by = 1 - self._longest / self._within
        return GoalOutcome(met=not self._failure, says=self._failure, robustness=by, unit="of what is allowed")


class LastsTable(Record):
    """A motion, and how long it may or has to last."""

    motion: Annotated[str, Key(choices=MOTIONS, doc="which")]
    before: _Before = ()
    least_s: Annotated[float | None, Key(above=0, most=LONGEST_S, doc="no shorter")] = None
    most_s: Annotated[float | None, Key(above=0, most=LONGEST_S, doc="no longer")] = None

    def __post_init__(self) -> None:
        _refuse_other_motions(self.before)


class Lasts(MotorWatch):
    """A motion lasts so long each time: no shorter, no longer."""

    STATE = ("_motion", "_begun", "_is_judged")

    def __init__(self, table: LastsTable) -> None:
        super().__init__()
        self._table = table
        self._least, self._most = nanos(table.least_s or 0.0), nanos(table.most_s or LONGEST_S)
        self._motion: str = "stand"
        self._begun: Nanos = 0
        self._is_judged = table.motion == "stand" and not table.before

    def stayed(self, since: Nanos, until: Nanos) -> None:
        table = self._table
        if self.motion != self._motion:
            self._judge(since - self._begun, is_over=True)
            self._is_judged = self.motion == table.motion and (not table.before or self._motion in table.before)
            self._motion, self._begun = self.motion, since
        self._judge(until - self._begun, is_over=False)

    def _judge(self, lasted: Nanos, *, is_over: bool) -> None:
        if not self._is_judged or self._failure or not (lasted > self._most or (is_over and lasted < self._least)):
            return
        bound, word = (self._most, "most") if lasted > self._most else (self._least, "least")
        says = f"{self._table.motion} from {seconds(self._begun)} on lasted {lasted / NS_PER_S:.3f} s"
        self._failure = f"{says}, {bound / NS_PER_S:g} s at {word}"


class ReportsMotionTable(Record):
    """A motion, and what is printed as it begins."""

    motion: Annotated[str, Key(choices=MOTIONS, doc="what begins")]
    before: _Before = ()
    matches: Annotated[str, Key(doc="a regular expression that is found in a line")]
    within_s: Annotated[float, Key(above=0, most=LONGEST_S, doc="the line comes so long before or after, at most")]

    def __post_init__(self) -> None:
        _refuse_other_motions(self.before)
        try:
            re.compile(self.matches)
        except re.error as error:
            raise UsageError(f"{self.matches!r} is no regular expression: {error}") from error


class ReportsMotion(MotorWatch):
    """As a motion begins a line is printed that says so, one for each time."""

    STATE = ("_motion", "_lines", "_printed", "_due")
    kinds = (PinEdge, Text)

    def __init__(self, table: ReportsMotionTable) -> None:
        super().__init__()
        self._table, self._within = table, nanos(table.within_s)
        self._found = re.compile(table.matches).search
        self._motion: str = "stand"
        self._lines = Lines()
        #: When lines came that no motion has been found for, and when motions began without a line.
        self._printed: list[Nanos] = []
        self._due: list[Nanos] = []

    def feed(self, event: Event) -> GoalOutcome | None:
        if not isinstance(event, Text):
            return super().feed(event)
        outcome = self.advance_to(event.t)
        line = self._lines.take(event)
        if line is not None and event.data.endswith(b"\n") and self._found(line):
            if self._due:
                del self._due[0]
            else:
                self._printed.append(event.t)
        return outcome

    def stayed(self, since: Nanos, until: Nanos) -> None:
        table, before, self._motion = self._table, self._motion, self.motion
        if self._motion != before and self._motion == table.motion and (not table.before or before in table.before):
            self._printed = [at for at in self._printed if since - at <= self._within]
            if self._printed:
                del self._printed[0]
            else:
                self._due.append(since)

    def advance_to(self, limit: Nanos) -> GoalOutcome | None:
        outcome = super().advance_to(limit)
        if not self._due or limit - self._due[0] <= self._within or self._failure:
            return outcome
        self._failure = f"{self._table.motion} began at {seconds(self._due[0])}, and no line with "
        self._failure += f"{self._table.matches!r} came within {self._within / NS_PER_S:g} s"
        return self.finish(limit)


def _refuse_other_motions(motions: tuple[str, ...]) -> None:
    for one in motions:
        if one not in MOTIONS:
            raise UsageError(f"there is no motion {shown(one)}", hint=nearest(str(one), MOTIONS))


def _when(table: AnswersTable) -> str:
    parts = [f"{', '.join(table.high)} high"] * bool(table.high)
    parts += [f"one of {', '.join(table.any_high)} high"] * bool(table.any_high)
    parts += [f"{', '.join(table.low)} low"] * bool(table.low)
    if table.moving:
        parts.append(f"motion {' or '.join(table.moving)}")
    return " and ".join(parts) or "anything"


def _bounds(table: AnswersTable) -> str:
    if table.least is not None and table.least == table.most:
        return f"exactly {table.least:g}"
    given = [("at least", table.least), ("at most", table.most)]
    return " and ".join(f"{word} {value:g}" for word, value in given if value is not None)


def _lasting(table: LastsTable) -> str:
    given = [("at least", table.least_s), ("at most", table.most_s)]
    return " and ".join(f"{word} {value:g} s" for word, value in given if value is not None)


def _after(before: tuple[str, ...]) -> str:
    return f" after {' or '.join(before)}" if before else ""


KINDS: Mapping[str, GoalKind] = {
    "answers": GoalKind(
        AnswersTable,
        lambda table: f"with {_when(table)}, has the motors' {table.signal} {_bounds(table)} in {table.within_s:g} s",
        Answers, doc="while the sensors' pins are so and the motors are `moving` so, `mean` or `turn` of their values "
        "is out of bounds for no longer than that", any_of=("least", "most"), holds_anywhere=True,
    ),
    "has_reason": GoalKind(
        HasReasonTable,
        lambda table: f"{'with ' + ', '.join(table.given) + ' high ' if table.given else ''}begins motion "
        f"{table.motion}{_after(table.before)} only with "
        + " and ".join(f"one of {', '.join(one)}" for one in table.needs) + " high"
        + (f", but for {table.row} in a row" if table.row else ""),
        HasReason, doc="a motion begins only where of each list one pin was high until so long before; with `given`, "
        "only where these pins have been high for so long is it judged; so many in a `row` need no reason",
        holds_anywhere=True,
    ),
    "turn_ends": GoalKind(
        TurnEndsTable,
        lambda table: f"ends turns within {table.within_s:g} s of {', '.join(table.low)} low, the first {table.row} "
        "in one place",
        TurnEnds, doc="a turn on the spot that follows a way forward ends soon after all of `low` are; not judged are "
        "those after the first `row` in one place, and those out of a passage", holds_anywhere=True,
    ),
    "lasts": GoalKind(
        LastsTable, lambda table: f"has motion {table.motion}{_after(table.before)} last {_lasting(table)}",
        Lasts, doc="each time, the motors ask for a motion no shorter and no longer", any_of=("least_s", "most_s"),
        holds_anywhere=True,
    ),
    "reports_motion": GoalKind(
        ReportsMotionTable,
        lambda table: f"prints {table.matches!r} within {table.within_s:g} s of motion {table.motion}"
        f"{_after(table.before)}",
        ReportsMotion, doc="each time that the motors begin a motion a line comes that matches, so long before "
        "or after it at most", holds_anywhere=True,
    ),
}  # fmt: skip
