"""What C has no memory for is said by name, whatever it is: nothing goes on with a null pointer."""

from collections.abc import Callable

import pytest

from bluepill_sim.core.halts import HaltKind
from bluepill_sim.extension.library import library as real_library
from bluepill_sim.native import engine
from tests.bluepill_sim.machine import Machine

#: Waits for a word of SRAM.
PROGRAM = """
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


def run(_machine: Machine) -> None:
    Machine(PROGRAM, {}).run(10)


def look_at_a_register(machine: Machine) -> None:
    machine.board.chip.engine._traps._trap(0x08000200, 0, HaltKind.UNALIGNED)


@pytest.mark.parametrize(
    ("name", "act", "what"),
    [
        ("core_new", run, "the native core"),
        ("core_region", run, "a region of the chip"),
        ("core_add_row", run, "the block at 0x0800"),
        ("core_set_loop", run, "a loop"),
        ("core_start_recording", lambda machine: machine.board.chip.record_blocks(10), "a record of blocks"),
        ("core_trap", look_at_a_register, "a look at 0x08000200"),
    ],
)
def test_what_there_is_no_memory_for_is_said(
    name: str, act: Callable[[Machine], None], what: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    machine = Machine(PROGRAM, {})
    with monkeypatch.context() as short:
        library = WithoutMemory(name)
        short.setattr(engine, "library", lambda: library)
        for _ in range(2):  # and again: nothing is taken to be there
            with pytest.raises(MemoryError, match=f"no memory for {what}"):
                act(machine)
    act(machine)
