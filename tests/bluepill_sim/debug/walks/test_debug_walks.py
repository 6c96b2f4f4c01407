"""A debugger that does anything to programs: every answer, place and register, forwards and backwards, as approved."""

import binascii
import io
import random
import zlib
from collections.abc import Iterator

from bluepill_sim.board import BluePill
from bluepill_sim.core import Reg
from bluepill_sim.debug.chip_state import (
    clock_rows,
    code_place,
    core_rows,
    exception_rows,
    source_place,
    stack_rows,
)
from bluepill_sim.debug.execution import Execution
from bluepill_sim.debug.gdb_session import GdbSession
from bluepill_sim.debug.history import History
from bluepill_sim.debug.inspector import Inspector
from bluepill_sim.debug.itm import PacketWriter, TextWriter, source_packet, time_stamps
from bluepill_sim.debug.machine import LoneChip
from bluepill_sim.debug.packets import MAX_BYTES, PacketReader, checksum, frame, unescape
from bluepill_sim.debug.sampler import VariableSampler
from bluepill_sim.debug.semihosting import Semihosting
from bluepill_sim.program.variables import NumberForm, Variable
from tests.bluepill_sim.machine import PORT_A_OUT, Machine
from tests.tools.examples import EXAMPLES
from tests.tools.suite.approved import Trace, judge_of, said

SYSTICK = 15
#: SysTick each 3000 cycles; a loop that calls, writes SRAM and sets a pin; what prints; a division that faults.
PROGRAM = (
    PORT_A_OUT
    + """\
mov32 r0, #0xE000E014
mov32 r1, #2999
str r1, [r0, #0]
mov32 r0, #0xE000E010
movs r1, #7
str r1, [r0, #0]
movs r5, #0
mov32 r6, #0x20000800
loop: adds r5, #1
bl work
mov32 r4, #0x40010810
movs r3, #3
str r3, [r4, #0]
cmp r5, #40
bne loop
bkpt #3
movs r0, #3
mov r1, r6
bkpt #171
b loop
work: push {r4, lr}
str r5, [r6, #0]
ldr r4, [r6, #0]
strb r5, [r6, #5]
pop {r4, pc}
tick: mov32 r2, #0x20000900
ldr r3, [r2, #0]
adds r3, #1
str r3, [r2, #0]
bx lr
"""
)
PLACES = ("start", "loop", "work", "tick", "stop", "default")


def packets_of(draw: random.Random, machine: Machine) -> str | bytes:
    """Return what a debugger may ask for."""
    at = f"{machine.label(draw.choice(PLACES)):x}"
    sram = draw.choice(
        (
            "20000800",
            "20000804",
            "20000900",
            "20004ffe",
            "1ffff7e0",
            "40010800",
            "e000ed00",
            "8000000",
            "0",
            "50000000",
            "2000",
        )
    )
    size = draw.choice(("1", "2", "4", "8", "0", "13", "400"))
    page = draw.choice(("8001000", "8001001", "1000", "801fc00", "8020000"))
    number = draw.choice(("0", "5", "d", "e", "f", "10", "11", "12", "13", "14", "15", "16", "17", "ff"))
    digits = draw.choice(("00", "78563412", "0102", "01", "ffffffff", "x", ""))
    return draw.choice(
        (
            "?",
            "g",
            f"p{number}",
            f"P{number}={digits}",
            f"m{sram},{size}",
            f"m{sram},{size}",
            f"M{sram},{len(digits) // 2:x}:{digits}",
            b"X" + sram.encode() + b",2:ab",
            "c",
            "c",
            "c",
            "s",
            "s",
            "s",
            f"s{at}",
            f"c{at}",
            "C05",
            "S05",
            "S05;" + at,
            "bs",
            "bs",
            "bs",
            "bc",
            "bc",
            "bx",
            "vCont;c",
            "vCont;s:1",
            "vCont?",
            "vCont;t",
            f"Z0,{at},2",
            f"Z0,{at},2",
            f"z0,{at},2",
            f"Z1,{at},2",
            f"Z2,{sram},{size}",
            f"Z3,{sram},4",
            f"Z4,{sram},1",
            f"z2,{sram},{size}",
            f"z4,{sram},1",
            "Z9,0,0",
            f"Z0,{at}",
            "Z2,0,1001",
            "H1",
            "T1",
            "k",
            "D",
            "qSupported:x",
            "qC",
            "qAttached",
            "qfThreadInfo",
            "qsThreadInfo",
            "qOffsets",
            "qSymbol::",
            "qTStatus",
            "QStartNoAckMode",
            "Qx",
            "vKill;1",
            "vMustReplyEmpty",
            "qXfer:features:read:target.xml:0,40",
            "qXfer:memory-map:read::10,30",
            "qXfer:features:read:target.xml:fff,40",
            "qXfer:features:read:none:0,9",
            "qXfer:x",
            f"vFlashErase:{page},{draw.choice(('400', '401', '0', '800'))}",
            b"vFlashWrite:8001000:\1\2",
            b"vFlashWrite:8020000:\1",
            "vFlashDone",
            "",
            "y",
            "!",
        )
    )


