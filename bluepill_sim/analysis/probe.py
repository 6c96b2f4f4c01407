"""A logic analyser on a board: every change of its pins and of some signals inside.

    PA0 … PC15            the wire: 0, 1, or z while it is not driven or pulled
    irq.NAME              the interrupt line of a peripheral
    usart1.tx             the bits that go out, rebuilt from the characters and the baud rate
    usart1.word           the characters themselves (VCD only), at the end of their stop bit

Not seen: edges inside the chip that no pin or line shows, such as a timer's
internal compare. The TX *pin* stays high in this emulator; `usart1.tx` is what
a probe on a real one would show, without breaks and idle characters.

Invariant: probing changes nothing; edges of one signal are in order of time
and differ from one to the next.
"""

import ctypes
from collections.abc import Callable, MutableSequence
from typing import TypeVar

from bluepill_sim.analysis.edge_log import EdgeLog, NativeEdgeLog, PythonEdgeLog
from bluepill_sim.board import BluePill
from bluepill_sim.core.nvic import IRQ_NAMES
from bluepill_sim.fabric.pins import Pin, PinBank
from bluepill_sim.native.engine import NativeEngine
from simbase.timing import Nanos

#: The value of a wire that is not driven.
FLOATING = 2
#: (ns, 0 or 1, or FLOATING).
Edge = tuple[Nanos, int]
_Listener = TypeVar("_Listener")


class Probe:
    """Records a board from now on.

    Args:
        board: What is looked at.
        with_signals: Whether signals inside the chip are recorded beside the pins.
    """

    def __init__(self, board: BluePill, *, with_signals: bool = True) -> None:
        self._board = board
        self.start_ns = self.end_ns = board.now_ns
        ports = [board.chip.pins.port(letter) for letter in PinBank.PORTS]
        inside = [f"irq.{name}" for name in IRQ_NAMES] + [f"{name}.tx" for name in board.serial_ports]
        #: Every signal in the order in which a person reads them, the words of the USARTs behind.
        self.names = [pin.name for port in ports for pin in port] + sorted(inside)
        self.first_word = len(self.names)
        self.names += [f"{name}.word" for name in sorted(board.serial_ports)]
        self._numbers = {name: number for number, name in enumerate(self.names)}
        #: Values at the start, by signal: of all pins, and of what has changed inside.
        self.initial = {pin.name: _value(pin) for pin in board.pins}
        self._undo: list[Callable[[], None]] = []
        levels = [_value(pin) for port in ports for pin in port]
        bonded = [sum(1 << pin.number for pin in port if pin.is_bonded) for port in ports]
        engine = board.chip.engine
        self._last: dict[int, int] = {}
        if isinstance(engine, NativeEngine):
            log = NativeEdgeLog(bonded, levels)
            self._levels: MutableSequence[int] | ctypes.Array[ctypes.c_uint8] = log.last
            self.log: EdgeLog = log
            self._listen(board.chip.pins.bulk_listeners, lambda: log.take(engine.state, board.chip.time_base))
        else:
            self._levels = levels
            self.log = PythonEdgeLog()
        self._listen(board.chip.pins.wire_listeners, self._wire_changed)
        if with_signals:
            self._listen(board.chip.irq_listeners, self._irq_changed)
            for name, port in board.serial_ports.items():
                self._listen(port.listeners, self._word_listener(name, port.name))

    def finish(self) -> None:
        """End the recording here."""
        self.end_ns = self._board.now_ns
        while self._undo:
            self._undo.pop()()

    @property
    def edges(self) -> dict[str, list[Edge]]:
        """Edges after the start, by signal."""
        return self._by_name(0, self.first_word)

    @property
    def words(self) -> dict[str, list[tuple[Nanos, int]]]:
        """Characters, by signal, at the end of their stop bit."""
        return self._by_name(self.first_word, len(self.names))

    def _by_name(self, first: int, end: int) -> dict[str, list[Edge]]:
        rows: dict[str, list[Edge]] = {}
        for at_ns, number, value in self.log.rows():
            if first <= number < end:
                rows.setdefault(self.names[number], []).append((at_ns, value))
        return rows

    def _listen(self, listeners: list[_Listener], listener: _Listener) -> None:
        listeners.append(listener)
        self._undo.append(lambda: listeners.remove(listener))

    def _put(self, name: str, value: int, at_ns: Nanos) -> None:
        number = self._numbers[name]
        last = self._last.get(number)
        if last is None:
            self.initial[name] = last = 0
        if value != last:
            self._last[number] = value
            self.log.put(at_ns, number, value)

    def _wire_changed(self, pin: Pin, at_ns: Nanos) -> None:
        if pin.is_bonded:
            number = self._numbers[pin.name]
            value = _value(pin)
            if value != self._levels[number]:
                self._levels[number] = value
                self.log.put(at_ns, number, value)

    def _irq_changed(self, irq: int, level: bool, at_ns: Nanos) -> None:
        self._put(f"irq.{IRQ_NAMES[irq]}", int(level), at_ns)

    def _word_listener(self, name: str, peripheral: str) -> Callable[[int, Nanos], None]:
        usart = self._board.chip.parts.usart(int(peripheral[-1]))
        line = f"{name}.tx"
        line_number, word_number = self._numbers[line], self._numbers[f"{name}.word"]

        def sent(word: int, at_ns: Nanos) -> None:
            self.log.put(at_ns, word_number, word)
            bit_ns = usart.bit_ns
            if line_number not in self._last:
                self.initial[line] = self._last[line_number] = 1
            begin = at_ns - 10 * bit_ns
            for number, level in enumerate([0, *(word >> n & 1 for n in range(8)), 1]):
                self._put(line, level, begin + number * bit_ns)

        return sent


def _value(pin: Pin) -> int:
    return FLOATING if pin.is_floating else int(pin.level)


def signals_in_order(probe: Probe) -> list[str]:
    """Return the signals as a person reads them: pins by port and number, then what is inside; unused ones left out."""
    used = probe.log.used()
    names = probe.names[: probe.first_word]
    return [name for n, name in enumerate(names) if n in used or probe.initial.get(name, FLOATING) != FLOATING]


def words_in_order(probe: Probe) -> list[str]:
    """Return the signals that are characters; unused ones left out."""
    used = probe.log.used()
    return [name for n, name in enumerate(probe.names) if n >= probe.first_word and n in used]
