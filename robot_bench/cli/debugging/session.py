"""The control of one run: what a page asks for is done to its futures, between two slices of the chosen one.

Passive: time is an argument. Whoever owns it calls `do` with a command, and `go_on` with the time of a clock while
`is_running`; it says how long nothing is to be done.

Invariant: whatever else is asked, the run itself leaves the trace that it leaves with what hands have done in it, each
at its time, and nobody looking; only a fork is another run.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Protocol

from bluepill_sim.core import Watchpoint
from bluepill_sim.debug.machine import HaltReason, StopKind
from bluepill_sim.program.variables import Variable, read_variables
from p2os.view.run_control import (
    Doing,
    FutureState,
    HaltState,
    HandState,
    PartingState,
    RunCommand,
    RunState,
)
from robot_bench.bench import Bench
from robot_bench.cli.debugging.future import SLICE_NS, THE_END, Future, Halted
from robot_bench.cli.debugging.hands import drive_words, driven_by, saved_as
from robot_bench.cli.debugging.holds import Holds
from robot_bench.cli.debugging.points import HaltPoint, point_of
from robot_bench.events.words import distinguishing_words, what_of
from robot_bench.recording.divergence import Difference, differences
from robot_bench.scenario.hands.timed import Hand
from simbase.errors import P2osError, UsageError
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos

#: The run itself.
MAIN = "run"
#: chosen: futures at a time; each has its trace in a file and its rows in memory.
MOST_FUTURES = 8
#: chosen: variables of the program that are watched at a time; each is looked at a thousand times a second.
MOST_VARIABLES = 32
#: chosen: differences that are listed, the first that part.
MOST_SIGNALS = 8
#: chosen: what hands did last is listed.
MOST_HANDS = 20
#: What is done beside a run that goes on: where it cannot be, the run goes on.
_BESIDE = frozenset({"hand", "drive", "stop", "save"})
#: What moves the run to another place: GDB cannot be notified while it stands at its prompt.
_MOVES = frozenset({"go", "step", "back", "fork", "choose", "drop", "compare", "hand"})
GDB_STANDS = "GDB stands at this halt, and what it shows has to stay: continue there first, and it waits for this page"
#: Number and words of what GDB halts at, among the places of the page.
GDB, GDB_WORDS = -2, "GDB"
#: chosen: slower than this, what happens is looked for ahead of the time that is shown: else it would come late.
_SLOW = 0.25
#: chosen: a bench that cannot keep the pace goes on from where it is after so long, ns of the clock.
_MOST_LAG_NS: Nanos = NS_PER_S // 2
#: chosen: a run that goes on is reported so often, ns of the clock.
_REPORTED_NS: Nanos = 50 * NS_PER_MS


def trouble_of(error: P2osError) -> str:
    """Return what a page says of what could not be done."""
    return f"{error} ({error.hint})" if error.hint else str(error)


class FutureRecorder(Protocol):
    """Who records what happens in each future."""

    def begin(self, future: Future) -> None:
        """Listen to a future's bench from now on."""

    def forked(self, future: Future, parent: Future) -> None:
        """Take a future that has left another one where that one stands."""

    def dropped(self, future: Future) -> None:
        """Forget a future."""

    def saved(self, future: Future, kind: str) -> str:
        """Write down what hands have done in a future, as a `scenario` or a `test`; return where, for a person.

        Raises:
            P2osError: It cannot be written.
        """