#: What `monitor` is asked.
MONITOR = (
    "help",
    "",
    "reset",
    "time",
    "wait 1ms",
    "wait 10us",
    "wait x",
    "wait",
    "pins",
    "pins all",
    "pin PA0",
    "pin pa1 1",
    "pin PA1 0",
    "pin PA1 z",
    "pin PA1 high",
    "pin PD5",
    "pin PA1 9",
    "pin",
    "pin PA1 1 2",
    "registers",
    "registers GPIOA",
    "registers gpioa crl",
    "registers TIM3 CR1",
    "registers X",
    "registers GPIOA X",
    "registers GPIOA CRL X",
    "snapshot",
    "snapshot a",
    "restore",
    "restore a",
    "restore b",
    "fault",
    "blocks",
    "warnings",
    "reset halt",
    "none",
)


class Seen:
    """A session at a program, and what it prints."""

    def __init__(self, source: str = PROGRAM, *, most_points: int = 64) -> None:
        self.machine = Machine(source, {SYSTICK: "tick"})
        self.board = self.machine.board
        self.printed = bytearray()
        self.execution = Execution(LoneChip(self.board), self.printed.extend, most_points=most_points, slice_ns=70_000)
        self.looks = 0
        self.execution.wants_stop = self._has_enough
        self.session = GdbSession(self.execution)

    def _has_enough(self) -> bool:
        """Press Ctrl-C, after some slices."""
        self.looks += 1
        return self.looks > 6

    def ask(self, payload: str | bytes) -> str:
        self.looks = 0
        answer = self.session.answer(payload.encode() if isinstance(payload, str) else payload)
        return "later" if answer is None else answer.decode("latin-1")

    def monitor(self, line: str) -> str:
        answer = self.ask("qRcmd," + line.encode().hex())
        return binascii.unhexlify(answer).decode() if answer and not answer.startswith("E") else answer

    def where(self) -> str:
        state, board = self.session.state, self.board
        sums = [zlib.crc32(self.ask("g").encode()), zlib.crc32(board.read_memory(0x2000_0000, 0x1000) or b"")]
        points = [(point.cycle, point.at_ns) for point in self.execution.history.latest_first()]
        stands = (state.has_no_acks, state.is_over, state.was_killed, board.fault is not None, bytes(self.printed))
        return said([board.cycle, f"{board.pc:x}", board.now_ns, sums, len(points), points[:1] + points[-1:], stands])


def sessions(draw: random.Random) -> Iterator[str]:
    for _ in range(7):
        seen = Seen(most_points=draw.choice((64, 4)))
        for _ in range(55):
            if draw.random() < 0.22:
                line = draw.choice(MONITOR)
                yield f"monitor {line}: {seen.monitor(line)} {seen.where()}"
            else:
                payload = packets_of(draw, seen.machine)
                yield f"{payload!r}: {seen.ask(payload)} {seen.where()}"
        seen.execution.read_only = "not now"
        for payload in (
            "g",
            "P0=00000000",
            "M20000000,1:00",
            "X20000000,0:",
            "vFlashDone",
            "s20",
            "c20",
            "m20000000,1",
        ):
            yield f"{payload}: {seen.ask(payload)}"
        yield "".join(seen.monitor(line) for line in ("reset", "wait 1ms", "restore", "pin PA1 1", "pin PA1", "time"))
        seen.execution.detach()
        yield said([seen.board.advance_to(seen.board.now_ns + 1_000_000), seen.where()])


