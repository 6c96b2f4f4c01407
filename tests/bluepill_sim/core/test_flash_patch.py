"""What the FPB remaps: instructions and literals taken from a table in SRAM, as firmware uses it; on both cores."""

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim.core.faults import FaultKind
from tests.bluepill_sim.machine import Machine
from tests.bluepill_sim.native.test_native_core import state

FP_CTRL, FP_REMAP, FP_COMP = 0xE000_2000, 0xE000_2004, 0xE000_2008
TABLE = 0x2000_1000
#: movs r0, #n twice in a word.
#: `patched` is `movs r0, #1; nop`, `literal` the word 0x11111111, `run` logs both; each at a multiple of 4.
BODY = """
b run
.half 0xbf00
patched: movs r0, #1
bx lr
load: .half 0x4800
bx lr
literal: .word 0x11111111
run: mov r4, r5
again: bl patched
log r0
bl load
log r0
"""


def store(address: int, value: int | str) -> str:
    return f"mov32 r1, #{address}\nmov32 r2, #{value}\nstr r2, [r1, #0]\n"


def comparator(number: int, place: str, bits: int = 1) -> str:
    return (
        f"mov32 r1, #{FP_COMP + 4 * number}\nmov32 r2, #{place}\nmov32 r3, #{bits}\nadds r2, r2, r3\nstr r2, [r1, #0]\n"
    )


def aligned(make: Any, before: str, after: str, vectors: dict[int, str | int] | None = None) -> Any:
    """Return a machine whose `patched` stands at a multiple of 4."""
    source = before + BODY + after
    machine = make(source, vectors or {})
    if machine.label("patched") % 4:
        machine = make("nop\n" + source, vectors or {})
    assert machine.label("patched") % 4 == machine.label("literal") % 4 == 0
    return machine


