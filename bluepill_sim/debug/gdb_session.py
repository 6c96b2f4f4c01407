"""What each packet of GDB asks for, and the answer to it.

Sans I/O: payloads go in, payloads come out; the owner of the connection frames
them. Commands that run the machine return when it is halted; where another one runs
it, they are answered by `stopped` once it is.

Source: Debugging with GDB, appendix E "GDB Remote Serial Protocol".
Invariant: any payload at all gives an answer (empty: not supported; None: later), never an exception.
"""

import binascii
from collections.abc import Callable
from dataclasses import dataclass

from bluepill_sim.core import WatchKind, Watchpoint
from bluepill_sim.debug.inspector import Inspector
from bluepill_sim.debug.machine import DebugTarget, HaltReason, StopKind
from bluepill_sim.debug.monitor import Monitor
from bluepill_sim.debug.packets import MAX_BYTES
from bluepill_sim.debug.target_description import FLASH_PAGE_BYTES, memory_map_xml, target_xml
from bluepill_sim.errors import BluePillError
from bluepill_sim.stm32f103 import FLASH_BASE, FLASH_BYTES_FITTED, without_alias
from simbase.terminal import readable

_OK, _NOT_SUPPORTED = b"OK", b""
#: chosen: errno-like numbers; GDB shows them and knows no others.
_BAD, _NO_MEMORY, _NO_REGISTER = b"E01", b"E0e", b"E16"
#: GDB's numbers of signals: SIGINT, SIGTRAP, SIGSEGV.
_SIGNALS = {StopKind.INTERRUPT: 2, StopKind.FAULT: 11}
_SIGTRAP = 5
#: A reply's bytes stand as two digits each.
_MAX_READ = MAX_BYTES // 2 - 16
#: The instruction set never needs longer watches; bounds the hooks.
_LONGEST_WATCH = 4096
_HEX_DIGITS = b"0123456789abcdefABCDEF"
_MOST_DIGITS = 16
#: What writes registers or memory.
_WRITES, _WRITING_WORDS = frozenset({b"G", b"P", b"M", b"X"}), b"vFlash"
_WATCH_KINDS = {b"2": WatchKind.WRITE, b"3": WatchKind.READ, b"4": WatchKind.ACCESS}
_WATCH_WORDS = {WatchKind.WRITE: b"watch", WatchKind.READ: b"rwatch", WatchKind.ACCESS: b"awatch"}
_FEATURES = (
    f"PacketSize={MAX_BYTES:x};qXfer:features:read+;qXfer:memory-map:read+;QStartNoAckMode+;vContSupported+;"
    "hwbreak+;ReverseStep+;ReverseContinue+"
).encode()


@dataclass(slots=True)
class State:
    """How a session stands."""

    #: Whether GDB has asked for no acknowledgements.
    has_no_acks: bool = False
    #: Whether GDB has left, and whether the machine is to run on.
    is_over: bool = False
    was_killed: bool = False


