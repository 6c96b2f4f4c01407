"""A run under control of a page and of GDB, asked for things at random: how it stands after each."""

import shutil
from collections.abc import Iterator
from pathlib import Path
from random import Random
from tempfile import mkdtemp
from types import SimpleNamespace
from typing import Any

from bluepill_sim.core import Watchpoint
from bluepill_sim.program.line_table import read_lines
from bluepill_sim.program.variables import read_variables
from p2os.view.run_control import RunCommand
from robot_bench.bench import Bench
from robot_bench.cli.debugging.future import Future
from robot_bench.cli.debugging.gdb_beside import GdbBeside
from robot_bench.cli.debugging.hands import drive_words, driven_by, hand_of, saved_as
from robot_bench.cli.debugging.points import STEPS, other_lines, point_of
from robot_bench.cli.debugging.session import RunSession, trouble_of
from robot_bench.scenario.loading import load_scenario
from simbase.errors import UsageError
from simbase.timing import NS_PER_MS
from tests.robot_bench.running.test_run_control import Controlled, Listener, scenario
from tests.tools.suite.acted import Acted, taken
from tests.tools.suite.approved import Trace, judge_of, said, tried
from tests.tools.suite.declared import declared_of

DURATION_S = 0.56
#: Where slices are as long as a clock wants them, so are the stretches in which variables are seen.
SLICE_NS = 10 * NS_PER_MS
PLACES = (
    "pin p2dx_con high", "pin encoder1_s1 changes", "packet PULSE", "note adapter connected", "robot near 0 0 1",
    "robot moves", "time 0.4", "line dodge.c:24", "line dodge.c:36", "line dodge.c:1", "variable ticks",
    "variable nothing", "goal met",
)  # fmt: skip
BY_HAND = (
    "move crate to 1.2 0.1 heading 20", "place post cylinder 0.1 at 1 1", "remove crate", "carry robot to 0.3 0.2",
    "fault sonar-stuck 3 0.2", "clear sonar-stuck 3", "press stop-button", "pin DD3 high", "let go DD3",
    "volts PA0 1.5", "type usart1 go", "drive 0.2 30", "let go wheels", "nonsense", "",
)  # fmt: skip
UNITS = ("instruction", "line", "edge", "packet", "event", "millisecond")


def controlled(folder: Path, waits_for_gdb: str = "") -> Controlled:
    run = Controlled(folder, duration_s=DURATION_S)
    run.session = RunSession(Bench(scenario(DURATION_S), slice_ns=SLICE_NS), Listener(), folder, 0.0, waits_for_gdb)
    return run


def shown(run: Controlled) -> Iterator[str]:
    session = run.session
    yield f"{said(session.state())} over={session.is_over} free={session.holds.is_free}"
    for future, types in session.watched():
        seen = [(one.begins_ns, one.until_ns, one.rows) for one in future.take_seen()]
        yield said([future.name, types, future.is_past, future.is_over, future.now_ns, seen])


def let_go(run: Controlled, slices: int) -> str:
    """Go on for some slices of a clock; say how long each wait is."""
    waits = []
    for _ in range(slices):
        if run.session.is_running:
            waits.append(run.session.go_on(run.clock_ns))
            run.clock_ns += 10 * NS_PER_MS
    return said(waits)


def asked(draw: Random, run: Controlled, kind: str) -> str:
    """Ask for one thing as a page does."""
    futures = [one.name for one in run.session.state().futures]
    at_ns = draw.randrange(round(DURATION_S * 1000) + 10) * NS_PER_MS
    future = draw.choice([*futures, "none"])
    about: dict[str, dict[str, object]] = {
        "run": {"at_ns": draw.choice((None, None, at_ns))}, "pause": {},
        "go": {"at_ns": draw.choice((at_ns, at_ns, None, 700 * NS_PER_MS))},
        "step": {"unit": draw.choice(UNITS)}, "back": {"unit": draw.choice(UNITS)},
        "speed": {"speed": draw.choice((0.0, 0.1, 1.0, 50.0))},
        "fork": {"at_ns": at_ns, "words": draw.choice(("", "", *BY_HAND))},
        "choose": {"future": future}, "drop": {"future": future}, "compare": {"future": future},
        "hand": {"words": draw.choice(BY_HAND), "at_ns": draw.choice((None, None, at_ns))},
        "drive": {"forward_mps": draw.choice((0.0, 0.2, -0.3)), "turn_dps": draw.choice((0.0, 30.0))},
        "stop": {}, "save": {"words": draw.choice(("scenario", "test", "book"))},
        "halt_at": {"words": draw.choice(PLACES)}, "halt_not_at": {"number": draw.randint(1, 5)},
        "watch": {"words": draw.choice(("ticks", "nothing", "turn_left"))},
        "watch_not": {"words": draw.choice(("ticks", "nothing"))},
        "dance": {},
    }  # fmt: skip
    run.do(kind, **about[kind])
    return f"{kind} {said(about[kind])}"


