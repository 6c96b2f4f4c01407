"""What a debugger sees and does: packets at a small program, forwards and backwards."""

import binascii
from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim.debug.execution import Execution
from bluepill_sim.debug.gdb_session import GdbSession
from bluepill_sim.debug.machine import LoneChip, StopKind

LOOP = (
    "movs r0, #0\nloop: adds r0, #1\nbl work\ncmp r0, #50\nbne loop\nb stop\nwork: adds r6, #2\nstr r0, [r7, #0]\nbx lr"
)
PRINTS = (
    "mov32 r1, #0x20000200\nmovs r2, #72\nstrb r2, [r1, #0]\nmovs r2, #0\nstrb r2, [r1, #1]\nmovs r0, #4\nbkpt #171\n"
    "movs r0, #3\nbkpt #171\nmovs r0, #99\nbkpt #171\nmov r4, r0\nbkpt #1\nmovs r5, #7\nmovs r0, #24\n"
    "mov32 r1, #0x20026\nbkpt #171"
)


class Debugger:
    def __init__(self, machine) -> None:
        self.printed = bytearray()
        self.board = machine.board
        self.execution = Execution(LoneChip(machine.board), self.printed.extend)
        self.session = GdbSession(self.execution)
        self.label = machine.label

    def __call__(self, text: str | bytes) -> str:
        return self.session.answer(text.encode() if isinstance(text, str) else text).decode()

    def monitor(self, line: str) -> str:
        return binascii.unhexlify(self("qRcmd," + line.encode().hex())).decode()

    def break_at(self, name: str) -> None:
        assert self(f"Z0,{self.label(name):x},2") == "OK"

    @property
    def place(self) -> tuple[int, int]:
        return self.board.cycle, self.board.pc


@pytest.fixture
def debug(boot) -> Callable[..., Debugger]:
    return lambda *words: Debugger(boot(*words))


def test_registers_are_read_and_written_by_number_and_all_at_once(debug) -> None:
    gdb = debug(LOOP)
    assert gdb("P2=78563412") == "OK"
    assert gdb.board.register("R2") == 0x12345678
    assert gdb("p2") == "78563412"
    assert gdb("pf") == gdb.label("start").to_bytes(4, "little").hex()
    assert gdb("p10") == "00000001"  # xPSR: T
    assert gdb("p11") == gdb("pd") == "00500020"  # MSP is SP
    everything = gdb("g")
    assert len(everything) == 2 * (17 * 4 + 2 * 4 + 4)
    changed = "01000000" + everything[8:]
    assert gdb("G" + changed) == "OK"
    assert gdb("g") == changed
    assert (gdb("p99"), gdb("P2=00"), gdb("Pff=00"), gdb("pzz")) == ("E16", "E01", "E01", "E01")


def test_memory_is_read_and_written_everywhere(debug) -> None:
    gdb = debug(LOOP)
    assert gdb("M20000300,4:01020304") == "OK"
    assert gdb(b"X20000304,2:\x7d\x03") == "OK"
    assert gdb("m20000300,6") == "010203047d03"
    assert gdb("m8000000,4") == "00500020"
    assert gdb("m10000000,4") == "E0e"
    assert gdb("M10000000,1:00") == "E0e"
    assert gdb("M20000300,4:01") == "E01"
    assert len(gdb("m20004ffe,8")) == 4  # as far as there is memory
    assert gdb("m40010800,4") == "44444444"  # GPIOA_CRL, its clock being off
    assert gdb("m40022000,4") == "30000000"  # FLASH_ACR, and no neighbour of it
    assert gdb("me000ed00,4") == (0x411F_C231).to_bytes(4, "little").hex()
    assert gdb("X20000300,0:") == "OK"
    assert gdb("Me000e010,4:05000000") == "OK"


