"""USART1 to USART3: characters at the speed of the line.

Theory of operation. DR hides two registers each way. A write fills TDR
(TXE falls); as soon as the shift register is free it takes TDR over (TXE
rises) and sends start, data, stop; at the end of the stop bit the character has
gone out, and the next one follows without a gap, or TC rises. All of that is
`extension/source/devices/usart.c`; here is what is warned of, and what the far end makes of
a character. Those that have gone out are kept in C and handed to `sinks` in bulk.
Switching TE on sends one idle character first. A received character is in DR
when its stop bit has ended; one that finds RXNE still set is lost and raises
ORE; a line that then stays idle for one character raises IDLE.

Modelled: 8 and 9 bits, parity, 0.5 to 2 stop bits, breaks, mute mode, LIN
breaks, half-duplex, RTS and CTS, synchronous mode, all flags, their interrupts
and DMA requests. The far end sends and listens at our
own baud rate, without errors, unless it has one of its own (`far_baud`): then
characters too far off arrive damaged, both ways, and what comes in raises the
FE, NE and PE that the samples of the line give (`fabric/line_speed.py`), at the
times of our own frames, and so do characters that are sent damaged on purpose.
Single bits show on the TX pin while somebody is subscribed or listens to it; else
it stays high, and they cost nothing; so does the clock on CK. Not modelled, and warned of: IrDA and
smartcard modes.

Source: RM0008 section 27.
Invariant: a character ends floor(frame half-bits * BRR * 10**9 / (2 * PCLK)) ns
after the point from which its run of characters is counted, never later than `due_ns` says.
"""

import contextlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from enum import IntEnum, IntFlag

from bluepill_sim.extension.layout import USART
from bluepill_sim.fabric.characters import Characters
from bluepill_sim.fabric.fabric import OWN_COMMANDS, WORD
from bluepill_sim.fabric.line_speed import TOLERANCE_PERCENT, Heard, heard, is_usual, nearest_usual
from bluepill_sim.fabric.pins import ALTERNATE_FUNCTIONS, Pin
from bluepill_sim.fabric.ports import ChipPorts
from bluepill_sim.fabric.registers import NATIVE, Peripheral, PeripheralMapping, Register, bits, indices, masks

#: Fields, from the left.
_SR = "CTS 9, LBD 8, TXE 7, TC 6, RXNE 5, IDLE 4, ORE 3, NE 2, FE 1, PE 0"
_CR1 = "UE 13, M 12, WAKE 11, PCE 10, PS 9, PEIE 8, TXEIE 7, TCIE 6, RXNEIE 5, IDLEIE 4, TE 3, RE 2, RWU 1, SBK 0"
_CR2 = "LINEN 14, STOP 13:12, CLKEN 11, CPOL 10, CPHA 9, LBCL 8, LBDIE 6, LBDL 5, ADD 3:0"
_CR3 = "CTSIE 10, CTSE 9, RTSE 8, DMAT 7, DMAR 6, SCEN 5, NACK 4, HDSEL 3, IRLP 2, IREN 1, EIE 0"
PE, FE, NE, RXNE, TC, TXE, LBD, _CTS = masks(_SR, "PE FE NE RXNE TC TXE LBD CTS")
_WORD_BITS = bits((8, 0))
#: Where a character that arrives has the flags of SR that a character brings.
_FLAGS_AT = 16
RE, TE, PS, PCE, M, UE = masks(_CR1, "RE TE PS PCE M UE")
#: Of CR2: a LIN break is recognised by 11 bits, not 10.
(_LBDL,) = masks(_CR2, "LBDL")
_IREN, _SCEN = masks(_CR3, "IREN SCEN")
#: What each bit of CR3 would ask for that is not modelled.
_UNMODELLED = ((_IREN, "IrDA mode"), (_SCEN, "smartcard mode"))
#: Stop bits in halves, by CR2 STOP.
_STOP_HALF_BITS = (2, 1, 4, 3)
#: Pins (TX, RX) by the value of the remap field (RM0008 tables 52 to 54).
PINS = {
    "USART1": {0: ("PA9", "PA10"), 1: ("PB6", "PB7")},
    "USART2": {0: ("PA2", "PA3"), 1: ("PD5", "PD6")},
    "USART3": {0: ("PB10", "PB11"), 1: ("PC10", "PC11"), 3: ("PD8", "PD9")},
}
#: Pins (CTS, RTS) by the same; a field that is missing leaves them where they are.
_CONTROL_PINS = {
    "USART1": {0: ("PA11", "PA12")},
    "USART2": {0: ("PA0", "PA1"), 1: ("PD3", "PD4")},
    "USART3": {0: ("PB13", "PB14"), 3: ("PD11", "PD12")},
}
#: Pins of CK by the same.
_CLOCK_PINS = {"USART1": {0: "PA8"}, "USART2": {0: "PA4", 1: "PD7"}, "USART3": {0: "PB12", 1: "PC12", 3: "PD10"}}
#: The character by which two speeds are compared: where one end, or the other, hears it wrong, so it does any other.
_TRIED = 0x55