class GdbSession:
    """One debugger at one machine.

    Args:
        target: the machine, standing still.
    """

    def __init__(self, target: DebugTarget) -> None:
        self.state = State()
        self._target = target
        self._monitor = Monitor(target)
        self._stop = HaltReason(StopKind.STEP)
        #: What is to be programmed, in the order in which it came: an address, and bytes so many times over.
        self._flash: list[tuple[int, bytes, int]] = []
        self._by_letter: dict[bytes, Callable[[bytes], bytes | None]] = {
            b"?": lambda _: self._stop_reply(self._stop),
            b"g": lambda _: _hex(self._inspector.read_registers()),
            b"G": self._write_registers,
            b"p": self._read_register,
            b"P": self._write_register,
            b"m": self._read_memory,
            b"M": self._write_memory,
            b"X": self._write_binary,
            b"c": lambda at: self._resume(at, self._target.go_on),
            b"s": lambda at: self._resume(at, self._target.step),
            b"C": lambda rest: self._resume(rest.partition(b";")[2], self._target.go_on),
            b"S": lambda rest: self._resume(rest.partition(b";")[2], self._target.step),
            b"b": self._backwards,
            b"Z": lambda rest: self._point(rest, is_set=True),
            b"z": lambda rest: self._point(rest, is_set=False),
            b"k": lambda _: self._leave(was_killed=True),
            b"D": lambda _: self._leave(was_killed=False),
            b"H": lambda _: _OK,
            b"T": lambda _: _OK,
            b"q": self._query,
            b"Q": self._set,
            b"v": self._verbose,
        }

        self._by_word: dict[bytes, Callable[[bytes], bytes | None]] = {
            b"Cont": self._continue,
            b"Kill": lambda _: self._leave(was_killed=True),
            b"FlashErase": lambda rest: self._erase_flash(*_numbers(rest)),
            b"FlashWrite": self._write_flash,
            b"FlashDone": lambda _: self._program_flash(),
        }

    @property
    def _inspector(self) -> Inspector:
        return Inspector(self._target.machine.board)

    def stopped(self, stop: HaltReason) -> bytes:
        """Return the answer to what went on, now that the machine is halted."""
        self._stop = stop
        return self._stop_reply(stop)

    def answer(self, payload: bytes) -> bytes | None:
        """Return the answer to a payload; empty: not supported; None: `stopped` is, once the machine is halted."""
        act = self._by_letter.get(payload[:1])
        if act is None:
            return _NOT_SUPPORTED
        if self._target.read_only and (payload[:1] in _WRITES or payload.startswith(_WRITING_WORDS)):
            return b"E." + self._target.read_only.encode()
        try:
            return act(payload[1:])
        except (ValueError, IndexError, BluePillError):
            return _BAD

    # Registers and memory.

    def _write_registers(self, digits: bytes) -> bytes:
        data = binascii.unhexlify(digits)
        for number in range(len(self._inspector.layout)):
            begin, end = self._inspector.layout[number]
            if end <= len(data):
                self._inspector.write_register(number, data[begin:end])
        self._target.changed()
        return _OK

    def _read_register(self, digits: bytes) -> bytes:
        number = _number(digits)
        if number >= len(self._inspector.layout):
            return _NO_REGISTER
        return _hex(self._inspector.read_register(number))

    def _write_register(self, rest: bytes) -> bytes:
        number, _, digits = rest.partition(b"=")
        self._inspector.write_register(_number(number), binascii.unhexlify(digits))
        self._target.changed()
        return _OK

    def _read_memory(self, rest: bytes) -> bytes:
        address, size = _numbers(rest)
        data = self._inspector.read_memory(address, min(size, _MAX_READ)) if size else b""
        return _NO_MEMORY if data is None else _hex(data)

    def _write_memory(self, rest: bytes) -> bytes:
        where, _, digits = rest.partition(b":")
        return self._write(*_numbers(where), binascii.unhexlify(digits))

    def _write_binary(self, rest: bytes) -> bytes:
        where, _, data = rest.partition(b":")
        return self._write(*_numbers(where), data)

    def _write(self, address: int, size: int, data: bytes) -> bytes:
        if size != len(data):
            return _BAD
        if data and not self._inspector.write_memory(address, data):
            return _NO_MEMORY
        if data:
            self._target.changed()
        return _OK

    # Running.

    def _resume(self, address: bytes, run: Callable[[], HaltReason | None]) -> bytes | None:
        if address:
            if self._target.read_only:
                return b"E." + self._target.read_only.encode()
            self._inspector.set_register("pc", _address(address))
            self._target.changed()
        stop = run()
        return None if stop is None else self.stopped(stop)

    def _backwards(self, rest: bytes) -> bytes | None:
        if rest not in {b"s", b"c"}:
            return _NOT_SUPPORTED
        if not self._target.machine.can_rewind:
            return _BAD
        return self._resume(b"", self._target.step_back if rest == b"s" else self._target.go_back)

    def _stop_reply(self, stop: HaltReason) -> bytes:
        match stop.kind:
            case StopKind.EXIT:
                return b"W%02x" % stop.code
            case StopKind.END:
                return b"W00"
            case StopKind.BEGIN:
                return b"T05replaylog:begin;thread:1;"
            case StopKind.WATCHPOINT if (point := self._watchpoint_at(stop.address)) is not None:
                return b"T05%b:%x;thread:1;" % (_WATCH_WORDS[point.kind], point.address)
        return b"T%02xthread:1;" % _SIGNALS.get(stop.kind, _SIGTRAP)

    def _watchpoint_at(self, address: int | None) -> Watchpoint | None:
        points = self._target.machine.board.chip.engine.watchpoints
        # An access may begin up to three bytes before what it reaches into.
        near = [p for p in points if address is not None and p.address - 4 < address < p.address + p.size]
        return min(near, key=lambda p: (p.address, p.size, p.kind.value), default=None)

    def _point(self, rest: bytes, *, is_set: bool) -> bytes:
        kind, where, size, *_ = rest.split(b";")[0].split(b",")
        address, length = _address(where), _number(size)
        if kind in {b"0", b"1"}:
            self._target.set_point(address & ~1, is_set=is_set)
            return _OK
        if kind not in _WATCH_KINDS:
            return _NOT_SUPPORTED
        if not 1 <= length <= _LONGEST_WATCH:
            return _BAD
        self._target.set_point(Watchpoint(address, length, _WATCH_KINDS[kind]), is_set=is_set)
        return _OK

    def _leave(self, *, was_killed: bool) -> bytes:
        self.state.is_over, self.state.was_killed = True, was_killed
        return _OK

    # Words.

    def _query(self, rest: bytes) -> bytes:
        name, _, argument = rest.partition(b":" if not rest.startswith(b"Rcmd") else b",")
        if name == b"Xfer":
            return _transfer(argument)
        if name == b"Rcmd":
            text = self._monitor.run(binascii.unhexlify(argument).decode("utf-8", "replace"))
            return _hex(readable(text).encode()[:_MAX_READ])
        return _ANSWERS.get(name, _NOT_SUPPORTED)

    def _set(self, rest: bytes) -> bytes:
        if rest == b"StartNoAckMode":
            self.state.has_no_acks = True
            return _OK
        return _NOT_SUPPORTED

    def _verbose(self, rest: bytes) -> bytes | None:
        if rest == b"Cont?":
            return b"vCont;c;C;s;S"
        name, _, argument = rest.partition(b":" if rest.startswith(b"Flash") else b";")
        act = self._by_word.get(name)
        return _NOT_SUPPORTED if act is None else act(argument)

    def _continue(self, actions: bytes) -> bytes | None:
        run = {b"c": self._target.go_on, b"s": self._target.step}.get(actions[:1].lower())
        return _BAD if run is None else self._resume(b"", run)

    def _write_flash(self, rest: bytes) -> bytes:
        where, _, data = rest.partition(b":")
        self._flash.append((_number(where), data, 1))
        return _OK

    def _erase_flash(self, address: int, size: int) -> bytes:
        begin = without_alias(address) - FLASH_BASE
        if begin % FLASH_PAGE_BYTES or not 0 <= begin <= FLASH_BYTES_FITTED - size:
            return _NO_MEMORY
        self._flash.append((address, b"\xff", size))
        return _OK

    def _program_flash(self) -> bytes:
        rows, self._flash = self._flash, []
        is_done = all(self._inspector.write_memory(at, data * times) for at, data, times in rows if data and times)
        self._target.changed()
        return _OK if is_done else _NO_MEMORY


