"""The chip around its core, as Python reaches it: the queue of events, lines, and devices that are written in C.

A device takes a slot of the queue. One in C is a row of `source/fabric/devices.c` and keeps its state in words of
Python's; one in Python is called when its slot is due. Lines are numbered, those of interrupts first.

Python stands on both sides of C here: what a callback raises is kept, and raised by `check` once C has come back.

Invariant: all state is in Python's memory (`port_structs`, the words and structs of devices, `lines`, the slots'
times), so that a snapshot is made of bytes and numbers.
"""

import ctypes
import weakref
from collections.abc import Callable, Iterable
from typing import Any, Protocol, TypeVar

from bluepill_sim.extension.layout import (
    ANALOG,
    ANALOG_PINS,
    CLOCKS,
    INPUT_ROWS,
    PORT,
    PORTS,
    SENT,
    SOURCES,
    WAVE,
    packing,
    structure,
)
from bluepill_sim.extension.library import library, made
from bluepill_sim.extension.windows import NO_TIME
from bluepill_sim.fabric.subscriptions import EDGE
from simbase.c_library import guarded
from simbase.state import Stateful
from simbase.timing import Nanos

#: Lines, and how many words of 64 of them there are (`LINES` of fabric.h); rows show a line as a pin behind the last.
LINES, LINE_WORDS, FIRST_LINE_ROW = 192, 3, 16 * PORTS
#: Commands of every device (`enum command`), and the first of its own.
RESET, CLOCK, ROUTE, SETTLE, STOPPED, RESUMED, OWN_COMMANDS = 0, 1, 2, 4, 8, 9, 16
#: An alternate function that offers nothing.
NO_LEVEL = 2

#: A word that has gone out (`struct sent`): ns, the word, clock in Hz, divider, format.
WORD = packing(SENT)
PortStruct, WaveStruct, AnalogStruct = structure(PORT), structure(WAVE), structure(ANALOG)
_ClocksStruct: Any = structure(CLOCKS)
#: VDDA of a board as it is delivered, in microvolts, and the temperature of the chip, in thousandths of a degree.
VDDA_UV, TEMPERATURE_MC = 3_300_000, 25_000
_U32, _U64, _USER = ctypes.c_uint32, ctypes.c_uint64, ctypes.c_void_p
_CYCLE = ctypes.CFUNCTYPE(_U64, _USER)
_SET_IRQ = ctypes.CFUNCTYPE(_U32, _USER, _U32, _U32)
_PLAIN = ctypes.CFUNCTYPE(None, _USER)
_DUE = ctypes.CFUNCTYPE(None, _USER, _U64)
_PC = ctypes.CFUNCTYPE(_U32, _USER)
_EVENT = ctypes.CFUNCTYPE(None, _U32, _U64)
_ASK = ctypes.CFUNCTYPE(_U32, _U32, _U32, _U32)
_PAIR = ctypes.CFUNCTYPE(None, _U32, _U32)
_ONE = ctypes.CFUNCTYPE(None, _U32)
_BUS = ctypes.CFUNCTYPE(_U64, _U32, _U32, _U32, _U32)
_FORCED = ctypes.CFUNCTYPE(_U32, _U32, _USER)
_NOTHING = ctypes.CFUNCTYPE(None)
#: `MOST_SEEN` and `SEEN_WORDS` of fabric.h.
_MOST_SEEN = 8
_SEEN_WORDS = 1 + 2 * _MOST_SEEN
_Result = TypeVar("_Result")


class HostCalls(ctypes.Structure):
    """`struct host`: what the fabric needs of the core."""

    _fields_ = (
        ("user", _USER),
        ("cycle", ctypes.c_void_p),
        ("boundary", ctypes.c_void_p),
        ("set_irq", ctypes.c_void_p),
        ("end_slice", ctypes.c_void_p),
        ("due", ctypes.c_void_p),
        ("pc", ctypes.c_void_p),
        ("signal", ctypes.c_void_p),
        ("registers", ctypes.c_void_p),
        ("holds_code", ctypes.c_void_p),
        ("asleep_until", ctypes.c_void_p),
        ("forced", ctypes.c_void_p),
    )


