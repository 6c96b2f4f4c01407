"""Runs programs on the chip of one checkout and writes down what is seen: started inside that checkout.

Not part of any checkout: `tools.compare_chip` starts this very file with the checkout as its PYTHONPATH and its
folder, old or new. So it imports the most public names only, and whatever is spelt differently in some checkout
stands in `WAYS`, tried in order.

A job is a line of JSON on standard input, and its answer a line on standard output. What was seen goes to a folder,
one text file a kind (`edges`, `characters`, `blocks`, `state`), one item a line, so that any two can be compared.

Invariant: when something is put in from outside depends on the job's script only, never on the slices.
"""

import json
import os
import pickle
import random
import struct
import sys
import time
import zlib
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any, TextIO

import bluepill_sim
from bluepill_sim import BluePill, load_image

FLASH_BASE, SRAM_BASE, SRAM_BYTES, PERIPHERAL_BASE, PPB_BASE = (
    0x0800_0000,
    0x2000_0000,
    0x5000,
    0x4000_0000,
    0xE000_0000,
)
#: chosen: rows of blocks that wait in memory.
ROWS = 1 << 15
#: chosen: a chip that stops so often without getting anywhere stands at a halt for good.
MOST_STOPS = 1000

#: chosen: bytes of SRAM, and characters, that a line shows.
ROW_BYTES = 16

#: Rows of edges: ns, number of the pin, of what it drives, of the wire's level.
EDGE = struct.Struct("<QBBBBI")
PIN_NAMES = [f"P{port}{number}" for port in "ABCDE" for number in range(16)]
DRIVES = ("none", "low", "high", "pull-up", "pull-down")
#: What checkouts spell differently: by what it does, the ways to do it, of which the first that exists is taken.
WAYS: dict[str, tuple[Callable[..., Any], ...]] = {
    # (board) -> {"USART1.SR": address, …} of all modelled peripherals
    "registers": (
        lambda board: {
            f"{name}.{register.name}": part.base + register.offset
            for name, part in board.chip.parts.by_name.items()
            for register in part.REGISTERS
        },
    ),
    # (board, address) -> what a load of the program would read, side effects and all
    "read": (
        lambda board, address: (
            board.chip.system.read(address - PPB_BASE, 4)
            if address >= PPB_BASE
            else board.chip._bus.read(address - PERIPHERAL_BASE, 4)  # noqa: SLF001
        ),
    ),
    # (board, address, word): as a store of the program would
    "write": (lambda board, address, word: board.chip._bus.write(address - PERIPHERAL_BASE, 4, word),),  # noqa: SLF001
    # (board, take) where take(pin, drive, ns): what the chip puts on pins
    "hear pins": (
        lambda board, take: board.subscribe_pins(
            [pin.name for pin in board.chip.pins],
            lambda rows: [take(PIN_NAMES[row[1]], DRIVES[row[2]], row[0]) for row in EDGE.iter_unpack(rows)],
        ),
        lambda board, take: setattr(board, "on_pin", lambda pin, drive, ns: take(pin, drive.value, ns)),
    ),
    # (port, take) where take(word, ns)
    "hear characters": (
        lambda port, take: port.subscribe(lambda rows: [take(word, ns) for word, ns in rows]),
        lambda port, take: port.listeners.append(take),
    ),
    # (board): edges of its pins end slices
    "watch": (
        lambda board: board.subscribe_pins(
            [pin.name for pin in board.pins], lambda _rows: None, ends_slice=[pin.name for pin in board.pins]
        ),
        lambda board: [pin.watch() for pin in board.pins],
    ),
    # (board, take) where take(rows) and a row is (cycle, address, kind)
    "record": (lambda board, take: board.chip.record_blocks(ROWS, lambda recorder: take(recorder.drain())),),
    # (recorder) -> rows that wait
    "drain": (lambda recorder: recorder.drain(),),
}