#: Answers that never change; there is one thread.
_ANSWERS = {
    b"Supported": _FEATURES,
    b"C": b"QC1",
    b"fThreadInfo": b"m1",
    b"sThreadInfo": b"l",
    b"Attached": b"1",
    b"Symbol": _OK,
}
_DOCUMENTS = {b"features:read:target.xml": target_xml, b"memory-map:read:": memory_map_xml}


def _transfer(argument: bytes) -> bytes:
    """Answer qXfer: a part of a document."""
    name, _, where = argument.rpartition(b":")
    make = _DOCUMENTS.get(name)
    if make is None:
        return b"E00"
    offset, size = _numbers(where)
    text = make().encode()
    part = text[offset : offset + min(size, _MAX_READ)]
    return (b"l" if offset + len(part) >= len(text) else b"m") + part


def _numbers(text: bytes) -> tuple[int, int]:
    first, _, second = text.partition(b",")
    return _number(first), _number(second)


def _number(digits: bytes) -> int:
    """Return a number as GDB writes it: plain hexadecimal digits, of at most 64 bits, without a sign.

    Raises:
        ValueError: these are others; `int` alone would take signs, spaces, underscores and 0x.
    """
    if len(digits) > _MOST_DIGITS or digits.strip(_HEX_DIGITS):
        raise ValueError(f"{digits!r} is no hexadecimal number")
    return int(digits, 16)


def _address(digits: bytes) -> int:
    """Return an address of this chip.

    Raises:
        ValueError: it is none.
    """
    address = _number(digits)
    if address >> 32:
        raise ValueError(f"{address:#x} is beyond the address space")
    return address


def _hex(data: bytes) -> bytes:
    return binascii.hexlify(data)