@pytest.fixture(params=["native", "python"])
def make(request: pytest.FixtureRequest, boot: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setenv("P2OS_CORE", request.param)
    return boot


ON = store(FP_REMAP, TABLE) + store(FP_CTRL, 3)
#: movs r0, #2; bx lr
TWO = 0x4770_2002


@pytest.mark.parametrize("number", range(6))
def test_an_instruction_is_taken_from_its_place_in_the_table(make: Any, number: int) -> None:
    machine = aligned(make, store(TABLE + 4 * number, TWO) + comparator(number, "patched") + ON, "b stop").run(200)
    assert machine.log == [2, 0x1111_1111]
    assert not machine.board.warnings


@pytest.mark.parametrize("number", [6, 7])
def test_a_literal_is_taken_from_its_place_in_the_table(make: Any, number: int) -> None:
    machine = aligned(make, store(TABLE + 4 * number, 0x77) + comparator(number, "literal") + ON, "b stop").run(200)
    assert machine.log == [1, 0x77]


@pytest.mark.parametrize("address", [0x4002_1000, 0xE000_E000])
def test_what_is_never_executed_is_not_behind_a_read_of_it_either(make: Any, address: int) -> None:
    """The core keeps each page that it has found, and a page is found by what reaches for it first."""
    read_then_branch = f"mov32 r1, #{address + 0x14}\nldr r2, [r1, #0]\nmov32 r1, #{address + 1}\nbx r1\n"
    machine = aligned(make, store(TABLE, TWO) + comparator(0, "patched") + ON, read_then_branch).run(200)
    assert machine.board.fault is not None
    assert (machine.log, machine.board.fault.kind) == ([2, 0x1111_1111], FaultKind.EXECUTE_NEVER)


@pytest.mark.parametrize(("number", "place"), [(6, "patched"), (0, "literal")])
def test_fetches_and_loads_have_comparators_of_their_own(make: Any, number: int, place: str) -> None:
    machine = aligned(
        make, store(TABLE + 4 * number, TWO) + comparator(number, place) + ON,
        "mov32 r1, #patched\nldr r0, [r1, #0]\nlog r0\nb stop",
    ).run(200)  # fmt: skip
    assert machine.log == [1, 0x1111_1111, TWO if number == 6 else 0x4770_2001]


def test_loads_of_a_patched_instruction_see_what_is_in_flash(make: Any) -> None:
    machine = aligned(
        make, store(TABLE, TWO) + comparator(0, "patched") + ON,
        "mov32 r1, #patched\nldr r0, [r1, #0]\nlog r0\nldrh r0, [r1, #2]\nlog r0\nbl patched\nlog r0\nb stop",
    ).run(200)  # fmt: skip
    assert machine.log == [2, 0x1111_1111, 0x4770_2001, 0x4770, 2]
    assert machine.board.read_memory(machine.label("patched"), 2) == b"\x01\x20"


@pytest.mark.parametrize(
    ("control", "bits", "offset", "is_patched"),
    [(3, 1, 0, True), (1, 1, 0, False), (2, 1, 0, False), (3, 0, 0, False), (3, 1, 4, False), (3, 1 - 4, 0, False),
     (3, 1, -0x0800_0000, False)],
)  # fmt: skip
def test_it_needs_key_enables_and_the_very_word(
    make: Any, control: int, bits: int, offset: int, is_patched: bool
) -> None:
    """The address is that of the fetch: the same flash at 0 is another one."""
    move = comparator(0, "patched", (bits + offset) & 0xFFFF_FFFF)
    before = store(TABLE, TWO) + move + store(FP_REMAP, TABLE) + store(FP_CTRL, control)
    machine = aligned(make, before, "b stop").run(200)
    assert machine.log[0] == (2 if is_patched else 1)


def test_the_alias_at_0_has_words_of_its_own(make: Any) -> None:
    low = "mov32 r3, #patched+1\nmov32 r2, #0x08000000\nsubs r3, r3, r2\nblx r3\nlog r0\nb stop"
    before = store(TABLE, TWO) + comparator(0, "patched", 0xF800_0001) + ON
    machine = aligned(make, before, low).run(200)
    assert machine.log == [1, 0x1111_1111, 2]


def test_a_word_of_the_table_counts_from_the_next_block_on_and_so_does_a_comparator(make: Any) -> None:
    off = store(FP_CTRL, 2)
    machine = aligned(
        make, store(TABLE, TWO) + comparator(0, "patched") + ON,
        store(TABLE, TWO + 1) + "bl patched\nlog r0\n" + store(TABLE + 32, TWO + 2) + store(FP_REMAP, TABLE + 32)
        + "bl patched\nlog r0\n" + off + "bl patched\nlog r0\n" + store(FP_CTRL, 3) + "bl patched\nlog r0\n"
        + comparator(0, "patched", 0) + "bl patched\nlog r0\nb stop",
    ).run(400)  # fmt: skip
    assert machine.log == [2, 0x1111_1111, 3, 4, 1, 4, 1]


@pytest.mark.parametrize("number", [6, 7])
def test_a_literal_follows_the_table(make: Any, number: int) -> None:
    machine = aligned(
        make, store(TABLE + 4 * number, 5) + comparator(number, "literal") + ON,
        store(TABLE + 4 * number, 6) + "bl load\nlog r0\n" + store(FP_CTRL, 2) + "bl load\nlog r0\nb stop",
    ).run(400)  # fmt: skip
    assert machine.log == [1, 5, 6, 0x1111_1111]


def test_half_of_a_wide_instruction_and_a_branch_may_be_patched(make: Any) -> None:
    """The word has a BL to elsewhere whose offset counts from where it stands."""
    source = (
        store(TABLE + 8, "0xF000F801".replace("0xF000F801", str(0xF801_F000)))
        + "{pad}" + comparator(2, "place") + ON
        + "b go\n{fill}place: nop\nnop\nb stop\nother: log #9\nb stop\ngo: b place"
    )  # fmt: skip
    for pad in ("", "nop\n"):
        machine = make(source.replace("{pad}", pad).replace("{fill}", ""), {})
        if machine.label("place") % 4 == 0:
            break
    machine.run(200)
    assert machine.log == [9], "BL to 4 + 2 behind itself"


def test_two_comparators_for_one_word_and_a_breakpoint_on_a_patched_one(make: Any) -> None:
    before = store(TABLE + 4, TWO) + store(TABLE + 12, TWO + 1)
    before += comparator(3, "patched") + comparator(1, "patched") + ON
    assert aligned(make, before, "b stop").run(200).log[0] == 2
    stops = before + store(0xE000_EDFC, 1 << 16) + comparator(0, "patched", 0x4000_0001)
    handler = "b stop\nmonitor: log #8\n" + store(FP_COMP, 0) + "bx lr"
    assert aligned(make, stops, handler, {12: "monitor"}).run(400).log[:2] == [8, 2]


@pytest.mark.parametrize("table", [0x2000_5000, 0x2200_0000, 0x3000_0000])
def test_a_table_that_is_not_in_memory_patches_nothing(make: Any, table: int) -> None:
    machine = aligned(make, comparator(0, "patched") + store(FP_REMAP, table) + store(FP_CTRL, 3), "b stop").run(200)
    assert machine.log == [1, 0x1111_1111]


def test_flash_that_is_programmed_shows_beside_a_patch(make: Any) -> None:
    unlock = store(0x4002_2004, 0x4567_0123) + store(0x4002_2004, 0xCDEF_89AB) + store(0x4002_2010, 1)
    program = "mov32 r1, #0x08000FF8\nmov32 r2, #0x4770\nmov32 r3, #0x2021\nstrh r3, [r1, #0]\nstrh r2, [r1, #2]\n"
    call = "mov32 r3, #0x08000FF9\nblx r3\nlog r0\nb stop"
    before = store(TABLE, TWO) + f"mov32 r1, #{FP_COMP}\nmov32 r2, #0x08000FFD\nstr r2, [r1, #0]\n" + ON
    machine = aligned(make, before + unlock + program, call).run(2000)
    assert machine.log == [1, 0x1111_1111, 0x21]


def test_a_store_to_a_patched_page_leaves_its_literal_patched(make: Any) -> None:
    unlock = store(0x4002_2004, 0x4567_0123) + store(0x4002_2004, 0xCDEF_89AB) + store(0x4002_2010, 1)
    program = "mov32 r1, #0x080000F0\nmov32 r2, #0x1234\nstrh r2, [r1, #0]\nldr r0, [r1, #0]\nlog r0\n"
    before = unlock + store(TABLE + 24, 0x77) + comparator(6, "literal") + ON
    machine = aligned(make, before, program + "bl load\nlog r0\nb stop").run(2000)
    assert machine.label("literal") < 0x0800_0400
    assert machine.log == [1, 0x77, 0xFFFF_1234, 0x77]


def test_there_is_nothing_where_the_copies_are(make: Any) -> None:
    machine = aligned(
        make, store(TABLE, TWO) + comparator(0, "patched") + ON, "mov32 r1, #0x9FFF8000\nldr r0, [r1, #0]\nb stop"
    )
    machine.run(200)
    assert machine.board.fault.kind.name == "READ_ERROR"


@settings(max_examples=8)
@given(
    st.lists(
        st.tuples(st.sampled_from(["word", "literal", "comparator", "table", "control", "call", "load", "svc"]),
                  st.integers(0, 7), st.integers(0, 3)),
        min_size=3, max_size=24,
    ),
    st.integers(1, 60),
)  # fmt: skip
def test_both_cores_agree_in_slices_of_any_length_and_from_snapshots(
    steps: list[tuple[str, int, int]], cut: int
) -> None:
    text: dict[str, Callable[[int, int], str]] = {
        "word": lambda n, v: store(TABLE + 32 * (v & 1) + 4 * n, TWO + v),
        "literal": lambda n, v: store(TABLE + 32 * (v & 1) + 24 + 4 * (n & 1), v),
        "comparator": lambda n, v: comparator(n, "literal" if n > 5 else "patched", v & 1),
        "table": lambda _n, v: store(FP_REMAP, TABLE + 32 * (v & 1)),
        "control": lambda _n, v: store(FP_CTRL, 2 | (v > 0)),
        "call": lambda _n, _v: "bl patched\nlog r0\n", "load": lambda _n, _v: "bl load\nlog r0\n",
        "svc": lambda _n, _v: "svc #0\n",
    }  # fmt: skip
    after = "".join(text[what](n, v) for what, n, v in steps) + "b stop\ncall: log #7\nbx lr"
    before = store(TABLE, TWO) + comparator(0, "patched") + ON
    ends = []
    for core, slice_us, cuts in [("native", None, False), ("python", None, False), ("native", 0.5, True)]:
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("P2OS_CORE", core)
            machine = aligned(Machine, before, after, {11: "call"})
            machine.run(cut, slice_us)
            if cuts:
                snapshot, machine = machine.board.snapshot(), aligned(Machine, before, after, {11: "call"})
                machine.board.restore(snapshot)
            machine.board.advance_to(200_000)
            ends.append((machine.log, state(machine.board)))
    assert ends[1] == ends[0]
    assert ends[2] == ends[0]
