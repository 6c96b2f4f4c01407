"""One future of a run: a bench that goes on, to any time of its past, and halts where it should.

Theory of operation. The debugger's own machinery (`bluepill_sim.debug.execution`) brings the bench forwards and, from
older states, backwards; what is added are events in words. They are reported up to 50 ms after they happen: so at every
stand still the bench is run on until all is reported that happened by then, and put back. Where an event is found that
one halts at, the bench goes back to its time. What was reported once is known: a run is repeatable.

Invariant: a bench that was halted, set back and let go on leaves the trace of one that was not.
"""

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from bluepill_sim.debug.execution import Execution
from bluepill_sim.debug.history import Point
from bluepill_sim.debug.machine import HaltReason, StopKind
from bluepill_sim.debug.sampler import VariableSampler
from bluepill_sim.program.line_table import read_lines
from bluepill_sim.program.variables import Variable
from robot_bench.bench import Bench, run_of
from robot_bench.bench.waiting import TraceMark, events_since, mark_of
from robot_bench.cli.debugging.hands import hand_of
from robot_bench.cli.debugging.machine import BenchMachine
from robot_bench.cli.debugging.points import STEPS, HaltPoint, other_lines
from robot_bench.events.kinds import Event
from robot_bench.events.selection import Selector, Wires
from robot_bench.events.words import what_of
from robot_bench.recording.recorder import SAMPLE_NS
from robot_bench.scenario.hands.timed import Hand
from simbase.errors import P2osError, UsageError
from simbase.timing import NS_PER_MS, Nanos

#: chosen: older states; 50 MB at the most, and of an hour one each ten seconds.
MOST_POINTS = 512
#: chosen: how often a running bench looks for a request to stop.
SLICE_NS: Nanos = 20 * NS_PER_MS


_AT_POINT, _STEPPED = HaltReason(StopKind.BREAKPOINT), HaltReason(StopKind.STEP)


@dataclass(frozen=True, slots=True)
class Halted:
    """Why a future stands still: the point's number (0: none of the list), and a line; and as a debugger knows it."""

    number: int
    why: str
    stop: HaltReason = _AT_POINT


@dataclass(slots=True)
class SeenStretch:
    """What was seen of variables in a stretch of time without gaps: rows where one is another than before."""

    begins_ns: Nanos
    until_ns: Nanos = 0
    rows: list[tuple[Nanos, str, float]] = field(default_factory=list)


class _Watch:
    """One thing to halt at by events: it stays subscribed, and its state goes back with the machine."""

    def __init__(self, selector: Selector, end: Callable[[], None]) -> None:
        self.selector, self.end = selector, end


class _FutureMachine(BenchMachine):
    """A bench whose snapshots have what its watches know, too; what hands do comes again wherever it goes back to.

    Args:
        bench: At the moment where the future begins.
        watches: What it halts at.
        hands: What hands do in this future, the earliest first; the bench knows of all of them.
    """

    def __init__(self, bench: Bench, watches: Mapping[int, _Watch], hands: Sequence[Hand]) -> None:
        super().__init__(bench)
        self._run, self._watches = run_of(bench), watches
        self.hands: Sequence[Hand] = tuple(hands)
        self._known = self.hands

    def snapshot(self) -> object:
        """Return all that decides the bench's future, and what the watches have seen."""
        seen = {number: one.selector.snapshot() for number, one in self._watches.items()}
        return super().snapshot(), seen, self._known

    def restore(self, snapshot: object) -> None:
        """Put back what `snapshot` returned; watches and hands that are newer stay as they are."""
        assert isinstance(snapshot, tuple)  # noqa: S101 - its own
        bench, seen, self._known = snapshot
        super().restore(bench)
        for number, one in self._watches.items():
            if number in seen:
                one.selector.restore(seen[number])
        self.take(self.hands)

    def take(self, hands: Sequence[Hand]) -> None:
        """Have hands do this from now on, and nothing else; what they have done by now is the same."""
        known, self.hands = self._known, tuple(hands)
        for hand in known:
            if not any(hand is one for one in self.hands):
                self._run.take_back(hand.doing)
        for hand in self.hands:
            if not any(hand is one for one in known):
                self._run.schedule(hand.doing)
        self._known = self.hands


