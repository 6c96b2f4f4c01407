"""I2C1 and I2C2: master and slave, a byte at a time.

What it does is `extension/source/devices/i2c.c`, with the theory of operation; here are its registers, its pins, the
parts
that hang on it, and masters outside that call it (`call`). Each part hears each address and says whether it is meant; a
byte goes to those that are, and of what several send a bit is low where one of them sends it low.

Source: RM0008 26.3 to 26.6.
Invariant: what a part is told is in the order of the bus, each call with the time at which its last bit ended.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import NamedTuple

from bluepill_sim.extension.layout import I2C
from bluepill_sim.extension.windows import NO_TIME
from bluepill_sim.fabric.bus_parts import I2cDevice, subscribe_words
from bluepill_sim.fabric.fabric import OWN_COMMANDS
from bluepill_sim.fabric.fabric import WORD as SENT
from bluepill_sim.fabric.pins import ALTERNATE_FUNCTIONS, PinDrive
from bluepill_sim.fabric.ports import ChipPorts
from bluepill_sim.fabric.registers import NATIVE, WORD, Peripheral, PeripheralMapping, Register, bits, indices, masks
from simbase.timing import Nanos

#: Fields, from the left.
_SR1 = (
    "SMBALERT 15, TIMEOUT 14, PECERR 12, OVR 11, AF 10, ARLO 9, BERR 8, "
    "TxE 7, RxNE 6, STOPF 4, ADD10 3, BTF 2, ADDR 1, SB 0"
)
_ARLO, _BERR = masks(_SR1, "ARLO BERR")
#: What an answer, a symbol and a byte to a master outside have above the byte.
_ACK = _HELD = 1 << 8
#: What a byte that is sent to nobody in particular answers.
_RELEASED = 0xFF
#: Pins (SCL, SDA, SMBA), by the value of the remap bit (RM0008 table 55, DS5319 table 5).
PINS = {"I2C1": {0: ("PB6", "PB7", "PB5"), 1: ("PB8", "PB9", "PB5")}, "I2C2": {0: ("PB10", "PB11", "PB12")}}
#: CNDTR of the channel of DMA1 that each receives by (RM0008 table 78): its end of transfer is what LAST waits for.
_COUNTERS = {"I2C1": 0x4002_0000 + 0x0C + 20 * 6, "I2C2": 0x4002_0000 + 0x0C + 20 * 4}


class I2cQuestion(IntEnum):
    """What Python is asked; from NO_PINS on they are warnings."""

    ADDRESS = 0
    WRITE = 1
    READ = 2
    END = 3
    NEXT_STEP = 4
    NO_PINS = 5
    SEQUENCE = 6


class I2cCommand(IntEnum):
    """A command of its own."""

    #: Move to the pins.
    MOVE = OWN_COMMANDS
    #: A master outside has something to do.
    CALL = OWN_COMMANDS + 1
    #: Arbitration is lost, or the bus disturbed.
    DISTURB = OWN_COMMANDS + 2
    #: Listen again.
    LISTEN = OWN_COMMANDS + 3
    #: DBGMCU_CR's freeze of the timeout, and its end after `one` + 2^32 * `other` ns.
    HOLD_TIMEOUT = OWN_COMMANDS + 4
    GO_ON_TIMEOUT = OWN_COMMANDS + 5


class FarStep(IntEnum):
    """What a master outside does, above a byte or, for FAR_READ, its acknowledge."""

    FAR_NOTHING = 0
    FAR_START = 1
    FAR_WRITE = 2
    FAR_READ = 3
    FAR_STOP = 4


class I2cStep(IntEnum):
    """What has happened on the bus (i2c.c)."""

    START = 0
    #: A byte with its acknowledge.
    BYTE = 1
    STOP = 2
    #: The chip has lost the arbitration: the rest of the transfer is another master's.
    LOST = 3
    #: The chip was reset or switched off in the middle, or SCL was low for too long.
    CUT = 4


class I2cSymbol(NamedTuple):
    """A condition or a byte, when its last bit ended."""

    ended_ns: Nanos
    step: I2cStep
    byte: int
    is_acknowledged: bool


#: Takes symbols, oldest first.
Sink = Callable[[Sequence[I2cSymbol]], None]
_STEP_AT = 9
_FAR_START, _FAR_WRITE, _FAR_READ, _FAR_STOP = (step << _STEP_AT for step in FarStep if step)


@dataclass(frozen=True, slots=True)
class I2cCall:
    """What a master outside does with the chip, and what became of it."""

    #: 7 bits, 10 bits above 0x7F, 0 for the general call.
    address: int
    written: bytes
    #: How many bytes it reads, behind a repeated START if it has written.
    read_bytes: int
    #: How many of its addresses and bytes were acknowledged, and what it has read.
    acknowledged: int = 0
    read: bytes = b""
    #: Its clock.
    hz: int = 100_000

    def steps(self) -> Iterator[int]:
        """Return what it does, up to the STOP."""
        ten = self.address > 0x7F
        header = 0xF0 | self.address >> 7 & 6 if ten else self.address << 1
        if self.written or ten or not self.read_bytes:
            yield _FAR_START | header
            if ten:
                yield _FAR_WRITE | self.address & 0xFF
            yield from (_FAR_WRITE | byte for byte in self.written)
        if self.read_bytes:
            yield _FAR_START | header | 1
            yield from (_FAR_READ | int(n + 1 < self.read_bytes) for n in range(self.read_bytes))


class I2c(Peripheral):
    """Inter-integrated circuit interface."""

    KIND, HOLDS = "i2c", I2C
    OUTPUTS = ("event_irq", "error_irq", "rx_dma", "tx_dma")
    #: SR1 at its last read, half of the sequences that clear its flags.
    HIDDEN = ("SEEN",)
    ENUMS = (I2cQuestion, I2cCommand, FarStep)
    STATE = ("_hung", "_addressed", "_high_bits", "_ten_bit", "_calls", "_step", "_is_stopping", "answered")
    DERIVED = ("_pin_names", "_sinks")
    SOURCE = "RM0008 26.6"
    REGISTERS = (
        Register(
            name="CR1", offset=0x00, on_write=NATIVE,
            fields="SWRST 15, ALERT 13, PEC 12, POS 11, ACK 10, STOP 9, "
            "START 8, NOSTRETCH 7, ENGC 6, ENPEC 5, ENARP 4, "
            "SMBTYPE 3, SMBUS 1, PE 0",
        ),
        Register(
            name="CR2", offset=0x04, on_write=NATIVE,
            fields="LAST 12, DMAEN 11, ITBUFEN 10, ITEVTEN 9, ITERREN 8, FREQ 5:0",
        ),
        Register(
            name="OAR1", offset=0x08, fields="ADDMODE 15, one 14, ADD 9:0",
        ),
        Register(
            name="OAR2", offset=0x0C, fields="ADD2 7:1, ENDUAL 0"
        ),
        Register(
            name="DR", offset=0x10, readable=0, writable=bits((7, 0)), on_read=NATIVE, on_write=NATIVE, fields="DR 7:0"
        ),
        Register(
            name="SR1", offset=0x14, readable=bits(15, 14, (12, 6), (4, 0)), writable=0,
            write_zero_to_clear=bits(15, 14, (12, 8)), latched_in="SEEN", on_write=NATIVE,
            fields=_SR1,
        ),
        Register(
            name="SR2", offset=0x18, readable=bits((15, 4), (2, 0)), writable=0, on_read=NATIVE,
            fields="PEC 15:8, DUALF 7, SMBHOST 6, SMBDEFAULT 5, GENCALL 4, TRA 2, BUSY 1, MSL 0",
        ),
        Register(
            name="CCR", offset=0x1C, on_write="_write_ccr",
            fields="FS 15, DUTY 14, CCR 11:0",
        ),
        Register(name="TRISE", offset=0x20, reset=2, fields="TRISE 5:0"),
    )  # fmt: skip

    def __init__(self, chip: ChipPorts, place: PeripheralMapping) -> None:
        super().__init__(chip, place)
        #: Get what is on the bus, in bulk, when the chip has run.
        self._sinks: list[Sink] = []
        self._hung: list[I2cDevice] = []
        #: Which of them the last address has meant, by their places.
        self._addressed: tuple[int, ...] = ()
        #: The header of a 10-bit address, and the last whole one.
        self._high_bits: int | None = None
        self._ten_bit = 0
        #: Masters outside that wait, the first of them at a step.
        self._calls: tuple[I2cCall, ...] = ()
        self._step = 0
        self._is_stopping = False
        #: What became of those that have ended.
        self.answered: tuple[I2cCall, ...] = ()
        self._pin_names = PINS[place.name][0]
        native = self.native
        native.source = ALTERNATE_FUNCTIONS.index(f"{place.name}_SCL")
        native.smba_source = ALTERNATE_FUNCTIONS.index(f"{place.name}_SMBA")
        native.offered[:] = [2] * 3
        native.counter = _COUNTERS[place.name]
        native.clock_hz = native.rate_hz = native.far_hz = self.clock_hz()
        native.due_ns = native.timeout_ns = native.show_ns = NO_TIME
        self.reset()
        chip.pins.route_listeners.append(self._route_changed)

    # From outside the chip.

    def attach(self, device: I2cDevice) -> None:
        """Hang a part on the bus, with the pull-ups that a bus has."""
        self._hung.append(device)
        self.native.has_parts = True
        self._pull_up()

    def subscribe(self, sink: Sink) -> Callable[[], None]:
        """Have `sink` called with what is on the bus from now on, in bulk; return a function that ends it."""
        return subscribe_words(self, self._sinks, sink)

    def call(self, address: int, written: bytes = b"", read_bytes: int = 0, *, hz: int = 100_000) -> None:
        """Call the chip as a master outside, once the bus is free; what becomes of it is added to `answered`.

        Args:
            address: 7 bits, 10 bits above 0x7F, 0 for the general call.
            written: what it writes first.
            read_bytes: how many bytes it reads then.
            hz: its clock.

        Raises:
            ValueError: The address has more than 10 bits, or the clock is none.
        """
        if not 0 <= address < 1 << 10 or hz <= 0:
            raise ValueError(f"{self.name}: a call of {address:#x} at {hz} Hz: 0 to 0x3FF, and more than 0 Hz")
        self._calls += (I2cCall(address, written, read_bytes, hz=hz),)
        if len(self._calls) == 1:
            self.native.far_hz = hz
            self.command(I2cCommand.CALL)

    def lose_arbitration(self) -> None:
        """Have another master win the bus during the next address or byte that the chip sends."""
        self.command(I2cCommand.DISTURB, _ARLO)

    def disturb(self) -> None:
        """Put a START or a STOP where none may be: BERR."""
        self.command(I2cCommand.DISTURB, _BERR)

    # For the chip.

    def clock_name(self) -> str:
        """Return that of PCLK1."""
        return "pclk1_hz"

    def freeze(self) -> None:
        """Have the SMBus timeout alone stand still (RM0008 31.16.3, DBG_I2Cx_SMBUS_TIMEOUT)."""
        self.command(I2cCommand.HOLD_TIMEOUT)

    def thaw(self, frozen_ns: int) -> None:
        """Have it go on."""
        self.command(I2cCommand.GO_ON_TIMEOUT, frozen_ns & WORD, frozen_ns >> 32)

    def on_reset(self) -> None:
        """Forget who was addressed."""
        self._addressed = ()
        self._high_bits = None
        self._route_changed()

    def deliver(self) -> None:
        """Hand what was on the bus to the sinks."""
        if rows_sent := self.fabric.take_words(self.slot):
            rows = [
                I2cSymbol(at_ns, I2cStep(word >> _STEP_AT), word & 0xFF, bool(word & _ACK))
                for at_ns, word, *_ in SENT.iter_unpack(rows_sent)
            ]
            for sink in list(self._sinks):
                sink(rows)

    def answer(self, what: int, value: int) -> int | None:
        """Tell the parts what is on the bus, or the master outside what became of its step; or warn."""
        now_ns = self.chip.now_ns
        if what == I2cQuestion.ADDRESS:
            return _ACK if self._address(value, now_ns) else 0
        if what == I2cQuestion.WRITE:
            acknowledges = [self._hung[n].write(value, now_ns) for n in self._addressed]
            return _ACK if any(acknowledges) else 0
        if what == I2cQuestion.READ:
            byte = _RELEASED
            for n in self._addressed:
                byte &= self._hung[n].read(now_ns)
            return byte
        if what == I2cQuestion.END:
            self._addressed, self._high_bits = (), None
            for device in self._hung:
                device.stop(now_ns)
        elif what == I2cQuestion.NEXT_STEP:
            return self._next_step(value)
        elif what == I2cQuestion.NO_PINS:
            names = " or ".join(self._pin_names[:2])
            self.chip.warn(
                f"{self.name}: nobody hears it: {names} is no alternate-function output", once=f"{self.name}:pins"
            )
        else:
            self.chip.warn(
                f"{self.name}_DR: an address written before SR1 was read with SB or ADD10: ignored",
                once=f"{self.name}:sb",
            )
        return None

    def _address(self, byte: int, now_ns: int) -> bool:
        """Take an address; return whether somebody acknowledges it."""
        is_read = bool(byte & 1)
        if self._high_bits is not None:  # the second byte of a 10-bit one
            self._ten_bit, self._high_bits = self._high_bits << 8 | byte, None
            address, is_read = self._ten_bit, False
        elif byte & 0xF8 == 0xF0:
            if not is_read:
                self._high_bits = byte >> 1 & 3
                return bool(self._hung)
            address = self._ten_bit
        else:
            address = byte >> 1
        meant = [n for n, device in enumerate(self._hung) if device.start(address, is_read, now_ns)]
        self._addressed = tuple(meant)
        return bool(meant)

    def _next_step(self, answer: int) -> int:
        """Return what the first master outside does next; `answer` is what the chip made of its last step."""
        if not self._calls:
            return 0
        call = self._calls[0]
        steps = tuple(call.steps())
        if self._is_stopping:
            self.answered += (call,)
            self._calls, self._step, self._is_stopping = self._calls[1:], 0, False
            if self._calls:
                self.native.far_hz = self._calls[0].hz
            return self._next_step(0)
        if self._step:
            call = self._noted(call, steps[self._step - 1], answer)
            self._calls = (call, *self._calls[1:])
        if self._step == len(steps):
            self._is_stopping = True
            return _FAR_STOP
        self._step += 1
        return steps[self._step - 1]

    def _noted(self, call: I2cCall, step: int, answer: int) -> I2cCall:
        """Return a call with what became of a step; one that is refused is the last."""
        if step & ~0x1FF == _FAR_READ:
            return replace(call, read=call.read + bytes([answer & 0xFF]))
        if not answer & _HELD:
            self._step = len(tuple(call.steps()))
            return call
        return replace(call, acknowledged=call.acknowledged + 1)

    def _write_ccr(self, _written: int, _previous: int) -> None:
        if self.words[CR1] & 1:
            self.chip.warn(f"{self.name}_CCR: written while PE is set", once=f"{self.name}:ccr")

    # Pins.

    def _pull_up(self) -> None:
        for name in self._pin_names[:2]:
            self.chip.pins[name].board_pull = PinDrive.PULL_UP

    def _route_changed(self) -> None:
        """Move to the pins that AFIO now gives; the parts go with them."""
        self._find_pins()
        scl, sda, smba = (self.chip.pins[name].index for name in self._pin_names)
        self.command(I2cCommand.MOVE, scl | sda << 8 | smba << 16)
        if self._hung:
            self._pull_up()

    def _find_pins(self) -> None:
        pins = PINS[self.name]
        self._pin_names = pins.get(self.chip.pins.remaps.get(self.name, 0), pins[0])

    def _restored(self) -> None:
        self._find_pins()
        self.native.wants_words = bool(self._sinks)
        self.command(I2cCommand.LISTEN)


CR1, CCR = indices(I2c.REGISTERS, "CR1 CCR")
