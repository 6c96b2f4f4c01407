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

from collections.abc import Callable

from bluepill_sim.analysis.edge_log import EdgeLog
from bluepill_sim.board import BluePill
from bluepill_sim.core.nvic import IRQ_NAMES
from bluepill_sim.fabric.characters import Characters
from bluepill_sim.fabric.pins import Pin
from bluepill_sim.fabric.subscriptions import FLOATING, Of
from bluepill_sim.peripherals.usart import Usart
from simbase.timing import Nanos

#: (ns, 0 or 1, or FLOATING).
Edge = tuple[Nanos, int]


class Probe:
    """Records a board from now on.

    Args:
        board: What is looked at.
        with_signals: Whether signals inside the chip are recorded beside the pins.
    """

    def __init__(self, board: BluePill, *, with_signals: bool = True) -> None:
        self._board = board
        self.start_ns = self.end_ns = board.now_ns
        pins = list(board.chip.pins)
        inside = sorted([f"irq.{name}" for name in IRQ_NAMES] + [f"{name}.tx" for name in board.serial_ports])
        #: Every signal in the order in which a person reads them, the words of the USARTs behind.
        self.names = [pin.name for pin in pins] + inside
        self.first_word = len(self.names)
        self.names += [f"{name}.word" for name in sorted(board.serial_ports)]
        self._numbers = {name: number for number, name in enumerate(self.names)}
        #: Values at the start, by signal: of all pins, and of what has changed inside.
        self.initial = {pin.name: _value(pin) for pin in board.pins}
        self.initial |= {name: 0 for name in inside if name.startswith("irq.")} if with_signals else {}
        self._last: dict[int, int] = {}
        lines = range(len(IRQ_NAMES)) if with_signals else range(0)
        signals = [*range(len(pins)), *(self._numbers[f"irq.{name}"] for name in IRQ_NAMES)]
        values = [_value(pin) for pin in pins] + [0] * len(inside)
        for line in lines:
            values[signals[len(pins) + line]] = board.chip.processor.nvic.levels >> line & 1
        self.initial |= {self.names[signals[len(pins) + line]]: values[signals[len(pins) + line]] for line in lines}
        #: What happened.
        self.log = EdgeLog(signals, values)
        bonded = [pin.name for pin in board.pins]
        subscription = board.chip.pins.subscribe_pins(bonded, self.log.take, of=Of.WIRE, lines=lines)
        self._undo: list[Callable[[], None]] = [subscription.close]
        if with_signals:
            for name, port in board.serial_ports.items():
                self._listen(board.chip.parts.usart(int(port.name[-1])), name)

    def finish(self) -> None:
        """End the recording here."""
        self.end_ns = self._board.now_ns
        self._board.chip.deliver()
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

    def _listen(self, usart: Usart, name: str) -> None:
        """Record what a USART sends."""
        line = f"{name}.tx"
        line_number, word_number = self._numbers[line], self._numbers[f"{name}.word"]

        def take(sent: Characters) -> None:
            bit_ns = sent.bit_ns
            for word, at_ns in sent:
                self.log.put(at_ns, word_number, word)
                if line_number not in self._last:
                    self.initial[line] = self._last[line_number] = 1
                begin = at_ns - 10 * bit_ns
                for number, level in enumerate([0, *(word >> n & 1 for n in range(8)), 1]):
                    self._put(line_number, level, begin + number * bit_ns)

        usart.deliver()
        usart.sinks.append(take)
        self._undo.append(lambda: usart.sinks.remove(take))

    def _put(self, number: int, value: int, at_ns: Nanos) -> None:
        if value != self._last[number]:
            self._last[number] = value
            self.log.put(at_ns, number, value)


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
