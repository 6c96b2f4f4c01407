"""USART1 to USART3, asynchronous: characters at the speed of the line.

Theory of operation. DR hides two registers each way. A write fills TDR
(TXE falls); as soon as the shift register is free it takes TDR over (TXE
rises) and sends start, data, stop; at the end of the stop bit the character is
notified to `on_transmit`, and the next one follows without a gap, or TC rises.
Switching TE on sends one idle character first. A received character is in DR
when its stop bit has ended; one that finds RXNE still set is lost and raises
ORE; a line that then stays idle for one character raises IDLE.

Modelled: 8 and 9 bits, parity, 0.5 to 2 stop bits, breaks (sent as silence),
all of these flags and their interrupts. The far end sends and listens at our
own baud rate, without errors, unless it has one of its own (`far_baud`): then
characters too far off arrive damaged, both ways, and what comes in raises the
FE, NE and PE that the samples of the line give (`fabric/line_speed.py`), at the
times of our own frames. Not modelled, and warned of: synchronous, LIN, IrDA,
smartcard and half-duplex modes, hardware flow control, mute mode, DMA
requests. The levels of single bits do not show on the TX pin: it stays high.

Source: RM0008 section 27.
Invariant: a character ends floor(frame half-bits * BRR * 10**9 / (2 * PCLK)) ns
after the point from which its run of characters is counted, never later than `due_ns` says.
"""

from collections import Counter
from collections.abc import Callable

from bluepill_sim.fabric.line_speed import TOLERANCE_PERCENT, Heard, heard, is_usual, nearest_usual
from bluepill_sim.fabric.pins import Pin
from bluepill_sim.fabric.ports import ChipPorts
from bluepill_sim.fabric.registers import Peripheral, Place, Register, bits

SR, DR, BRR, CR1, CR2, CR3, GTPR = range(7)
#: Hidden words, which the native core knows too: SR at its last read (half of the sequence that clears a
#: flag), what stands behind the shift register, what is in it (0: nothing), and what DR reads.
_SEEN, _TDR, _SHIFT, _RDR = range(7, 11)
#: Marks a data word in `_TDR` and `_SHIFT`; what the shift register holds besides.
_HELD, _PREAMBLE, _BREAK = 1 << 16, 1 << 17, 1 << 18

PE, FE, NE, ORE, IDLE, RXNE, TC, TXE = (1 << n for n in range(8))
_READ_SEQUENCE_FLAGS = bits((4, 0))
_WORD_BITS = bits((8, 0))
#: Where `_rx_queue` has the flags of SR that a character brings.
_FLAGS_AT = 16
_CTS_LBD = bits(9, 8)
SBK, RWU, RE, TE, IDLEIE, RXNEIE, TCIE, TXEIE, PEIE, PS, PCE, _WAKE, M, UE = (1 << n for n in range(14))
#: What each bit of the control registers would ask for that is not modelled.
_UNMODELLED = (
    (CR1, RWU, "mute mode"),
    (CR2, 1 << 11, "synchronous mode"),
    (CR2, 1 << 14, "LIN mode"),
    (CR3, 1 << 1, "IrDA mode"),
    (CR3, 1 << 3, "half-duplex mode"),
    (CR3, 1 << 5, "smartcard mode"),
    (CR3, 1 << 6, "DMA reception"),
    (CR3, 1 << 7, "DMA transmission"),
    (CR3, bits(8, 9), "hardware flow control"),
)
#: Stop bits in halves, by CR2 STOP.
_STOP_HALF_BITS = (2, 1, 4, 3)
#: Pins (TX, RX) by the value of the remap field (RM0008 tables 52 to 54).
PINS = {
    "USART1": {0: ("PA9", "PA10"), 1: ("PB6", "PB7")},
    "USART2": {0: ("PA2", "PA3"), 1: ("PD5", "PD6")},
    "USART3": {0: ("PB10", "PB11"), 1: ("PC10", "PC11"), 3: ("PD8", "PD9")},
}


