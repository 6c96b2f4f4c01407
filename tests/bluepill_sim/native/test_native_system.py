"""The system control space and faults: both cores end alike after random accesses, however time is cut."""

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim import BluePill
from bluepill_sim.extension.library import library_path
from tests.bluepill_sim.machine import COUNTER_ON, Machine
from tests.bluepill_sim.native.test_native_core import state

pytestmark = pytest.mark.skipif(library_path() is None, reason="the native core is not built: no C compiler")

AIRCR, SHCSR, SCR, CCR, STIR = 0xE000ED0C, 0xE000ED24, 0xE000ED10, 0xE000ED14, 0xE000EF00
#: Words that programs may write and read as they like.
FREE = (
    *range(0xE000E010, 0xE000E020, 4), *(0xE000E100 + 0x80 * kind + 4 * word for kind in range(5) for word in range(3)),
    *range(0xE000E400, 0xE000E434, 4), *range(0xE000ED18, 0xE000ED40, 4), 0xE000E004, 0xE000E008, 0xE000ED00,
    0xE000ED04, CCR, 0xE000EDF0, 0xE000EDFC, 0xE0001000, 0xE0001004, 0xE0042000, 0xE0042004, STIR, 0xE000EFF0,
    0xE0002000,
)  # fmt: skip
#: What would end the program, or move its vectors, and what may be written there.
KEPT = {AIRCR: (0x05FA0500, 0x05FA0300, 0x12340000), SCR: (0, 16)}
VALUES = st.one_of(
    st.sampled_from(
        [0, 1, 3, 5, 7, 0xFF, 0x0100_0000, 0x0007_0000, 0x1000_0000, 0x0400_0000, 0x8000_0000, 0xFFFF_FFFF]
    ),
    st.integers(0, 0xFFFF_FFFF),
)
#: A handler notes its number, and that of a fault its registers; it passes the instruction, which has two bytes (or the
#: NOP behind a masked SVC).
HANDLERS = """b stop
handler: mrs r0, ipsr
log r0
bx lr
fault: mrs r0, ipsr
log r0
mov32 r1, #0xE000ED28
ldr r0, [r1, #0]
str r0, [r1, #0]
log r0
ldr r0, [r1, #4]
str r0, [r1, #4]
log r0
ldr r0, [r1, #16]
log r0
ldr r0, [sp, #24]
adds r0, #2
str r0, [sp, #24]
bx lr"""


@st.composite
def accesses(draw: Any) -> str:
    """One access; what is read goes to the log."""
    if draw(st.integers(0, 9)) == 0:
        address = draw(st.sampled_from(list(KEPT)))
        return f"mov32 r1, #{address}\nmov32 r2, #{draw(st.sampled_from(KEPT[address]))}\nstr r2, [r1, #0]"
    address, bytes_ = draw(st.sampled_from(FREE)), draw(st.sampled_from([4, 4, 4, 2, 1]))
    address += draw(st.sampled_from(range(0, 4, bytes_)))
    suffix = {4: "", 2: "h", 1: "b"}[bytes_]
    if draw(st.booleans()):
        return f"mov32 r1, #{address}\nldr{suffix} r0, [r1, #0]\nlog r0"
    return f"mov32 r1, #{address}\nmov32 r2, #{draw(VALUES)}\nstr{suffix} r2, [r1, #0]"


OTHERS = st.sampled_from(
    ["isb", "nop", "nop\nnop\nnop", "b @\n@: nop", "cpsid i", "cpsie i", "cpsie i", "svc #0\nnop", "udf", "sev\nwfe",
     "mov32 r1, #0x70000000\nldr r0, [r1, #4]", "mov32 r1, #0x70000000\nstr r0, [r1, #0]"]
)  # fmt: skip
STEPS = st.lists(st.one_of(accesses(), accesses(), OTHERS), min_size=1, max_size=40)


def source_of(steps: list[str]) -> str:
    enabled = f"mov32 r1, #{SHCSR}\nmov32 r2, #0x70000\nstr r2, [r1, #0]"
    return "\n".join([enabled, *(step.replace("@", f"j{n}") for n, step in enumerate(steps))])


