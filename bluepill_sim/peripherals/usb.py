"""The USB device at full speed: eight endpoint registers, and a memory of packets.

In Python, at the level of transactions; the memory of packets, reads of the registers and writes that change nothing
stay in C (`extension/source/devices/usb.c`). What the host says
comes from `fabric/usb_bus.py`, and who the host is does not matter here.

Theory of operation. The host begins a transaction and is answered by STAT of the endpoint (`begin`); when it has ended
(`end`), data are in the memory, DTOG and STAT have moved on and CTR is set. ISTR's CTR, DIR and EP_ID are those of the
first endpoint whose CTR stands, isochronous and double-buffered ones before the others. SOF, ESOF and SUSP have an
event only while their flag is 0: frames that nobody looks at cost nothing, and FNR follows from the time.

An isochronous or double-buffered endpoint has one direction and two buffers: the first is that of ADDRn_TX, the second
that of ADDRn_RX. DTOG of its direction says which is the device's, DTOG of the other (SW_BUF) which is the program's.
A bulk endpoint whose two are alike says NAK, but only once a transaction has ended since DBL_BUF was set: before that
its STAT alone answers, so that a program may fill both buffers and start with both bits as they are (23.4.3). Chosen:
STAT stays VALID from the first transaction on. The manual's sentence on that can be read otherwise for the first one,
but Klipper, which sets STAT once and then waits for both packets to go, runs on the chip.

Source: RM0008 section 23.
Invariant: with PDWN or FRES set nothing is answered; CTR, DIR and EP_ID of ISTR follow from the endpoint registers.
"""

from enum import IntEnum

from bluepill_sim.fabric.ports import ChipPorts
from bluepill_sim.fabric.registers import (
    HEARS_LINE,
    NATIVE,
    OWN_ANSWERS,
    Peripheral,
    PeripheralMapping,
    Register,
    bits,
    indices,
    masks,
)
from bluepill_sim.fabric.usb_bus import (
    FRAME_NS,
    FRAME_NUMBERS,
    BusState,
    Handshake,
    Token,
    Transaction,
    UsbMaster,
    UsbResponse,
)
from simbase.timing import Nanos

ENDPOINTS = 8
#: The memory of packets: 16 bits in each word, from here on.
MEMORY_OFFSET, MEMORY_WORDS = 0x400, 256
_MEMORY = MEMORY_OFFSET // 4

#: Fields, from the left.
_INTERRUPTS = "CTR{0} 15, PMAOVR{0} 14, ERR{0} 13, WKUP{0} 12, SUSP{0} 11, RESET{0} 10, SOF{0} 9, ESOF{0} 8"
_EPR = (
    "CTR_RX 15, DTOG_RX 14, STAT_RX 13:12, SETUP 11, EP_TYPE 10:9, EP_KIND 8, CTR_TX 7, DTOG_TX 6, STAT_TX 5:4, EA 3:0"
)
_CNTR = _INTERRUPTS.format("M") + ", RESUME 4, FSUSP 3, LP_MODE 2, PDWN 1, FRES 0"
_ISTR = _INTERRUPTS.format("") + ", DIR 4, EP_ID 3:0"
_FNR = "RXDP 15, RXDM 14, LCK 13, LSOF 12:11, FN 10:0"
CTR_RX, DTOG_RX, SETUP, EP_KIND, CTR_TX, DTOG_TX = masks(_EPR, "CTR_RX DTOG_RX SETUP EP_KIND CTR_TX DTOG_TX")
STAT_RX_AT, STAT_TX_AT, TYPE_AT = 12, 4, 9
DISABLED, STALL, NAK, VALID = range(4)
BULK, CONTROL, ISOCHRONOUS, INTERRUPT = range(4)
_CORRECT = CTR_RX | CTR_TX

CTR, PMAOVR, ERR, WKUP, SUSP, RESET, SOF, ESOF, DIR = masks(_ISTR, "CTR PMAOVR ERR WKUP SUSP RESET SOF ESOF DIR")
RESUME, FSUSP, LP_MODE, PDWN, FRES = masks(_CNTR, "RESUME FSUSP LP_MODE PDWN FRES")
_EVENTS = bits((15, 8))
_CLEARED = bits((14, 8))
RXDP, RXDM, LCK = masks(_FNR, "RXDP RXDM LCK")
_DADDR = "EF 7, ADD 6:0"
(EF,) = masks(_DADDR, "EF")
_LSOF_AT, _MOST_LOST = 11, 3
#: In the words of a buffer's description: ADDRn_TX, COUNTn_TX, ADDRn_RX, COUNTn_RX.
_COUNT, _BL_SIZE, _BLOCKS_AT, _SECOND = bits((9, 0)), 1 << 15, 10, 2
_SMALL_BLOCK, _LARGE_BLOCK = 2, 32
_SETUP_BYTES = 8
_HALFWORD = 0xFFFF