def test_flash_is_programmed_as_load_does(debug) -> None:
    gdb = debug(LOOP)
    stop = gdb.label("stop")
    assert gdb("vFlashErase:8001000,400") == "OK"
    assert gdb(b"vFlashWrite:8001000:\x01\x02") == "OK"
    assert gdb("vFlashDone") == "OK"
    assert gdb("m8001000,3") == "0102ff"
    assert gdb("vFlashErase:8001001,400") == "E0e"
    # Code that is changed runs as it is now.
    assert gdb(f"M{gdb.label('loop'):x},2:{'00e0' if stop else ''}") == "OK"
    assert gdb("s") == "T05thread:1;"


def test_a_page_that_is_erased_and_written_in_part_is_erased_behind_it(debug) -> None:
    gdb = debug(LOOP)
    gdb("M8001000,8:0101010101010101")
    assert gdb("vFlashErase:8001000,400") == gdb(b"vFlashWrite:8001000:\2\3") == gdb("vFlashDone") == "OK"
    assert gdb("m8001000,8") == "0203ffffffffffff"
    assert gdb(b"vFlashWrite:8001000:\4") == gdb("vFlashErase:8001000,400") == gdb("vFlashDone") == "OK"
    assert gdb("m8001000,2") == "ffff", "in the order in which they came"


def test_flash_that_is_programmed_in_part_is_a_change_too(debug) -> None:
    gdb = debug(LOOP)
    gdb("s")
    assert gdb(b"vFlashWrite:8001000:\4") == gdb(b"vFlashWrite:10000000:\4") == "OK"
    assert gdb("vFlashDone") == "E0e"
    assert gdb("m8001000,1") == "04"
    assert gdb("bs") == "T05replaylog:begin;thread:1;", "what was before it has led elsewhere"


def test_breakpoints_stop_before_and_again_each_time(debug) -> None:
    gdb = debug(LOOP)
    gdb.break_at("work")
    for turn in (1, 2, 3):
        assert gdb("c") == "T05thread:1;"
        assert (gdb.board.pc, gdb.board.register("R0")) == (gdb.label("work"), turn)
    assert gdb(f"z0,{gdb.label('work'):x},2") == "OK"
    gdb.break_at("stop")
    assert gdb("vCont;c:1") == "T05thread:1;"
    assert (gdb.board.pc, gdb.board.register("R6")) == (gdb.label("stop"), 100)
    assert gdb("Z9,0,1") == ""
    assert gdb("Z2,20000000,0") == "E01"


@pytest.mark.parametrize(("kind", "word"), [("2", "watch"), ("4", "awatch")])
def test_a_watchpoint_tells_its_address(debug, kind: str, word: str) -> None:
    gdb = debug(LOOP)
    gdb(f"Z{kind},20000100,4")
    assert gdb("c") == f"T05{word}:20000100;thread:1;"
    assert gdb("m20000100,1") == "01"
    assert gdb(f"z{kind},20000100,4") == "OK"


def test_steps_go_one_instruction_on(debug) -> None:
    gdb = debug(LOOP)
    places = []
    for _ in range(6):
        assert gdb("s") == "T05thread:1;"
        places.append(gdb.board.pc)
    start, loop, work = gdb.label("start"), gdb.label("loop"), gdb.label("work")
    assert places == [start + 4, start + 8, loop, loop + 2, work, work + 2]
    assert gdb(f"s{loop:x}") == "T05thread:1;"
    assert gdb.board.pc == loop + 2


def test_stepping_back_retraces_every_step(debug) -> None:
    gdb = debug(LOOP)
    gdb.break_at("work")
    gdb("c")
    trail = [(gdb.place, gdb("g"))]
    for _ in range(12):
        gdb("s")
        trail.append((gdb.place, gdb("g")))
    for place, registers in reversed(trail[:-1]):
        assert gdb("bs") == "T05thread:1;"
        assert (gdb.place, gdb("g")) == (place, registers)
    end = trail[-1]
    for _ in range(12):
        gdb("s")
    assert (gdb.place, gdb("g")) == end


