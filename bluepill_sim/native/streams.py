"""Transmissions of the USARTs, handed to the native core while no listener needs each character at its time.

Theory of operation. Before a run in C each USART that only sends hands its
transmission over: from then on C ends its characters and starts the next ones
(`native/streams.c`). Before Python looks at anything, in the middle of a run or
at its end, the transmission comes back, with the characters that were sent.

Invariant: outside runs in C every transmission is its USART's own.
"""

import ctypes
from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

from bluepill_sim.core import Engine
from bluepill_sim.fabric.pins import PinBank
from bluepill_sim.native.library import library
from bluepill_sim.peripherals.usart import Usart
from simbase.timing import Nanos

if TYPE_CHECKING:
    from bluepill_sim.native.engine import NativeEngine

#: Bit of `dirty` that says that C has transmissions.
DIRTY = 1 << 31
_SENT = 1024
_U32, _U64 = ctypes.c_uint32, ctypes.c_uint64


class _Sent(ctypes.Structure):
    """`struct sent`."""

    _fields_ = (("ns", _U64), ("word", _U32), ("_padding", _U32))


class _Stream(ctypes.Structure):
    """`struct stream`."""

    _fields_ = (
        ("words", ctypes.c_void_p),
        ("base_ns", _U64),
        ("half_bits", _U64),
        ("due_ns", _U64),
        ("due_cycle", _U64),
        ("irq", _U32),
        ("frame_half_bits", _U32),
        ("clock_hz", _U32),
        ("sent_count", _U32),
        ("sent", _Sent * _SENT),
    )


class NativePorts(Protocol):
    """What the native core needs of the chip whose registers it holds."""

    engine: Engine
    pins: PinBank
    irq_listeners: list[Callable[[int, bool, Nanos], None]]

    @property
    def time_base(self) -> tuple[int, Nanos, int]:
        """Cycles a second, and the point in ns and in cycles from which they are counted."""
        ...

    def ns_of(self, cycle: int) -> Nanos:
        """Return the time of a cycle."""
        ...


class SharedStreams:
    """The transmissions of one chip."""

    def __init__(self, chip: NativePorts, engine: "NativeEngine", usarts: list[Usart]) -> None:
        self._chip = chip
        self._engine = engine
        self._streams: list[tuple[Usart, _Stream]] = []
        for number, usart in enumerate(usarts):
            stream = _Stream.from_address(library().core_stream(engine.state, number))
            stream.words, _ = usart.words.buffer_info()
            stream.irq = usart.place.irqs[0]
            self._streams.append((usart, stream))
        self._given: list[tuple[Usart, _Stream]] = []

    def give(self) -> bool:
        """Hand over what can be, before a run in C; return whether that moved a deadline."""
        given = [pair for pair in self._streams if pair[0].can_stream()]
        if not given or self._engine.needs_python or self._chip.irq_listeners:
            return False
        for usart, stream in given:
            stream.base_ns, stream.half_bits, stream.frame_half_bits, stream.clock_hz = usart.give_stream()
        self._given = given
        frequency_hz, base_ns, base_cycle = self._chip.time_base
        library().core_start_streams(self._engine.state, frequency_hz, base_ns, base_cycle)
        return True

    def take_back(self) -> None:
        """Take all of them back, then pass on what was sent."""
        given, self._given = self._given, []
        sent = [(usart, [(one.word, one.ns) for one in stream.sent[: stream.sent_count]]) for usart, stream in given]
        for usart, stream in given:
            usart.take_stream_back(stream.half_bits)
        library().core_stop_streams(self._engine.state)
        for usart, words in sent:
            usart.report_sent(words)