class ReceiveError(IntFlag):
    """What a character that comes in raises beside RXNE."""

    PARITY = PE
    FRAMING = FE
    NOISE = NE


NOT_DAMAGED = ReceiveError(0)


class UsartQuestion(IntEnum):
    """What Python is asked: all but the last four are warnings."""

    TX_PIN = 0
    TX_OFF = 1
    NO_RATE = 2
    CHARACTER_LOST = 3
    RX_OFF = 4
    CUT_OFF = 5
    CHECK_MODES = 6
    JUDGE_SPEED = 7
    GIVE_MORE = 8
    #: What comes in by the clock of a character that goes out.
    EXCHANGE = 9


class UsartCommand(IntEnum):
    """A command of its own."""

    #: Move to the pins (TX, RX).
    MOVE = OWN_COMMANDS
    #: Hear a word, or learn that no more can be held.
    HEAR = OWN_COMMANDS + 1
    #: Tell whether words can be heard.
    CAN_HEAR = OWN_COMMANDS + 2
    #: Listen to nCTS.
    LISTEN = OWN_COMMANDS + 3
    #: Move (nCTS, nRTS).
    CONTROL = OWN_COMMANDS + 4
    MOVE_CK = OWN_COMMANDS + 5


#: What is warned of, after the name, and its key.
_WARNINGS = {
    UsartQuestion.TX_OFF: ("_DR: written while the transmitter is off", "tx-off"),
    UsartQuestion.NO_RATE: ("_DR: written while BRR is 0: no baud rate", "brr"),
    UsartQuestion.CHARACTER_LOST: ("_DR: written while TXE is 0: a character is lost", "txe"),
    UsartQuestion.RX_OFF: (": characters lost, the receiver is not set up", "rx-off"),
    UsartQuestion.CUT_OFF: ("_CR1: TE cleared during a character, which is lost", "te"),
}
#: Takes characters that have gone out.
Sink = Callable[[Characters], None]
#: What `take_words` returns, in words of 32 bits: of each row its own (behind 64 bits of time), and how it was sent.
_ROW_WORDS = WORD.size // 4
_WORD, _HOW = 2, slice(3, 6)


