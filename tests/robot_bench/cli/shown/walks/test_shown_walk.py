"""What pages are shown of runs: panels of the chip, what hands may do and have done, live runs and fleets as asked."""

import contextlib
import io
import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any
from unittest import mock

from bluepill_sim.board import BluePill
from bluepill_sim.cli.browser.viewing import ViewedRun
from p2os.view.header import PageSection, PageText
from p2os.view.recording import ViewRecording
from p2os.view.run_control import RunCommand
from p2os.view.targets import ViewPanel
from robot_bench.bench import Bench
from robot_bench.cli import run as run_verb
from robot_bench.cli.debugging.hands import hand_of
from robot_bench.cli.shown import chip_panels, live_target, lone_board, saved_hands, targets
from robot_bench.cli.shown.fleet_hands import FleetHands
from robot_bench.cli.shown.live_fleet import LiveFleet
from robot_bench.cli.shown.live_run import BenchBuilt, BenchReleased, Happened, LiveRun
from robot_bench.cli.shown.looked_panels import LOOK_NS, MOST_LOOKS, LookedPanels
from robot_bench.cli.shown.offered_hands import hands_of
from robot_bench.cli.shown.targets import run_target, scenario_target
from robot_bench.scenario.loading import load_scenario
from robot_bench.scenario.scenario import Scenario
from tests.robot_bench.firmware.hurried import hurried_scenario
from tests.tools.suite.acted import Acted, taken
from tests.tools.suite.approved import judge_of, said, tried
from tests.tools.suite.declared import declared_of

MS = 1_000_000
GOAL = '[[goal]]\nkind = "min_distance"\ndistance_m = 1\n[start]\nx_m = 1\ny_m = 0\nheading_deg = 0\n'
SCENARIO = hurried_scenario("dodge", 1, mode="direct", body="kinematic", duration_s=0.3)
ASKED = (
    RunCommand(do="pause"),
    RunCommand(do="step", unit="millisecond"),
    RunCommand(do="go", at_ns=100 * MS),
    RunCommand(do="watch", words="ticks"),
    RunCommand(do="watch", words="nothing"),
    RunCommand(do="hand", words="carry robot to 0.3 0.2"),
    RunCommand(do="run"),
    RunCommand(do="fork", words="pin PA0 high"),
    RunCommand(do="drive", forward_mps=0.9, turn_dps=-200.0),
    RunCommand(do="run"),
    RunCommand(do="stop"),
    RunCommand(do="halt_at", words="pin motor1_comm1 changes"),
    RunCommand(do="save", words="scenario"),
    RunCommand(do="compare", future="run"),
    RunCommand(do="choose", future="run"),
    RunCommand(do="drop", future="fork 1"),
    RunCommand(do="speed", speed=0.0),
    RunCommand(do="run"),
    RunCommand(do="run"),
)
FLEET = (
    RunCommand(do="hand", robot="east", words="drive 0.2 30"),
    RunCommand(do="hand", robot="none", words="drive 0 0"),
    RunCommand(do="hand", words="press stop-button"),
    RunCommand(do="drive", robot="west", forward_mps=0.9),
    RunCommand(do="drive", robot="east", forward_mps=-0.2, turn_dps=200.0),
    RunCommand(do="stop"),
    RunCommand(do="hand", robot="east", words="let go wheels"),
    RunCommand(do="pause"),
    RunCommand(do="save", words="test"),
    RunCommand(do="save", words="book"),
    RunCommand(do="step", unit="millisecond"),
    RunCommand(do="step", unit="event"),
    RunCommand(do="run", at_ns=0),
    RunCommand(do="back", unit="event"),
    RunCommand(do="speed", speed=4.0),
    RunCommand(do="run"),
)


