"""Time that passes while a debugger halts the core: watchdogs go on unless DBGMCU_CR freezes them."""

import binascii
from collections.abc import Callable
from typing import Any

import pytest

from bluepill_sim.debug.execution import Execution
from bluepill_sim.debug.gdb_session import GdbSession
from bluepill_sim.debug.inspector import Inspector
from bluepill_sim.debug.machine import LoneChip
from bluepill_sim.peripherals.rcc import ResetCause

IWDG, WWDG, APB1ENR, DBGMCU_CR = 0x4000_3000, 0x4000_2C00, 0x4002_101C, 0xE004_2004
DBG_IWDG_STOP, DBG_WWDG_STOP = 1 << 8, 1 << 9
#: Time-outs: 4096 counts of 40 kHz / 4, and 64 counts of 8 MHz / 4096.
IWDG_NS, WWDG_NS, MS = 409_600_000, 64 * 512_000, 1_000_000


def store(address: int, value: int) -> str:
    return f"mov32 r1, #{address}\nmov32 r2, #{value}\nstr r2, [r1, #0]\n"


START = {"IWDG": store(IWDG, 0xCCCC), "WWDG": store(APB1ENR, 1 << 11) + store(WWDG, 0xFF)}
SPAN = {"IWDG": IWDG_NS, "WWDG": WWDG_NS}


@pytest.fixture(params=["native", "python"])
def make(request: pytest.FixtureRequest, boot: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setenv("P2OS_CORE", request.param)
    return boot


class Session:
    def __init__(self, machine: Any) -> None:
        self.board = machine.board
        self._session = GdbSession(Execution(LoneChip(machine.board), lambda _data: None))

    def wait(self, span_ns: int) -> str:
        text = f"wait {span_ns}ns"
        return binascii.unhexlify(self._session.answer(b"qRcmd," + text.encode().hex().encode())).decode()


@pytest.mark.parametrize(("name", "mask"), [("primask", 1), ("faultmask", 1), ("basepri", 0xF0), ("control", 2)])
def test_a_debugger_sets_the_bits_that_a_mask_register_has(make: Any, name: str, mask: int) -> None:
    """Not CONTROL's bit 0 here: without privilege the rest could not be written back."""
    inspector = Inspector(make("stop: b stop").run(10).board)
    for value in (mask, 0, 0xFF & ~(name == "control"), 0):
        inspector.set_register(name, value)
        assert inspector.register(name) == value & mask
        assert {other: inspector.register(other) for other in ("primask", "faultmask", "basepri", "control")} == {
            "primask": 0, "faultmask": 0, "basepri": 0, "control": 0, name: value & mask,
        }  # fmt: skip


@pytest.mark.parametrize("name", ["IWDG", "WWDG"])
@pytest.mark.parametrize("control", [0, DBG_IWDG_STOP, DBG_WWDG_STOP])
def test_a_watchdog_resets_a_halted_chip_unless_its_bit_freezes_it(make: Any, name: str, control: int) -> None:
    frozen = control == {"IWDG": DBG_IWDG_STOP, "WWDG": DBG_WWDG_STOP}[name]
    machine = make(store(DBGMCU_CR, control) + START[name] + "b stop").run(100)
    session, board = Session(machine), machine.board
    due_ns = board.chip.parts.by_name[name].due_ns
    pc = board.pc
    answer = session.wait(due_ns - board.now_ns - 125)
    assert dict(board.resets) == {}
    assert board.pc == pc
    answer = session.wait(10 * MS)
    assert dict(board.resets) == ({} if frozen else {ResetCause[name]: 1})
    assert (f"reset by {name}: at start" in answer) is not frozen
    if frozen:
        left_ns = due_ns + (due_ns - 100_000) + 10 * MS - board.now_ns
        assert left_ns > 0
        session.wait(SPAN[name])
        machine.run((SPAN[name] - 2 * MS) / 1000)
        assert dict(board.resets) == {}
        machine.run(3000)
        assert dict(board.resets) == {ResetCause[name]: 1}


def test_systick_and_cyccnt_stand_still_and_the_program_goes_on_where_it_was(make: Any) -> None:
    machine = make(
        store(0xE000_EDFC, 1 << 24) + store(0xE000_1000, 1) + store(0xE000_E014, 999_999) + store(0xE000_E018, 0)
        + store(0xE000_E010, 5) + "loop: adds r6, #1\nb loop"
    ).run(100)  # fmt: skip
    board = machine.board

    def counters() -> tuple[int, int, int]:
        read = board.chip.system.read
        return read(0xE018, 4), read(0x1004, 4), board.register("R6")

    before = counters()
    with board.chip.halted_core():
        board.run_for("250 ms")
    assert counters() == before
    machine.run(10)
    assert board.register("R6") > before[2]
    assert before[0] - counters()[0] == counters()[1] - before[1]


@pytest.mark.parametrize("words", ["wait", "wait soon", "wait 1 2", "wait -1ms"])
def test_a_span_that_is_none_is_not_understood(boot: Callable[..., Any], words: str) -> None:
    machine = boot("b stop").run(10)
    session = GdbSession(Execution(LoneChip(machine.board), lambda _data: None))
    at = machine.board.now_ns
    answer = binascii.unhexlify(session.answer(b"qRcmd," + words.encode().hex().encode())).decode()
    assert "not understood" in answer
    assert machine.board.now_ns == at


@pytest.mark.parametrize("steps", [1, 2, 3, 4])
def test_time_passes_where_a_step_has_halted_the_core_within_a_block(make: Any, steps: int) -> None:
    """It stood still for ever: the end of the wait was put off to the block's end, which never came."""
    found = []
    for waits in (False, True):
        machine = make(START["WWDG"] + "movs r0, #0\nloop: adds r0, #1\nadds r4, r0, r4\ncmp r0, #9\nbne loop\nb stop")
        session, board = Session(machine), machine.board
        for _ in range(steps):
            session._session.answer(b"s")
        begun_ns, cycle = board.now_ns, board.cycle
        if waits:
            assert "0.0000" in session.wait(10_000)
            assert (board.now_ns - begun_ns, board.cycle - cycle) == (10_000, 80)
        board.run_for("1 ms")
        found.append((board.register("R4"), board.pc))
    assert found[0] == found[1]
    resets = board.resets.copy()
    session.wait(SPAN["WWDG"])
    assert board.resets != resets