class Usart(Peripheral):
    """Universal asynchronous receiver transmitter."""

    KIND, HOLDS = "usart", USART
    OUTPUTS = ("irq", "tx_dma", "rx_dma")
    ENUMS = (UsartQuestion, UsartCommand)
    HIDDEN = ("SEEN", "TDR", "SHIFT", "RDR")
    STATE = ("_coming", "sent_at")
    DERIVED = ("_tx_pin", "_rx_pin")
    SOURCE = "RM0008 27.6"
    REGISTERS = (
        Register(
            name="SR",
            offset=0x00,
            reset=TXE | TC,
            readable=bits((9, 0)),
            writable=0,
            write_zero_to_clear=_CTS | LBD | TC | RXNE,
            latched_in="SEEN",
            on_write=NATIVE,
            fields=_SR,
        ),
        Register(
            name="DR", offset=0x04, readable=0, writable=bits((8, 0)), on_read=NATIVE, on_write=NATIVE, fields="DR 8:0"
        ),
        Register(
            name="BRR",
            offset=0x08,
            readable=bits((15, 0)),
            writable=bits((15, 0)),
            on_write=NATIVE,
            fields="DIV_Mantissa 15:4, DIV_Fraction 3:0",
        ),
        Register(
            name="CR1",
            offset=0x0C,
            readable=bits((13, 0)),
            writable=bits((13, 0)),
            on_write=NATIVE,
            fields=_CR1,
        ),
        Register(
            name="CR2",
            offset=0x10,
            readable=bits((14, 8), (6, 5), (3, 0)),
            writable=bits((14, 8), (6, 5), (3, 0)),
            on_write=NATIVE,
            fields=_CR2,
        ),
        Register(
            name="CR3",
            offset=0x14,
            readable=bits((10, 0)),
            writable=bits((10, 0)),
            on_write=NATIVE,
            fields=_CR3,
        ),
        Register(name="GTPR", offset=0x18, readable=bits((15, 0)), writable=bits((15, 0)), fields="GT 15:8, PSC 7:0"),
    )

    def __init__(self, chip: ChipPorts, place: PeripheralMapping) -> None:
        super().__init__(chip, place)
        #: Get the characters that have gone out, in bulk, when the chip has run.
        self.sinks: list[Sink] = []
        #: The far end's speed in bit/s; None follows whatever the firmware sets.
        self.far_baud: int | None = None
        #: How many characters were sent at each divider: (PCLK in Hz, BRR).
        self.sent_at: Counter[tuple[int, int]] = Counter()
        #: Characters from outside for which there is no room in C yet.
        self._coming: tuple[int, ...] = ()
        #: In synchronous mode: the other end, given each word that goes out; None: the level of RX, as each bit ends
        #: where somebody looks at CK, else as the word does.
        self.exchange: Callable[[int, int], int] | None = None
        self._pins = PINS[place.name]
        self._tx_pin, self._rx_pin = self._routed_pins()
        self.native.source = ALTERNATE_FUNCTIONS.index(f"{place.name}_TX")
        self.native.tx_pin, self.native.rx_pin = self._tx_pin.index, self._rx_pin.index
        self.native.clock_hz = self.clock_hz()
        self.on_reset()
        self.reset()
        chip.pins.route_listeners.append(self._route_changed)

    # From outside the chip.

    @property
    def bit_ns(self) -> int:
        """How long one bit takes at the present baud rate, in ns; 0 while none is set."""
        return self.words[BRR] * 1_000_000_000 // self.clock_hz()

    def receive(self, data: Iterable[int], damage: ReceiveError = NOT_DAMAGED) -> None:
        """Send characters to the RX pin, at the speed of the line, behind those still on their way.

        Args:
            data: bytes, or words of 9 bits.
            damage: what each raises beside RXNE; PARITY turns its parity bit over.
        """
        control = self.words[CR1]
        words = [_with_parity(word & _WORD_BITS, control) for word in data]
        if damage & ReceiveError.PARITY and control & PCE:
            words = [word ^ 1 << (8 if control & M else 7) for word in words]
        self._hear(tuple(word | damage << _FLAGS_AT for word in self._arriving(words)))

    def receive_break(self, low_bits: int) -> None:
        """Hold the line at 0 for so many bits: a character 0 without its stop bit, and in LIN mode a break.

        Raises:
            ValueError: it would be over before a character is.
        """
        control = self.words[CR1]
        if low_bits < _data_bits(control) + 2:
            raise ValueError(f"{low_bits} bits at 0 are no break: {_data_bits(control) + 2} at least")
        is_lin = low_bits >= (11 if self.words[CR2] & _LBDL else 10)
        self._hear(((FE | (LBD if is_lin else 0)) << _FLAGS_AT,))

    def _hear(self, arriving: tuple[int, ...]) -> None:
        if self.chip.power.is_stopped or not self.command(UsartCommand.CAN_HEAR):
            self._warn(UsartQuestion.RX_OFF)
            return
        self._coming += arriving
        self._give_more()

    # For the chip.

    def on_reset(self) -> None:
        """Drop what is on its way."""
        self._coming = ()
        self._route_changed()

    def clock_name(self) -> str:
        """Return that of PCLK2 for USART1, of PCLK1 for the others."""
        return "pclk2_hz" if self.name == "USART1" else "pclk1_hz"

    def deliver(self) -> None:
        """Hand what has gone out to the sinks."""
        sent = self.fabric.take_words(self.slot)
        if not sent:
            return
        for (clock_hz, brr, how), rows in _runs(sent):
            self.sent_at[clock_hz, brr] += len(rows)
            if self.far_baud is not None and brr:
                found = [(one, at) for word, at in rows for one in self._as_heard(word, clock_hz, brr, how)]
                rows = Characters([one for one, _ in found], [at for _, at in found], rows.bit_ns)  # noqa: PLW2901
            mask = int((1 << _data_bits(how) - bool(how & PCE)) - 1)
            if rows and max(rows.words) > mask:
                rows = Characters([word & mask for word in rows.words], rows.times, rows.bit_ns)  # noqa: PLW2901
            for sink in self.sinks if rows else ():
                sink(rows)

    def answer(self, what: int, value: int) -> int | None:
        """Warn, or give the next characters."""
        if what == UsartQuestion.EXCHANGE:
            return self._exchange(value)
        if what == UsartQuestion.GIVE_MORE:
            self._give_more()
        elif what == UsartQuestion.JUDGE_SPEED:
            self._judge_speed()
        elif what == UsartQuestion.CHECK_MODES:
            self._check_modes()
        else:
            self._warn(UsartQuestion(what))
        return None

    def _exchange(self, word: int) -> int:
        """Return what comes in, in synchronous mode, while a word goes out."""
        if self.exchange is not None:
            return self.exchange(word, self.chip.now_ns)
        level = _WORD_BITS if self._rx_pin.level else 0
        return int(self.native.ck_word | level << self.native.ck_count)

    def _warn(self, question: UsartQuestion) -> None:
        if question is UsartQuestion.TX_PIN:
            pin = self._tx_pin
            text = f": nothing comes out, {pin.name} is no alternate-function output ({pin.mode.value})"
            self.chip.warn(f"{self.name}{text}", once=f"{self.name}:tx-pin")
            return
        text, key = _WARNINGS[question]
        if question is UsartQuestion.RX_OFF and self.words[CR1] & (UE | RE) == UE | RE and self.words[BRR]:
            pin = self._rx_pin
            why = "asleep" if self.chip.power.is_stopped else f"deaf: {pin.name} is {pin.mode.value}"
            text, key = f": characters lost, the receiver is {why}", "rx-pin"
        self.chip.warn(f"{self.name}{text}", once=f"{self.name}:{key}")

    def _check_modes(self) -> None:
        for mask, what in _UNMODELLED:
            if self.words[CR3] & mask:
                self.chip.warn(f"{self.name}: {what} is not modelled", once=f"{self.name}:{what}")

    def _give_more(self) -> None:
        """Let C have as many of the characters that come as it has room for."""
        given = 0
        for word in self._coming:
            if not self.command(UsartCommand.HEAR, word):
                break
            given += 1
        self._coming = self._coming[given:]
        self.native.rx_more = bool(self._coming)

    def _as_heard(self, word: int, clock_hz: int, brr: int, how: int) -> list[int]:
        """Return what a far end of another speed makes of a character that went out."""
        ratio = clock_hz, (self.far_baud or 0) * brr
        control = how & 0xFFFF
        found = heard([_with_parity(word, control)], _data_bits(control), *ratio, _STOP_HALF_BITS[how >> 16])
        return [one.word for one in found]

    def _judge_speed(self) -> None:
        """Warn of a speed that the far end does not have, or, where none is set, that hardly any has."""
        brr = self.words[BRR]
        baud = round(self.native.clock_hz / brr) if brr else 0
        far = self.far_baud
        if far is not None:
            if brr and any(
                [(one.word, one.has_framing_error) for one in heard([_TRIED] * 2, 8, *ratio)] != [(_TRIED, False)] * 2
                for ratio in ((self.native.clock_hz, far * brr), (far * brr, self.native.clock_hz))
            ):
                self.chip.warn(
                    f"{self.name} is at {baud} bit/s and the far end at {far}: characters arrive damaged",
                    once=f"{self.name}:far:{baud}",
                    pc=self.native.rate_pc,
                )
        elif baud and not is_usual(baud):
            self.chip.warn(
                f"{self.name} is at {baud} bit/s, more than {TOLERANCE_PERCENT} % from every usual speed "
                f"(nearest: {nearest_usual(baud)}): PCLK is {self.native.clock_hz} Hz and BRR {brr}",
                once=f"{self.name}:baud:{baud}",
                pc=self.native.rate_pc,
            )

    def _arriving(self, words: list[int]) -> tuple[int, ...]:
        """Return what the receiver makes of characters that the far end sends, for C."""
        if self.far_baud is None:
            return tuple(words)
        self._judge_speed()
        ratio = self.far_baud * self.words[BRR], self.native.clock_hz
        stop_half_bits = _STOP_HALF_BITS[self.words[CR2] >> 12 & 3]
        found = heard(words, _data_bits(self.words[CR1]), *ratio, stop_half_bits)
        return tuple(one.word | self._flags(one) << _FLAGS_AT for one in found)

    def _flags(self, one: Heard) -> int:
        """Return the flags of SR that rise with a character."""
        is_wrong = one.word != _with_parity(one.word, self.words[CR1])
        return (FE if one.has_framing_error else 0) | (NE if one.has_noise else 0) | (PE if is_wrong else 0)

    # Pins.

    def _route_changed(self) -> None:
        """Move to the pins that AFIO now gives."""
        self._tx_pin, self._rx_pin = self._routed_pins()
        remap = self.chip.pins.remaps.get(self.name, 0)
        cts, rts = _CONTROL_PINS[self.name].get(remap, _CONTROL_PINS[self.name][0])
        self.command(UsartCommand.CONTROL, self.chip.pins[cts].index, self.chip.pins[rts].index)
        clocks = _CLOCK_PINS[self.name]
        self.command(UsartCommand.MOVE_CK, self.chip.pins[clocks.get(remap, clocks[0])].index)
        self.command(UsartCommand.MOVE, self._tx_pin.index, self._rx_pin.index)

    def _restored(self) -> None:
        self._tx_pin, self._rx_pin = self._routed_pins()
        self.command(UsartCommand.LISTEN)

    def _routed_pins(self) -> tuple[Pin, Pin]:
        tx, rx = self._pins.get(self.chip.pins.remaps.get(self.name, 0), self._pins[0])
        return self.chip.pins[tx], self.chip.pins[rx]


