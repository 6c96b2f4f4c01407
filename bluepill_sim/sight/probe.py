"""A logic analyser on a board: every change of its pins and of some signals inside.

    PA0 … PC15            the wire: 0, 1, or z while nobody drives or pulls it
    irq.NAME              the interrupt line of a peripheral
    usart1.tx             the bits that go out, rebuilt from the characters and the baud rate
    usart1.word           the characters themselves (VCD only), at the end of their stop bit

Not seen: edges inside the chip that no pin or line shows, such as a timer's
internal compare. The TX *pin* stays high in this emulator; `usart1.tx` is what
a probe on a real one would show, without breaks and idle characters.

Invariant: looking on changes nothing; edges of one signal are in order of time
and differ from one to the next.
"""

from collections.abc import Callable
from typing import TypeVar

from bluepill_sim.board import BluePill
from bluepill_sim.pins import Pin
from bluepill_sim.timing import Nanos
from bluepill_sim.vectors import IRQ_NAMES

#: Nobody drives.
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
        #: Edges after the start, by signal; `initial` is what was there before.
        self.edges: dict[str, list[Edge]] = {}
        self.initial: dict[str, int] = {}
        self.words: dict[str, list[tuple[Nanos, int]]] = {}
        self._last: dict[str, int] = {}
        self._undo: list[Callable[[], None]] = []
        for pin in board.pins:
            self.initial[pin.name] = self._last[pin.name] = _value(pin)
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

    def _listen(self, listeners: list[_Listener], listener: _Listener) -> None:
        listeners.append(listener)
        self._undo.append(lambda: listeners.remove(listener))

    def _put(self, name: str, value: int, at_ns: Nanos) -> None:
        last = self._last.get(name)
        if last is None:
            self.initial[name] = last = 0
        if value != last:
            self._last[name] = value
            self.edges.setdefault(name, []).append((at_ns, value))

    def _wire_changed(self, pin: Pin, at_ns: Nanos) -> None:
        if pin.is_bonded:
            self._put(pin.name, _value(pin), at_ns)

    def _irq_changed(self, irq: int, level: bool, at_ns: Nanos) -> None:
        self._put(f"irq.{IRQ_NAMES[irq]}", int(level), at_ns)

    def _word_listener(self, name: str, peripheral: str) -> Callable[[int, Nanos], None]:
        usart = self._board.chip.parts.usart(int(peripheral[-1]))
        line, words = f"{name}.tx", f"{name}.word"

        def sent(word: int, at_ns: Nanos) -> None:
            self.words.setdefault(words, []).append((at_ns, word))
            bit_ns = usart.bit_ns
            if line not in self._last:
                self.initial[line] = self._last[line] = 1
            begin = at_ns - 10 * bit_ns
            for number, level in enumerate([0, *(word >> n & 1 for n in range(8)), 1]):
                self._put(line, level, begin + number * bit_ns)

        return sent


def _value(pin: Pin) -> int:
    return FLOATING if pin.is_floating else int(pin.level)


def signals_in_order(probe: Probe) -> list[str]:
    """Return the signals as a person reads them: pins by port and number, then what is inside; unused ones left out."""
    names = {name for name, edges in probe.edges.items() if edges}
    names |= {name for name, value in probe.initial.items() if value != FLOATING}
    return sorted(names, key=_order)


def _order(name: str) -> tuple[int, str, int]:
    if name.startswith("P") and "." not in name:
        return 0, name[1], int(name[2:])
    return 1, name, 0
