"""Whole programs on the interpreter: the run on Unicorn, slice by slice, with halts, snapshots and faults."""

from collections.abc import Callable
from typing import Any

import pytest

from bluepill_sim import BluePill
from bluepill_sim.core import HaltKind, WatchKind, Watchpoint
from bluepill_sim.core.unicorn_core import UnicornCore
from bluepill_sim.errors import BluePillError
from bluepill_sim.extension.library import core_chosen
from bluepill_sim.native.interpreter_core import InterpreterCore
from tests.bluepill_sim.machine import listen
from tests.bluepill_sim.native.test_native_core import PROGRAMS, story

CORES = ("own", "native")
REGISTERS = (
    *(f"R{n}" for n in range(13)),
    "SP",
    "LR",
    "XPSR",
    "MSP",
    "PSP",
    "PRIMASK",
    "BASEPRI",
    "FAULTMASK",
    "CONTROL",
)
SRAM, SRAM_BYTES = 0x2000_0000, 0x5000
MS = 1_000_000

MakeBoard = Callable[[str, str], BluePill]


@pytest.fixture
def make(monkeypatch: pytest.MonkeyPatch) -> MakeBoard:
    """Make a board with a core: make("dodge", "own")."""

    def make_board(program: str, core: str) -> BluePill:
        monkeypatch.setenv("P2OS_CORE", core)
        board = BluePill(str(PROGRAMS[program]))
        assert isinstance(board.chip.engine._core, InterpreterCore) is (core == "own")
        return board

    return make_board


def state(board: BluePill) -> list[Any]:
    """Return what decides a board's future, but for how its core keeps its registers."""
    chip = board.chip.snapshot()
    seen = {name: value for name, value in chip.items() if name != "processor"}
    return [
        board.now_ns, board.cycle, board.pc, [board.register(name) for name in REGISTERS],
        board.read_memory(SRAM, SRAM_BYTES), board.last_rows, board.warnings, str(board.fault), str(seen.keys()),
    ]  # fmt: skip


def live(board: BluePill, steps: list[tuple[int, str, bool, bytes]]) -> list[list[Any]]:
    """Return the states behind slices with inputs."""
    states = []
    for span_ns, pin, level, characters in steps:
        board.pin(pin).drive(level)
        if characters:
            board.usart1.receive(characters)
        board.advance_to(board.now_ns + span_ns)
        states.append(state(board))
    return states


@pytest.mark.parametrize("program", ["dodge", "unoptimised"])
def test_the_ways_that_blocks_were_left_by_are_those_of_unicorn(make: MakeBoard, program: str) -> None:
    """Also where the interpreter goes from block to block by itself, and where a block was cut."""
    boards = {core: make(program, core) for core in CORES}
    for board in boards.values():
        live(board, story(3, 30))
    found = {core: board.gone_ways for core, board in boards.items()}
    assert found["own"] == found["native"]
    assert {elsewhere for _, elsewhere in found["own"]} == {False, True}


@pytest.mark.parametrize(
    ("program", "slices"), [("dodge", 12), *(pytest.param(name, 40, marks=pytest.mark.slow) for name in PROGRAMS)]
)
def test_every_slice_ends_in_the_same_state(make: MakeBoard, program: str, slices: int) -> None:
    steps = story(38, slices)
    own, native = (live(make(program, core), steps) for core in CORES)
    for number, (one, other) in enumerate(zip(own, native, strict=True)):
        assert one == other, number


@pytest.mark.slow  # 1 s
def test_every_edge_and_block_is_the_same(make: MakeBoard) -> None:
    seen: dict[str, list[Any]] = {}
    for core in CORES:
        board = make("dodge", core)
        edges: list[Any] = []
        listen(board, edges)
        recorder = board.chip.record_blocks(1 << 16)
        live(board, story(2, 25))
        seen[core] = [edges, recorder.drain()]
    assert seen["own"] == seen["native"]
    assert all(seen["own"])


def test_a_snapshot_goes_on_as_the_run_that_it_is_of(make: MakeBoard) -> None:
    steps = story(3, 30)
    one, other = make("encoders", "own"), make("encoders", "own")
    live(one, steps[:10])
    other.restore(one.snapshot())
    assert live(one, steps[10:]) == live(other, steps[10:])


@pytest.mark.parametrize(("core", "other"), [CORES, CORES[::-1]])
def test_a_snapshot_of_another_core_is_refused(make: MakeBoard, core: str, other: str) -> None:
    with pytest.raises(ValueError, match="the state is of another core: P2OS_CORE chooses it"):
        make("dodge", core).restore(make("dodge", other).snapshot())


@pytest.mark.slow  # 1 s
def test_single_steps_are_the_same(make: MakeBoard) -> None:
    seen: dict[str, list[Any]] = {}
    for core in CORES:
        board = make("foreign", core)
        board.advance_to(2 * MS)
        seen[core] = []
        for _ in range(150):
            board.step(board.now_ns + MS)
            seen[core].append((board.pc, board.cycle, [board.register(name) for name in REGISTERS]))
    assert seen["own"] == seen["native"]


def test_break_and_watchpoints_halt_at_the_same_places(make: MakeBoard) -> None:
    seen: dict[str, list[Any]] = {}
    for core in CORES:
        board = make("dodge", core)
        board.chip.engine.breakpoints.add(board.image.symbols.address_of("clock_start") or 0)
        board.chip.engine.watchpoints.add(Watchpoint(SRAM + SRAM_BYTES - 8, 8, WatchKind.ACCESS))
        halts = []
        for _ in range(12):
            reached = board.advance_to(board.now_ns + 5 * MS)
            halts.append((reached.halt, board.now_ns, board.pc, board.cycle))
        seen[core] = halts
    assert seen["own"] == seen["native"]
    assert {halt.kind for halt, *_ in seen["own"] if halt} == {HaltKind.BREAKPOINT, HaltKind.WATCHPOINT}


def test_a_core_may_be_chosen_whatever_the_environment_says(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("P2OS_CORE", "python")

    def core_of(name: str = "") -> type:
        if not name:
            return type(BluePill(str(PROGRAMS["motors"])).chip.engine._core)
        with core_chosen(name):
            return core_of()

    assert [core_of(name) for name in ("own", "exact", "native", "python", "")] == [
        InterpreterCore, InterpreterCore, UnicornCore, UnicornCore, UnicornCore
    ]  # fmt: skip
    with pytest.raises(BluePillError, match="no such core"):
        core_of("another")
    assert core_of() is UnicornCore