def make(source: str, core: str) -> BluePill:
    vectors: dict[int, str | int] = dict.fromkeys((2, 11, 14, 15, *range(16, 59)), "handler")
    vectors.update(dict.fromkeys(range(3, 7), "fault"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("P2OS_CORE", core)
        return Machine(f"{source}\n{HANDLERS}", vectors).board


def story(source: str, core: str, slice_ns: int) -> tuple[dict[str, Any], Any, list[str], Any]:
    board = make(source, core)
    recorder = board.chip.record_blocks(10_000)
    for at_ns in range(slice_ns, 210_001, slice_ns):
        board.advance_to(at_ns)
    return state(board), recorder.drain(), board.warnings, board.fault


@settings(max_examples=40)
@given(steps=STEPS, slice_ns=st.sampled_from([1000, 7000, 210_000]))
def test_random_accesses_and_faults_end_alike_on_both_cores(steps: list[str], slice_ns: int) -> None:
    source = source_of(steps)
    ours, reference = story(source, "native", slice_ns), story(source, "python", slice_ns)
    assert ours[1:] == reference[1:]
    for name in reference[0]:
        assert ours[0][name] == reference[0][name], name


#: Counters and flags that a loop may poll, with what starts them; r0 has the address of the first register.
POLLED = {
    "COUNTFLAG": (f"{0xE000E010}", "ldr r3, [r0, #0]\n.half 0x03DB\nbpl w", 0),
    "VAL": (f"{0xE000E010}", "ldr r3, [r0, #8]\n.half 0x055B\nbne w", 0),
    "an unmodelled register": (f"{0x40000C00}", "ldr r3, [r0, #16]\n.half 0x07DB\nbpl w", 1),
    "an unmodelled word of the core": (f"{0xE000EFF0}", "ldr r3, [r0, #0]\n.half 0x07DB\nbpl w", 1),
}


@pytest.mark.parametrize("what", POLLED)
@pytest.mark.parametrize("reload", [99, 1023, 7207])
def test_a_loop_that_polls_is_left_at_the_same_cycle_on_both_cores(what: str, reload: int) -> None:
    base, loop, warnings = POLLED[what]
    source = f"""mov32 r0, #0xE000E010
        mov32 r1, #{reload}
        str r1, [r0, #4]
        str r1, [r0, #8]
        movs r1, #5
        str r1, [r0, #0]
        mov32 r0, #{base}
        loop: nop
        w: {loop}
        adds r6, #1
        b loop"""
    ends: list[tuple[str, dict[str, Any]]] = []
    for core in ("native", "python"):
        board = make(source, core)
        for slice_ns in (10_000, 700, 33_000, 100_000):
            board.advance_to(board.now_ns + slice_ns)
            ends.append((core, state(board)))
        assert len(board.warnings) == warnings
    for ours, reference in zip(ends[:4], ends[4:], strict=True):
        for name in reference[1]:
            assert ours[1][name] == reference[1][name], name


#: Steps that compute with r3 (the counter) and r1, r2, r4, r6, some of which no such loop may have.
COMPUTING = st.one_of(
    st.builds(lambda base, bits: base | bits << 6 | 3 << 3 | 3, st.sampled_from([0, 0x800]), st.integers(0, 31)),
    st.builds(
        lambda base, m: base | m << 6 | 3 << 3 | 3, st.sampled_from([0x1800, 0x1A00]), st.sampled_from([1, 2, 4])
    ),
    st.builds(lambda n, d: 0x1A00 | 3 << 6 | n << 3 | d, st.sampled_from([1, 2, 4]), st.sampled_from([3, 3, 5, 1])),
    st.builds(lambda base, k: base | 3 << 8 | k, st.sampled_from([0x2800, 0x3000, 0x3800]), st.integers(0, 255)),
    st.builds(lambda base, m: base | m << 3 | 3, st.sampled_from([0x4280, 0x4000, 0x4200]), st.sampled_from([1, 2, 4])),
    st.builds(lambda n: 0x4280 | 3 << 3 | n, st.sampled_from([1, 2, 4])),
    st.just(0xBF00),
    st.just(0x3601),  # adds r6, #1: not a value of the counter
)
CONSTANTS = st.one_of(st.integers(0, 3000), st.integers(0, 0xFFFF_FFFF), st.just(0xFFFF_FFFF))


@settings(max_examples=40)
@given(
    register=st.sampled_from([0xE0001004, 0xE000E018, 0x20000000]), steps=st.lists(COMPUTING, min_size=1, max_size=4),
    condition=st.integers(0, 13), constants=st.lists(CONSTANTS, min_size=3, max_size=3), reload=st.integers(0, 5000),
    control=st.sampled_from([1, 5, 7]),
)  # fmt: skip
def test_a_loop_that_computes_with_a_counter_is_left_at_the_same_round_on_both_cores(
    register: int, steps: list[int], condition: int, constants: list[int], reload: int, control: int
) -> None:
    sets = "\n".join(f"mov32 r{n}, #{value}" for n, value in zip((1, 2, 4), constants, strict=True))
    source = f"""{COUNTER_ON}
        mov32 r0, #0xE000E010
        mov32 r1, #{reload}
        str r1, [r0, #4]
        str r1, [r0, #8]
        movs r1, #{control}
        str r1, [r0, #0]
        mov32 r0, #{register}
        {sets}
        again: nop
        b w
        w: ldr r3, [r0, #0]
        .half {", ".join(map(str, steps))}
        .half {0xD000 | condition << 8 | 0x100 - len(steps) - 3}
        adds r5, #1
        b again"""
    ends: list[dict[str, Any]] = []
    for core, slices in (("native", (40_000, 333, 500_000)), ("python", (540_333,))):
        board = make(source, core)
        for slice_ns in slices:
            board.advance_to(board.now_ns + slice_ns)
        board.advance_to(700_000)
        ends.append(state(board))
    for name in ends[1]:
        assert ends[0][name] == ends[1][name], name


@pytest.mark.parametrize("limit", [20, 0x8000_0014, 0x7FFF_FFF0])
@pytest.mark.parametrize("condition", range(14))
def test_every_condition_leaves_a_loop_at_its_round(condition: int, limit: int) -> None:
    """CYCCNT / 64 against a limit that it stays at for some rounds, or that is signed; the load is not at the start."""
    source = f"""{COUNTER_ON}
        mov32 r0, #0xE0001004
        mov32 r4, #{limit}
        b w
        w: nop
        nop
        ldr r3, [r0, #0]
        .half {0x0800 | 6 << 6 | 3 << 3 | 3}, {0x4280 | 4 << 3 | 3}
        .half {0xD000 | condition << 8 | 0x100 - 7}
        ldr r5, [r0, #0]
        b stop"""
    ends: list[dict[str, Any]] = []
    for core in ("native", "python"):
        board = make(source, core)
        board.advance_to(400_000)
        ends.append(state(board))
    assert ends[0] == ends[1]


def test_a_board_restored_from_before_a_warning_warns_again() -> None:
    board = make("mov32 r0, #0x40000C00\nw: ldr r3, [r0, #16]\n.half 0x07DB\nbpl w", "native")
    early = board.snapshot()
    board.run_for("1 ms")
    assert len(board.warnings) == 1
    board.restore(early)
    assert board.warnings == []
    board.run_for("1 ms")
    assert len(board.warnings) == 1