def test_going_back_stops_at_the_last_stop_before(debug) -> None:
    gdb = debug(LOOP)
    gdb.break_at("work")
    places = []
    for _ in range(5):
        gdb("c")
        places.append(gdb.place)
    for place in reversed(places[:-1]):
        assert gdb("bc") == "T05thread:1;"
        assert gdb.place == place
    assert gdb("bc") == "T05replaylog:begin;thread:1;"
    assert gdb.board.pc == gdb.label("start")
    assert gdb("bs") == "T05replaylog:begin;thread:1;"


def test_going_back_over_many_snapshots_and_interrupts(debug) -> None:
    systick = (
        "mov32 r1, #0xE000E010\nmov32 r2, #7999\nstr r2, [r1, #4]\nstr r2, [r1, #8]\nmovs r2, #7\nstr r2, [r1, #0]\n"
    )
    gdb = debug(systick + "spin: wfi\nb spin\ntick: adds r6, #1\nbx lr", {15: "tick"})
    gdb.break_at("tick")
    places = []
    for _ in range(100):
        gdb("c")
        places.append(gdb.place)
    assert gdb.board.now_ns > 99_000_000
    assert gdb("bc") == "T05thread:1;"
    assert gdb.place == places[-2]
    assert gdb("bs") == "T05thread:1;"
    assert gdb.board.register("R6") == 98
    gdb(f"z0,{gdb.label('tick'):x},2")
    gdb(f"Z0,{gdb.label('spin') - 2:x},2")
    assert gdb("bc") == "T05thread:1;"
    assert gdb.board.now_ns < 1_000_000


def test_a_run_with_a_debugger_is_the_run_without(boot, debug) -> None:
    gdb = debug(LOOP)
    gdb.break_at("work")
    for _ in range(7):
        gdb("c")
    gdb("bc")
    gdb("D")
    gdb.execution.detach()
    plain = boot(LOOP).board
    plain.advance_to(3_000_000)
    gdb.board.advance_to(3_000_000)
    assert gdb.board.snapshot() == plain.snapshot()


def test_what_a_run_comes_by_again_is_printed_once(debug) -> None:
    gdb = debug(PRINTS)
    execution = gdb.execution
    for at_ns in (1_000_000, 0, 1_000_000, 0):
        execution.go_to(at_ns)
        assert gdb.printed == b"HH"
        assert gdb.board.now_ns < 5_000 + at_ns // 2  # no further than where the program ends
    for packet in ("c", "bc", "c", "bs"):
        assert gdb(packet).startswith("T05")
    assert gdb.printed == b"HH"
    execution.go_to(0)
    execution.changed()  # what comes now is another run
    execution.go_to(1_000_000)
    assert gdb.printed == b"HHHH"


def test_semihosting_prints_and_ends(debug) -> None:
    gdb = debug(PRINTS)
    assert gdb("c") == "T05thread:1;"  # BKPT 1 is the program's own
    assert gdb.printed == b"HH"
    assert gdb.board.register("R4") == 0xFFFF_FFFF  # there is no operation 99
    assert gdb("c") == "W00"
    assert gdb.board.register("R5") == 7
    assert gdb("bc") == "T05thread:1;"
    assert gdb.printed == b"HH"


SEMIHOSTING = [
    (1, [0x0800_0000, 0, 3], 0xFFFF_FFFF),  # SYS_OPEN of no console
    (2, [1], 0),
    (5, [1, 0x0800_0000, 4], 0),  # SYS_WRITE: nothing is left
    (5, [7, 0x0800_0000, 4], 4),
    (5, [1, 0x1000_0000, 4], 4),
    (6, [0, 0, 9], 9),
    (7, [], 0),
    (9, [1], 1),
    (0x10, [], 0),
    (0x11, [], 0),
    (0x13, [], 0),
    (0x30, [0, 0], 0),
    (0x31, [], 8_000_000),
]


@pytest.mark.parametrize(("operation", "words", "result"), SEMIHOSTING)
def test_each_operation_answers(debug, operation: int, words: list[int], result: int) -> None:
    gdb = debug("bkpt #171\nbkpt #2")
    data = b"".join(word.to_bytes(4, "little") for word in words)
    gdb(b"X20000400,%x:" % len(data) + data)
    gdb("P0=" + operation.to_bytes(4, "little").hex())
    gdb("P1=00040020")
    assert gdb("c") == "T05thread:1;"
    assert gdb.board.register("R0") == result