#: RCC_AHBENR, APB2ENR, APB1ENR: at the end all clocks are on, so that every register can be read.
CLOCK_GATES = (0x4002_1014, 0x4002_1018, 0x4002_101C)
#: Registers of the core (ARMv7-M B3.2); CFSR and the like last, as reading them changes nothing.
CORE_REGISTERS = {
    "DWT_CYCCNT": 0xE000_1004, "SYST_CVR": 0xE000_E018, "SYST_CSR": 0xE000_E010, "SYST_RVR": 0xE000_E014,
    **{f"NVIC_ISER{n}": 0xE000_E100 + 4 * n for n in range(2)},
    **{f"NVIC_ISPR{n}": 0xE000_E200 + 4 * n for n in range(2)},
    **{f"NVIC_IABR{n}": 0xE000_E300 + 4 * n for n in range(2)},
    **{f"NVIC_IPR{n}": 0xE000_E400 + 4 * n for n in range(11)},
    "ICSR": 0xE000_ED04, "VTOR": 0xE000_ED08, "AIRCR": 0xE000_ED0C, "SCR": 0xE000_ED10, "CCR": 0xE000_ED14,
    **{f"SHPR{n}": 0xE000_ED14 + 4 * n for n in range(1, 4)},
    "SHCSR": 0xE000_ED24, "CFSR": 0xE000_ED28, "HFSR": 0xE000_ED2C, "MMFAR": 0xE000_ED34, "BFAR": 0xE000_ED38,
    "DEMCR": 0xE000_EDFC,
}  # fmt: skip
CPU_REGISTERS = (
    *(f"R{n}" for n in range(13)),
    *("SP", "LR", "XPSR", "MSP", "PSP", "PRIMASK", "BASEPRI", "FAULTMASK", "CONTROL"),
)


def way(name: str, *arguments: Any) -> Any:
    """Do something in the way of this checkout."""
    for one in WAYS[name]:
        try:
            return one(*arguments)
        except AttributeError as error:
            missing = error
    raise RuntimeError(f"this checkout has no way to {name!r}: add it to WAYS of {__file__} ({missing})")


class Seen:
    """What is seen of one run, as lines of files."""

    def __init__(self, folder: Path, kinds: list[str]) -> None:
        self.files: dict[str, TextIO] = {kind: (folder / kind).open("w", encoding="utf-8") for kind in kinds}

    def subscribe(self, board: Any, *, is_watched: bool) -> None:
        """Hear a board from now on."""
        if "edges" in self.files:
            put = self.files["edges"].write
            way("hear pins", board, lambda pin, drive, ns: put(f"{ns} ns  {pin} {drive}\n"))
            for name, port in board.serial_ports.items():
                way("hear characters", port, self._character_of(name))
        if is_watched:
            way("watch", board)
        self._recorder = None
        if "blocks" in self.files:
            self._recorder = way("record", board, self._rows)

    def finish(self, board: Any, addresses: dict[str, int]) -> None:
        """Write the last rows and the state; the board is of no use afterwards."""
        if self._recorder is not None:
            self._rows(way("drain", self._recorder))
        with self.files["state"] as file:
            file.writelines(f"{name} = {value}\n" for name, value in state_of(board, addresses))
        for file in self.files.values():
            file.close()

    def _character_of(self, name: str) -> Callable[[int, int], None]:
        put = self.files["characters"].write

        def take(word: int, ns: int) -> None:
            put(f"{ns} ns  {name} {word:#x}\n")

        return take

    def _rows(self, rows: list[tuple[int, int, int]]) -> None:
        self.files["blocks"].writelines([f"cycle {row[0]}  {row[1]:#010x} {row[2]}\n" for row in rows])


def state_of(board: Any, addresses: dict[str, int]) -> Iterator[tuple[str, object]]:
    """Yield everything that can be seen of a board that stands, by name."""
    yield from outside_of(board)
    for name in CPU_REGISTERS:
        yield name, f"{board.register(name):#010x}"
    sram = board.read_memory(SRAM_BASE, SRAM_BYTES)
    for at in range(0, SRAM_BYTES, ROW_BYTES):
        yield f"SRAM {SRAM_BASE + at:#010x}", sram[at : at + ROW_BYTES].hex(" ", 4)
    yield "flash (CRC)", zlib.crc32(board.read_memory(FLASH_BASE, 0x1_0000))
    for name, address in CORE_REGISTERS.items():
        yield name, f"{way('read', board, address):#010x}"
    for gate in CLOCK_GATES:
        yield f"RCC {gate:#010x}", f"{way('read', board, gate):#010x}"
        way("write", board, gate, 0xFFFF_FFFF)
    for name, address in addresses.items():
        yield name, f"{way('read', board, address):#010x}"


def outside_of(board: Any) -> Iterator[tuple[str, object]]:
    """Yield what is seen of a board from outside, by name."""
    yield "time in ns", board.now_ns
    yield "cycle", board.cycle
    yield "HCLK in Hz", board.hclk_hz
    yield "PC", f"{board.pc:#010x}"
    yield "asleep", board.is_asleep
    yield "fault", str(board.fault)
    yield "verdict", board.verdict
    for number, text in enumerate(board.warnings):
        yield f"warning {number + 1}", text
    for name, value in asdict(board.activity).items():
        yield name, value
    for name, port in board.serial_ports.items():
        for at in range(0, len(port.unread), ROW_BYTES):
            yield f"{name} sent {at}", bytes(port.unread[at : at + ROW_BYTES]).hex(" ", 4)
        yield f"{name} speeds", port.speeds
    for pin in board.pins:
        yield f"pin {pin.name}", f"{pin.output.value}, {int(pin.level)}, {pin.mode.value}, {pin.function}"