def panels(_draw: Random) -> Iterator[str]:
    """Look at each panel of a chip, with each of its choices, at three times."""
    bench = Bench(SCENARIO, slice_ns=10 * MS)
    board = bench.chip
    assert isinstance(board, BluePill)
    made = [make(board) for make in (chip_panels.program_panel, chip_panels.registers_panel, chip_panels.board_panel)]
    yield said([make(3) for make in (chip_panels.program_panel, chip_panels.registers_panel, chip_panels.board_panel)])
    yield said([chip_panels._frequency(hz) for hz in (0, 1, 999_999, 1_000_000, 72_000_000, 8_123_456)])
    yield said([chip_panels._field("A", value) for value in (0, 9, 10)])
    for at in (0, 5, 120):
        bench.run_until(at * MS)
        for panel in made:
            assert panel is not None
            yield said([panel.name, panel.title, panel.header])
            for choice in (*panel.choices, "none", "") if at != 5 else panel.choices[:3]:
                for section in panel.look(choice):
                    yield f"{choice} {section.title} {section.note}"
                    yield from (said(block) for block in section.blocks)


def hands(_draw: Random) -> Iterator[str]:
    """Offer what hands can do, and write down what they have done."""
    for name, options in (("dodge", {}), ("dodge", {"mode": "direct"}), ("rover", {}), ("two-dodge", {})):
        scenario = load_scenario(name).with_options(**options)
        for one in (scenario, *scenario.programmed):
            yield said([name, options, hands_of(one)])
    bench = Bench(hurried_scenario("dodge", 1, body="kinematic", duration_s=0.3))
    done = [hand_of(words, (n + 1) * 10**7 + 7, bench) for n, words in enumerate((
        "drive 0.2 30", "press stop-button", "pin PA0 high", "volts PA1 1.5", "type usart1 go", "move crate to 1 1",
        "let go wheels", "carry robot to 0.1 0.2"))]  # fmt: skip
    before = Path.cwd()
    with TemporaryDirectory(prefix="p2os-test-") as name:
        os.chdir(name)
        try:
            folder = Path(name, "runs", "my run-1")
            folder.mkdir(parents=True)
            file = Path(name, "mine.toml")
            head = 'firmware = "dodge.elf"\nworld = "arena"\nbody = "kinematic"\nseeds = "0-3"\nduration_s = 9\n'
            for text in (
                "",
                '[[goal]]\nkind = "min_distance"\ndistance_m = 1\n[start]\nx_m = 1\ny_m = 0\nheading_deg = 0\n',
            ):
                file.write_text(head + text, encoding="utf-8")
                scenario = load_scenario(str(file)).with_options(seed=4, usart_baud=9600, record="spi1")
                yield saved_hands.scenario_text(scenario, done, folder).replace(name, "HERE")
            for kind, future in (("scenario", ""), ("test", "fork 1")):
                yield saved_hands.saved_beside(scenario, done, folder, kind, future).replace(name, "HERE")
            yield said(sorted(path.name for path in folder.parent.iterdir()))
            yield tried(saved_hands.saved_beside, scenario, done, None, "test")
            yield tried(saved_hands.scenario_text, replace(scenario, path=None), done, folder)
            yield said([tried(run_target, one) for one in ("none", name)])
            yield said([tried(scenario_target, one) for one in ("none", "gone.toml")])
        finally:
            os.chdir(before)
    yield saved_hands.pytest_text("a b-c.toml", 1_500_000_000)
    yield saved_hands.scenario_text(load_scenario("two-dodge"), [replace(done[0], robot="west")], Path("/x"))


def rows(shown: ViewRecording) -> Iterator[str]:
    yield said(
        [shown.header.title, shown.header.lead, shown.header.is_live, shown.header.robots, sorted(shown.dropped)]
    )
    for track in shown.tracks:
        yield said([track.header.source, track.header.name, len(track.times), *track.times[:3], *track.times[-2:]])


