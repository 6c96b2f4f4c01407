"""The native core is the Python executor: the same state after the same slices, the same record, the same edges.

What C has no memory for is said by name: nothing goes on with a null pointer.
"""

import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from bluepill_sim import BluePill
from bluepill_sim.core import BlockRecorder
from bluepill_sim.core.halts import HaltKind
from bluepill_sim.errors import BluePillError
from bluepill_sim.extension.library import library as real_library
from bluepill_sim.native import engine
from tests.bluepill_sim.machine import COUNTER_ON, Machine, listen
from tests.tools.examples import EXAMPLES

FIRMWARE = EXAMPLES
PROGRAMS = {name: Path(str(FIRMWARE / f"{name}.elf")) for name in ("motors", "sensors", "encoders", "dodge")}
PROGRAMS["foreign"] = Path(__file__).parents[2] / "firmware_foreign" / "foreign.elf"
PROGRAMS["unoptimised"] = Path(__file__).parents[1] / "firmware" / "unoptimised.elf"
#: Pins that the examples read.
INPUTS = ("PA0", "PA1", "PA4", "PA5", "PB0", "PB5", "PB10", "PB11", "PB12", "PC13")

MakeBoard = Callable[[str, str], BluePill]


@pytest.fixture
def make(monkeypatch: pytest.MonkeyPatch) -> MakeBoard:
    """Make a board with a core: make("dodge", "native")."""

    def make_board(program: str, core: str) -> BluePill:
        monkeypatch.setenv("P2OS_CORE", core)
        board = BluePill(str(PROGRAMS[program]))
        assert (type(board.chip.engine).__name__ == "NativeEngine") is (core == "native")
        return board

    return make_board


def story(seed: int, slices: int) -> list[tuple[int, str, bool, bytes]]:
    """Return (span in ns, pin, level, characters) of each slice."""
    dice = random.Random(seed)
    return [
        (dice.choice([1, 700, 30_000, 333_333]), dice.choice(INPUTS), dice.random() < 0.5,
         dice.randbytes(dice.choice([0, 0, 3])))
        for _ in range(slices)
    ]  # fmt: skip


def state(board: BluePill) -> dict[str, Any]:
    """Return all that decides a board's future."""
    chip = board.chip
    return {"now": board.now_ns, "pc": board.pc, **chip.snapshot()}


def live(board: BluePill, steps: list[tuple[int, str, bool, bytes]]) -> list[dict[str, Any]]:
    states = []
    for span_ns, pin, level, characters in steps:
        board.pin(pin).drive(level)
        if characters:
            board.usart1.receive(characters)
        board.advance_to(board.now_ns + span_ns)
        states.append(state(board))
    return states


@pytest.mark.parametrize("program", PROGRAMS)
def test_every_slice_ends_in_the_same_state(make: MakeBoard, program: str) -> None:
    steps = story(1, 60)
    ours, reference = (live(make(program, core), steps) for core in ("native", "python"))
    for number, (one, other) in enumerate(zip(ours, reference, strict=True)):
        for name in one:
            assert one[name] == other[name], (number, name)


@pytest.mark.parametrize("program", PROGRAMS)
def test_every_block_exception_and_edge_is_the_same(make: MakeBoard, program: str) -> None:
    rows: dict[str, list[Any]] = {}
    edges: dict[str, list[Any]] = {}
    for core in ("native", "python"):
        board = make(program, core)
        rows[core], edges[core] = [], []
        listen(board, edges[core])

        def take(recorder: BlockRecorder, core: str = core) -> None:
            rows[core] += recorder.drain()

        recorder = board.chip.record_blocks(1000, take)
        live(board, story(2, 25))
        take(recorder)
    assert rows["native"] == rows["python"]
    assert edges["native"] == edges["python"]
    assert len(rows["native"]) > 500


def test_a_snapshot_of_one_goes_on_in_the_other(make: MakeBoard) -> None:
    steps = story(3, 30)
    native, python = make("dodge", "native"), make("dodge", "python")
    live(native, steps[:10])
    python.restore(native.snapshot())
    assert live(native, steps[10:]) == live(python, steps[10:])