KINDS = (
    "run", "run", "pause", "go", "go", "step", "step", "step", "back", "back", "speed", "fork", "choose", "drop",
    "compare", "compare", "hand", "hand", "drive", "stop", "save", "halt_at", "halt_at", "halt_not_at", "watch",
    "watch_not", "dance",
)  # fmt: skip


def page(draw: Random) -> Iterator[str]:
    """Ask for anything; forks come and go, up to as many as there may be."""
    folder = Path(mkdtemp(prefix="p2os-test-"))
    run = controlled(folder)
    run.do("speed", speed=1.0)
    for step in range(60):
        if run.session.chosen.is_over and draw.random() < 0.8:
            run.do("go", at_ns=draw.randrange(500) * NS_PER_MS)
        if step == 40:
            for _ in range(8):
                run.do("fork", at_ns=300 * NS_PER_MS)
            yield from shown(run)
        if len(run.session.state().futures) > 4 and step > 43:
            run.do("drop", future=run.session.state().futures[-1].name)
        yield asked(draw, run, KINDS[step % len(KINDS)] if step < 30 else draw.choice(KINDS))
        yield let_go(run, draw.choice((0, 1, 3, 8)))
        yield from shown(run)
        yield said([*run.session.hands])
    run.session.end()
    yield from shown(run)
    run.session.replace_main(folder / "other.jsonl")
    run.session.bench.run_until(run.session.bench.end)
    run.session.bench.finish()
    yield run.session.bench.trace.sha256
    shutil.rmtree(folder)


class Port:
    """GDB's port: keeps what it is reported."""

    def __init__(self) -> None:
        self.reported: list[object] = []

    def serve(self, _target: object, wait_s: float) -> None:
        self.reported.append(wait_s)

    def stopped(self, stop: object, why: str) -> None:
        self.reported.append((stop, why))


def gdb(draw: Random) -> Iterator[str]:
    """GDB comes, halts, steps, continues, goes and is lost, while a page does what it does."""
    folder = Path(mkdtemp(prefix="p2os-test-"))
    run, port = controlled(folder, "waits for GDB"), Port()
    beside = GdbBeside(run.session, port)  # type: ignore[arg-type]  # as far as it is asked
    board = run.session.chosen.machine.board
    rows = [
        row.address for row in read_lines(board.image).rows if row.file.endswith("dodge.c") and row.line in (24, 36)
    ]
    ticks, size, _ = read_variables(board.image).place("ticks")
    points: list[int | Watchpoint] = [Watchpoint(ticks, size.size), *rows[:2]]
    is_there = False
    kinds = (
        "set_point", "go_on", "go_on", "step", "go_on", "step_back", "go_back", "set_point", "go_on", "interrupted",
        "page", "page", "set_point", "left", "lost",
    )  # fmt: skip
    yield from shown(run)
    run.do("speed", speed=1.0)
    for step in range(60):
        if run.session.chosen.is_over and is_there:
            beside.left(was_killed=False, is_lost=False)
            is_there = False
            run.do("go", at_ns=draw.randrange(400) * NS_PER_MS)
        kind = "attached" if not is_there else kinds[step % len(kinds)] if step < 30 else draw.choice(kinds)
        is_set = draw.random() < 0.8
        if kind == "page":
            kind = asked(
                draw, run, draw.choice(("run", "run", "run", "pause", "go", "step", "halt_at", "hand", "drive", "fork"))
            )
        elif kind == "attached":
            if draw.random() < 0.5:
                kind = asked(draw, run, "run")
            beside.attached()
            is_there = True
            for point in draw.sample(points, 2):
                beside.set_point(point, is_set=True)
        elif kind == "set_point":
            beside.set_point(draw.choice(points), is_set=is_set)
        elif kind in {"left", "lost"}:
            beside.left(was_killed=False, is_lost=kind == "lost")
            is_there = False
        else:
            getattr(beside, kind)()
        beside.changed()
        waits = let_go(run, draw.choice((1, 2, 5)))
        beside.serve(0.25)
        yield f"{kind} {is_set} {waits} {said(port.reported)} {beside.machine is run.session.chosen.machine}"
        port.reported.clear()
        yield from shown(run)
    yield tried(lambda: beside.left(was_killed=True, is_lost=False))
    shutil.rmtree(folder)