def live(_draw: Random) -> Iterator[str]:
    """Ask a live run for all that a page may ask for, a command at a look of its clock."""
    states: list[str] = []
    with TemporaryDirectory(prefix="p2os-test-"):
        run = LiveRun(SCENARIO, speed=0.5, variables=["head"], on_wait=lambda: states.append("waits"))
        left, now = [*ASKED], 0
        offer = run.source.offer

        def offered(happened: Happened, *given: Any, **named: Any) -> None:
            if not isinstance(happened, BenchBuilt | BenchReleased):
                states.append(said([happened, given, named]))
            offer(happened, *given, **named)

        def clock() -> int:
            nonlocal now
            now += LOOK_NS // 3
            for panel, choice in (("program", "next line"), ("chip", "NVIC"), ("none", "")):
                found = run.look(panel, choice)
                states.append(f"{panel} {None if found is None else (found.at_ns, len(said(found)))}")
            if left and now % (LOOK_NS // 3 * 2) == 0:
                run.offer(left.pop(0))
            return now

        def show(state: object) -> None:
            states.append(said(state))

        run._clock, run._show = clock, show  # type: ignore[method-assign,assignment]  # each of them
        run.source.offer = offered  # type: ignore[method-assign]
        run.drive(Bench(SCENARIO, slice_ns=10 * MS))
        yield from states
        run.source.update()
        yield from rows(run.source.recording)
        yield said(run.offered("t"))


def fleet(_draw: Random) -> Iterator[str]:
    """Ask robots of one world for all that a page may ask for."""
    scenario = load_scenario("two-dodge").with_options(duration_s=0.25)
    states: list[str] = []
    run = LiveFleet(scenario, speed=0.3, on_wait=lambda: states.append("waits"))
    left, now = [*FLEET], 0

    def clock() -> int:
        nonlocal now
        now += LOOK_NS // 3
        for panel, choice in (("program", "west: next line"), ("board", "east"), ("board", "gone")):
            found = run.look(panel, choice)
            states.append(f"{panel} {None if found is None else (found.at_ns, len(said(found)))}")
        if left:
            run.offer(left.pop(0))
        return now

    kept = run._show

    def show(state: object) -> None:
        states.append(said(state))
        kept(state)  # type: ignore[arg-type]  # as it is

    run._clock, run._show = clock, show  # type: ignore[method-assign,assignment]  # each of them
    run.drive(Bench.together(scenario, slice_ns=10 * MS))
    yield from states
    run.source.update()
    yield from rows(run.source.recording)


def fleet_hands(draw: Random) -> Iterator[str]:
    """Drive robots of one world by hand, heard of in time and too late."""
    scenario = load_scenario("two-dodge").with_options(duration_s=0.6)
    benches = Bench.together(scenario, slice_ns=10 * MS)
    made, clock = FleetHands(benches, 500 * MS), 0
    for _ in range(30):
        clock += draw.choice((10, 100, 600)) * MS
        robot = draw.choice(("", "west", "east", "none"))
        words = draw.choice(("drive 0.2 10", "let go wheels", "press stop-button", "nothing", "carry robot to 0 0"))
        command = RunCommand(
            do=draw.choice(("drive", "drive", "stop")), robot=robot, forward_mps=draw.choice((0.0, 0.3))
        )
        reported = [tried(made.do, robot, words) if draw.random() < 0.4 else "", tried(made.ask, command, clock),
                tried(made.drive_on, clock)]  # fmt: skip
        yield said([robot, words, command.do, reported, [one.now for one in benches.values()]])
        yield said([(one.robot, one.at, one.words) for one in made.done[-3:]])


def looks(_draw: Random) -> Iterator[str]:
    """Look at panels as often as may be, and at more than may be."""
    counts: dict[str, int] = {}

    def look(choice: str) -> list[PageSection]:
        counts[choice] = counts.get(choice, 0) + 1
        return [PageSection(title="t", blocks=[PageText(text=f"{choice} {counts[choice] // 2}")])]

    panel = ViewPanel("a", "A", ("x",), look)
    made = LookedPanels([panel])
    for at in (0, 1, LOOK_NS - 1, LOOK_NS, LOOK_NS + 1, 2 * LOOK_NS, 3 * LOOK_NS):
        reported = [made.asked("a", "x"), made.asked("b", "x"), made.is_due(at)]
        made.look(at, at // 2)
        yield said([at, reported, counts])
    for number in range(MOST_LOOKS + 2):
        made.asked("a", str(number))
    made.look(9 * LOOK_NS, 5)
    yield said([sorted(counts), [made.asked("a", str(n)) is None for n in range(MOST_LOOKS + 2)], len(made.panels)])
    made.replace([])
    with contextlib.suppress(KeyError):
        made.look(99 * LOOK_NS, 5)
    yield said([made.asked("a", "1"), made.panels])


class Live:
    """Takes the place of a run that a page shows: notes what it is made with and asked."""

    def __init__(self, calls: list[str], scenario: Any, **named: Any) -> None:
        self.stays = False
        self.source: Any = Acted(calls, "source")
        self.scenario, self._calls = scenario, calls
        calls.append(said(["live", scenario.name, {key: one for key, one in named.items() if key != "on_wait"}]))
        if "on_wait" in named:
            named["on_wait"]()

    def drive(self, bench: Any) -> str:
        self._calls.append(said(["drive", self.stays, bench]))
        return "driven"

    def stay(self) -> None:
        self._calls.append(said(["stay", self.stays]))


def held(_draw: Random) -> Iterator[str]:
    """Show boards, runs and fleets on pages that are none, driven by whatever is asked for."""
    calls: list[str] = []

    @contextlib.contextmanager
    def noted(*given: object, **named: object) -> Iterator[str]:
        names = [one.name if isinstance(one, Scenario) else "words" if callable(one) else str(one) for one in given]
        calls.append(said([*names, named]))
        yield "port"
        calls.append("closed")

    def live_of(scenario: Any, **named: Any) -> Live:
        return Live(calls, scenario, **named)

    display: Any = Acted(calls, "display")
    chosen = load_scenario("motors")
    with contextlib.ExitStack() as stack:
        for module in (lone_board, run_verb):
            for part, other in (("gdb_port", noted), ("shown", noted), ("LiveRun", live_of), ("LiveFleet", live_of)):
                if hasattr(module, part):
                    stack.enter_context(mock.patch.object(module, part, other))
        bench = Acted(calls, "bench")
        bench.now, bench.trace = 1_250_000_000, Acted(calls, "trace")  # type: ignore[attr-defined]
        stack.enter_context(mock.patch.object(lone_board, "Bench", lambda scenario, trace: calls.append(
            f"{scenario.name} {type(trace).__name__}") or bench))  # fmt: skip
        for ends in ([], [KeyboardInterrupt()]):
            bench._answers["finish"] = [*ends]
            viewed = ViewedRun(firmware=chosen.firmware, end_ns=5, usart_baud=9600, gdb=3, is_opened=False)
            with contextlib.redirect_stderr(io.StringIO()) as shown, contextlib.suppress(KeyboardInterrupt):
                lone_board.view_board(viewed)
            yield said([shown.getvalue(), taken(calls)])
        with run_verb.viewed(chosen, 0.5, display, ["a"], is_opened=True, gdb=0) as drive:
            yield said([drive(bench), taken(calls)])  # type: ignore[arg-type]  # as much of it as is asked
        with mock.patch.object(
            run_verb, "run_together", lambda *given, **named: [given[1:], sorted(named), named["force"]]
        ):
            yield said(run_verb.run_viewed_fleet(chosen, Path("f"), 2.0, display, force=True, is_opened=False))
            yield taken(calls)
        other: Any = SimpleNamespace(
            live_scene=noted, met=noted, refuse_without_pins=lambda one: calls.append(one.name),
            with_inputs=lambda inputs: f"with {inputs}",
        )  # fmt: skip
        for ros, inputs, foxglove in ((None, None, None), ("node", None, None), (None, Path("in"), None),
                                      ("node", Path("in"), None), ("", None, None), (None, None, "9000")):  # fmt: skip
            with (
                mock.patch.object(run_verb, "network_of", return_value=other),
                mock.patch.object(run_verb, "viewer_of", return_value=other),
                run_verb.driven(chosen, ros=ros, inputs=inputs, foxglove=foxglove, origins=["o"]) as by,
            ):
                yield said([ros, inputs, foxglove, by])
            yield taken(calls)


def held_targets(_draw: Random) -> Iterator[str]:
    """Run scenarios that a page shows, with and without GDB beside it, to their ends and interrupted."""
    calls: list[str] = []
    chosen = load_scenario("motors")

    def live_of(scenario: Any, **named: Any) -> Live:
        return Live(calls, scenario, **named)

    with TemporaryDirectory(prefix="p2os-test-") as name, mock.patch.object(live_target, "LiveRun", live_of):
        for was_interrupted in (False, True):
            for is_kept in (False, True):
                done = SimpleNamespace(folder=Path(name), was_interrupted=was_interrupted)
                page = SimpleNamespace(header="header")
                with (
                    mock.patch.object(live_target, "run_scenario", lambda *given, d=done, **named: calls.append(
                        said([given[0].name, given[1], named["drive"]("bench")])) or d),
                    mock.patch.object(live_target, "make_next_folder", "{}-001".format),
                    mock.patch.object(live_target, "kept", return_value=page if is_kept else None),
                    mock.patch.object(live_target, "read_run"),
                    mock.patch.object(live_target, "run_report", return_value=page),
                    mock.patch.object(live_target, "GdbPort", lambda port: Acted(calls, f"gdb {port}")),
                    mock.patch.object(live_target, "say_where", lambda _port, one: calls.append(one.name)),
                ):  # fmt: skip
                    target = live_target.live_target(chosen)
                    for one in (target, target.debugged(3)) if target.debugged is not None else ():
                        try:
                            one.run()
                            yield taken(calls)
                        except KeyboardInterrupt:
                            yield f"interrupted {taken(calls)}"


def looked(_draw: Random) -> Iterator[str]:
    """Count what has run anew at each look of a small program, and more seldom of a larger one; collect no garbage."""
    for size in (0, 2999, 3000, 9000, 20_000):
        counts: list[int] = []
        counted = SimpleNamespace(of_board=lambda *_, counts=counts: counts.append(1))
        board: Any = SimpleNamespace(entered_blocks={1}, gone_ways=set(), image=SimpleNamespace(name="a/b.elf"))
        with (
            mock.patch.object(chip_panels, "Coverage", counted),
            mock.patch.object(chip_panels, "program_lines", lambda *_, size=size: {
                "files": [], "functions": [["f", 0, size // 2], ["g", 0, size - size // 2]]}),
        ):  # fmt: skip
            program = chip_panels._RunningProgram(board)
            for number in range(24):
                board.entered_blocks = {*range(number)}
                counts.append(len(program.lines["functions"]))  # type: ignore[arg-type]  # a list
        yield said([size, counts])
    calls: list[str] = []
    for was_enabled in (True, False):
        with (
            mock.patch.object(targets, "gc", Acted(calls, "gc", isenabled=[was_enabled])),
            targets._without_collecting(),
        ):
            calls.append("inside")
        yield said([was_enabled, taken(calls)])


TRACES = {
    "looked": looked,
    "held": held, "held targets": held_targets,
    "panels": panels, "hands": hands, "live": live, "fleet": fleet, "fleet_hands": fleet_hands, "looks": looks,
    "declared": declared_of("robot_bench.cli.shown"),
}  # fmt: skip
test_what_pages_are_shown_is_what_was_approved = judge_of(__file__, TRACES)