@pytest.mark.parametrize(("operation", "words", "code"), [(0x20, [0x20026, 5], "W05"), (0x20, [1, 5], "W01")])
def test_an_exit_has_its_code(debug, operation: int, words: list[int], code: str) -> None:
    gdb = debug("bkpt #171")
    gdb(b"X20000400,8:" + b"".join(word.to_bytes(4, "little") for word in words))
    gdb("P0=" + operation.to_bytes(4, "little").hex())
    gdb("P1=00040020")
    assert gdb("c") == code


def test_a_fault_stops_in_its_handler(debug) -> None:
    gdb = debug("mov32 r1, #0x60000000\nldr r0, [r1, #0]\nb stop\nhard: b hard", {3: "hard"})
    assert gdb("c") == "T0bthread:1;"
    assert gdb("?") == "T0bthread:1;"
    assert gdb.board.pc == gdb.label("hard")
    assert "read of nothing" in gdb.monitor("fault")
    assert gdb.monitor("reset").startswith("reset: at start")
    assert gdb.monitor("fault") == "no fault\n"


def test_a_lockup_is_reported_each_time(debug) -> None:
    gdb = debug("mov32 r1, #0x60000000\nldr r0, [r1, #0]", {3: 0x1000_0001})
    assert gdb("c") == "T0bthread:1;"
    assert gdb("c") == "T0bthread:1;"
    assert gdb("s") == "T0bthread:1;"


def test_ctrl_c_stops_a_program_that_spins_or_sleeps(debug) -> None:
    for source in ("loop: adds r0, #1\nb loop", "loop: wfi\nb loop"):
        gdb = debug(source)
        gdb.execution.wants_stop = lambda gdb=gdb: gdb.board.now_ns > 5_000_000
        assert gdb("c") == "T02thread:1;"
        gdb.execution.wants_stop = lambda: True
        assert gdb("s") in {"T05thread:1;", "T02thread:1;"}


def test_monitor_tells_what_gdb_has_no_word_for(debug) -> None:
    gdb = debug(LOOP)
    assert gdb.monitor("help").count("\n") == 12
    assert gdb.monitor("") == gdb.monitor("help")
    assert gdb.monitor("time") == "0.000000000 s of virtual time, 0 cycles, 8 MHz\n"
    assert "PA13" in gdb.monitor("pins")
    assert len(gdb.monitor("pins all").splitlines()) == 37
    assert gdb.monitor("pin pa4 1").split() == ["PA4", "high", "floating", "input,", "high", "from", "outside"]
    assert gdb.board.pin("PA4").level
    assert "not understood" in gdb.monitor("pin PA4 2")
    assert "not understood" in gdb.monitor("pin")
    assert "not understood" in gdb.monitor("tea")
    gdb("s")
    assert "snapshot 1 at" in gdb.monitor("snapshot")
    before = gdb.place
    gdb("s")
    assert "restored 1" in gdb.monitor("restore")
    assert gdb.place == before
    assert "no snapshot x; there are: 1" in gdb.monitor("restore x")
    assert gdb.monitor("warnings") == "no warnings\n"


def test_monitor_shows_registers_by_name_with_their_fields(debug) -> None:
    gdb = debug(LOOP)
    assert "TIM4" in gdb.monitor("registers")
    assert gdb.monitor("registers tim3").splitlines()[11] == "ARR      0x0000ffff  ARR=0xffff"
    assert gdb.monitor("registers RCC cr").splitlines()[0] == "RCC_CR at 0x40021000: 0x00000083"
    assert "HSION        0x1" in gdb.monitor("registers RCC CR")
    assert "TIM3 has no RCR; it has CR1" in gdb.monitor("registers TIM3 RCR")
    assert "not understood" in gdb.monitor("registers TIM9")