def words(_draw: Random) -> Iterator[str]:
    """Read the words of places and hands, for a robot, a board by itself, and a mode without a controller."""
    bench = Bench(scenario(DURATION_S))
    board = bench.chip
    for line in (
        *PLACES, "line dodge.c", "line :3", "line dodge.c:x", "line dodg.c:3", "line dodge.c:18", "line dodge.c:9999",
        " line  dodge.c:24 ", "variable ticks", "variable", "spi spi1", "i2c i2c1 0x3c", "can can", "pni PA1", "",
    ):  # fmt: skip
        point = tried(point_of, line, board, bench.scenario, None)
        yield f"{line!r}: {point.partition(' at 0x')[0] if 'function' in point else point}"
    yield said(len(other_lines(board)))  # type: ignore[arg-type]  # an emulated one
    for unit, make in STEPS.items():
        yield said([unit, [kind.__name__ for kind in make("", None).kinds], make("p2dx_con", None).words])
    driven = []
    for about in (bench, Bench(load_scenario("dodge").with_options(mode="direct", body="kinematic"))):
        for number, line in enumerate(BY_HAND):
            yield f"{line!r}: {tried(hand_of, line, number, about)}"
        driven = [hand_of(line, 10 * n, about) for n, line in enumerate(
            ("drive 0.2 30", "volts PA0 1", "let go wheels", "drive -0.1 0", "let go PA0", "drive 0 -5"))]  # fmt: skip
    yield said([driven_by(driven, at) for at in (-1, 0, 9, 10, 19, 20, 21, 30, 40, 49, 50, 51)])
    alone = SimpleNamespace(scenario=SimpleNamespace(has_robot=False, own_robot=None, parameters=None))
    for line in BY_HAND:
        yield f"alone {line!r}: {tried(hand_of, line, 5, alone)}"
    yield said([tried(saved_as, one) for one in ("scenario", "test", "")])
    yield said([drive_words((0.12345, -7.06)), trouble_of(UsageError("no", hint="yes")), trouble_of(UsageError("no"))])


def paces(_draw: Random) -> Iterator[str]:
    """Say what time the pace has come to: of a run that stands, keeps up, or lags by a little less or more."""
    for speed in (0.0, 0.1, 0.5, 0.75, 1.0, 1.5, 4.0):
        for is_step in (False, True):
            for lag_ms in (0, 250, 300, 375, 400, 499, 500, 501, 750, 751, 1999, 2001):
                run: Any = SimpleNamespace(
                    speed=speed, _is_step=is_step, _base=(10**9, 0), _chosen=SimpleNamespace(head_ns=5 * NS_PER_MS),
                    _least=max(1, int(10 * speed)),
                )  # fmt: skip
                clock_ns = 10**9 + round((lag_ms + 5) * NS_PER_MS / (speed or 1.0))
                yield said([speed, is_step, lag_ms, RunSession._due(run, clock_ns), run._base])
                run._base = None
                yield said([RunSession._due(run, clock_ns), run._base])
        yield said(RunSession._least.fget(SimpleNamespace(speed=speed)))  # type: ignore[attr-defined]  # a property


def resumed(_draw: Random) -> Iterator[str]:
    """Go on from where a run stands: at a breakpoint it makes one step without any, and what was hit is forgotten."""
    for pc in (4, 8):
        for is_over in (False, True):
            engine = SimpleNamespace(breakpoints={8, 12}, watchpoints={16})
            board, seen = SimpleNamespace(pc=pc, chip=SimpleNamespace(engine=engine)), list[object]()
            future: Any = SimpleNamespace(
                _hits=[(1, 2, "x")], machine=SimpleNamespace(board=board), is_over=is_over,
                execution=SimpleNamespace(step=lambda e=engine, s=seen: s.append([*e.breakpoints, *e.watchpoints])),
            )  # fmt: skip
            Future.resume(future)
            yield said([pc, is_over, future._hits, seen, sorted(engine.breakpoints), sorted(engine.watchpoints)])


def hands(_draw: Random) -> Iterator[str]:
    """Do something by hand at a time or now, in a future whose past is known or not, running or standing."""
    for at_ns in (None, 7):
        for is_past in (False, True):
            for is_running in (False, True):
                for does in ("drive 0.1 0", "let go", "type go", ""):
                    calls: list[str] = []
                    chosen: Any = Acted(calls, "chosen")
                    chosen.is_past, chosen.now_ns, chosen.hands = is_past, 9, ()
                    run: Any = Acted(calls)
                    run.is_running, run._chosen, run._speeds, run.holds = (
                        is_running,
                        chosen,
                        "as before",
                        Acted(calls, "holds"),
                    )
                    ended = tried(RunSession._hand, run, RunCommand(do="hand", words=does, at_ns=at_ns))
                    yield said([at_ns, is_past, is_running, does, ended, run._speeds]) + taken(calls).replace(
                        " object", ""
                    )


def places(_draw: Random) -> Iterator[str]:
    """Halt no more at a place, which may be gone."""
    for number in (1, 2, 3):
        calls: list[str] = []
        run: Any = SimpleNamespace(_points={1: "a", 2: "b"}, _counts={1: 5, 2: 6}, _armed="armed",
                                   _chosen=Acted(calls, "chosen"))  # fmt: skip
        ended = tried(RunSession._halt_not_at, run, RunCommand(do="halt", number=number))
        yield said([number, ended, run._points, run._counts, taken(calls)])


TRACES: dict[str, Trace] = {
    "places": places,
    "hands": hands,
    "resumed": resumed,
    "paces": paces,
    "words": words,
    "declared": declared_of("robot_bench.cli.debugging"),
    "gdb": gdb,
    "page": page,
}
test_how_a_run_stands_is_what_was_approved = judge_of(__file__, TRACES)
