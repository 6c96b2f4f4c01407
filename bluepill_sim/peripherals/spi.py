"""SPI1 and SPI2: master and slave, one word of 8 or 16 bits at a time.

What it does is `extension/source/devices/spi.c`, with the theory of operation; here are its registers, its pins, and
the parts that hang on it. A part is selected by a pin of the chip, low, or always; a word goes to all that
were selected since it began, and a bit that several send is low where one of them sends it low. A master outside clocks
words into the chip (`clock_in`), which is the slave then.

Source: RM0008 25.3 to 25.5.
Invariant: `native.selected` is the number of parts that are selected.
"""

from collections.abc import Callable, Sequence
from enum import IntEnum
from typing import NamedTuple, cast

from bluepill_sim.extension.layout import AHEAD_BYTES, SPI
from bluepill_sim.fabric.bus_parts import AheadDevice, SpiDevice, subscribe_words
from bluepill_sim.fabric.fabric import OWN_COMMANDS, WORD
from bluepill_sim.fabric.pins import ALTERNATE_FUNCTIONS, PinDrive
from bluepill_sim.fabric.ports import ChipPorts
from bluepill_sim.fabric.registers import NATIVE, Peripheral, PeripheralMapping, Register, bits, indices, masks
from simbase.state import Stateful
from simbase.timing import NS_PER_S, Nanos

#: Fields, from the left.
_CR1 = (
    "BIDIMODE 15, BIDIOE 14, CRCEN 13, CRCNEXT 12, DFF 11, RXONLY 10, "
    "SSM 9, SSI 8, LSBFIRST 7, SPE 6, BR 5:3, MSTR 2, CPOL 1, CPHA 0"
)
CPHA, CPOL, MSTR, SPE, LSBFIRST, DFF = masks(_CR1, "CPHA CPOL MSTR SPE LSBFIRST DFF")
_BR_AT, _HELD, _WHATEVER = 3, 1 << 16, 0xFFFF_FFFF
#: Pins (MISO, MOSI, NSS, SCK), by the value of the remap bit (RM0008 table 56, DS5319 table 5).
PINS = {
    "SPI1": {0: ("PA6", "PA7", "PA4", "PA5"), 1: ("PB4", "PB5", "PA15", "PB3")},
    "SPI2": {0: ("PB14", "PB15", "PB12", "PB13")},
}


class SpiQuestion(IntEnum):
    """What Python is asked: those from NO_SCK on are warnings."""

    EXCHANGE = 0
    SELECT = 1
    NEXT_WORD = 2
    NO_SCK = 3
    NO_MOSI = 4
    NO_MISO = 5
    WORD_LOST = 6
    MODE_FAULT = 7


class SpiCommand(IntEnum):
    """A command of its own."""

    #: Move to the pins: two, and two.
    MOVE = OWN_COMMANDS
    #: Listen to the pins that select.
    LISTEN = OWN_COMMANDS + 1
    #: Take a word from a master outside.
    CLOCK_IN = OWN_COMMANDS + 2


_WARNINGS = {
    SpiQuestion.NO_SCK: ": nobody is clocked: {SCK} is no alternate-function output",
    SpiQuestion.NO_MOSI: ": what is sent does not come out: {MOSI} is no alternate-function output",
    SpiQuestion.NO_MISO: ": it reads 0: {MISO} cannot be read (analog, or the debug port has it)",
    SpiQuestion.WORD_LOST: "_DR: written while TXE is 0: a word is lost",
    SpiQuestion.MODE_FAULT: ": mode fault: a master whose NSS ({NSS}, or SSI) is low; it is switched off",
}


class SpiWord(NamedTuple):
    """A word that has been exchanged: when it ended, how many bits it has, and how long it took."""

    ended_ns: Nanos
    from_master: int
    from_slave: int
    bits: int
    span_ns: Nanos


#: Takes words, oldest first.
Sink = Callable[[Sequence[SpiWord]], None]


class Loopback(Stateful):
    """A wire from MOSI to MISO, which is always there: the chip hears itself."""

    spi_modes = frozenset(range(4))
    max_hz = 36_000_000

    def select(self, at_ns: Nanos) -> None:
        """Nothing selects a wire."""

    def deselect(self, at_ns: Nanos) -> None:
        """Nothing selects a wire."""

    def exchange(self, byte: int, at_ns: Nanos) -> int:  # noqa: ARG002 - the interface's
        """Return the byte."""
        return byte


class _Hung(Stateful):
    """A part and the pin that selects it."""

    STATE = ("device", "since_ns")

    def __init__(self, device: SpiDevice, select: str | None) -> None:
        self.device, self.select = device, select
        #: Since when it is selected; None: it is not.
        self.since_ns: Nanos | None = 0 if select is None else None