def _runs(sent: bytes) -> Iterator[tuple[tuple[int, int, int], Characters]]:
    """Yield the characters of rows of `WORD`, as many in one go as were sent alike: PCLK, BRR and format, and they."""
    cells = memoryview(sent).cast("I")
    times = cells.cast("B").cast("Q")[:: _ROW_WORDS // 2]
    count = len(times)
    words: Sequence[int] = cells[_WORD::_ROW_WORDS].tolist()
    with contextlib.suppress(ValueError):  # nine bits
        words = bytes(words)
    how = [cells[place::_ROW_WORDS] for place in range(_HOW.start, _HOW.stop)]
    first = 0
    while first < count:
        alike = how[0][first], how[1][first], how[2][first]
        last = count
        if any(column.tobytes() != count * column[first : first + 1].tobytes() for column in how):
            rows = zip(*(column[first:] for column in how), strict=True)
            last = next((first + n for n, row in enumerate(rows) if row != alike), last)
        yield alike, Characters(words[first:last], times[first:last], alike[1] * 1_000_000_000 // alike[0])
        first = last


def _data_bits(control: int) -> int:
    """Return how many bits stand between start and stop, a parity among them, by CR1."""
    return 9 if control & M else 8


def _with_parity(word: int, control: int) -> int:
    """Return what DR reads: with PCE the top bit is the parity that the far end has put there."""
    if not control & PCE:
        return word
    top = 8 if control & M else 7
    word &= (1 << top) - 1
    is_odd = word.bit_count() & 1
    return word | (is_odd ^ bool(control & PS)) << top


BRR, CR1, CR2, CR3 = indices(Usart.REGISTERS, "BRR CR1 CR2 CR3")