class Future:
    """One course of a run.

    Args:
        name: Of it.
        bench: At the moment where it begins.
        parent: The name of the one that it leaves; empty: it is the run itself.
        words: What is done where it begins.
        hands: What hands do in it, the earliest first; the bench knows of all of them.
    """

    def __init__(self, name: str, bench: Bench, parent: str = "", words: str = "", hands: Sequence[Hand] = ()) -> None:
        self.name, self.parent, self.words = name, parent, words
        self._watches: dict[int, _Watch] = {}
        self._points: dict[int, HaltPoint] = {}
        #: Events to halt at that have come: time, number, words.
        self._hits: list[tuple[Nanos, int, str]] = []
        #: What was seen of the watched variables since that was taken.
        self._seen: list[SeenStretch] = []
        #: When they were looked at last.
        self._seen_until: Nanos = 0
        self._take(bench, hands)
        #: Until when all is known: who records it says so.
        self.known_ns: Nanos = bench.events.released_until
        self.begins_ns: Nanos = self.now_ns
        #: Where its own events begin in its trace.
        self.mark: TraceMark = mark_of(bench.events, bench.trace, run_of(bench).harness)
        #: The moment that it stands at for a person: that of an event, or where the chip is.
        self.head_ns: Nanos = self.now_ns
        #: Where it stood last: what happens later counts, though it be reported when the chip is further.
        self._stood_ns: Nanos = self.head_ns

    def _take(self, bench: Bench, hands: Sequence[Hand]) -> None:
        self.bench = bench
        self.machine = _FutureMachine(bench, self._watches, hands)
        self._sampler = VariableSampler(self.machine.board, self._see)
        run_of(bench).samplers.append(self._sampler)
        self.execution = Execution(self.machine, most_points=MOST_POINTS, slice_ns=SLICE_NS)

    def replace(self, bench: Bench) -> None:
        """Go on with another bench that stands where this one does."""
        points, variables = self._points, self._sampler.variables
        self.arm({})
        run_of(self.bench).samplers.remove(self._sampler)
        history = self.execution.history
        self._take(bench, self.hands)
        self.execution.history.take(history)
        self.arm(points)
        self.watch(variables)

    def watch(self, variables: Sequence[Variable]) -> None:
        """Look at these variables of the program from now on, and at no others."""
        self._sampler.watch(variables)

    def take_seen(self) -> Sequence[SeenStretch]:
        """Return what was seen of the variables since the last call."""
        seen, self._seen = self._seen, []
        return seen

    def _see(self, at: Nanos, is_anew: bool, changes: Sequence[tuple[str, float]]) -> None:
        if is_anew or not self._seen:
            begun = self._seen_until if not is_anew else at
            self._seen.append(SeenStretch(begun))
        self._seen[-1].until_ns = self._seen_until = at
        self._seen[-1].rows += [(at, name, value) for name, value in changes]

    @property
    def hands(self) -> Sequence[Hand]:
        """What hands do in it, the earliest first."""
        return self.machine.hands

    @property
    def is_past(self) -> bool:
        """Whether it is known what comes next: it stands where it has been before."""
        return self.known_ns - self.now_ns >= SAMPLE_NS

    @property
    def now_ns(self) -> Nanos:
        """Where the chip stands."""
        return self.bench.now

    @property
    def is_over(self) -> bool:
        """Whether it stands at the end of the run."""
        return self.bench.now >= self.bench.end

    @property
    def place(self) -> str:
        """The source line that comes next, or else the function."""
        board = self.machine.board
        row = read_lines(board.image).place(board.pc)
        function = board.image.symbols.where(board.pc).partition("+")[0]
        words = f"{row} in {function}" if row else board.where()
        return f"{words}, asleep" if board.is_asleep else words

    def arm(self, points: Mapping[int, HaltPoint]) -> None:
        """Halt at these points from now on, and at no others."""
        for number in self._watches.keys() - {number for number, one in points.items() if one.selector}:
            self._watches.pop(number).end()
        for number, point in points.items():
            if point.selector is not None and number not in self._watches:
                self._watch(number, point.selector())
        self._points = dict(points)
        engine = self.machine.board.chip.engine
        engine.breakpoints.clear()
        engine.breakpoints.update(*(one.breakpoints for one in points.values()))
        engine.watchpoints.clear()
        engine.watchpoints.update(*(one.watched for one in points.values()))

    def _watch(self, number: int, selector: Selector) -> None:
        def take(event: Event) -> None:
            if selector.takes(event) and event.t > self._stood_ns:
                self._hits.append((event.t, number, what_of(event)))

        end = self.bench.events.subscribe(take, *selector.kinds, wires=selector.wires)
        self._watches[number] = _Watch(selector, end)

    # Forwards.

    def resume(self) -> None:
        """Prepare to go on from a stand still: what the program stands before does not halt it again."""
        self._hits.clear()
        engine = self.machine.board.chip.engine
        if self.machine.board.pc in engine.breakpoints and not self.is_over:
            kept = set(engine.breakpoints), set(engine.watchpoints)
            engine.breakpoints.clear()
            engine.watchpoints.clear()
            self.execution.step()
            engine.breakpoints.update(kept[0])
            engine.watchpoints.update(kept[1])

    def run_to(self, limit_ns: Nanos, *, is_seen_at_once: bool = False) -> Halted | None:
        """Go on to a time; return why it halts before, or None.

        Args:
            limit_ns: The time.
            is_seen_at_once: Whether what happens by then is reported by then, not up to 50 ms later.
        """
        if limit_ns <= self.now_ns and not self.is_over:
            return None
        stop = self.execution.run_to(limit_ns)
        if is_seen_at_once or stop.kind is not StopKind.INTERRUPT:
            self.look_ahead()
        if self._hits:
            return self._halt_at(min(self._hits))
        if stop.kind is StopKind.INTERRUPT:
            self.head_ns = max(self.head_ns, self.now_ns)
            return None
        self.head_ns = self._stood_ns = self.now_ns
        if stop.kind is StopKind.END:
            return Halted(0, THE_END, stop)
        return self._halted_by(stop)

    def _halted_by(self, stop: HaltReason) -> Halted:
        pc = self.machine.board.pc
        for number, point in self._points.items():
            is_there = pc in point.breakpoints if stop.kind is StopKind.BREAKPOINT else any(
                stop.address is not None and one.sees(stop.address, 4, is_read=is_read)
                for one in point.watched for is_read in (False, True)
            )  # fmt: skip
            if is_there:
                return Halted(number, point.words, stop)
        return Halted(0, "", stop)

    def _halt_at(self, hit: tuple[Nanos, int, str]) -> Halted:
        at, number, what = hit
        self.go_to(at)
        point = self._points.get(number)
        words = "" if point is None else f"{point.words}: "
        return Halted(number, f"{words}{what}" if what not in words else point.words if point else what)

    def step_to_event(self, unit: str, wire: str, wires: Wires | None) -> None:
        """Halt at the next event of a kind as well, until `forget_step`."""
        self._watch(_STEP, STEPS[unit](wire, wires))

    def forget_step(self) -> None:
        """Halt at the points alone again."""
        if _STEP in self._watches:
            self._watches.pop(_STEP).end()

    def step(self) -> Halted:
        """Run one instruction of the program."""
        with self._unarmed():
            stop = self.execution.step()
        return self._stand(THE_END if stop.kind is StopKind.END else "", stop)

    def step_line(self) -> Halted:
        """Run to where another line of the source begins."""
        with self._halting_at(other_lines(self.machine.board)):
            while True:
                stop = self.execution.run_to(self.now_ns + SAMPLE_NS)
                if stop.kind is not StopKind.INTERRUPT:
                    break
        return self._stand(THE_END if stop.kind is StopKind.END else "")

    def do_by_hand(self, words: str) -> None:
        """Do what words mean at the first moment that nothing is known of yet, up to 50 ms from here, and go there.

        What hands would have done later is not done any more.

        Raises:
            UsageError: They mean nothing that can be done, or the run is over.
            P2osError: It cannot be done then; nothing has changed.
        """
        at = max(self.now_ns, self.known_ns) + 1
        if at >= self.bench.end:
            raise UsageError("the run is over", hint="go back: what is done there begins a fork")
        hand, kept, snapshot = hand_of(words, at, self.bench), self.hands, self.machine.snapshot()
        self.machine.take([*(one for one in kept if one.at < at), hand])
        try:
            self.execution.pass_to(at)
        except P2osError:
            self.machine.hands = kept
            self.machine.restore(snapshot)
            self.execution.history.forget_after(self.machine.board.cycle)
            raise
        self.head_ns = max(self.head_ns, self.now_ns)

    def stand(self) -> None:
        """Stand still where the chip is, and know all that happened by now."""
        self._stand("")

    # To other times.

    def go_to(self, at_ns: Nanos) -> None:
        """Go to a time between where it begins and its end."""
        at_ns = max(at_ns, self.begins_ns)
        with self._quiet():
            self.execution.go_to(at_ns)
        self._stand("")
        self.head_ns = self._stood_ns = min(at_ns, self.now_ns)

    def step_back(self) -> Halted:
        """Go to before the last instruction."""
        with self._unarmed(), self._quiet():
            stop = self.execution.step_back()
        return self._stand(_BEGIN if stop.kind is StopKind.BEGIN else "", stop)

    def go_back(self) -> Halted:
        """Go to the last line or variable that it halts at before this moment, or to where this future begins."""
        with self._quiet():
            stop = self.execution.go_back()
        return self._stand(_BEGIN if stop.kind is StopKind.BEGIN else "", stop)

    def step_line_back(self) -> Halted:
        """Go to where the program came to the line before."""
        # To the last run of instructions of that line, to the line before it, and on to where the line then begins.
        for _ in range(2):
            with self._halting_at(other_lines(self.machine.board)), self._quiet():
                stop = self.execution.back_to_near_stop()
            if stop.kind is StopKind.BEGIN:
                return self._stand(_BEGIN)
        return self.step_line()

    def back_to_event(self, unit: str, wire: str, wires: Wires | None) -> Halted:
        """Go to the last event of a kind before this moment, or to where this future begins."""
        head, history, found = self.head_ns, self.execution.history, list[tuple[Nanos, str]]()

        def take(event: Event) -> None:
            if self.begins_ns < event.t < head and selector.takes(event):
                found.append((event.t, what_of(event)))

        for point in self._points_before(head):
            selector = STEPS[unit](wire, wires)
            with self._unarmed(), self._quiet():
                self.machine.restore(point.snapshot)
                end = self.bench.events.subscribe(take, *selector.kinds, wires=selector.wires)
                try:
                    while self.bench.events.released_until < head and not self.is_over:
                        self.machine.advance_to(self.now_ns + SAMPLE_NS)
                    if self.bench.events.released_until < head:
                        self.bench.finish()
                finally:
                    end()
                self.machine.restore(point.snapshot)
                history.forget_after(point.cycle)
            if found:
                at, what = max(found)
                self.go_to(at)
                return Halted(0, what)
        self.go_to(self.begins_ns)
        return Halted(0, _BEGIN)

    def _points_before(self, head_ns: Nanos) -> Iterator[Point]:
        """Yield older states, each twice as far away as the one before, and the oldest."""
        points, span = self.execution.history.latest_first(), SAMPLE_NS
        for point in points[:-1]:
            if point.at_ns < head_ns - span:
                span = 2 * (head_ns - point.at_ns)
                yield point
        yield points[-1]

    def look_ahead(self) -> None:
        """Have all reported that happened by now: run on until it is, and go back."""
        now = self.now_ns
        if self.bench.events.released_until >= now:
            return
        with self._ahead(now):
            pass
        # What comes later comes again.
        self._hits = [hit for hit in self._hits if hit[0] <= now]

    def events_until(self, mark: TraceMark, until_ns: Nanos) -> list[Event]:
        """Go to a time; return what has happened by then since a place of the trace."""
        self.go_to(until_ns)
        with self._ahead(until_ns):
            return [event for event in events_since(mark, self.bench.trace) if event.t <= until_ns]

    @contextlib.contextmanager
    def _ahead(self, until_ns: Nanos) -> Iterator[None]:
        """Have all in the trace that happened until a time, for a block."""
        snapshot = self.machine.snapshot()
        with self._unarmed(), self._quiet():
            while self.bench.events.released_until < until_ns and not self.is_over:
                self.machine.advance_to((self.now_ns // SAMPLE_NS + 1) * SAMPLE_NS)
            if self.bench.events.released_until < until_ns:
                self.bench.finish()
            yield
            self.machine.restore(snapshot)

    def _stand(self, why: str, stop: HaltReason = _STEPPED) -> Halted:
        """Stand still where the chip is."""
        self.head_ns = self._stood_ns = self.now_ns
        self.look_ahead()
        self._hits.clear()
        return Halted(0, why, stop)

    @contextlib.contextmanager
    def _unarmed(self) -> Iterator[None]:
        with self._halting_at(frozenset()):
            yield

    @contextlib.contextmanager
    def _halting_at(self, addresses: frozenset[int]) -> Iterator[None]:
        """Halt before these instructions in place of the points."""
        engine = self.machine.board.chip.engine
        kept = set(engine.breakpoints), set(engine.watchpoints)
        engine.breakpoints.clear()
        engine.watchpoints.clear()
        engine.breakpoints.update(addresses)
        try:
            yield
        finally:
            engine.breakpoints.clear()
            engine.breakpoints.update(kept[0])
            engine.watchpoints.update(kept[1])

    @contextlib.contextmanager
    def _quiet(self) -> Iterator[None]:
        """Log nothing, and tell nobody how far the run is: it goes where it was before."""
        recorder, on_slice = run_of(self.bench).recorder, self.bench.on_slice
        kept, recorder.on_event, self.bench.on_slice = recorder.on_event, None, None
        try:
            yield
        finally:
            recorder.on_event, self.bench.on_slice = kept, on_slice


#: The number of what a step halts at.
_STEP = -1
_BEGIN, THE_END = "the beginning", "the end of the run"