def ways(draw: random.Random) -> Iterator[str]:
    """Times that are gone to, and back from; stops that are looked for from nearby; a program that faults."""
    seen = Seen(most_points=8)
    execution, machine = seen.execution, seen.machine
    for at_ns in (5_000_000, 1_000_000, 3_300_000, 100_000, 9_000_000, 8_999_000, 0):
        execution.go_to(at_ns)
        yield f"to {at_ns} {seen.where()}"
    for _ in range(25):
        what = draw.choice(
            ("go_on", "step", "step_back", "go_back", "back_to_near_stop", "run_to", "pass_to", "point", "changed")
        )
        seen.looks = 0
        if what == "point":
            execution.set_point(machine.label(draw.choice(PLACES)), is_set=draw.random() < 0.7)
            found: object = None
        elif what in {"run_to", "pass_to"}:
            found = getattr(execution, what)(seen.board.now_ns + draw.choice((0, 1_000, 70_000, 650_000)))
        else:
            found = getattr(execution, what)()
        yield f"{what} {said(found)} {seen.where()}"
    seen = Seen()
    for payload in (
        *("p", "P=00000000", "P5", "m,4", "m20000000,", "vFlashErase:8000000,400", "m8000000,8", "s"),
        *("m100000000,4", "mffffffff,1", "mffffffff,2", "Z0,100000000,2", "Z2,fffffffe,4", "s100000001", "c1ffffffff"),
        *("vFlashWrite:50000000:", "vFlashDone", "vFlashWrite:50000000:x", "vFlashDone"),
        *(b"vFlashWrite:8000000:" + bytes(8), "vFlashErase:801fc00,400", "vFlashErase:7fffc00,400", "vFlashDone", "c"),
    ):
        yield f"{payload!r}: {seen.ask(payload)} {seen.where()}"
    for source in (
        "movs r0, #0\nmov32 r1, #0xE000ED14\nmovs r2, #16\nstr r2, [r1, #0]\nmovs r3, #4\nudiv r0, r3, r0\ntick: nop",
        "udf\ntick: nop",
        "wfi\ntick: nop",
        "movs r0, #24\nmov32 r1, #0x20026\nbkpt #171\ntick: nop",
        "movs r0, #24\nmovs r1, #5\nbkpt #171\ntick: nop",
    ):
        seen = Seen(source)
        for payload in ("s", "s", "c", "bs", "bc", "c", "?"):
            yield f"{payload}: {seen.ask(payload)} {seen.where()}"
        yield seen.monitor("fault")
    free = Execution(LoneChip(Machine(PROGRAM, {SYSTICK: "tick"}).board))
    yield said([free.run_to(2_000_000), free.machine.board.now_ns, free.machine.board.cycle])