def spans(slices: int | str, end_ns: int) -> Iterator[int]:
    """Yield for ever how long the next slice is, in ns: fixed, up to the next input ("whole") or "random SEED"."""
    kind, _, seed = str(slices).partition(" ")
    dice = random.Random(seed)
    while True:
        if kind == "random":
            yield dice.choice((1, 17, 777, 31_337, 250_001, 3_000_017))
        else:
            yield end_ns if kind == "whole" else int(slices)


def run(job: dict[str, Any]) -> dict[str, Any]:
    """Run one program; return how long it took."""
    os.environ["P2OS_CORE"] = job["core"]
    folder, level, end_ns = Path(job["folder"]), job["level"], job["end_ns"]
    seen = Seen(folder, [*job["kinds"], "state"])
    board: Any = BluePill(job["image"])
    for pin in board.pins:  # older chips see what the board hangs on a pin from its first change on
        pin.drive(True)
        pin.drive(None)
    seen.subscribe(board, is_watched=level == "watched")
    began = time.process_time()
    inputs = [*job["script"], [end_ns, "end"]]
    middle = inputs[len(inputs) // 2] if level == "restored" else None
    slices = spans(job["slices"], end_ns)
    for what in inputs:
        advance(board, min(what[0], end_ns), slices)
        if what is middle:
            snapshot = pickle.dumps(board.snapshot())
            far_bauds = {name: port.far_baud for name, port in board.serial_ports.items()}
            board = BluePill(job["image"])
            board.restore(pickle.loads(snapshot))  # noqa: S301 - made a line above
            for name, baud in far_bauds.items():  # the line's other end is no part of the board
                board.serial_ports[name].far_baud = baud
            seen.subscribe(board, is_watched=False)
        if what[0] >= end_ns:
            break
        put_in(board, what)
    used_s = time.process_time() - began
    seen.finish(board, job["addresses"])
    return {"used_s": used_s}


def advance(board: Any, until_ns: int, slices: Iterator[int]) -> None:
    """Bring a board to a time in slices."""
    stops = 0
    while board.now_ns < until_ns:
        before = board.now_ns
        board.advance_to(min(until_ns, before + next(slices)))
        stops = stops + 1 if board.now_ns == before else 0
        if stops > MOST_STOPS:
            return


def put_in(board: Any, what: list[Any]) -> None:
    """Do one thing of a script from outside."""
    _, kind, *arguments = what
    if kind == "pin":
        name, level = arguments
        board.pin(name).drive(level)
    elif kind == "receive":
        name, text = arguments
        board.serial_ports[name].receive(bytes.fromhex(text))
    elif kind == "far baud":
        name, baud = arguments
        board.serial_ports[name].far_baud = baud
    elif kind == "reset":
        board.reset()


def list_registers(job: dict[str, Any]) -> dict[str, Any]:
    """Return the addresses of the checkout's registers by name."""
    vectors = struct.pack("<2I", SRAM_BASE + SRAM_BYTES, FLASH_BASE + 9) + b"\xfe\xe7"
    path = Path(job["folder"]) / "empty.bin"
    path.write_bytes(vectors)
    return {"addresses": way("registers", BluePill(path))}


def find_symbols(job: dict[str, Any]) -> dict[str, Any]:
    """Return what stands at addresses of an image, as far as it says."""
    symbols = load_image(job["image"]).symbols
    return {"where": [symbols.where(address) for address in job["addresses"]]}


JOBS: dict[str, Callable[[dict[str, Any]], dict[str, Any]]] = {
    "run": run,
    "registers": list_registers,
    "symbols": find_symbols,
}


def main() -> None:
    """Answer jobs until there are no more."""
    if not Path(bluepill_sim.__file__).is_relative_to(Path.cwd()):
        sys.exit(f"the chip of another checkout is imported: {bluepill_sim.__file__}")
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # what anything else prints is no answer
    for line in sys.stdin:
        job = json.loads(line)
        try:
            answer = JOBS[job["do"]](job)
        except Exception as error:  # noqa: BLE001 - told to whoever asked
            answer = {"error": f"{type(error).__name__}: {error}"}
        answers.write(json.dumps(answer) + "\n")
        answers.flush()


if __name__ == "__main__":
    main()