class _Calls(ctypes.Structure):
    """`struct fabric_calls`."""

    _fields_ = (
        ("event", _EVENT),
        ("ask", _ASK),
        ("electrical", _PAIR),
        ("deliver", _ONE),
        ("bus", _BUS),
        ("code_written", _PAIR),
        ("forced", _FORCED),
        ("no_memory", _NOTHING),
    )


class FabricPorts(Protocol):
    """What the fabric needs of the chip, where no native core stands under it, and what all else on it needs too."""

    @property
    def now_ns(self) -> Nanos:
        """The exact time of the accessing instruction inside of an access, else the time reached."""

    @property
    def access_cycle(self) -> int:
        """The cycle of the accessing instruction, else the one reached."""

    @property
    def access_pc(self) -> int:
        """The accessing instruction inside of an access, else the next one."""

    def irq_changed(self, irq: int, level: bool) -> bool:
        """Take a new level of an interrupt line; return whether the interrupt is enabled."""

    def end_slice(self) -> None:
        """End the slice at the boundary of the running block."""

    def event_due(self, cycle: int) -> None:
        """End the slice at this cycle at the latest."""

    def reach_registers(self, address: int, size: int, written: int | None) -> int | None:
        """Make an access of a bus master: the word that is read, 0 after a write, None for an error of the bus."""

    def code_written(self, address: int, size: int) -> None:
        """Forget, before the next block, what was translated from bytes that a bus master has written."""

    def signal(self, name: str) -> None:
        """Signal an event to the core by name.

        "event" sets the event register that WFE waits for, "nmi" is a request, "wake" ends Standby, and after
        "no clock" only a reset helps.
        """

    def request_stop(self) -> None:
        """End the CPU's slice at the boundary of the running block."""

    def warn(self, message: str, *, once: str, pc: int | None = None) -> None:
        """Warn of what the firmware does wrong, or of what is not modelled; once for each key.

        With `pc`: of what the instruction there did; else it is the one that runs.
        """