def chips(draw: random.Random) -> Iterator[str]:
    board = BluePill(EXAMPLES / "board_test.elf")
    inspector = Inspector(board)
    for _ in range(12):
        board.advance_to(board.now_ns + draw.choice((1_000, 12_345, 400_000)))
        yield said([core_rows(board), stack_rows(board), exception_rows(board), source_place(board)])
        yield said(clock_rows(board))
        name = draw.choice(("r0", "sp", "pc", "xpsr", "psp", "primask", "basepri", "control", "faultmask"))
        before = inspector.register(name)
        inspector.set_register(name, draw.choice((0, 0x10, 0x2000_4000, 0xF800_0001)) if name != "pc" else 0x0800_0200)
        yield said([name, before, inspector.register(name)])
        inspector.set_register(name, before)
        at = draw.choice(
            (
                0x2000_0800,
                0x4001_0800,
                0x4001_0802,
                0xE000_E010,
                0xE000_ED04,
                0x1FFF_F7E8,
                0x2000_4FFD,
                0x4000_7C00,
                0x6000_0000,
                0x0801_FFFF,
            )
        )
        yield said(
            [f"{at:x}", [inspector.read_memory(at, size) for size in (1, 2, 4, 7)], inspector.peek_word(at & ~3)]
        )
        yield said(
            [inspector.write_memory(at, bytes(size)) for size in (1, 2, 3, 4) if at not in {0xE000_E010, 0xE000_ED04}]
        )
    yield said(
        [
            code_place(board, at)
            for at in (0, 1, 2, 0x0800_0000, 0x0800_0130, 0x0800_0131, 0x131, 0x0801_FFFE, 0x0802_0000, 0x2000_0000)
        ]
    )
    yield said(inspector.layout)
    for below in (0, 4, 124, 128, 132, 0x300):
        inspector.set_register("sp", 0x2000_5000 - below)
        yield said(stack_rows(board))
    for pended in (1 << 31, 1 << 28, 1 << 26):
        inspector.write_memory(0xE000_ED04, pended.to_bytes(4, "little"))
        yield said(exception_rows(board))
    board.step(board.now_ns + 1_000)
    yield said([exception_rows(board), core_rows(board), source_place(board)])


def calls(draw: random.Random) -> Iterator[str]:
    machine = Machine("bkpt #171\nbkpt #1\ntick: nop", {})
    board, printed = machine.board, bytearray()
    host = Semihosting(board, printed.extend)
    call = machine.label("stop") - 6
    board.chip.memory.write(0x2000_0300, b"hello\0:tt\0\1")
    blocks = {
        "tty": (0x2000_0306, 4, 3),
        "file": (0x2000_0300, 4, 5),
        "none": (0x6000_0000, 4, 3),
        "out": (1, 0x2000_0300, 5),
        "err": (2, 0x2000_0300, 3),
        "other": (3, 0x2000_0300, 5),
        "long": (1, 0x2000_0000, 5000),
        "exit": (0x20026, 7, 0),
        "other exit": (0x20023, 7, 0),
    }
    for n, words in enumerate(blocks.values()):
        board.chip.memory.write(0x2000_0400 + 16 * n, b"".join(word.to_bytes(4, "little") for word in words))
    places = [0x2000_0400 + 16 * n for n in range(len(blocks))]
    board.advance_to(1_234_567)
    for operation in range(0x34):
        for at in (*places, 0x2000_0300, 0x2000_4FFC, 0x6000_0000, 0x20026, 0x20023):
            board.chip.engine.jump(call | 1)
            registers = board.chip.engine.registers
            registers[Reg.R0], registers[Reg.R1] = operation, at
            found = host.serve()
            if found is not None or registers[Reg.R0] != 0xFFFF_FFFF or printed:
                yield said(
                    [operation, at, found, registers[Reg.R0], f"{board.pc - call}", len(printed), bytes(printed[:12])]
                )
            printed.clear()
    yield said(
        [host.is_call(call), host.is_call(call + 2), host.is_call(0x6000_0000), board.read_memory(0x2000_4FF8, 8)]
    )


def packets(draw: random.Random) -> Iterator[str]:
    for payload in (b"", b"OK", b"a#b$c}d*e\x03", bytes(range(0x20, 0x30)), b"}" * 4):
        yield said([frame(payload), checksum(payload), unescape(frame(payload)[1:-3])])
    for text in (b"}", b"a}", b"}\x03", b"a}]b", b"}}"):
        yield said(unescape(text))
    for _ in range(80):
        reader, found = PacketReader(), list[str]()
        pieces = [
            frame(draw.choice((b"g", b"m0,4", b"a}b#", b""))),
            b"+",
            b"-",
            b"\x03",
            b"$g#00",
            b"$g#zz",
            b"$ab",
            b"$c#6",
            b"#",
            b"x",
            b"$g#67",
            b"$}\x04#81",
        ]
        for _ in range(6):
            found.append(said(reader.receive(draw.choice(pieces))))
        yield " ".join(found)
    for size in (MAX_BYTES - 1, MAX_BYTES, MAX_BYTES + 1):
        found_all = PacketReader().receive(frame(b"m" * size))
        yield said([[type(one).__name__ for one in found_all], [getattr(one, "name", "") for one in found_all]])