def test_documents_are_read_in_parts(debug) -> None:
    gdb = debug(LOOP)
    whole, at = "", 0
    while True:
        part = gdb(f"qXfer:features:read:target.xml:{at:x},50")
        whole, at = whole + part[1:], at + 0x50
        if part[0] == "l":
            break
    assert whole.endswith("</target>\n")
    assert '<reg name="primask" bitsize="8"' in whole
    assert 'type="flash" start="0x8000000"' in gdb("qXfer:memory-map:read::0,4000")
    assert gdb("qXfer:auxv:read::0,10") == "E00"


def test_words_of_the_session(debug) -> None:
    gdb = debug(LOOP)
    assert "ReverseStep+" in gdb("qSupported:swbreak+")
    answers = {"qC": "QC1", "qfThreadInfo": "m1", "qsThreadInfo": "l", "qAttached": "1", "Hg0": "OK", "T1": "OK",
               "QStartNoAckMode": "OK", "QOther": "", "qOther": "", "vOther": "", "vCont?": "vCont;c;C;s;S", "": "",
               "bx": "", "vCont;x": "E01"}  # fmt: skip
    assert {packet: gdb(packet) for packet in answers} == answers
    assert gdb.session.state.has_no_acks
    assert gdb("vKill;1") == "OK"
    assert gdb.session.state.was_killed


def test_any_payload_is_answered(debug) -> None:
    gdb = debug("b stop")
    gdb.execution.wants_stop = lambda: True
    wild = st.one_of(st.binary(max_size=24), st.from_regex(rb"[mMXpPGzZqvQHTb][0-9a-f,:;=]{0,14}", fullmatch=True))

    @settings(max_examples=200)
    @given(payload=wild)
    def ask(payload: bytes) -> None:
        assert isinstance(gdb.session.answer(payload), bytes)

    ask()


NUMBERS = ["0", "1", "-1", "+1", " 1", "1_0", "0x10", "4", "1000", "7fffffff", "-80000000", "80000000", "ffffffff",
           "8000000", "20000000", "20004fff", "e000e010", "e00fffff", "100000000", "f" * 16, "f" * 60, "-" + "f" * 30,
           "", "zz", "-"]  # fmt: skip
SHAPES = ["m{},{}", "M{},{}:00", "X{},{}:a", "Z0,{},{}", "Z2,{},{}", "z2,{},{}", "Z4,{},{}", "vFlashErase:{},{}",
          "vFlashWrite:{}:{}", "vFlashDone", "qXfer:features:read:target.xml:{},{}", "qXfer:memory-map:read::{},{}",
          "p{}", "P{}={}", "Z1,{},{}"]  # fmt: skip


@pytest.mark.parametrize("shape", SHAPES)
def test_numbers_that_no_debugger_sends_are_answered(shape: str, debug) -> None:
    gdb = debug(LOOP)
    for first in NUMBERS:
        for second in NUMBERS:
            answer = gdb(shape.format(first, second))
            assert len(answer) <= 0x4000
            if {first[:1], second[:1]} & {"-", "+", " "} and shape.count("{}") == 2 and "P" not in shape:
                assert answer == "E01" or shape.startswith("vFlashWrite"), (shape, first, second)
    assert gdb("m7fffffff,-80000000") == "E01"
    assert gdb("m20000000,4") != "E01"


def test_any_bytes_of_registers_are_read(debug) -> None:
    """GPIOA_CRL is written, and CRH is 0x44444444 after a reset."""
    gdb = debug(LOOP)
    gdb("M40010800,4:78563412")
    whole = bytes.fromhex("78563412" + "44" * 4)
    for first in range(5):
        for size in range(1, 5):
            assert gdb(f"m{0x4001_0800 + first:x},{size:x}") == whole[first : first + size].hex()


def test_the_kinds_of_stops_are_all_reported() -> None:
    assert {kind.value for kind in StopKind} == {
        "breakpoint", "watchpoint", "step", "interrupt", "bkpt", "fault", "exit", "end", "begin",
    }  # fmt: skip
