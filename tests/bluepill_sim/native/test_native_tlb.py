"""Pages of memory in the native core: stores to data are fast, stores to code are seen, IT blocks stay whole."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.bluepill_sim.machine import Machine

#: A page of SRAM that nothing has touched, and the vectors' neighbour where the function is put.
FRESH, CODE = 0x2000_1800, 0x2000_1000
#: Puts `movs r0, #N; bx lr` at CODE and calls it, a store to the same page in between.
PUT_AND_CALL = f"""
mov32 r4, #{CODE}
mov32 r6, #{CODE | 1}
mov32 r5, #{{first}}
str r5, [r4, #0]
blx r6
log r0
str r5, [r4, #64]
mov32 r5, #{{second}}
str r5, [r4, #0]
dsb
isb
blx r6
log r0
blx r6
log r0
"""


def logs(text: str) -> list[list[int]]:
    """Return what a program logs on each core."""
    found = []
    for core in ("native", "python"):
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("P2OS_CORE", core)
            machine = Machine(text, {}).run()
        assert machine.is_done
        found.append(list(machine.log))
    return found


def function(number: int) -> int:
    """Return the word of `movs r0, #number; bx lr`."""
    return 0x4770_2000 | number


@given(first=st.integers(0, 255), second=st.integers(0, 255))
def test_code_that_is_written_anew_is_what_runs(first: int, second: int) -> None:
    native, python = logs(PUT_AND_CALL.format(first=function(first), second=function(second)))
    assert native == python == [first, second, second]


@pytest.mark.parametrize("access", ["str r1, [r6, #0]", "ldr r1, [r6, #0]", "strb r1, [r6, #3]"])
def test_the_first_access_to_a_page_may_stand_inside_an_it_block(access: str) -> None:
    native, python = logs(
        f"mov32 r6, #{FRESH}\nmovs r1, #1\nmovs r2, #0\nmovs r3, #0\ncmp r2, #0\nittt eq\n"
        f"nop\n{access}\nadds r2, #1\nadds r3, #1\nb next\nnext: adds r3, #1\nmov r0, r2\nlog r0\nmov r0, r3\nlog r0"
    )
    assert native == python == [1, 2]


@pytest.mark.parametrize("address", [0x4000_0000, 0x4002_3FFC, 0x5000_0000, 0xA000_0000, 0xE000_E000])
def test_what_never_executes_ends_both_cores_alike(address: int) -> None:
    ends = []
    for core in ("native", "python"):
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("P2OS_CORE", core)
            machine = Machine(f"mov32 r6, #{address | 1}\nbx r6", {})
            machine.board.advance_to(1_000_000)
        chip = machine.board.chip
        ends.append((chip.processor.snapshot(), chip.processor.exception_number))
    assert ends[0] == ends[1]
    assert ends[0][1] == 3  # HardFault