#: Cycle counter on; r1 is its address, and [r2] holds it.
COUNTING = f"""{COUNTER_ON}mov32 r2, #0x20000800
mov32 r1, #0xE0001004
str r1, [r2, #0]
b next
next: mov r3, r2
"""
#: Loads that reach for the counter, among others that look like them.
LOADS = {
    "base changed in between": "ldr r3, [r3, #0]\nldr r3, [r3, #0]\nmov r0, r3\nlog r0",
    "twice the same": "ldr r4, [r1, #0]\nldr r5, [r1, #0]\nmov r0, r4\nlog r0\nmov r0, r5\nlog r0",
    "another register": "ldr r4, [r2, #0]\nnop\nldr r5, [r4, #0]\nmov r0, r5\nlog r0",
    "with an index": "movs r4, #0\nldr r5, [r2, r4]\nldr r5, [r1, r4]\nmov r0, r5\nlog r0",
    "several at once": "nop\nldmia.w r1, {r4, r5}\nmov r0, r4\nlog r0",
    "a narrow one": "ldrb r4, [r2, #0]\nnop\nldrb r0, [r1, #0]\nlog r0",
}


@pytest.mark.parametrize("loads", LOADS.values(), ids=LOADS)
def test_an_access_has_the_time_of_its_instruction(loads: str, monkeypatch: pytest.MonkeyPatch) -> None:
    logs = {}
    for core in ("native", "python"):
        monkeypatch.setenv("P2OS_CORE", core)
        machine = Machine(COUNTING + loads, {}).run()
        assert machine.is_done
        logs[core] = machine.log
    assert logs["native"] == logs["python"]
    assert logs["native"][0] > 0


def test_outputs_that_nobody_watches_are_seen_when_somebody_looks(make: MakeBoard) -> None:
    boards = {core: make("motors", core) for core in ("native", "python")}
    for _ in range(8):
        for board in boards.values():
            board.advance_to(board.now_ns + 130_000_000)
        levels = {core: [(pin.level, pin.output, pin.input) for pin in board.pins] for core, board in boards.items()}
        assert levels["native"] == levels["python"]


def test_the_core_is_chosen_by_the_environment(make: MakeBoard, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("P2OS_CORE", "quick")
    with pytest.raises(BluePillError, match="P2OS_CORE=quick: no such core"):
        BluePill(str(PROGRAMS["motors"]))


def test_an_output_with_an_edge_line_interrupts_on_a_board_that_was_restored_too(make: MakeBoard) -> None:
    """C changes the level of a plain output alone; of one that EXTI looks at it must not."""
    one, other = make("dodge", "native"), make("dodge", "native")
    one.chip.parts.exti.write(8, 4, 1 << 5)  # RTSR
    other.restore(one.snapshot())


#: Waits for a word of SRAM.
WAITS = """
mov32 r3, #0x20001000
again: ldr r1, [r3, #0]
cmp r1, #0
beq again
"""


class WithoutMemory:
    """The library, one of whose functions makes nothing."""

    def __init__(self, name: str) -> None:
        self._library, self._name = real_library(), name

    def __getattr__(self, name: str) -> object:
        return (lambda *_: None) if name == self._name else getattr(self._library, name)


def run_another(_machine: Machine) -> None:
    Machine(WAITS, {}).run(10)


def look_at_a_register(machine: Machine) -> None:
    machine.board.chip.engine._traps._trap(0x08000200, 0, HaltKind.UNALIGNED)


@pytest.mark.parametrize(
    ("name", "act", "what"),
    [
        ("core_new", run_another, "the native core"),
        ("core_region", run_another, "a region of the chip"),
        ("core_add_row", run_another, "the block at 0x0800"),
        ("core_set_loop", run_another, "a loop"),
        ("core_start_recording", lambda machine: machine.board.chip.record_blocks(10), "a record of blocks"),
        ("core_trap", look_at_a_register, "a look at 0x08000200"),
    ],
)
def test_what_there_is_no_memory_for_is_said(
    name: str, act: Callable[[Machine], None], what: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    machine = Machine(WAITS, {})
    with monkeypatch.context() as short:
        library = WithoutMemory(name)
        short.setattr(engine, "library", lambda: library)
        for _ in range(2):  # and again: nothing is taken to be there
            with pytest.raises(MemoryError, match=f"no memory for {what}"):
                act(machine)
    act(machine)