#: 23.2, USB 2.0 7.1.7: clock; how long a reset must last to be one (chosen: the least); idle that is a suspend.
CLOCK_HZ = 48_000_000
_RESET_NS: Nanos = 2_500
_SUSPEND_FRAMES = 3
#: 23.4.1: less makes the memory of packets too slow.
_LEAST_PCLK1_HZ = 8_000_000
_PINS = (("PA11", "USBDM"), ("PA12", "USBDP"))


class UsbQuestion(IntEnum):
    """What Python is told beside what a listener hears."""

    #: A write that has changed a word, with the word before it.
    WRITTEN = OWN_ANSWERS


class Usb(Peripheral):
    """Universal serial bus full-speed device interface."""

    KIND = "usb"
    OUTPUTS = ("hp_irq", "lp_irq", "wakeup")
    INPUTS = ("can",)
    STATE = (
        "_host", "_bus", "_since_ns", "_frame", "_quiet_ns", "_sof_ns", "_esof_ns", "_susp_ns", "_reset_ns",
        "_can_is_on", "_is_stopped", "_turns",
    )  # fmt: skip
    SOURCE = "RM0008 23.5"
    ENUMS = (UsbQuestion,)
    REGISTERS = (
        *(
            Register(
                name=f"EP{n}R",
                offset=4 * n,
                readable=bits((15, 0)),
                writable=bits((10, 8), (3, 0)),
                write_zero_to_clear=_CORRECT,
                on_write=NATIVE,
                fields=_EPR,
            )
            for n in range(ENDPOINTS)
        ),
        Register(
            name="CNTR",
            offset=0x40,
            reset=PDWN | FRES,
            on_write=NATIVE,
            fields=_CNTR,
        ),
        Register(
            name="ISTR",
            offset=0x44,
            readable=bits((15, 8), (4, 0)),
            writable=0,
            write_zero_to_clear=_CLEARED,
            on_write=NATIVE,
            fields=_ISTR,
        ),
        Register(
            name="FNR",
            offset=0x48,
            readable=bits((15, 0)),
            writable=0,
            on_read="_read_fnr",
            fields=_FNR,
        ),
        Register(
            name="DADDR",
            offset=0x4C,
            on_write=NATIVE,
            fields=_DADDR,
        ),
        Register(name="BTABLE", offset=0x50, fields="BTABLE 15:3"),
        *(
            Register(
                name=f"PMA_{2 * n:03X}",
                offset=MEMORY_OFFSET + 4 * n,
                fields="DATA 15:0",
            )
            for n in range(MEMORY_WORDS)
        ),
    )

    def __init__(self, chip: ChipPorts, place: PeripheralMapping) -> None:
        super().__init__(chip, place)
        self._host: UsbMaster | None = None
        self._can_is_on = False
        self._bus = BusState.IDLE
        #: When that state began; of FRAMES the start of the frame whose number is `_frame`.
        self._since_ns: Nanos = 0
        self._frame = 0
        #: Endpoints whose two buffers take turns, a bit each: a transaction has ended since DBL_BUF was set.
        self._turns = 0
        self._forget()
        self.listen_to_pins("A", 1 << 12)
        self.heed_pull_up(False)

    def _forget(self) -> None:
        #: Since when nothing has come, and the next times of what has an event.
        self._quiet_ns: Nanos = 0
        self._sof_ns: Nanos | None = None
        self._esof_ns: Nanos | None = None
        self._susp_ns: Nanos | None = None
        self._reset_ns: Nanos | None = None
        #: Its clock stands still: nothing is heard or counted, but a resume or a reset wakes.
        self._is_stopped = False

    # For the host.

    def attach(self, host: UsbMaster) -> None:
        """Take the host at the other end of the cable."""
        self._host = host

    def heed_pull_up(self, wanted: bool) -> None:
        """Tell the host when the pull-up of D+ comes or goes, as it wants while the cable is plugged in."""
        self.listen_to_pins("A", (1 << 12) * wanted)

    @property
    def now_ns(self) -> Nanos:
        """The time reached."""
        return self.chip.now_ns

    @property
    def is_attached(self) -> bool:
        """Whether D+ is pulled up."""
        return self.chip.pins["PA12"].level

    def bus_changed(self, state: BusState, at_ns: Nanos, frame: int) -> None:
        """Take a state of the bus; FRAMES begin with the number `frame`."""
        now_frame = self._frame_at(at_ns)
        if self._bus is BusState.FRAMES:
            self._quiet_ns = at_ns - (at_ns - self._since_ns) % FRAME_NS
        self._bus, self._since_ns = state, at_ns
        self._frame = frame if state is BusState.FRAMES else now_frame
        self._reset_ns = at_ns + _RESET_NS if state is BusState.RESET and not self._is_stopped else None
        if state in {BusState.RESET, BusState.RESUME} and self.words[CNTR] & FSUSP and not self._is_off:
            self._wake_up()
        if state is not BusState.IDLE:
            self._quiet_ns = at_ns
        self._look_for_frames(at_ns)

    def begin(self, transaction: Transaction) -> UsbResponse | None:
        """Return the answer to a transaction that begins now; None: none."""
        if not self._is_listening:
            return None
        if transaction.is_damaged:
            self.words[ISTR] |= ERR
            self._update()
            return None
        n = self._endpoint(transaction)
        if n is None:
            return None
        if transaction.token is Token.IN:
            return self._begin_in(n)
        return self._begin_out(n, transaction)

    def end(self, transaction: Transaction) -> None:
        """Take that a transaction has ended as it should."""
        n = self._endpoint(transaction) if self._is_listening else None
        if n is None:
            return
        word = self.words[n]
        if transaction.token is Token.IN:
            stat = VALID if self._has_two_buffers(word) else NAK
            self.words[n] = (_with_stat(word, STAT_TX_AT, stat) ^ DTOG_TX) | CTR_TX
        elif not self._is_new(word, transaction):
            return
        else:
            self._store(self._rx_buffer(n), transaction.data)
            kept = word if word & CTR_RX else word & ~SETUP  # frozen until the one before is acknowledged
            word = (kept ^ DTOG_RX) | CTR_RX
            if transaction.token is Token.SETUP:
                word = _with_stat(word, STAT_TX_AT, NAK) | SETUP | DTOG_RX | DTOG_TX
            self.words[n] = word if self._has_two_buffers(word) else _with_stat(word, STAT_RX_AT, NAK)
        self._turns |= self._has_flow_control(word) << n
        self._update()

    def would_nak(self, endpoint: int, is_in: bool) -> bool:
        """Whether the answer to IN, or OUT, would be NAK now."""
        if not self._is_listening:
            return False
        transaction = Transaction(Token.IN if is_in else Token.OUT, self.words[DADDR] & ~EF, endpoint)
        n = self._endpoint(transaction)
        return n is not None and self._says_nak(n, is_in)

    def plan(self) -> None:
        """Work out when something is due next."""
        host_ns = None if self._host is None else self._host.next_ns
        times = (self._sof_ns, self._esof_ns, self._susp_ns, self._reset_ns, host_ns)
        known = [time for time in times if time is not None]
        self.due_ns = max(min(known), self.chip.now_ns) if known else None

    # For the chip.

    def advance_to(self, now_ns: Nanos) -> None:
        """Act on what is due: frames, their absence, resets, and what the host does."""
        self.due_ns = None
        if self._reset_ns is not None and self._reset_ns <= now_ns:
            self._reset_ns = None
            if not self._is_off:
                self._take_reset()
        flags = 0
        for time, flag in ((self._sof_ns, SOF), (self._esof_ns, ESOF), (self._susp_ns, SUSP)):
            flags |= flag if time is not None and time <= now_ns else 0
        if flags:
            self.words[ISTR] |= flags
            self._look_for_frames(now_ns)
        self._update()
        if self._host is not None:
            self._host.advance_to(now_ns)
        self.plan()

    def reset(self) -> None:
        """Go back to the state after a system reset; the memory of packets keeps what it holds."""
        kept = self.words[_MEMORY : _MEMORY + MEMORY_WORDS]
        super().reset()
        self.words[_MEMORY : _MEMORY + MEMORY_WORDS] = kept

    def on_reset(self) -> None:
        """Let go of the pins; the bus stays as it is."""
        self._forget()
        self._turns = 0
        self._hold_pins()
        self._update()
        self._tell_host()

    def clock_changed(self) -> None:
        """Look whether it still hears."""
        if not self._is_off and self.chip.clocks.usb_hz:
            self._check_clock()
        self._tell_host()

    def clock_stopped(self) -> None:
        """Stand still in Stop; what wakes is asynchronous (RM0008 23.4.5)."""
        self.advance_to(self.chip.now_ns)
        self._is_stopped, self._reset_ns = True, None
        self._look_for_frames(self.chip.now_ns)

    def clock_resumed(self, stopped_ns: int) -> None:
        """Go on: frames, silence and a reset of the bus are counted from now on."""
        del stopped_ns
        if not self._is_stopped:  # reset meanwhile
            return
        now_ns = self.chip.now_ns
        self._is_stopped, self._quiet_ns = False, now_ns
        self._reset_ns = now_ns + _RESET_NS if self._bus is BusState.RESET else None
        self._look_for_frames(now_ns)

    def line_changed(self, name: str, level: bool) -> None:
        """Take that CAN is on or off."""
        del name
        self._can_is_on = level
        self._check_can()

    def pins_changed(self) -> None:
        """Take that the pull-up of D+ has come or gone."""
        self._tell_host()

    # Registers.

    def answer(self, what: int, value: int) -> None:
        """Take what the device in C hears: a line, a pin, or a write that has changed a word."""
        if what == UsbQuestion.WRITTEN:
            if value >> 16 == CNTR:
                self._control(value & _HALFWORD)
            elif value >> 16 == ISTR:
                self._look_for_frames(self.chip.now_ns)
            elif value >> 16 < ENDPOINTS and not self._has_flow_control(self.words[value >> 16]):
                self._turns &= ~(1 << (value >> 16))
            self._update()
            self._tell_host()
        elif what == HEARS_LINE:
            self.line_changed(self.INPUTS[value >> 1], bool(value & 1))
        else:
            self.pins_changed()

    def _control(self, previous: int) -> None:
        """Follow a new word of CNTR."""
        now_ns, written = self.chip.now_ns, self.words[CNTR]
        if written & FRES and not previous & FRES:
            self._take_reset()
        was_off = previous & (PDWN | FRES)
        if was_off and not self._is_off:
            self._quiet_ns = now_ns
            self._check_clock()
            self._check_can()
        if previous & RESUME and not written & RESUME and written & FSUSP and self._host is not None:
            self._host.wake(now_ns)
        self._hold_pins()
        self._look_for_frames(now_ns)

    def _read_fnr(self) -> int:
        now_ns = self.chip.now_ns
        lines = RXDM if self._bus is BusState.RESUME else 0 if self._bus is BusState.RESET else RXDP
        frames = (now_ns - self._quiet_ns) // FRAME_NS
        is_running = self._bus is BusState.FRAMES
        lost = 0 if is_running else min(frames, _MOST_LOST)
        lock = LCK if is_running and frames >= 1 else 0
        return (lines if self.is_attached else 0) | lock | lost << _LSOF_AT | self._frame_at(now_ns)

    # The bus.

    @property
    def _is_off(self) -> bool:
        return bool(self.words[CNTR] & (PDWN | FRES))

    @property
    def _is_listening(self) -> bool:
        """Whether packets reach the endpoints."""
        is_ready = not self._is_off and not self.words[ISTR] & RESET and self.words[DADDR] & EF
        return bool(is_ready) and self.chip.clocks.usb_hz == CLOCK_HZ and not self._is_stopped

    def _frame_at(self, now_ns: Nanos) -> int:
        """Return the number of the last frame that has begun."""
        begun = (now_ns - self._since_ns) // FRAME_NS if self._bus is BusState.FRAMES else 0
        return (self._frame + begun) % FRAME_NUMBERS

    def _look_for_frames(self, now_ns: Nanos) -> None:
        """Work out the next SOF, or what says that there is none, of those whose flag is 0."""
        self._sof_ns = self._esof_ns = self._susp_ns = None
        flags = self.words[ISTR]
        if self._is_stopped:
            pass
        elif not self._is_off and self._bus is BusState.FRAMES and not flags & SOF:
            self._sof_ns = _next(self._since_ns, FRAME_NS, now_ns)
        elif not self._is_off and self._bus is BusState.IDLE and not self.words[CNTR] & FSUSP:
            if not flags & ESOF:
                self._esof_ns = _next(self._quiet_ns, FRAME_NS, now_ns)
            if not flags & SUSP:
                self._susp_ns = _next(self._quiet_ns, _SUSPEND_FRAMES * FRAME_NS, now_ns)
        self.plan()

    def _take_reset(self) -> None:
        """Reset what a bus reset does: address and endpoints, but for the transfers that are not acknowledged yet."""
        for n in range(ENDPOINTS):
            self.words[n] &= _CORRECT
        self._turns = 0
        self.words[DADDR] = 0
        self.words[ISTR] |= RESET
        self._update()

    def _wake_up(self) -> None:
        self.words[CNTR] &= ~LP_MODE
        self.words[ISTR] |= WKUP
        self._update()
        self.set_output("wakeup", True)
        self.set_output("wakeup", False)

    def _hold_pins(self) -> None:
        """Take D+ and D- from GPIO while the transceiver is on (RM0008 table 29)."""
        for name, owner in _PINS:
            pin = self.chip.pins[name]
            if self.words[CNTR] & PDWN:
                if pin.holder == owner:
                    pin.release()
            elif pin.holder is None:
                pin.hold(owner)

    def _tell_host(self) -> None:
        if self._host is not None:
            self._host.device_changed(self.chip.now_ns)
            self.plan()

    def _check_clock(self) -> None:
        clocks = self.chip.clocks
        if clocks.usb_hz != CLOCK_HZ:
            what = f"{clocks.usb_hz} Hz" if clocks.usb_hz else "off (the PLL is not ready)"
            self.chip.warn(
                f"USB: its clock is {what} and must be {CLOCK_HZ} Hz (RCC_CFGR USBPRE): it hears nothing",
                once="USB:clock",
            )
        elif clocks.pclk1_hz < _LEAST_PCLK1_HZ:
            self.chip.warn(f"USB: PCLK1 is {clocks.pclk1_hz} Hz, below {_LEAST_PCLK1_HZ} Hz", once="USB:pclk1")

    def _check_can(self) -> None:
        if self._can_is_on and not self._is_off:
            self.chip.warn(
                "USB and CAN are both on: they share one memory of 512 bytes, and only one of them may be",
                once="USB:CAN",
            )

    def _update(self) -> None:
        """Bring ISTR and the interrupts up to date."""
        words = self.words
        pending = [n for n in range(ENDPOINTS) if words[n] & _CORRECT]
        urgent = [n for n in pending if self._has_two_buffers(words[n])]
        flags = words[ISTR] & _CLEARED
        if pending:
            first = (urgent or pending)[0]
            flags |= CTR | first | (DIR if words[first] & CTR_RX else 0)
        words[ISTR] = flags
        enabled = words[CNTR] & _EVENTS
        self.set_output("hp_irq", bool(urgent and enabled & CTR))
        self.set_output("lp_irq", bool(flags & enabled))

    # Endpoints.

    def _endpoint(self, transaction: Transaction) -> int | None:
        """Return which register a transaction means, unless it is disabled there."""
        if transaction.address != self.words[DADDR] & ~EF:
            return None
        at = STAT_TX_AT if transaction.token is Token.IN else STAT_RX_AT
        for n in range(ENDPOINTS):
            word = self.words[n]
            if word & 0xF == transaction.endpoint and word >> at & 3:
                return n
        return None

    @staticmethod
    def _has_two_buffers(word: int) -> bool:
        return word >> TYPE_AT & 3 == ISOCHRONOUS or Usb._has_flow_control(word)

    @staticmethod
    def _has_flow_control(word: int) -> bool:
        """Tell whether it is a bulk endpoint with DBL_BUF."""
        return word >> TYPE_AT & 3 == BULK and bool(word & EP_KIND)

    def _says_nak(self, n: int, is_in: bool) -> bool:
        word = self.words[n]
        stat = word >> (STAT_TX_AT if is_in else STAT_RX_AT) & 3
        if word >> TYPE_AT & 3 == ISOCHRONOUS:
            return False
        is_taken = self._turns >> n & 1 and bool(word & DTOG_RX) == bool(word & DTOG_TX)
        return stat == NAK or (stat == VALID and bool(is_taken))

    def _begin_in(self, n: int) -> UsbResponse | None:
        word = self.words[n]
        if self._says_nak(n, is_in=True):
            return UsbResponse(Handshake.NAK)
        if word >> STAT_TX_AT & 3 == STALL:
            return UsbResponse(Handshake.STALL)
        toggle = bool(word & DTOG_TX)
        second = self._has_two_buffers(word) and toggle
        at = self._description(n) + (_SECOND if second else 0)
        count = self._memory(at + 1) & _COUNT
        pid = 0 if word >> TYPE_AT & 3 == ISOCHRONOUS else int(toggle)
        return UsbResponse(None, pid, self._load(self._memory(at), count))

    def _begin_out(self, n: int, transaction: Transaction) -> UsbResponse | None:
        word = self.words[n]
        kind = word >> TYPE_AT & 3
        if transaction.token is Token.SETUP:
            # What comes before the last one is acknowledged is not heard, whatever STAT (23.4.2, control transfers).
            is_heard = kind == CONTROL and not word & CTR_RX and len(transaction.data) == _SETUP_BYTES
            return UsbResponse(Handshake.ACK) if is_heard else None
        if kind == ISOCHRONOUS:
            return UsbResponse(None)
        if self._says_nak(n, is_in=False):
            return UsbResponse(Handshake.NAK)
        is_wrong_status = kind == CONTROL and word & EP_KIND and transaction.data
        room = self._room(self._memory(self._rx_buffer(n) + 1))
        if word >> STAT_RX_AT & 3 == STALL or is_wrong_status or len(transaction.data) > room:
            return UsbResponse(Handshake.STALL)
        return UsbResponse(Handshake.ACK)

    @staticmethod
    def _is_new(word: int, transaction: Transaction) -> bool:
        """Whether data have not been received before, by their PID."""
        if transaction.token is Token.SETUP or word >> TYPE_AT & 3 == ISOCHRONOUS:
            return True
        return transaction.pid == bool(word & DTOG_RX)

    # The memory of packets; places are words of 16 bits.

    def _memory(self, at: int) -> int:
        return self.words[_MEMORY + at % MEMORY_WORDS]

    def _description(self, n: int) -> int:
        return self.words[BTABLE] // 2 + 4 * n

    def _rx_buffer(self, n: int) -> int:
        """Return where the description of the buffer stands into which it receives next."""
        word = self.words[n]
        is_first = self._has_two_buffers(word) and not word & DTOG_RX
        return self._description(n) + (0 if is_first else _SECOND)

    @staticmethod
    def _room(count: int) -> int:
        """Return how many bytes a buffer for reception has, by its COUNTn_RX."""
        blocks = count >> _BLOCKS_AT & 0x1F
        return (blocks + 1) * _LARGE_BLOCK if count & _BL_SIZE else blocks * _SMALL_BLOCK

    def _load(self, address: int, count: int) -> bytes:
        first = address // 2
        words = [self._memory(first + n) for n in range((count + 1) // 2)]
        return b"".join(word.to_bytes(2, "little") for word in words)[:count]

    def _store(self, description: int, data: bytes) -> None:
        """Put what was received into a buffer, as far as that goes."""
        count = self._memory(description + 1)
        first = self._memory(description) // 2
        data = data[: self._room(count)]
        for i in range(0, len(data), 2):
            place = _MEMORY + (first + i // 2) % MEMORY_WORDS
            pair = data[i : i + 2]
            self.words[place] = pair[0] | (pair[1] << 8 if len(pair) > 1 else self.words[place] & 0xFF00)
        self.words[_MEMORY + (description + 1) % MEMORY_WORDS] = count & ~_COUNT | len(data)


def _with_stat(word: int, at: int, stat: int) -> int:
    return word & ~(3 << at) | stat << at


def _next(base_ns: Nanos, period_ns: Nanos, now_ns: Nanos) -> Nanos:
    """Return the first time behind `now_ns` that is whole periods, one at least, from a base."""
    return base_ns + max(1, (now_ns - base_ns) // period_ns + 1) * period_ns


CNTR, ISTR, FNR, DADDR, BTABLE = indices(Usb.REGISTERS, "CNTR ISTR FNR DADDR BTABLE")
