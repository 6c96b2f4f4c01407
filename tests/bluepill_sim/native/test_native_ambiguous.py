"""Accesses that may be mistaken for each other cost nothing where no peripheral is, and are exact where one is."""

from pathlib import Path

import pytest

from bluepill_sim import BluePill
from bluepill_sim.core.accesses import may_end_in_it
from tests.bluepill_sim.machine import COUNTER_ON, Machine, listen

PROGRAM = Path(__file__).parents[1] / "firmware" / "unoptimised.elf"

#: r3 is the base of each access. The cycle counter counts, r1 is its address, [r2] holds it and [r2, #4] holds r2.
COUNTING = f"""{COUNTER_ON}mov32 r2, #0x20000800
mov32 r1, #0xE0001004
str r1, [r2, #0]
str r2, [r2, #4]
mov r3, r2
b next
next:
"""
LOADS = {
    "memory, then the counter": "ldr r3, [r3, #0]\nldr r3, [r3, #0]\nmov r0, r3\nlog r0",
    "the counter, then memory": "mov r3, r1\nldr r4, [r3, #0]\nmov r3, r2\nldr r3, [r3, #0]\nmov r0, r4\nlog r0",
    "the counter three times": (
        "mov r3, r1\nldr r4, [r3, #0]\nmov r3, r1\nldr r5, [r3, #0]\nmov r3, r1\nldr r6, [r3, #0]\n"
        "mov r0, r4\nlog r0\nmov r0, r5\nlog r0\nmov r0, r6\nlog r0"
    ),
    "memory and the counter twice": (
        "ldr r3, [r3, #0]\nldr r4, [r3, #0]\nmov r3, r1\nldr r3, [r3, #0]\nmov r0, r4\nlog r0\nmov r0, r3\nlog r0"
    ),
    "several at once": (
        "mov r3, r1\nnop\nldmia.w r3, {r4, r5}\nmov r3, r1\nldmia.w r3, {r5, r6}\n"
        "mov r0, r4\nlog r0\nmov r0, r5\nlog r0"
    ),
}


def native_board(monkeypatch: pytest.MonkeyPatch) -> BluePill:
    monkeypatch.setenv("P2OS_CORE", "native")
    return BluePill(str(PROGRAM))


@pytest.mark.parametrize("loads", LOADS.values(), ids=LOADS)
def test_the_run_stops_at_the_access_and_its_time_is_that_of_the_instruction(
    loads: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    logs = {}
    for core in ("native", "python"):
        monkeypatch.setenv("P2OS_CORE", core)
        machine = Machine(COUNTING + loads, {}).run()
        logs[core] = machine.log
        if core == "native":
            assert machine.board.chip.engine.shared.exact_stops > 0  # type: ignore[attr-defined]  # a `NativeEngine`
    assert logs["native"] == logs["python"]


def test_blocks_that_only_touch_memory_have_no_hooks_and_are_never_stopped(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each hooked instruction would call a hook and walk the list of all hooks."""
    board = native_board(monkeypatch)
    board.run_for("20 ms")
    engine = board.chip.engine
    hooks: list[int] = engine._noted  # type: ignore[attr-defined]
    before = engine.shared.exact_stops, engine.shared.logged  # type: ignore[attr-defined]
    board.run_for("200 ms")
    stops, blocks = (engine.shared.exact_stops - before[0], engine.shared.logged - before[1])  # type: ignore[attr-defined]
    assert blocks > 40_000
    assert len(hooks) == 0
    assert stops * 1_000_000 <= 1000 * blocks


def test_edges_characters_and_states_are_the_same_however_time_is_cut(monkeypatch: pytest.MonkeyPatch) -> None:
    lives = []
    for core, slice_ns in (("python", 6_000_000), ("native", 6_000_000), ("native", 77_777), ("native", 1_000_000)):
        monkeypatch.setenv("P2OS_CORE", core)
        board = BluePill(str(PROGRAM))
        edges: list[tuple[object, ...]] = []
        words: list[tuple[int, int]] = []
        listen(board, edges)
        board.usart1.subscribe(words.extend)
        while board.now_ns < 6_000_000:
            board.advance_to(min(board.now_ns + slice_ns, 6_000_000))
        lives.append((edges, words, board.chip.snapshot()))
    assert len(lives[0][0]) + len(lives[0][1]) > 40
    assert all(one == lives[0] for one in lives)


def test_a_restored_program_runs_as_the_one_it_was_taken_from(monkeypatch: pytest.MonkeyPatch) -> None:
    board = native_board(monkeypatch)
    board.run_for("20 ms")
    fresh = native_board(monkeypatch)
    fresh.restore(board.snapshot())
    for one in (board, fresh):
        one.run_for("3 ms")
    assert fresh.snapshot() == board.snapshot()


@pytest.mark.parametrize(("code", "may"), [
    ("08bf", True), ("08bf c046", False), ("08bf 4ff00000", False), ("04bf c046", True), ("04bf c046 c046", False),
    ("01bf c046 c046 c046", True), ("01bf c046 c046 c046 c046", False), ("00bf", False), ("c046", False), ("", False),
])  # fmt: skip
def test_what_follows_an_it_block_is_told_from_what_is_in_it(code: str, may: bool) -> None:
    assert may_end_in_it(bytes.fromhex(code)) is may