class RunSession:
    """Controls one run.

    Args:
        bench: Of the run, at its beginning.
        recorder: Records its futures.
        folder: Where traces of forks are kept.
        speed: Virtual seconds a second; 0 as fast as it goes.
        waits_for_gdb: Where it stands at first until GDB comes, or the page lets it go: what is said then.
    """

    def __init__(
        self, bench: Bench, recorder: FutureRecorder, folder: Path, speed: float = 1.0, waits_for_gdb: str = ""
    ) -> None:
        self._recorder, self._folder = recorder, folder
        self.speed = speed
        self.holds = Holds(waits_for_gdb=bool(waits_for_gdb))
        self.is_running = not waits_for_gdb
        #: What GDB halts at; what it has asked for that waits for the page; how the run has come to stand for it.
        self._gdb_point = HaltPoint(words=GDB_WORDS)
        self._asked: Callable[[Future], Halted] | None = None
        self._gdb_halt: Halted | None = None
        self._main = self._chosen = Future(MAIN, bench)
        self._futures = {MAIN: self._main}
        #: Those that were dropped, too: others come from them.
        self._known = {MAIN: self._main}
        self._numbers, self._places = count(1), count(1)
        self._points: dict[int, HaltPoint] = {}
        self._counts: dict[int, int] = {}
        self._variables: dict[str, Variable] = {}
        self._compared: dict[str, tuple[str, Nanos, tuple[PartingState, ...]]] = {}
        self._why, self._trouble, self._done, self._saved = waits_for_gdb, "", 0, ""
        #: How somebody drives the robot, m/s and deg/s, as far as the run goes on; None: nobody does.
        self._speeds: tuple[float, float] | None = None
        self._reported_at: Nanos | None = None
        self._state: RunState | None = None
        self._base: tuple[Nanos, Nanos] | None = None
        self._doing: Mapping[Doing, Callable[[RunCommand], None]] = {
            "run": self._run, "pause": self._pause, "go": self._go, "step": self._step, "back": self._back,
            "speed": self._set_speed, "fork": self._fork, "choose": self._choose, "drop": self._drop,
            "compare": self._compare, "hand": self._hand, "drive": self._drive, "stop": self._drive,
            "save": self._save,
            "halt_at": self._halt_at, "halt_not_at": self._halt_not_at,
            "watch": self._watch, "watch_not": self._watch_not,
        }  # fmt: skip
        recorder.begin(self._main)

    @property
    def bench(self) -> Bench:
        """The bench of the run itself."""
        return self._main.bench

    @property
    def hands(self) -> Sequence[Hand]:
        """What hands do in the run itself, the earliest first."""
        return self._main.hands

    @property
    def chosen(self) -> Future:
        """The future that goes on."""
        return self._chosen

    @property
    def is_over(self) -> bool:
        """Whether the run itself has come to its end."""
        return self._main.is_over

    def state(self) -> RunState:
        """Return how it stands."""
        if self._state is None:
            place = "" if self.is_running else self._chosen.place
            self._state = RunState(
                is_running=self.is_running, speed=self.speed, head_ns=self._chosen.head_ns, why=self._why, place=place,
                trouble=self._trouble, done=self._done, future=self._chosen.name, saved=self._saved,
                hand_count=len(self._chosen.hands), hands=[
                    HandState(at_ns=one.at, words=one.words or one.do) for one in self._chosen.hands[-MOST_HANDS:]
                ],
                futures=[self._state_of(one) for one in self._futures.values()],
                halts=[HaltState(number=number, words=one.words, count=self._counts[number])
                       for number, one in self._points.items()],
                variables=list(self._variables),
            )  # fmt: skip
        return self._state

    def _state_of(self, future: Future) -> FutureState:
        against, until_ns, parting = self._compared.get(future.name, ("", 0, ()))
        return FutureState(
            name=future.name, source="" if future is self._main else future.name, parent=future.parent,
            at_ns=future.begins_ns if future.parent else 0, head_ns=future.head_ns, words=future.words,
            end_ns=max(future.known_ns, future.head_ns), is_over=future.is_over, against=against, until_ns=until_ns,
            parting=parting,
        )  # fmt: skip

    # What is asked for.

    def do(self, command: RunCommand) -> None:
        """Do what a page asks for; what cannot be done is said in the state."""
        self._state, self._reported_at, self._base, self._trouble, self._saved = None, None, None, "", ""
        was_going = self._is_going
        try:
            if self.holds.is_shown_to_gdb and self._moves(command):
                raise UsageError(GDB_STANDS)
            doing = self._doing.get(command.do)
            if doing is None:
                raise UsageError(f"a run knows no {command.do!r}")
            doing(command)
        except P2osError as error:
            self._trouble = trouble_of(error)
            if command.do not in _BESIDE and not self.holds.is_shown_to_gdb:
                self._stop("")
        if was_going and not self._is_going:
            self._tell_gdb(Halted(0, self._why, HaltReason(StopKind.INTERRUPT)))
        self._done += 1
        self._state = None

    @property
    def _is_going(self) -> bool:
        """Whether time goes on by itself: not for a step."""
        return self.is_running and not self._is_step

    def _moves(self, command: RunCommand) -> bool:
        if command.do == "halt_at":  # an event is looked for from a little before on
            return command.words.split()[:1] not in (["line"], ["variable"])
        return command.do in _MOVES or (command.do == "run" and command.at_ns not in {None, self._chosen.head_ns})

    def _run(self, command: RunCommand) -> None:
        self._go(command)
        self._set_off()

    def _set_off(self) -> None:
        """Let the chosen future go as far as the page is concerned; do what GDB has asked for, or go on."""
        self.holds.page_runs()
        if self._go_on_for_both():
            self._drive_on()

    def _go_on_for_both(self) -> bool:
        """Do what GDB has asked for, or go on, where neither holds; return whether it goes on."""
        self._state, self._base = None, None
        if self._chosen.is_over and self._asked is None:
            self._stop(THE_END)
            self._tell_gdb(Halted(GDB, THE_END, HaltReason(StopKind.END)))
            return False
        if not self.holds.is_free:
            gdb = "GDB holds it: continue there" if self.holds.by_gdb else "GDB waits until it goes on here"
            self.is_running, self._why = False, gdb
            return False
        asked, self._asked = self._asked, None
        if asked is not None:
            self._stand_for_gdb(asked(self._chosen))
        else:
            self._chosen.resume()
            self.is_running, self._why = True, ""
        return self.is_running

    # As GDB asks for, beside the page.

    def do_for_gdb(self, ask: Callable[[Future], Halted] | None) -> None:
        """Do what GDB asks for, or go on (None), as soon as the page lets it; `take_gdb_halt` says when it stands."""
        self.holds.gdb_continues()
        self._asked = ask
        if self._go_on_for_both():
            self._drive_on()

    def stand_for_gdb(self, why: str) -> None:
        """Stand still where it is, for GDB."""
        if self.is_running:
            self._chosen.go_to(self._chosen.head_ns)
        self._stand_for_gdb(Halted(GDB, why, HaltReason(StopKind.INTERRUPT)))

    def gdb_comes(self) -> None:
        """Stand still where it is: GDB begins at a halt."""
        self.stand_for_gdb(GDB_WORDS)
        self.holds.gdb_comes()

    def gdb_leaves(self, *, is_lost: bool) -> None:
        """Take that GDB is there no more: what it halts at is gone; a lost line lets nothing go."""
        self.holds.gdb_leaves(is_lost=is_lost)
        self._asked = self._gdb_halt = None
        self.halt_for_gdb(frozenset(), frozenset())
        if is_lost:
            self._why, self._state = "GDB has gone without detaching", None
        elif not self.is_running:
            self._go_on_for_both()

    def halt_for_gdb(self, breakpoints: frozenset[int], watched: frozenset[Watchpoint]) -> None:
        """Halt at these places for GDB, and at no others."""
        self._gdb_point = HaltPoint(words=GDB_WORDS, breakpoints=breakpoints, watched=watched)
        self._chosen.arm(self._armed)

    def take_gdb_halt(self) -> Halted | None:
        """Return why it stands still for GDB, which waits for that; once."""
        halted, self._gdb_halt = self._gdb_halt, None
        return halted

    def _stand_for_gdb(self, halted: Halted) -> None:
        """Stand still for GDB, whatever the page wants."""
        self.is_running, self._is_step, self._state, self._asked = False, False, None, None
        self._why = f"{GDB_WORDS}: {halted.why}" if halted.why and halted.why != GDB_WORDS else GDB_WORDS
        self._chosen.forget_step()
        self._tell_gdb(replace(halted, number=GDB))

    def _tell_gdb(self, halted: Halted) -> None:
        if self.holds.stands():
            self._gdb_halt = halted

    @property
    def _armed(self) -> dict[int, HaltPoint]:
        """Where the chosen future halts: for the page, and for GDB."""
        point = self._gdb_point
        return self._points | ({GDB: point} if point.breakpoints or point.watched else {})

    # As the page asks for.

    def _pause(self, _command: RunCommand) -> None:
        self.holds.page_holds()
        if self.is_running:
            self._stop("paused")
            self._chosen.go_to(self._chosen.head_ns)
        elif self.holds.is_shown_to_gdb:
            self._why = "paused; GDB holds it, too"

    def _go(self, command: RunCommand) -> None:
        """Stand still at the time of a command."""
        was_running = self.is_running
        self._stop(self._why)
        if command.at_ns is not None and command.at_ns != self._chosen.head_ns:
            self._chosen.go_to(command.at_ns)
            self._why = ""
        elif was_running:
            self._chosen.look_ahead()

    def _step(self, command: RunCommand) -> None:
        self._go(command)
        future = self._chosen
        if future.is_over:
            self._stop(THE_END)
        elif command.unit == "instruction":
            self._stop(future.step().why)
        elif command.unit == "line":
            self._stop(future.step_line().why)
        elif command.unit == "millisecond":
            future.go_to(future.head_ns + NS_PER_MS)
            self._stop("")
        else:
            future.resume()
            future.step_to_event(command.unit, command.words, _wires(future.bench))
            self.is_running, self._why, self._is_step = True, "", True

    def _back(self, command: RunCommand) -> None:
        self._go(command)
        future = self._chosen
        if command.unit == "instruction":
            self._stop(future.step_back().why)
        elif command.unit == "line":
            self._stop(future.step_line_back().why)
        elif command.unit == "millisecond":
            future.go_to(max(future.begins_ns, future.head_ns - NS_PER_MS))
            self._stop("")
        else:
            self._stop(future.back_to_event(command.unit, command.words, _wires(future.bench)).why)

    def _set_speed(self, command: RunCommand) -> None:
        self.speed = command.speed

    def _fork(self, command: RunCommand) -> None:
        if len(self._futures) >= MOST_FUTURES:
            raise UsageError(f"{MOST_FUTURES} futures are there already", hint="drop one")
        self._go(command)
        parent, name = self._chosen, f"fork {next(self._numbers)}"
        bench = parent.bench.fork(self._folder / f"{name.replace(' ', '-')}.jsonl")
        words = command.words.strip()
        future = Future(name, bench, parent.name, words, parent.hands)
        self._futures[name] = self._known[name] = future
        self._recorder.forked(future, parent)
        future.watch(list(self._variables.values()))
        try:
            if words:
                future.do_by_hand(words)
        except P2osError:
            self._leave(future)
            raise
        self._choose_future(future)

    def _hand(self, command: RunCommand) -> None:
        """Do something in the chosen future; where it is known what comes next, in a fork that begins there."""
        was_running = self.is_running
        if command.at_ns is not None:
            self._go(command)
        if self._chosen.is_past:
            self._fork(command)
        else:
            self._chosen.do_by_hand(command.words)
            if not was_running:
                self._chosen.stand()
        if was_running:
            self.holds.page_runs()
            self._go_on_for_both()
        if command.words.split()[:1] in (["drive"], ["let"]):
            self._speeds = driven_by(self._chosen.hands, self._chosen.now_ns)

    def _drive(self, command: RunCommand) -> None:
        """Drive by hand from now on; a run that stands still is driven when it goes on."""
        self._speeds = round(command.forward_mps, 3), round(command.turn_dps, 1)
        if self.is_running:
            self._drive_on()

    def _drive_on(self) -> None:
        """Have the chosen future driven as somebody wants."""
        speeds = self._speeds
        if speeds is not None and speeds != driven_by(self._chosen.hands, self._chosen.now_ns):
            self._hand(RunCommand(do="hand", words=drive_words(speeds)))

    def _save(self, command: RunCommand) -> None:
        self._saved = self._recorder.saved(self._chosen, saved_as(command.words))

    def _choose(self, command: RunCommand) -> None:
        self._speeds = None
        self._choose_future(self._named(command.future))

    def _choose_future(self, future: Future) -> None:
        self._stop("")
        self._chosen.arm({})
        self._chosen = future
        future.arm(self._armed)
        future.go_to(future.head_ns)

    def _drop(self, command: RunCommand) -> None:
        future = self._named(command.future)
        if future is self._main:
            raise UsageError("the run itself stays", hint="drop a fork")
        if future is self._chosen:
            self._choose_future(self._main)
        self._leave(future)

    def _leave(self, future: Future) -> None:
        del self._futures[future.name]
        self._compared = {name: row for name, row in self._compared.items() if future.name not in {name, row[0]}}
        self._recorder.dropped(future)
        future.bench.trace.close()

    def _compare(self, command: RunCommand) -> None:
        """Find where the chosen future and another one part."""
        ours, theirs = self._chosen, self._named(command.future)
        self._stop(self._why)
        if ours is theirs:
            raise UsageError("a future does not differ from itself", hint="choose another one")
        until_ns = min(max(one.known_ns, one.head_ns) for one in (ours, theirs))
        heads = [(one, one.head_ns) for one in (ours, theirs)]
        mark = self._parted(ours, theirs).mark
        kept = [one.events_until(mark, until_ns) for one in (ours, theirs)]
        parting = tuple(_parting_of(one) for one in differences(*kept)[:MOST_SIGNALS])
        for one, head_ns in heads:
            one.go_to(head_ns)
        self._compared[ours.name] = theirs.name, until_ns, parting

    def _parted(self, one: Future, other: Future) -> Future:
        """Return the future with whose beginning two of them part: what was before is the same."""
        lines = [self._line_of(one), self._line_of(other)]
        own = [[step for step in lines[way] if step not in lines[1 - way]] for way in (0, 1)]
        return min((line[-1] for line in own if line), key=lambda step: step.begins_ns)

    def _line_of(self, future: Future) -> list[Future]:
        """Return a future and those that it comes from, back to the run itself."""
        found = [future]
        while found[-1].parent in self._known:
            found.append(self._known[found[-1].parent])
        return found

    def _halt_at(self, command: RunCommand) -> None:
        point = point_of(
            command.words, self._chosen.machine.board, self._chosen.bench.scenario, _wires(self._chosen.bench)
        )  # fmt: skip
        if any(one.words == point.words for one in self._points.values()):
            return
        number = next(self._places)
        self._points[number], self._counts[number] = point, 0
        self._chosen.arm(self._armed)
        if not self.is_running and point.selector is not None:
            # It sees what was before from the last older state on: a robot that is there already does not come there.
            self._chosen.go_to(self._chosen.head_ns - 1)
            self._chosen.go_to(self._chosen.head_ns + 1)

    def _halt_not_at(self, command: RunCommand) -> None:
        if self._points.pop(command.number, None) is None:
            raise UsageError(f"there is no place {command.number} to halt at", hint="it may be gone")
        del self._counts[command.number]
        self._chosen.arm(self._armed)

    def watch(self, names: Sequence[str]) -> None:
        """Look at these variables of the program from now on, too.

        Raises:
            UsageError: There is none of a name, or there are too many.
        """
        table = read_variables(self._main.machine.board.image)
        found = [table.variable(name) for name in names]
        wanted = self._variables | {one.name: one for one in found}
        if len(wanted) > MOST_VARIABLES:
            raise UsageError(f"{MOST_VARIABLES} variables are watched already", hint="take one away")
        self._look_at(wanted)

    def watched(self) -> Iterator[tuple[Future, Mapping[str, str]]]:
        """Yield each future, with the names and types of the variables that are watched."""
        types = {name: one.type_name for name, one in self._variables.items()}
        for future in self._futures.values():
            yield future, types

    def _watch(self, command: RunCommand) -> None:
        self.watch([command.words])

    def _watch_not(self, command: RunCommand) -> None:
        self._look_at({name: one for name, one in self._variables.items() if name != command.words})

    def _look_at(self, variables: dict[str, Variable]) -> None:
        self._variables = variables
        for future in self._futures.values():
            future.watch(list(variables.values()))

    def _named(self, name: str) -> Future:
        found = self._futures.get(name)
        if found is None:
            raise UsageError(f"there is no future {name!r}", hint=", ".join(self._futures))
        return found

    def _stop(self, why: str) -> None:
        self.is_running, self._why, self._is_step = False, why, False
        self.holds.page_holds()
        self._chosen.forget_step()

    _is_step = False

    # Going on.

    def go_on(self, clock_ns: Nanos) -> float:
        """Run a slice of the chosen future, as far as its pace has come.

        Args:
            clock_ns: Of any clock that goes on.

        Returns:
            Seconds until the next slice is due.
        """
        future = self._chosen
        limit = self._due(clock_ns)
        if limit is not None and limit <= future.head_ns:
            return (future.head_ns + self._least - limit) / self.speed / NS_PER_S
        limit = future.head_ns + SLICE_NS * _SLICES if limit is None else min(limit, future.head_ns + _MOST_LAG_NS)
        halted = future.run_to(limit, is_seen_at_once=0 < self.speed < _SLOW and not self._is_step)
        if halted is not None:
            self._halted(halted)
        if self._reported_at is None or halted is not None or clock_ns - self._reported_at >= _REPORTED_NS:
            self._reported_at, self._state = clock_ns, None
        return 0.0

    @property
    def _least(self) -> Nanos:
        """The least that is run in one go: a fiftieth of a second of the clock."""
        return max(1, int(SLICE_NS * self.speed))

    def _due(self, clock_ns: Nanos) -> Nanos | None:
        """Return the time that the pace has come to; None where there is no pace."""
        if self.speed == 0 or self._is_step:
            return None
        head = self._chosen.head_ns
        if self._base is None:
            self._base = clock_ns, head
        begun, base = self._base
        due = base + int((clock_ns - begun) * self.speed)
        if due - head > _MOST_LAG_NS * max(1.0, self.speed):
            self._base = clock_ns, head
            due = head + self._least
        return due

    def _halted(self, halted: Halted) -> None:
        if halted.number == GDB:
            self._stand_for_gdb(replace(halted, why=halted.stop.kind.value))
            return
        if halted.number in self._counts:
            self._counts[halted.number] += 1
        was_going = self._is_going
        self._stop(halted.why)
        if was_going:
            self._tell_gdb(halted)

    def end(self) -> None:
        """Bring the run itself to where it was furthest, for whoever ends it there."""
        self._stop("")
        main = self._main
        self._choose_future(main)
        main.arm({})
        if main.now_ns < (furthest := min(main.known_ns, main.bench.end)):
            main.go_to(furthest)

    def replace_main(self, path: Path) -> None:
        """Go on with a copy of the run itself, whose trace is another file: the run's own is to be ended."""
        self._main.replace(self._main.bench.fork(path))
        self._recorder.begin(self._main)


def _wires(bench: Bench) -> Mapping[str, str] | None:
    own = bench.scenario.own_robot
    return None if own is None else own.wires


def _parting_of(part: Difference) -> PartingState:
    if part.one is not None and part.other is not None:
        words = distinguishing_words(part.one, part.other)
    else:
        words = tuple("nothing more" if one is None else what_of(one) for one in (part.one, part.other))  # type: ignore[assignment]  # two
    return PartingState(signal=part.signal, at_ns=part.at, one=words[0], other=words[1])


#: chosen: slices in one go where there is no pace.
_SLICES = 4