class Fabric(Stateful):
    """Queue, lines and devices of one chip."""

    STATE = ("ports", "waves", "lines", "inputs", "analog", "samples")
    #: What one of the callbacks has raised; and what is filled once, when a chip is made.
    DERIVED = (
        "_failure", "electrical", "forced", "_kept", "_kept_words", "_names", "_acts", "_answers", "_deliveries",
        "_samples",
    )  # fmt: skip

    def __init__(self, chip: FabricPorts) -> None:
        self._chip = chip
        self._calls_of_c = calls = library()
        self._failure: BaseException | None = None
        self._names: dict[int, str] = {}
        self._acts: dict[int, Callable[[Nanos], None]] = {}
        self._answers: dict[int, Callable[[int, int], int | None]] = {}
        self._deliveries: dict[int, Callable[[], None]] = {}
        self._kept: list[object] = []
        #: Called with (number of the pin, 0 for a fight with the outside and 1 for a short).
        self.electrical: Callable[[int, int], None] = lambda _pin, _what: None
        #: Returns which bits of the register at an address the running store sets whatever was there, and what that
        #: hangs on beside the code: values by the number of a register or the address of a word.
        self.forced: Callable[[int], tuple[int, dict[int, int]]] = lambda _address: (0, {})
        self.port_structs: Any = (PortStruct * PORTS)()
        #: The wave that each alternate function offers; its period is 0 where it offers none.
        self.wave_structs: Any = (WaveStruct * SOURCES)()
        self._callbacks = _Calls(
            _EVENT(self._guarded(self._event, None)),
            _ASK(self._guarded(self._ask, 0)),
            _PAIR(self._guarded(self._electrical, None)),
            _ONE(self._guarded(lambda slot: self._deliveries[slot](), None)),
            _BUS(self._guarded(self._reach_registers, NO_TIME)),
            _PAIR(self._guarded(self._code_written, None)),
            _FORCED(self._guarded(self._find_forced, 0)),
            _NOTHING(self._guarded(self._lose_memory, None)),
        )
        #: `struct fabric`, for the native core.
        fabric = calls.fabric_new(
            ctypes.addressof(self._callbacks), ctypes.addressof(self.port_structs), ctypes.addressof(self.wave_structs)
        )
        self.handle = ctypes.c_void_p(made(fabric, "the fabric"))
        weakref.finalize(self, calls.fabric_free, self.handle)
        #: `struct analog`: write it between two runs, behind a call of `inputs_change`.
        self.analog_struct: Any = AnalogStruct(vdda_uv=VDDA_UV, temperature_mc=TEMPERATURE_MC)
        self._samples: list[Any] = [None] * ANALOG_PINS
        #: What C has pointers to.
        self._kept_words: list[object] = []
        #: Called before volts on pins change: what was sampled by now, was sampled with those before.
        self.input_listeners: list[Callable[[], object]] = []
        calls.fabric_set_analog(self.handle, ctypes.addressof(self.analog_struct))
        self._use_python_host()
        self._schedule = calls.fabric_schedule
        self._due = calls.fabric_due
        self._inputs: Any = structure(INPUT_ROWS)()
        self._input_slot = self._new_slot("inputs")
        calls.fabric_add_device(self.handle, self._input_slot, b"inputs", None, ctypes.addressof(self._inputs))

    # The core.

    def use_host(self, host: HostCalls, *kept: object) -> None:
        """Take another core than Python's."""
        self._kept[:] = [host, *kept]
        self._calls_of_c.fabric_set_host(self.handle, ctypes.addressof(host))

    def set_time(self, base_ns: Nanos, base_cycle: int, frequency_hz: int) -> None:
        """Tie nanoseconds and the host's cycles together; before that a cycle is a nanosecond."""
        self._calls_of_c.fabric_set_time(self.handle, base_ns, base_cycle, frequency_hz)

    def set_clocks(self, clocks: ctypes.Structure) -> None:
        """Say where the clock tree's outputs are, `struct clocks`, which devices in C read and set."""
        self._kept_words.append(clocks)
        self._calls_of_c.fabric_set_clocks(self.handle, ctypes.addressof(clocks))

    def set_clock(self, slot: int, name: str) -> None:
        """Say which of them a device counts."""
        self._calls_of_c.fabric_set_clock(self.handle, slot, getattr(_ClocksStruct, name).offset)

    def clocks_changed(self) -> None:
        """Notify every device in C that counts a clock that one may be another."""
        self._calls_of_c.fabric_clocks_changed(self.handle)
        self.check()

    # Events.

    @property
    def event_ns(self) -> Nanos | None:
        """The time of the event that is acted on, while one is."""
        at = self._calls_of_c.fabric_event_ns(self.handle)
        return None if at == NO_TIME else at

    @property
    def next_ns(self) -> Nanos | None:
        """When the first event is due; None for never."""
        at = self._calls_of_c.fabric_next_ns(self.handle)
        return None if at == NO_TIME else at

    def run_events(self, until_ns: Nanos) -> None:
        """Act on all that is due up to a time, in order of time, then of slots."""
        self._calls_of_c.fabric_run_events(self.handle, until_ns)
        self.check()

    def catch_up(self, slot: int, until_ns: Nanos) -> None:
        """Act on what one device has due up to a time."""
        self._calls_of_c.fabric_catch_up(self.handle, slot, until_ns)
        self.check()

    def schedule(self, slot: int, at_ns: Nanos | None) -> None:
        """Have a slot's event come at a time; None takes it back."""
        self._schedule(self.handle, slot, NO_TIME if at_ns is None else at_ns)

    def due(self, slot: int) -> Nanos | None:
        """Return when a slot's event comes."""
        at = self._due(self.handle, slot)
        return None if at == NO_TIME else at

    def check(self) -> None:
        """Raise what a callback has raised since.

        Raises:
            Exception: Whatever it was.
        """
        if self._failure is not None:
            failure, self._failure = self._failure, None
            raise failure

    # Devices.

    def add_slot(self, name: str, act: Callable[[Nanos], None]) -> int:
        """Take a slot for a device in Python, called with the time that was due; return its number."""
        slot = self._new_slot(name)
        self._acts[slot] = act
        return slot

    def add_device(
        self,
        name: str,
        kind: str,
        words: int,
        state: int,
        *,
        act: Callable[[Nanos], None],
        answer: Callable[[int, int], int | None],
        deliver: Callable[[], None],
    ) -> int:
        """Take a slot for a device in C; return its number.

        Args:
            name: its own, for messages.
            kind: that of its kind in `source/fabric/devices.c`.
            words: where its registers are in the host's memory.
            state: and what it holds beside them.
            act: called when it is due, where its kind leaves that to Python.
            answer: called with what it asks.
            deliver: called when the words that it has sent must be taken over.
        """
        slot = self._new_slot(name)
        if not self._calls_of_c.fabric_add_device(self.handle, slot, kind.encode(), words, state):
            raise ValueError(f"no kind of device is called {kind!r} (hint: build its C again: pip install -e .)")
        self._acts[slot], self._answers[slot], self._deliveries[slot] = act, answer, deliver
        return slot

    def set_gate(self, slot: int, register: int, bit: int) -> None:
        """Say which bit of RCC's enable and reset registers is a device's; 0 is the AHB's, 1 APB2's, 2 APB1's."""
        self._calls_of_c.fabric_set_gate(self.handle, slot, register, bit)

    def set_initial(self, slot: int, words: "ctypes.Array[ctypes.c_uint32]", *, is_whole: bool) -> None:
        """Say what the registers of a device in C are after a reset: index and word.

        Args:
            slot: its own.
            words: a pair for each register; C reads them at each reset.
            is_whole: whether these, and what its kind does, are all of a reset.
        """
        self._kept_words.append(words)
        at = ctypes.addressof(words)
        self._calls_of_c.fabric_set_initial(self.handle, slot, at, len(words) // 2, is_whole)

    def reset_device(self, slot: int) -> None:
        """Put a device in C back to its state after a reset, but for what of it is Python's."""
        self._calls_of_c.fabric_reset_device(self.handle, slot)
        self.check()

    def name_of(self, slot: int) -> str:
        """Return the name of the device in a slot."""
        return self._names[slot]

    def read(self, slot: int, index: int) -> int:
        """Return what a device in C answers to the read of a register."""
        word: int = self._calls_of_c.fabric_read(self.handle, slot, index)
        self.check()
        return word

    def write(self, slot: int, index: int, written: int, previous: int) -> None:
        """Have a device in C do what follows a store."""
        self._calls_of_c.fabric_write(self.handle, slot, index, written, previous)
        self.check()

    def command(self, slot: int, what: int, one: int = 0, other: int = 0) -> int:
        """Have a device in C do something; return its answer."""
        answer: int = self._calls_of_c.fabric_command(self.handle, slot, what, one, other)
        self.check()
        return answer

    def take_words(self, slot: int) -> bytes:
        """Take the words that a device has sent: rows of `WORD`."""
        count = self._calls_of_c.fabric_word_count(self.handle, slot)
        if not count:
            return b""
        return ctypes.string_at(self._calls_of_c.fabric_take_words(self.handle, slot), count * WORD.size)

    def stop_at_words(self, slot: int, wanted: bool) -> None:
        """Choose whether each word that a device sends ends the slice."""
        self._calls_of_c.fabric_stop_at_words(self.handle, slot, wanted)

    # Lines.

    def set_line(self, line: int, level: bool) -> None:
        """Set a line as the first output on it does."""
        self._calls_of_c.fabric_set_line(self.handle, line, level)
        self.check()

    def set_output(self, slot: int, output: int, level: bool) -> None:
        """Set an output of a device in Python; nothing happens where it is on no line."""
        self._calls_of_c.fabric_set_output(self.handle, slot, output, level)
        self.check()

    def put_output(self, slot: int, output: int, line: int) -> None:
        """Put an output of a device on a line.

        Raises:
            ValueError: There is no room.
        """
        if not self._calls_of_c.fabric_put_output(self.handle, slot, output, line):
            raise ValueError(f"line {line} cannot take another output")

    def wire(self, line: int, slot: int, input_number: int) -> None:
        """Hang an input of a device in C on a line.

        Raises:
            ValueError: There is no room, or no such device.
        """
        if not self._calls_of_c.fabric_wire(self.handle, line, slot, input_number):
            raise ValueError(f"line {line} cannot take another input")

    @property
    def lines(self) -> bytes:
        """The outputs that are 1 on each line, a bit each."""
        level, handle = self._calls_of_c.fabric_line, self.handle
        return bytes([level(handle, line) for line in range(LINES)])

    @lines.setter
    def lines(self, levels: bytes) -> None:
        for line, level in enumerate(levels):
            self._calls_of_c.fabric_restore_line(self.handle, line, level)

    @property
    def waves(self) -> bytes:
        """What the alternate functions offer as waves, as bytes."""
        return bytes(self.wave_structs)

    @waves.setter
    def waves(self, waves: bytes) -> None:
        ctypes.memmove(self.wave_structs, waves, len(waves))

    @property
    def inputs(self) -> bytes:
        """What the outside puts on pins later, as bytes."""
        used = self._inputs.count
        return bytes(self._inputs) if used else b""

    @inputs.setter
    def inputs(self, inputs: bytes) -> None:
        self._inputs.count = 0
        ctypes.memmove(ctypes.addressof(self._inputs), inputs, len(inputs))

    def put_inputs(self, rows: bytes) -> None:
        """Have the outside put levels on pins later: rows of `EDGE`, of which time, pin and drive count.

        Raises:
            ValueError: More than `LATER_INPUTS` would be to come.
        """
        if not self._calls_of_c.fabric_put_inputs(self.handle, self._input_slot, rows, len(rows) // EDGE.size):
            raise ValueError("too many levels of pins to come")

    # Volts.

    def inputs_change(self) -> None:
        """Notify that volts on pins are about to change."""
        for listener in self.input_listeners:
            listener()

    def channel_uv(self, channel: int, at_ns: Nanos) -> int:
        """Return the microvolts on the pin of an ADC channel, 0 to 9, at a time."""
        return ctypes.c_int64(self._calls_of_c.fabric_channel_uv(self.handle, channel, at_ns)).value

    def set_samples(self, channel: int, samples: bytes) -> None:
        """Give the samples of a pin's signal: 32-bit integers of microvolts."""
        if not samples and self._samples[channel] is None:
            return
        kept = (ctypes.c_int32 * (len(samples) // 4)).from_buffer_copy(samples) if samples else None
        self._samples[channel] = kept
        at = None if kept is None else ctypes.addressof(kept)
        self._calls_of_c.fabric_set_samples(self.handle, channel, at)

    @property
    def analog(self) -> bytes:
        """The analog side, as bytes."""
        return bytes(self.analog_struct)

    @analog.setter
    def analog(self, analog: bytes) -> None:
        ctypes.memmove(ctypes.addressof(self.analog_struct), analog, len(analog))

    @property
    def samples(self) -> tuple[bytes, ...]:
        """The samples of each signal."""
        return tuple(b"" if kept is None else bytes(kept) for kept in self._samples)

    @samples.setter
    def samples(self, samples: tuple[bytes, ...]) -> None:
        for channel, data in enumerate(samples):
            self.set_samples(channel, data)

    def resume(self) -> None:
        """Go on with a state that was put back, once core and clock have theirs."""
        self._calls_of_c.fabric_resume(self.handle)
        self._calls_of_c.fabric_command(self.handle, self._input_slot, CLOCK, 0, 0)
        self.check()

    # The bus, for masters that are not the core.

    def add_memory(self, address: int, buffer: "ctypes.Array[ctypes.c_char]", *, is_writable: bool) -> None:
        """Make a memory known to bus masters."""
        self._calls_of_c.fabric_add_memory(self.handle, ctypes.addressof(buffer), address, len(buffer), is_writable)

    def bus_read(self, slot: int, address: int, size: int) -> int | None:
        """Read 1, 2 or 4 bytes for a device in Python; None for an error of the bus."""
        return self._bus(slot, 0, address, size, 0)

    def bus_write(self, slot: int, address: int, size: int, word: int) -> bool:
        """Write 1, 2 or 4 bytes for a device in Python; False for an error of the bus."""
        return self._bus(slot, 1, address, size, word) is not None

    @property
    def master(self) -> str | None:
        """The device whose access is under way; None for the core."""
        return self._names.get(self._calls_of_c.fabric_master(self.handle))

    def _bus(self, slot: int, is_write: int, address: int, size: int, word: int) -> int | None:
        answer: int = self._calls_of_c.fabric_bus(self.handle, slot, is_write, address, size, word)
        self.check()
        return None if answer == NO_TIME else answer

    def _code_written(self, address: int, size: int) -> None:
        self._chip.code_written(address, size)

    def _find_forced(self, address: int, seen_at: int) -> int:
        """Answer what C asks, with what the answer hangs on."""
        bits, seen = self.forced(address)
        words = (_U32 * _SEEN_WORDS).from_address(seen_at)
        pairs = [word for pair in seen.items() for word in pair][: _SEEN_WORDS - 1]
        words[: 1 + len(pairs)] = [len(seen), *pairs]
        return bits

    def _reach_registers(self, is_write: int, address: int, size: int, word: int) -> int:
        answer = self._chip.reach_registers(address, size, word if is_write else None)
        return NO_TIME if answer is None else answer

    @property
    def ports(self) -> bytes:
        """The pins, as bytes; with their waves as they are now, since nobody may have looked at them for long."""
        return b"".join(bytes(self.look(port)) for port in range(PORTS))

    @ports.setter
    def ports(self, ports: bytes) -> None:
        ctypes.memmove(self.port_structs, ports, len(ports))
        self._calls_of_c.fabric_forget_output(self.handle)

    # Pins, for `PinBank`.

    def pins_changed(self, port: int) -> None:
        """Work out a port anew: something of it was written from Python."""
        self._calls_of_c.fabric_pins_changed(self.handle, port)
        self.check()

    def configure_pin(self, pin: int, mode: int, output_bit: bool) -> None:
        """Give a pin a mode, by its index in `PinMode`, and a bit of ODR."""
        self._calls_of_c.fabric_configure_pin(self.handle, pin, mode, output_bit)
        self.check()

    def offer(self, pin: int, source: int, level: int) -> None:
        """Have an alternate function offer a level on a pin: 0, 1, or `NO_LEVEL`."""
        self._calls_of_c.fabric_offer(self.handle, pin, source, level)
        self.check()

    def look(self, port: int) -> Any:
        """Return a port as it is now, where pins of it show waves."""
        now = PortStruct()
        self._calls_of_c.fabric_look(self.handle, port, ctypes.addressof(now))
        return now

    def set_wave(self, pin: int, source: int, frequency_hz: int, period: int, high: int, position: int) -> None:
        """Have an alternate function offer a wave on a pin: `wave_set` of `source/fabric/fabric.h`."""
        self._calls_of_c.fabric_set_wave(self.handle, pin, source, frequency_hz, period, high, position)
        self.check()

    @property
    def last_output_ns(self) -> Nanos:
        """When the chip last changed what it drives; 0 for never."""
        at: int = self._calls_of_c.fabric_last_output(self.handle)
        return at

    def subscribe(
        self, drive: Iterable[int], wire: Iterable[int], stop: Iterable[int], lines: Iterable[int], *, waves: bool
    ) -> int:
        """Subscribe to pins by masks, one a port, and to lines by their numbers; return the subscription's number.

        With `waves` it gets waves as they are, else their edges.

        Raises:
            ValueError: There are too many subscriptions.
        """
        words = [0] * LINE_WORDS
        for line in lines:
            words[line // 64] |= 1 << line % 64
        number: int = self._calls_of_c.fabric_subscribe(
            self.handle, _masks(drive), _masks(wire), _masks(stop), (_U64 * LINE_WORDS)(*words), waves
        )
        if number < 0:
            raise ValueError("too many subscriptions to pins")
        return number

    def stop_at(self, subscription: int, stop: Iterable[int]) -> None:
        """Choose which pins of a subscription end the slice."""
        self._calls_of_c.fabric_stop_at(self.handle, subscription, _masks(stop))

    def unsubscribe(self, subscription: int) -> None:
        """End a subscription."""
        self._calls_of_c.fabric_unsubscribe(self.handle, subscription)

    def take_rows(self, subscription: int) -> bytes:
        """Take the rows of a subscription."""
        count = self._calls_of_c.fabric_row_count(self.handle, subscription)
        if not count:
            return b""
        at = self._calls_of_c.fabric_take_rows(self.handle, subscription)
        return ctypes.string_at(at, count * EDGE.size)

    def take_stop(self) -> bool:
        """Return whether a subscriber wants the slice to end, and forget it."""
        wanted: bool = self._calls_of_c.fabric_take_stop(self.handle)
        return wanted

    def is_watched(self, pin: int) -> bool:
        """Return whether somebody is subscribed to a pin, by its number."""
        is_watched: bool = self._calls_of_c.fabric_is_watched(self.handle, pin)
        return is_watched

    @property
    def has_news(self) -> bool:
        """Whether rows or words wait for Python."""
        has: bool = self._calls_of_c.fabric_has_news(self.handle)
        return has

    # Callbacks.

    def _new_slot(self, name: str) -> int:
        slot: int = self._calls_of_c.fabric_add_slot(self.handle)
        if slot < 0:
            raise ValueError("the queue of events has no slot left")
        self._names[slot] = name
        return slot

    def _event(self, slot: int, at_ns: Nanos) -> None:
        self._acts[slot](at_ns)
        if self._due(self.handle, slot) <= at_ns:
            raise RuntimeError(f"{self._names[slot]} is still due at {at_ns} ns after acting then")

    def _electrical(self, pin: int, what: int) -> None:
        self.electrical(pin, what)

    def _lose_memory(self) -> None:
        raise MemoryError("no memory for what the chip shows")

    def _ask(self, slot: int, what: int, value: int) -> int:
        return self._answers[slot](what, value) or 0

    def _guarded(self, call: Callable[..., _Result], default: _Result) -> Callable[..., _Result]:
        """Return a callback for C: what it raises is kept, and the slice ends."""
        return guarded(call, default, self._fail)

    def _fail(self, error: BaseException) -> None:
        self._failure = error
        self._calls_of_c.fabric_end_slice(self.handle)

    def _use_python_host(self) -> None:
        chip = self._chip
        calls = (
            _CYCLE(self._guarded(lambda _user: chip.access_cycle, 0)),
            _SET_IRQ(self._guarded(lambda _user, irq, level: chip.irq_changed(irq, bool(level)), 0)),
            _PLAIN(self._guarded(lambda _user: chip.end_slice(), None)),
            _DUE(self._guarded(lambda _user, cycle: chip.event_due(cycle), None)),
            _PC(self._guarded(lambda _user: chip.access_pc, 0)),
            _PLAIN(self._guarded(lambda _user: chip.signal("event"), None)),
        )
        at = [ctypes.cast(call, ctypes.c_void_p) for call in calls]
        self.use_host(HostCalls(None, at[0], None, *at[1:], None, None, None, None), *calls)


def _masks(values: Iterable[int]) -> "ctypes.Array[ctypes.c_uint32]":
    return (_U32 * PORTS)(*values)