def traced(draw: random.Random) -> Iterator[str]:
    class Kept(io.StringIO):
        def close(self) -> None:
            self.seek(0)

    class KeptBytes(io.BytesIO):
        def close(self) -> None:
            self.seek(0)

    for _ in range(12):
        text, packed = Kept(), KeptBytes()
        writers, now, cycle = (TextWriter(text), PacketWriter(packed)), 0, 0
        for _ in range(12):
            now, cycle = (
                now + draw.choice((0, 5, 10**9)),
                cycle + draw.choice((0, 1, 6, 7, 127, 128, 1 << 28, (1 << 28) - 1)),
            )
            port = draw.choice((0, 0, 0, 1, 31))
            data = (
                draw.choice((b"a", b"\n", b"\r\n", b"ab\n\x01", b"\xc3\xa4", b"\xff", b"x y "))[
                    : draw.choice((1, 2, 4))
                ]
                if port == 0
                else bytes(draw.choice((1, 2, 4)))
            )
            data = data if len(data) in {1, 2, 4} else data[:2]
            for writer in writers:
                writer.write(now, cycle, port, data)
        for writer in writers:
            writer.close()
        yield f"{text.read()!r} {packed.read().hex()}"
    yield said([source_packet(port, bytes(size)).hex() for port in (0, 1, 31) for size in (1, 2, 4)])
    yield said(
        [
            time_stamps(cycles).hex()
            for cycles in (0, 1, 6, 7, 127, 128, 16_383, 16_384, (1 << 28) - 1, 1 << 28, (1 << 29) + 3)
        ]
    )


def looks(draw: random.Random) -> Iterator[str]:
    class Board:
        now_ns = 0
        memory = bytearray(16)

        def read_memory(self, address: int, size: int) -> bytes | None:
            return bytes(self.memory[address : address + size]) if address < 16 else None

    board, seen = Board(), list[object]()
    sampler = VariableSampler(board, lambda *look: seen.append(look), 100)
    yield said([sampler.look(5), seen, list(sampler.variables)])
    one, two = (
        Variable(name=name, type_name="", address=at, size=2, encoding=NumberForm.SIGNED)
        for name, at in (("a", 0), ("b", 99))
    )
    sampler.watch((one, two))
    for now in (0, 50, 99, 100, 101, 199, 250, 250, 249, 30, 300):
        board.now_ns = now
        board.memory[0] = draw.choice((1, 1, 2))
        yield said([now, sampler.look(now), seen])
        seen.clear()
    usual = VariableSampler(board, lambda *look: seen.append(look))
    yield said([usual.look(1), usual._period_ns])


def histories(draw: random.Random) -> Iterator[str]:
    class Board:
        cycle, now_ns = 0, 0

    class Passing:
        board, can_rewind = Board(), True

        def snapshot(self) -> int:
            return self.board.cycle

    for rewinds in (True, False):
        machine = Passing()
        machine.can_rewind = rewinds
        machine.board.cycle = machine.board.now_ns = 0
        history, other = History(machine, 5), History(machine)  # type: ignore[arg-type]
        for _ in range(40):
            machine.board.now_ns += draw.choice((400_000, 999_999, 1_000_000, 2_000_000))
            machine.board.cycle = machine.board.now_ns // 10
            history.pass_by()
            yield said(
                [
                    [point.cycle for point in history.latest_first()],
                    [point.cycle for point in history.before(machine.board.cycle)],
                    history._stride_ns,
                ]
            )
        history.forget_after(machine.board.cycle // 2)
        other.take(history)
        yield said([history.latest_first(), other.latest_first(), history.here()])


TRACES: dict[str, Trace] = {
    "sessions": sessions,
    "ways": ways,
    "chips": chips,
    "calls": calls,
    "packets": packets,
    "traced": traced,
    "looks": looks,
    "histories": histories,
}
test_a_walk_shows_what_was_approved = judge_of(__file__, TRACES)