class Spi(Peripheral):
    """Serial peripheral interface."""

    KIND, HOLDS = "spi", SPI
    OUTPUTS = ("irq", "rx_dma", "tx_dma")
    ENUMS = (SpiQuestion, SpiCommand)
    STATE = ("_hung", "_coming")
    DERIVED = ("_pin_names", "_sinks")
    SOURCE = "RM0008 25.5"
    REGISTERS = (
        Register(
            name="CR1", offset=0x00, on_write=NATIVE,
            fields=_CR1,
        ),
        Register(
            name="CR2", offset=0x04, on_write=NATIVE,
            fields="TXEIE 7, RXNEIE 6, ERRIE 5, SSOE 2, TXDMAEN 1, RXDMAEN 0",
        ),
        Register(
            name="SR", offset=0x08, reset=2, readable=bits((7, 0)), writable=0, write_zero_to_clear=bits(4),
            on_read=NATIVE, on_write=NATIVE,
            fields="BSY 7, OVR 6, MODF 5, CRCERR 4, UDR 3, CHSIDE 2, TXE 1, RXNE 0",
        ),
        Register(
            name="DR", offset=0x0C, readable=0, writable=bits((15, 0)), on_read=NATIVE, on_write=NATIVE,
            fields="DR 15:0",
        ),
        Register(
            name="CRCPR", offset=0x10, reset=7, fields="CRCPOLY 15:0"
        ),
        Register(name="RXCRCR", offset=0x14, readable=bits((15, 0)), writable=0, fields="RxCRC 15:0"),
        Register(name="TXCRCR", offset=0x18, readable=bits((15, 0)), writable=0, fields="TxCRC 15:0"),
        Register(name="I2SCFGR", offset=0x1C, readable=0, writable=bits(11), on_write="_write_i2s", doc="no I2S"),
        Register(name="I2SPR", offset=0x20, mask=0, doc="no I2S"),
    )  # fmt: skip

    def __init__(self, chip: ChipPorts, place: PeripheralMapping) -> None:
        super().__init__(chip, place)
        #: Get the words that were exchanged, in bulk, when the chip has run.
        self._sinks: list[Sink] = []
        self._hung: list[_Hung] = []
        #: Words that a master outside sends still.
        self._coming: tuple[int, ...] = ()
        self._pin_names = PINS[place.name][0]
        self.native.source = ALTERNATE_FUNCTIONS.index(f"{place.name}_MISO")
        self.native.offered[:] = [2] * 4
        self.native.clock_hz = self.native.rate_hz = self.clock_hz()
        self.reset()
        chip.pins.route_listeners.append(self._route_changed)

    # From outside the chip.

    @property
    def bit_hz(self) -> int:
        """Bits a second of the chip as the master."""
        hz: int = self.native.clock_hz >> (self.words[CR1] >> _BR_AT & 7) + 1
        return hz

    def sends_at(self, pin: str) -> bool:
        """Whether something outside sends on a pin: parts do so on MISO."""
        return bool(self._hung) and pin == self._pin_names[0]

    def attach(self, device: SpiDevice, select: str | None = None) -> None:
        """Hang a part on the bus.

        Args:
            device: what it is.
            select: the pin that selects it while it is low, such as "PA4", with a pull-up; None: it always is.

        Raises:
            KeyError: The chip has no such pin.
        """
        pin = None if select is None else self.chip.pins[select]
        self._hung.append(_Hung(device, select))
        self.native.is_looped = any(isinstance(other.device, Loopback) for other in self._hung)
        if pin is not None:
            if pin.board_pull is PinDrive.NONE:
                pin.board_pull = PinDrive.PULL_UP
            self.native.selects[pin.index // 16] |= 1 << pin.number
            self.command(SpiCommand.LISTEN)
        self._follow_selects()

    def subscribe(self, sink: Sink) -> Callable[[], None]:
        """Have `sink` called with the words that are exchanged from now on, in bulk; return a function that ends it."""
        return subscribe_words(self, self._sinks, sink)

    def clock_in(self, words: Sequence[int], hz: int) -> None:
        """Clock words into the chip as a master outside does, from now on; what comes back goes to `subscribe`.

        Args:
            words: what MOSI carries; as long as the chip's are.
            hz: the master's clock.

        Raises:
            ValueError: The clock is none.
        """
        if hz <= 0:
            raise ValueError(f"{self.name}: a master's clock of {hz} Hz")
        self._coming += tuple(words)
        if self._coming and self.command(SpiCommand.CLOCK_IN, self._coming[0], hz):
            self._coming = self._coming[1:]

    # For the chip.

    def clock_name(self) -> str:
        """Return that of PCLK2 for SPI1, of PCLK1 for SPI2."""
        return "pclk2_hz" if self.name == "SPI1" else "pclk1_hz"

    def on_reset(self) -> None:
        """Drop what is on its way."""
        self._coming = ()
        self._settle()
        self._route_changed()

    def deliver(self) -> None:
        """Hand what was exchanged to the sinks."""
        sent = self.fabric.take_words(self.slot)
        if sent:
            rows = [
                SpiWord(at_ns, word & 0xFFFF, word >> 16, 16 if control & DFF else 8, ticks * NS_PER_S // hz)
                for at_ns, word, hz, ticks, control in WORD.iter_unpack(sent)
            ]
            for sink in list(self._sinks):
                sink(rows)

    def answer(self, what: int, value: int) -> int | None:
        """Exchange a word with the parts, follow their select pins, or warn."""
        if what == SpiQuestion.EXCHANGE:
            return self._exchange(value)
        if what == SpiQuestion.NEXT_WORD:
            if not self._coming:
                return 0
            word, self._coming = self._coming[0], self._coming[1:]
            return _HELD | word
        if what == SpiQuestion.SELECT:
            self._follow_selects()
        else:
            names = dict(zip(("MISO", "MOSI", "NSS", "SCK"), self._pin_names, strict=True))
            question = SpiQuestion(what)
            self.chip.warn(f"{self.name}{_WARNINGS[question].format(**names)}", once=f"{self.name}:{question.name}")
        return None

    def _exchange(self, word: int) -> int:
        self._settle()
        control, now_ns, began_ns = self.words[CR1], self.chip.now_ns, self.native.word_ns
        heard = [
            one.device for one in self._hung
            if one.since_ns is not None and one.since_ns <= began_ns and self._understands(one.device, control)
        ]  # fmt: skip
        count = 2 if control & DFF else 1
        sent = (_reversed(word, 8 * count) if control & LSBFIRST else word).to_bytes(count, "big")
        got = 0
        for byte in sent:
            answer = 0xFF
            for device in heard:
                answer &= device.exchange(byte, now_ns)
            got = got << 8 | answer
        if len(heard) == 1 == self.native.selected and not control & (DFF | LSBFIRST):
            self._look_ahead(heard[0], control)
        return _reversed(got, 8 * count) if control & LSBFIRST else got

    def _look_ahead(self, device: SpiDevice, control: int) -> None:
        """Take what the part says that it will send next, so that it need not be asked for each byte."""
        if (ahead := getattr(device, "ahead", None)) is None:
            return
        data, while_sent = ahead(AHEAD_BYTES)
        native = self.native
        native.ahead[: len(data)] = data
        native.ahead_count, native.ahead_at, native.ahead_cr1 = len(data), 0, control
        native.ahead_sent = _WHATEVER if while_sent is None else while_sent

    def _settle(self) -> None:
        """Tell the part how much of what it said ahead has gone over."""
        native = self.native
        if native.ahead_count:
            went, native.ahead_count = native.ahead_at, 0
            native.ahead_at = 0
            if went:
                heard = [one.device for one in self._hung if one.since_ns is not None]
                cast("AheadDevice", heard[0]).went(went)

    def _understands(self, device: SpiDevice, control: int) -> bool:
        """Tell whether a part bears mode and clock; each is warned of."""
        mode = (2 if control & CPOL else 0) + (control & CPHA)
        hz = self.bit_hz
        name = type(device).__name__
        if mode not in device.spi_modes:
            known = ", ".join(map(str, sorted(device.spi_modes)))
            what = f"{self.name} is in mode {mode} and the {name} understands {known}: it hears nothing"
            self.chip.warn(what, once=f"{self.name}:mode:{name}")
            return False
        if hz > device.max_hz:
            self.chip.warn(
                f"{self.name} clocks at {hz} Hz and the {name} bears {device.max_hz}", once=f"{self.name}:hz:{name}"
            )
        return True

    # Pins.

    def _follow_selects(self) -> None:
        self._settle()
        now_ns = self.chip.now_ns
        for one in self._hung:
            if one.select is None:
                continue
            is_selected = not self.chip.pins[one.select].level
            if is_selected and one.since_ns is None:
                one.since_ns = now_ns
                one.device.select(now_ns)
            elif not is_selected and one.since_ns is not None:
                one.since_ns = None
                one.device.deselect(now_ns)
        self.native.selected = sum(one.since_ns is not None for one in self._hung)

    def _route_changed(self) -> None:
        """Move to the pins that AFIO now gives."""
        self._find_pins()
        at = [self.chip.pins[name].index for name in self._pin_names]
        self.command(SpiCommand.MOVE, at[0] | at[1] << 8, at[2] | at[3] << 8)

    def _find_pins(self) -> None:
        pins = PINS[self.name]
        self._pin_names = pins.get(self.chip.pins.remaps.get(self.name, 0), pins[0])

    def _restored(self) -> None:
        self._find_pins()
        self.native.wants_words = bool(self._sinks)
        self.command(SpiCommand.LISTEN)

    def _write_i2s(self, written: int, _previous: int) -> None:
        if written:
            self.chip.warn(f"{self.name}_I2SCFGR: this part has no I2S", once=f"{self.name}:i2s")


def _reversed(word: int, count: int) -> int:
    return int(f"{word:0{count}b}"[::-1], 2)


(CR1,) = indices(Spi.REGISTERS, "CR1")
