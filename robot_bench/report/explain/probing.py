"""What inputs change in a program: a replay with the recorded level against one with another, and the first difference.

A program takes *notice* of an input when its way through its code or its variables differ; it *answers* when its
outputs or its text do. An input that is never noticed may as well not be connected.

Invariant: what is found is a difference of two exact replays, never a likelihood.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise, zip_longest

from adapter_sim.pinout import WireRole
from bluepill_sim.core import BLOCK
from bluepill_sim.core.recorder import RECORD
from robot_bench.report.explain.replay import Branch, ChipReplay, Hold, ReplayPart, SourcePlace
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos

#: chosen: how often variables are compared.
_MEMORY_NS: Nanos = 10 * NS_PER_MS
#: chosen: for so long everything is held low before one sensor is raised, and so long that is held.
QUIET_NS: Nanos = 2 * NS_PER_S
ANSWER_NS: Nanos = 1500 * NS_PER_MS
#: chosen: a program that has not noticed an input after so long does not.
NOTICE_NS: Nanos = 3 * NS_PER_S

#: chosen: motors that are otherwise for less do the same: another way through a program shifts its outputs, and two
#: ports are written in turn.
SAME_NS: Nanos = 5 * NS_PER_MS
#: chosen: most programs notice in so long, so that is tried first.
SOON_NS: Nanos = 50 * NS_PER_MS

Codes = tuple[int, int]
#: Since when the motors had which codes.
Way = Sequence[tuple[Nanos, Codes]]


@dataclass(frozen=True, slots=True, kw_only=True)
class InputEffect:
    """What inputs have changed; None where nothing did."""

    noticed: Nanos | None
    #: Where the program's way parted, or which variable differed first.
    by: str
    answered: Nanos | None
    #: The motors' codes at the end, with the inputs as recorded, and as they were held.
    before: Codes
    after: Codes
    #: The motors' codes over the time, with the inputs as recorded.
    way: Way = ()
    #: For how long the motors had other codes, and of the longest time which: as recorded, and as the inputs were held.
    otherwise_ns: Nanos = 0
    otherwise: tuple[Codes, Codes] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorResponse:
    """What a program does when one sensor alone sees something."""

    at: Nanos
    base: Codes
    codes: Codes
    noticed: Nanos | None
    answered: Nanos | None
    #: For how long the motors had other codes.
    otherwise_ns: Nanos = 0

    @property
    def turn(self) -> int:
        """How much further left (positive) it turns, in motor steps."""
        return (self.codes[1] - self.codes[0]) - (self.base[1] - self.base[0])


class Prober:
    """Compares replays of one run."""

    def __init__(self, replay: ChipReplay) -> None:
        self.replay = replay
        self.sensors = replay.role(WireRole.DISTANCE)
        self._plain: dict[tuple[Nanos, Nanos], ReplayPart] = {}
        #: At a time, for a span: the chip with no sensor's pin high, and what it does; what one sensor alone changes.
        self._quiet: dict[tuple[Nanos, Nanos], tuple[Branch, ReplayPart]] = {}
        self._answers: dict[tuple[Nanos, Nanos, str], SensorResponse] = {}

    def codes_with(self, seen: ReplayPart, at: Nanos) -> Codes:
        """Return the codes at a time in a replay."""
        return self._codes(seen.levels_at(at))

    def way(self, seen: ReplayPart, since: Nanos, until: Nanos) -> Way:
        """Return the codes over a time in a replay."""
        levels = seen.levels_at(since)
        found = [(since, self._codes(levels))]
        for t, net, level in seen.edges:
            if since < t <= until:
                levels[net] = level
                found.append((t, self._codes(levels)))
        return found

    def _codes(self, levels: Mapping[str, bool]) -> Codes:
        found = []
        for motor in (1, 2):
            nets = [net for net in self.replay.outputs if net.startswith(f"motor{motor}_")]
            code = sum(levels[net] << bit for bit, net in enumerate(nets))
            sign = 1 << len(nets) - 1
            found.append((code ^ sign) - sign)
        return found[0], found[1]

    def effect(self, holds: Sequence[Hold], until: Nanos, since: Nanos | None = None) -> InputEffect:
        """Return what changes when inputs are held otherwise, against the recorded run, up to a time."""
        since = min(hold.since for hold in holds) if since is None else since
        plain = self._as_recorded(since, until)
        return self._compare(plain, self._beside(plain, holds, since, until), since, until)

    def _as_recorded(self, since: Nanos, until: Nanos) -> ReplayPart:
        if (since, until) not in self._plain:
            self._plain[since, until] = self.replay.run(since, until, rows=True, memory_ns=_MEMORY_NS)
        return self._plain[since, until]

    def _beside(
        self, plain: ReplayPart, holds: Sequence[Hold], since: Nanos, until: Nanos, *, branch: Branch | None = None,
        ends_parted: bool = False,
    ) -> ReplayPart:  # fmt: skip
        """Return a replay that is to be compared with another one of the same time."""
        return self.replay.run(
            since, until, holds, rows=True, memory_ns=_MEMORY_NS, branch=branch, beside=plain, ends_parted=ends_parted
        )

    def noticed(self, holds: Sequence[Hold], until: Nanos, since: Nanos) -> Nanos | None:
        """Return when a program takes notice of inputs that are held otherwise, as `effect` does; None for never."""
        for end in sorted({min(since + SOON_NS, until), until}):
            plain = self._as_recorded(since, end)
            at, _ = self._parting(plain, self._beside(plain, holds, since, end, ends_parted=True), since)
            if at is not None:
                return at
        return None

    def flip_noticed(self, nets: Sequence[str], at: Nanos, span: Nanos = NOTICE_NS) -> Nanos | None:
        """Return when a program takes notice that these inputs have the other level for a time; None for never."""
        until = min(at + span, self.replay.end)
        return self.noticed([Hold(wire=net, level=None, since=at, until=until) for net in nets], until, at)

    def takes_notice(self, at: Nanos, span: Nanos = NOTICE_NS) -> bool:
        """Tell whether a program takes notice of any sensor that changes at a time, in the time after it."""
        return self.flip_noticed(self.sensors, at, span) is not None

    def answers(self, at: Nanos, span: Nanos = ANSWER_NS, nets: Sequence[str] = ()) -> Mapping[str, SensorResponse]:
        """Return what a program does at a time when one sensor alone sees something, and nothing did before.

        Args:
            at: The time.
            span: For how long it does.
            nets: Which sensors are wanted; none: all.
        """
        if (at, span) not in self._quiet:
            start, until = max(0, at - QUIET_NS), min(at + span, self.replay.end)
            quiet = self.replay.branch(start, at - 1, self.held(start, until, level=False))
            self._quiet[at, span] = quiet, self.replay.run(at, until, rows=True, memory_ns=_MEMORY_NS, branch=quiet)
        for net in nets or self.sensors:
            if (at, span, net) not in self._answers:
                self._answers[at, span, net] = self._answer(at, span, net)
        return {net: self._answers[at, span, net] for net in nets or self.sensors}

    def _answer(self, at: Nanos, span: Nanos, net: str) -> SensorResponse:
        until = min(at + span, self.replay.end)
        quiet, base = self._quiet[at, span]
        hold = Hold(wire=net, level=True, since=at, until=until)
        effect = self._compare(base, self._beside(base, [hold], at, until, branch=quiet), at, until)
        return SensorResponse(
            at=at, base=effect.before, codes=effect.after,
            noticed=None if effect.noticed is None else effect.noticed - at,
            answered=None if effect.answered is None else effect.answered - at, otherwise_ns=effect.otherwise_ns,
        )  # fmt: skip

    def held(self, since: Nanos, until: Nanos, *, level: bool) -> list[Hold]:
        """Return all sensors' pins at one level for a time."""
        return [Hold(wire=net, level=level, since=since, until=until) for net in self.sensors]

    def codes_all(self, at: Nanos, *, level: bool) -> Codes:
        """Return the motors' codes when all sensors' pins have had one level for 2 s."""
        until = min(at + QUIET_NS, self.replay.end)
        return self.codes_with(self.replay.run(at, until, self.held(at, until, level=level)), until)

    def moments(self, until: Nanos, count: int = 5) -> list[Nanos]:
        """Return times at which a program drives, so that it may be asked; the last one a little before `until`."""
        begin = next((pose.t for pose in self.replay.record.poses if max(abs(pose.left), abs(pose.right)) > 20_000), -1)
        last = min(until, self.replay.end) - ANSWER_NS - QUIET_NS
        if begin < 0 or last <= begin + QUIET_NS:
            return []
        first = begin + QUIET_NS
        return sorted({first + (last - first) * place // max(1, count - 1) for place in range(count)})

    def ended_noticing(self, at: Nanos) -> Nanos | None:
        """Return since when a program takes no notice of its sensors any more, where it does not at `at`."""
        step, silent = NS_PER_S // 2, at
        while True:
            early = at - step
            if early <= 0:
                return None
            if self.takes_notice(early):
                break
            silent, step = early, 2 * step
        span = self._usual_wait(early)
        while silent - early > NS_PER_MS:
            middle = (early + silent) // 2
            if self.takes_notice(middle, span):
                early = middle
            else:
                silent = middle
        return early

    def _usual_wait(self, at: Nanos) -> Nanos:
        """Return a time in which a program surely notices a change, by how long it took some times up to `at`."""
        tried = [at - back * NS_PER_MS for back in (0, 370, 710, 1130) if at > back * NS_PER_MS]
        found = [noticed - t for t in tried if (noticed := self.flip_noticed(self.sensors, t)) is not None]
        return min(NOTICE_NS, max(100 * NS_PER_MS, 4 * max(found, default=NOTICE_NS)))

    def lines_run(self, since: Nanos, until: Nanos) -> dict[str, int]:
        """Return how often each line's block ran in a time."""
        counted: Counter[int] = Counter()
        while since < until:
            end = min(until, since + ANSWER_NS)
            rows = self.replay.run(since, end, rows=True).rows
            counted.update(address for _, address, kind in rows if kind == BLOCK)
            since = end
        found: Counter[str] = Counter()
        for address, count in counted.items():
            found[str(self.replay.line(address))] += count
        return dict(found)

    def new_lines(self, at: Nanos) -> list[str]:
        """Return the lines that a program came by just before a time, and not in the third of a second before that."""
        just = self.lines_run(max(0, at - 8 * NS_PER_MS), at)
        usual = self.lines_run(max(0, at - 300 * NS_PER_MS), max(0, at - 8 * NS_PER_MS))
        return [line for line in just if line not in usual]

    def last_place(self, at: Nanos) -> SourcePlace:
        """Return where the program is at a time."""
        self.replay.run(at, at + 1)
        return self.replay.line(self.replay.board.pc)

    def _parting(self, plain: ReplayPart, other: ReplayPart, since: Nanos) -> tuple[Nanos | None, str]:
        """Return when the way through the program, or its variables, first differ, and where; (None, "") for never."""
        flow = first_row(plain, other)
        noticed: Nanos | None = None
        by = ""
        if flow is not None and flow > 0:
            # What follows the last common row differs; when that was is read off the common row.
            cycle, block, _ = plain.row(flow - 1)
            noticed = self._time_of(cycle, since)
            by = str(self.replay.end_line(block))
        for (t, ours), (_, theirs) in zip(plain.memory, other.memory, strict=False):
            if noticed is not None and t >= noticed:
                break
            if ours != theirs:
                place = next(n for n, (a, b) in enumerate(zip(ours, theirs, strict=True)) if a != b)
                return t, self.replay.variable_at(place)
        return noticed, by

    def _compare(self, plain: ReplayPart, other: ReplayPart, since: Nanos, until: Nanos) -> InputEffect:
        noticed, by = self._parting(plain, other, since)
        answered = min(
            (
                min(a[0] for a in (one, two) if a is not None)
                for one, two in (_first(plain.edges, other.edges), _first(plain.text, other.text))
                if one is not None or two is not None
            ),
            default=None,
        )
        one, two = self.way(plain, since, until), self.way(other, since, until)
        apart = parted(one, two, until)
        return InputEffect(
            noticed=noticed, by=by, answered=answered, before=one[-1][1], after=two[-1][1], way=one,
            otherwise_ns=sum(apart.values()), otherwise=max(apart, key=lambda codes: apart[codes], default=None),
        )  # fmt: skip

    def _time_of(self, cycle: int, since: Nanos) -> Nanos:
        return max(since, self.replay.board.chip.ns_of(cycle))


def parted(one: Way, other: Way, until: Nanos) -> dict[tuple[Codes, Codes], Nanos]:
    """Return for how long the motors had which other codes in one way than in another one, up to a time."""
    found: Counter[tuple[Codes, Codes]] = Counter()
    times = sorted({t for t, _ in (*one, *other)})
    codes = [dict(one), dict(other)]
    ours, theirs = one[0][1], other[0][1]
    for t, end in pairwise([*times, until]):
        ours, theirs = codes[0].get(t, ours), codes[1].get(t, theirs)
        if ours != theirs:
            found[ours, theirs] += end - t
    return {pair: span for pair, span in found.items() if span}


def first_row(plain: ReplayPart, other: ReplayPart) -> int | None:
    """Return the place of the first row that differs, or that only one has; None for none."""
    ours, theirs = plain.packed_rows, other.packed_rows
    same, differ = 0, min(len(ours), len(theirs)) // RECORD.size
    if ours[: differ * RECORD.size] == theirs[: differ * RECORD.size]:
        shorter = plain if len(ours) < len(theirs) else other
        return None if len(ours) == len(theirs) or shorter.has_more_rows else differ
    while differ - same > 1:  # rows before `same` do, some before `differ` do not
        middle = (same + differ) // 2
        first, end = same * RECORD.size, middle * RECORD.size
        same, differ = (middle, differ) if ours[first:end] == theirs[first:end] else (same, middle)
    return same


def _first(
    ours: Sequence[tuple[object, ...]], theirs: Sequence[tuple[object, ...]]
) -> "tuple[tuple[Nanos, ...] | None, tuple[Nanos, ...] | None]":
    """Return the first pair of rows that differ; (None, None) where none do."""
    return next(((a, b) for a, b in zip_longest(ours, theirs) if a != b), (None, None))  # type: ignore[return-value]