class Usart(Peripheral):
    """Universal asynchronous receiver transmitter."""

    STATE = (
        "_tx_base_ns",
        "_tx_half_bits",
        "_tx_due_ns",
        "_rx_queue",
        "_rx_base_ns",
        "_rx_half_bits",
        "_rx_due_ns",
        "_idle_due_ns",
        "_clock_hz",
        "_is_enabled_before",
        "_rate_pc",
        "sent_at",
    )
    DERIVED = ("_tx_pin", "_rx_pin")
    REGISTERS = (
        Register(
            name="SR",
            offset=0x00,
            reset=TXE | TC,
            readable=bits((9, 0)),
            writable=0,
            write_zero_to_clear=_CTS_LBD | TC | RXNE,
            latched_in=0x1C,
            on_write="_write_sr",
        ),
        Register(name="DR", offset=0x04, readable=0, writable=bits((8, 0)), on_read="_read_dr", on_write="_write_dr"),
        Register(name="BRR", offset=0x08, readable=bits((15, 0)), writable=bits((15, 0)), on_write="_write_brr"),
        Register(name="CR1", offset=0x0C, readable=bits((13, 0)), writable=bits((13, 0)), on_write="_write_control"),
        Register(
            name="CR2",
            offset=0x10,
            readable=bits((14, 8), (6, 5), (3, 0)),
            writable=bits((14, 8), (6, 5), (3, 0)),
            on_write="_write_control",
        ),
        Register(name="CR3", offset=0x14, readable=bits((10, 0)), writable=bits((10, 0)), on_write="_write_control"),
        Register(name="GTPR", offset=0x18, readable=bits((15, 0)), writable=bits((15, 0))),
    )

    #: Start of the run of characters, and half-bits from there to the end of the present one.
    _tx_base_ns: int
    _tx_half_bits: int
    _tx_due_ns: int | None
    #: The characters from outside that have not fully arrived: what DR will read, and above it the flags of SR.
    _rx_queue: tuple[int, ...]
    _rx_base_ns: int
    _rx_half_bits: int
    _rx_due_ns: int | None
    _idle_due_ns: int | None
    #: The PCLK that the deadlines were worked out with.
    _clock_hz: int
    #: Whether transmission was on at the last write of a control register.
    _is_enabled_before: bool
    #: The instruction that has set the speed.
    _rate_pc: int

    def __init__(self, chip: ChipPorts, place: Place) -> None:
        super().__init__(chip, place)
        #: Called with (word, time in ns) at the end of each stop bit that goes out.
        self.on_transmit: Callable[[int, int], None] | None = None
        #: Whether a listener needs each of these calls at its own time; else they may come later, together.
        self.is_subscribed: Callable[[], bool] = lambda: self.on_transmit is not None
        #: The far end's speed in bit/s; None follows whatever the firmware sets.
        self.far_baud: int | None = None
        #: How many characters were sent at each divider: (PCLK in Hz, BRR).
        self.sent_at: Counter[tuple[int, int]] = Counter()
        self._source = f"{place.name}_TX"
        self._pins = PINS[place.name]
        self._tx_pin, self._rx_pin = self._routed_pins()
        self._clear()
        chip.pins.route_listeners.append(self._route_changed)

    # From outside the chip.

    @property
    def bit_ns(self) -> int:
        """How long one bit takes at the present baud rate, in ns; 0 while none is set."""
        return self._span_ns(2)

    def receive(self, data: bytes) -> None:
        """Send characters to the RX pin, at the speed of the line, behind those still on their way."""
        if not self._can_receive():
            self.chip.warn(f"{self.name}: characters lost, the receiver is not set up", once=f"{self.name}:rx-off")
            return
        if not self._rx_queue:
            self._rx_base_ns = self.chip.now_ns
            self._rx_half_bits = self._frame_half_bits()
        self._rx_queue += self._arriving([self._with_parity(byte) for byte in data])
        if not self._rx_queue:
            return
        self._idle_due_ns = None
        self._schedule()

    # For the native core, which ends the characters of a transmission by itself.

    def can_stream(self) -> bool:
        """Whether all that goes on here is characters going out, with no listener that needs each at its time."""
        words = self.words
        return (
            self._tx_due_ns is not None
            and self._tx_half_bits > 0
            and self._rx_due_ns is None
            and self._idle_due_ns is None
            and words[_SHIFT] != _BREAK
            and words[CR1] & (UE | TE | SBK) == UE | TE
            and not self.is_subscribed()
            and (self._clock_hz, words[BRR]) in self.sent_at  # the first one is judged at its own time
            and self._tx_pin.carries(self._source)
        )

    def give_stream(self) -> tuple[int, int, int, int]:
        """Hand the transmission over; `due_ns` is None until it comes back.

        Returns:
            Start of the run of characters in ns, half-bits from there to the
            end of the present one, half-bits of a frame, clock in Hz.
        """
        self.due_ns = None
        return self._tx_base_ns, self._tx_half_bits, self._frame_half_bits(), self._clock_hz

    def take_stream_back(self, half_bits: int) -> None:
        """Go on with a transmission `half_bits` after its start."""
        self._tx_half_bits = half_bits
        self._schedule()

    def report_sent(self, words: list[tuple[int, int]]) -> None:
        """Notify characters (word, ns) that have gone out meanwhile."""
        for word, at_ns in words:
            self._emit(word, at_ns)

    # For the chip.

    def on_reset(self) -> None:
        """Drop what is on its way and let go of the TX pin."""
        self._tx_pin.disconnect(self._source)
        self._clear()
        self._route_changed()
        self.chip.set_irq(self.place.irqs[0], False)

    def advance_to(self, now_ns: int) -> None:
        """End the characters that are due, in order of time; transmission first."""
        while self.due_ns is not None and self.due_ns <= now_ns:
            at_ns = self.due_ns
            if self._tx_due_ns == at_ns:
                self._end_transmission(at_ns)
            elif self._rx_due_ns == at_ns:
                self._end_reception(at_ns)
            else:
                self._idle_due_ns = None
                self.words[SR] |= IDLE
            self._schedule()
            self._update_irq()

    def clock_changed(self) -> None:
        """Carry the characters on the line over to the new PCLK."""
        now_ns = self.chip.now_ns
        self.advance_to(now_ns)
        old_hz, new_hz = self._clock_hz, self._pclk_hz()
        self._clock_hz = new_hz
        if self._tx_due_ns is not None:
            self._rebase_transmission(now_ns + (self._tx_due_ns - now_ns) * old_hz // new_hz)
        if self._rx_due_ns is not None:
            self._rebase_reception(now_ns + (self._rx_due_ns - now_ns) * old_hz // new_hz)
        self._schedule()

    def _clear(self) -> None:
        self.words[_SHIFT] = self.words[_TDR] = 0
        self._tx_base_ns = self._tx_half_bits = 0
        self._tx_due_ns = self._rx_due_ns = self._idle_due_ns = None
        self.words[_RDR] = self.words[_SEEN] = 0
        self._rx_queue = ()
        self._rx_base_ns = self._rx_half_bits = 0
        self._is_enabled_before = False
        self._rate_pc = 0
        self._clock_hz = self._pclk_hz()

    def _pclk_hz(self) -> int:
        clocks = self.chip.clocks
        return clocks.pclk2_hz if self.name == "USART1" else clocks.pclk1_hz

    def _frame_half_bits(self) -> int:
        data_bits = 9 if self.words[CR1] & M else 8
        return 2 * (1 + data_bits) + self._stop_half_bits()

    def _stop_half_bits(self) -> int:
        return _STOP_HALF_BITS[self.words[CR2] >> 12 & 3]

    def _span_ns(self, half_bits: int) -> int:
        return half_bits * self.words[BRR] * 1_000_000_000 // (2 * self._clock_hz)

    def _schedule(self) -> None:
        """Work out all deadlines from what is on the line."""
        self._tx_due_ns = self._tx_base_ns + self._span_ns(self._tx_half_bits) if self.words[_SHIFT] else None
        self._rx_due_ns = self._rx_base_ns + self._span_ns(self._rx_half_bits) if self._rx_queue else None
        due_ns = self._tx_due_ns
        for other in (self._rx_due_ns, self._idle_due_ns):
            if other is not None and (due_ns is None or other < due_ns):
                due_ns = other
        if due_ns != self.due_ns:
            self.due_ns = due_ns
            self.chip.deadline_changed()

    def _rebase_transmission(self, end_ns: int) -> None:
        """Let the present item end at `end_ns`, and count the next ones from there."""
        self._tx_base_ns, self._tx_half_bits = end_ns, 0

    def _rebase_reception(self, end_ns: int) -> None:
        self._rx_base_ns, self._rx_half_bits = end_ns, 0

    # Transmission.

    def _is_transmitting(self) -> bool:
        return self.words[CR1] & (UE | TE) == UE | TE

    def _load(self, item: int, base_ns: int, before_half_bits: int = 0) -> None:
        """Put an item into the shift register, `before_half_bits` after `base_ns`."""
        self.words[_SHIFT] = item
        self._tx_base_ns = base_ns
        self._tx_half_bits = before_half_bits + self._frame_half_bits()

    def _end_transmission(self, at_ns: int) -> None:
        words = self.words
        ended, words[_SHIFT] = words[_SHIFT], 0
        if ended & _HELD:
            self._emit(ended & _WORD_BITS, at_ns)
        if ended == _BREAK:
            self.words[CR1] &= ~SBK
        if not self._is_transmitting():
            self._tx_pin.disconnect(self._source)
            self.words[SR] |= TC
        elif self.words[CR1] & SBK:
            self._load(_BREAK, self._tx_base_ns, self._tx_half_bits)
        elif words[_TDR]:
            item, words[_TDR] = words[_TDR], 0
            words[SR] |= TXE
            self._load(item, self._tx_base_ns, self._tx_half_bits)
        else:
            self.words[SR] |= TC

    def _emit(self, word: int, at_ns: int) -> None:
        if not self._tx_pin.carries(self._source):
            pin = self._tx_pin
            self.chip.warn(
                f"{self.name}: nothing comes out, {pin.name} is no alternate-function output ({pin.mode.value})",
                once=f"{self.name}:tx-pin",
            )
            return
        divider = self._clock_hz, self.words[BRR]
        if divider not in self.sent_at:
            self._judge_speed()
        self.sent_at[divider] += 1
        if self.on_transmit is None:
            return
        bits = self._data_bits()
        mask = (1 << bits - bool(self.words[CR1] & PCE)) - 1
        if self.far_baud is None or not divider[1]:
            self.on_transmit(word & mask, at_ns)
            return
        ratio = divider[0], self.far_baud * divider[1]
        for one in heard([self._with_parity(word)], bits, *ratio, self._stop_half_bits()):
            self.on_transmit(one.word & mask, at_ns)

    def _data_bits(self) -> int:
        """Return how many bits stand between start and stop, a parity among them."""
        return 9 if self.words[CR1] & M else 8

    def _judge_speed(self) -> None:
        """Warn of a speed that the far end does not have, or, where none is set, that hardly any has."""
        brr = self.words[BRR]
        baud = round(self._clock_hz / brr) if brr else 0
        far = self.far_baud
        if far is not None:
            if brr and any(
                [(one.word, one.has_framing_error) for one in heard([word] * 2, 8, *ratio)] != [(word, False)] * 2
                for word in (0, 0x55, 0x7F, 0x80, 0xFF)
                for ratio in ((self._clock_hz, far * brr), (far * brr, self._clock_hz))
            ):
                self.chip.warn(
                    f"{self.name} is at {baud} bit/s and the far end at {far}: characters arrive damaged",
                    once=f"{self.name}:far:{baud}",
                    pc=self._rate_pc,
                )
        elif baud and not is_usual(baud):
            self.chip.warn(
                f"{self.name} is at {baud} bit/s, more than {TOLERANCE_PERCENT} % from every usual speed "
                f"(nearest: {nearest_usual(baud)}): PCLK is {self._clock_hz} Hz and BRR {brr}",
                once=f"{self.name}:baud:{baud}",
                pc=self._rate_pc,
            )

    # Reception.

    def _can_receive(self) -> bool:
        is_on = self.words[CR1] & (UE | RE) == UE | RE and self.words[BRR] > 0
        return is_on and self._rx_pin.is_listening()

    def _end_reception(self, at_ns: int) -> None:
        arrived, self._rx_queue = self._rx_queue[0], self._rx_queue[1:]
        self._rx_half_bits += self._frame_half_bits()
        if not self._can_receive():
            self.chip.warn(f"{self.name}: characters lost, the receiver is not set up", once=f"{self.name}:rx-off")
            return
        if self.words[SR] & RXNE:
            self.words[SR] |= ORE
        else:
            self.words[_RDR] = arrived & _WORD_BITS
            self.words[SR] |= RXNE | arrived >> _FLAGS_AT
        if not self._rx_queue:
            self._idle_due_ns = at_ns + self._span_ns(self._frame_half_bits())

    def _arriving(self, words: list[int]) -> tuple[int, ...]:
        """Return what the receiver makes of characters that the far end sends, for `_rx_queue`."""
        if self.far_baud is None:
            return tuple(words)
        self._judge_speed()
        ratio = self.far_baud * self.words[BRR], self._clock_hz
        found = heard(words, self._data_bits(), *ratio, self._stop_half_bits())
        return tuple(one.word | self._flags(one) << _FLAGS_AT for one in found)

    def _flags(self, one: Heard) -> int:
        """Return the flags of SR that rise with a character."""
        is_wrong = one.word != self._with_parity(one.word)
        return (FE if one.has_framing_error else 0) | (NE if one.has_noise else 0) | (PE if is_wrong else 0)

    def _with_parity(self, word: int) -> int:
        """Return what DR reads: with PCE the top bit is the parity that the far end has put there."""
        control = self.words[CR1]
        if not control & PCE:
            return word
        top = 8 if control & M else 7
        word &= (1 << top) - 1
        is_odd = word.bit_count() & 1
        return word | (is_odd ^ bool(control & PS)) << top

    # Registers.

    def _write_sr(self, _written: int, _previous: int) -> None:
        self._update_irq()

    def _read_dr(self) -> int:
        words = self.words
        words[SR] &= ~(RXNE | (words[_SEEN] & _READ_SEQUENCE_FLAGS))
        words[_SEEN] &= ~_READ_SEQUENCE_FLAGS
        self._update_irq()
        return words[_RDR]

    def _write_dr(self, written: int, _previous: int) -> None:
        word = written & _WORD_BITS
        if self.words[_SEEN] & TC:
            self.words[_SEEN] &= ~TC
            self.words[SR] &= ~TC
        if not self._is_transmitting():
            self.chip.warn(f"{self.name}_DR: written while the transmitter is off", once=f"{self.name}:tx-off")
        elif self.words[BRR] == 0:
            self.chip.warn(f"{self.name}_DR: written while BRR is 0: no baud rate", once=f"{self.name}:brr")
        elif not self.words[_SHIFT]:
            self._load(_HELD | word, self.chip.now_ns)
            self._schedule()
        else:
            if self.words[_TDR]:
                self.chip.warn(f"{self.name}_DR: written while TXE is 0: a character is lost", once=f"{self.name}:txe")
            self.words[_TDR] = _HELD | word
            self.words[SR] &= ~TXE
        self._update_irq()

    def _write_control(self, _written: int, _previous: int) -> None:
        for register, mask, what in _UNMODELLED:
            if self.words[register] & mask:
                self.chip.warn(f"{self.name}: {what} is not modelled", once=f"{self.name}:{what}")
        self._switch_transmitter()
        self._schedule()
        self._update_irq()

    def _switch_transmitter(self) -> None:
        """Follow UE, TE and SBK."""
        is_enabled = self._is_transmitting()
        has_rate = self.words[BRR] > 0
        if is_enabled and not self._is_enabled_before:
            self._tx_pin.connect(self._source, level=True)
            if not self.words[_SHIFT] and has_rate:
                self._load(_PREAMBLE, self.chip.now_ns)
        elif not self.words[CR1] & TE and self.words[_SHIFT]:
            # UE lets the present character end; TE cuts it off (RM0008 27.3.2).
            self.chip.warn(f"{self.name}_CR1: TE cleared during a character, which is lost", once=f"{self.name}:te")
            self.words[_SHIFT] = self.words[_TDR] = 0
            self.words[SR] |= TXE | TC
        if not is_enabled and not self.words[_SHIFT]:
            self._tx_pin.disconnect(self._source)
        self._is_enabled_before = is_enabled
        if is_enabled and self.words[CR1] & SBK and not self.words[_SHIFT] and has_rate:
            self._load(_BREAK, self.chip.now_ns)

    def _write_brr(self, _written: int, _previous: int) -> None:
        """Use the new rate from the next character on."""
        self._rate_pc = self.chip.access_pc
        if self._tx_due_ns is not None:
            self._rebase_transmission(self._tx_due_ns)
        if self._rx_due_ns is not None:
            self._rebase_reception(self._rx_due_ns)
        self._schedule()

    def _route_changed(self) -> None:
        """Move to the pins that AFIO now gives."""
        tx_pin, self._rx_pin = self._routed_pins()
        if tx_pin is not self._tx_pin:
            self._tx_pin.disconnect(self._source)
            self._tx_pin = tx_pin
            if self._is_transmitting():
                tx_pin.connect(self._source, level=True)

    def _restored(self) -> None:
        self._tx_pin, self._rx_pin = self._routed_pins()

    def _routed_pins(self) -> tuple[Pin, Pin]:
        tx, rx = self._pins.get(self.chip.pins.remaps.get(self.name, 0), self._pins[0])
        return self.chip.pins[tx], self.chip.pins[rx]

    def _update_irq(self) -> None:
        status, control = self.words[SR], self.words[CR1]
        # TXEIE, TCIE and IDLEIE sit at the places of their flags; ORE shares RXNEIE.
        asks = status & control & (TXE | TC | RXNE | IDLE) or (status & ORE and control & RXNEIE)
        asks = asks or (status & PE and control & PEIE)
        self.chip.set_irq(self.place.irqs[0], bool(asks))
