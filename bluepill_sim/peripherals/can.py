"""bxCAN: three mailboxes that send, two FIFOs of three that receive, fourteen filters.

In Python, since a frame takes at least 44 us of bus and what drivers poll are plain words. Who sends when is the
network's business (`fabric/can_network.py`); until a chip joins one it is alone, where nobody acknowledges, and in
loop-back mode too.

Theory of operation. A mailbox is latched when TXRQ is set. The network asks for the best one (`offer`) when a frame
begins, and tells its end in advance (`end`); what follows from it happens at that time.
While somebody is subscribed to TX or RX, the bits of a frame are worked out when it begins (`_frame_rows`); nothing
follows from them.
A frame that nobody acknowledges is tried again without end. Once a try has left everything as the one before, C repeats
it (`_repeat`), until something acts on CAN: that first takes the tries back (`_settle`).
Source: RM0008 24.
Invariant: FMP of each FIFO is the number of messages in `_fifos`, and its first stands in the registers.
"""

import ctypes
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import Enum, auto
from fractions import Fraction
from functools import lru_cache, partialmethod

from bluepill_sim.extension.layout import CAN_BITS, structure
from bluepill_sim.extension.windows import NO_TIME
from bluepill_sim.fabric.bus_parts import CanFrame
from bluepill_sim.fabric.can_network import CanEnd, CanError, CanNetwork, frame_bits
from bluepill_sim.fabric.fabric import OWN_COMMANDS
from bluepill_sim.fabric.pins import ALTERNATE_FUNCTIONS, PinDrive
from bluepill_sim.fabric.ports import ChipPorts
from bluepill_sim.fabric.registers import Peripheral, PeripheralMapping, Register, bits, fields_of, masks, numbered
from bluepill_sim.fabric.subscriptions import EDGE
from simbase.timing import NS_PER_S, Nanos

MCR, MSR, TSR, RF0R, RF1R, IER, ESR, BTR = range(8)
TI0R, RI0R, FMR, FM1R, FS1R, FFA1R, FA1R, F0R1 = (
    at // 4 for at in (0x180, 0x1B0, 0x200, 0x204, 0x20C, 0x214, 0x21C, 0x240)
)
_MAILBOXES, _FIFO_DEPTH, _BANKS = 3, 3, 14
#: Fields, RM0008 24.9.
_MASTER = "DBF 16, RESET 15, TTCM 7, ABOM 6, AWUM 5, NART 4, RFLM 3, TXFP 2, SLEEP 1, INRQ 0"
_STATUS = "RX 11, SAMP 10, RXM 9, TXM 8, SLAKI 4, WKUI 3, ERRI 2, SLAK 1, INAK 0"
_TRANSMISSION = (
    "LOW2 31, LOW1 30, LOW0 29, TME2 28, TME1 27, TME0 26, CODE 25:24, ABRQ2 23, RESERVED2 22:20, TERR2 19, ALST2 18, "
    "TXOK2 17, RQCP2 16, ABRQ1 15, RESERVED1 14:12, TERR1 11, ALST1 10, TXOK1 9, RQCP1 8, ABRQ0 7, RESERVED0 6:4, "
    "TERR0 3, ALST0 2, TXOK0 1, RQCP0 0"
)
_RECEPTION = "RFOM{n} 5, FOVR{n} 4, FULL{n} 3, FMP{n} 1:0"
_INTERRUPTS = (
    "SLKIE 17, WKUIE 16, ERRIE 15, LECIE 11, BOFIE 10, EPVIE 9, EWGIE 8, FOVIE1 6, FFIE1 5, FMPIE1 4, FOVIE0 3, "
    "FFIE0 2, FMPIE0 1, TMEIE 0"
)
_ERRORS = "REC 31:24, TEC 23:16, LEC 6:4, BOFF 2, EPVF 1, EWGF 0"
_TIMING = "SILM 31, LBKM 30, SJW 25:24, TS2 22:20, TS1 19:16, BRP 9:0"
_IDENTIFIER = "STID 31:21, EXID 20:3, IDE 2, RTR 1"
_REQUEST = f"{_IDENTIFIER}, TXRQ 0"
_RECEIVED = "TIME 31:16, FMI 15:8, RESERVED 7:4, DLC 3:0"
_LOW, _HIGH = ("DATA{3} 31:24, DATA{2} 23:16, DATA{1} 15:8, DATA{0} 7:0".format(*names) for names in ("0123", "4567"))
INRQ, SLEEP, TXFP, RFLM, NART, AWUM, ABOM, TTCM, RESET = masks(
    _MASTER, "INRQ SLEEP TXFP RFLM NART AWUM ABOM TTCM RESET"
)
INAK, SLAK, ERRI, WKUI, SLAKI = masks(_STATUS, "INAK SLAK ERRI WKUI SLAKI")
#: Those of the first mailbox; the others' stand 8 and 16 bits above.
RQCP, TXOK, ALST, TERR, ABRQ = masks(_TRANSMISSION, "RQCP0 TXOK0 ALST0 TERR0 ABRQ0")
FULL, FOVR, RFOM = masks(_RECEPTION.format(n=0), "FULL0 FOVR0 RFOM0")
TMEIE, EWGIE, EPVIE, BOFIE, LECIE, ERRIE, WKUIE, SLKIE = masks(
    _INTERRUPTS, "TMEIE EWGIE EPVIE BOFIE LECIE ERRIE WKUIE SLKIE"
)
EWGF, EPVF, BOFF, _LEC = masks(_ERRORS, "EWGF EPVF BOFF LEC")
LBKM, SILM = masks(_TIMING, "LBKM SILM")
TXRQ, RTR, IDE = masks(_REQUEST, "TXRQ RTR IDE")
_TME, _LOW_PRIORITY = masks(_TRANSMISSION, "TME0 LOW0")
_CODE_AT = next(field.low for field in fields_of(_TRANSMISSION) if field.name == "CODE")
#: RM0008 24.7.6; ISO 11898-1: warning, passive, off; bits at 1 that end an initialisation, and a bus-off.
_WARNING, _PASSIVE, _OFF = 96, 128, 256
_SYNC_BITS, _RECOVERY_BITS = 11, 128 * 11
#: LEC of a receiver of a damaged frame.
_CRC_ERROR = 6
#: Dominant bits of an error flag.
_FLAG_BITS = 6
#: Pins (RX, TX) by the remap field (RM0008 table 42).
PINS = {0: ("PA11", "PA12"), 2: ("PB8", "PB9"), 3: ("PD0", "PD1")}
#: The outputs in the order in which they are set; the first is for USB, whose memory it shares.
_UPDATED = ("packets", "tx_irq", "rx0_irq", "rx1_irq", "sce_irq")
#: Commands of the device in C that shows bits (`devices/can_bits.c`), and what comes next of a try that it repeats.
_GO_ON, _SHOW = OWN_COMMANDS, OWN_COMMANDS + 1
_IS_SINGLE, _TO_START, _TO_DECIDE, _TO_END = range(4)
#: Takes frames at their ends, oldest first.
Sink = Callable[[Sequence[CanEnd]], None]


@dataclass(frozen=True, slots=True)
class _Mailbox:
    """What is to be sent, and since when."""

    frame: CanFrame
    asked_ns: Nanos
    order: int


class _Part(Enum):
    """What a chip does while a frame stands on the bus."""

    SENDS = auto()
    ACKNOWLEDGES = auto()
    LISTENS = auto()
    #: In loop-back mode, without SILM and with it.
    IS_ALONE = auto()
    IS_MUTE = auto()


@dataclass(frozen=True, slots=True)
class _Tried:
    """How long a try lasted, and what it left: requests so far, mailboxes that wait, control and status registers."""

    span_ns: Nanos
    requests: int
    mailboxes: tuple[int, ...]
    words: bytes


@dataclass(frozen=True, slots=True)
class _Message:
    """What was received: the four words of a FIFO."""

    words: tuple[int, int, int, int]


def _mailbox_registers() -> tuple[Register, ...]:
    rows: list[Register] = []
    for n in range(_MAILBOXES):
        at = 0x180 + 0x10 * n
        rows += (
            Register(name=f"TI{n}R", offset=at, on_write=f"_write_ti{n}r", fields=_REQUEST),
            Register(
                name=f"TDT{n}R",
                offset=at + 4,
                readable=bits((31, 16), 8, (3, 0)),
                writable=bits(8, (3, 0)),
                on_write=f"_write_mail_{n}_1",
                fields="TIME 31:16, TGT 8, DLC 3:0",
            ),
            Register(name=f"TDL{n}R", offset=at + 8, on_write=f"_write_mail_{n}_2", fields=_LOW),
            Register(name=f"TDH{n}R", offset=at + 12, on_write=f"_write_mail_{n}_3", fields=_HIGH),
        )
    for n in range(2):
        at = 0x1B0 + 0x10 * n
        rows += (
            Register(name=f"{what}{n}R", offset=at + 4 * k, writable=0, fields=fields)
            for k, (what, fields) in enumerate(
                (("RI", _IDENTIFIER + ", RESERVED 0"), ("RDT", _RECEIVED), ("RDL", _LOW), ("RDH", _HIGH))
            )
        )
    return tuple(rows)


class Can(Peripheral):
    """Basic extended CAN."""

    OUTPUTS = ("tx_irq", "rx0_irq", "rx1_irq", "sce_irq", "packets")
    STATE = (
        "_alone", "_joined", "_mailboxes", "_order", "_fifos", "_ends", "_sync_ns", "_recover_ns", "_tec", "_rec",
        "_timer_ns", "_lost", "_is_stopped", "_tried", "_bits_held", "_bits_due_ns",
    )  # fmt: skip
    DERIVED = ("_pin_names", "_sinks", "_levels", "_bits", "_bits_slot")
    SOURCE = "RM0008 24.9"
    REGISTERS = (
        Register(
            name="MCR",
            fields=_MASTER,
            offset=0x00,
            reset=0x1_0002,
            readable=bits(16, (7, 0)),
            writable=bits((16, 15), (7, 0)),
            on_write="_write_mcr",
        ),
        Register(
            name="MSR",
            fields=_STATUS,
            offset=0x04,
            reset=0xC02,
            readable=bits((11, 8), (4, 0)),
            writable=0,
            write_one_to_clear=bits((4, 2)),
            on_write="_write_flags",
        ),
        Register(name="TSR", offset=0x08, reset=0x1C00_0000, writable=0, on_write="_write_tsr", fields=_TRANSMISSION),
        *(
            Register(
                name=f"RF{n}R",
                offset=0x0C + 4 * n,
                writable=0,
                write_one_to_clear=bits((4, 3)),
                on_write=f"_write_rf{n}r",
                fields=_RECEPTION.format(n=n),
            )
            for n in range(2)
        ),
        Register(
            name="IER",
            fields=_INTERRUPTS,
            offset=0x14,
            on_write="_write_flags",
        ),
        Register(
            name="ESR",
            offset=0x18,
            readable=bits((31, 16), (6, 4), (2, 0)),
            writable=_LEC,
            on_write="_write_flags",
            fields=_ERRORS,
        ),
        Register(
            name="BTR",
            fields=_TIMING,
            offset=0x1C,
            reset=0x0123_0000,
            on_write="_write_btr",
        ),
        *_mailbox_registers(),
        Register(name="FMR", offset=0x200, reset=0x2A1C_0E01, writable=1, fields="RESERVED 31:1, FINIT 0"),
        *(
            Register(
                name=name,
                offset=offset,
                on_write=f"_write_{name.lower()}",
                fields=numbered(f"{bit}n", range(_BANKS - 1, -1, -1)),
            )
            for name, offset, bit in (("FM1R", 0x204, "FBM"), ("FS1R", 0x20C, "FSC"), ("FFA1R", 0x214, "FFA"))
        ),
        Register(
            name="FA1R",
            offset=0x21C,
            fields=numbered("FACTn", range(_BANKS - 1, -1, -1)),
        ),
        *(
            Register(
                name=f"F{n // 2}R{n % 2 + 1}", offset=0x240 + 4 * n, on_write=f"_write_filter_{n}", fields="FB 31:0"
            )
            for n in range(2 * _BANKS)
        ),
    )

    def __init__(self, chip: ChipPorts, place: PeripheralMapping) -> None:
        #: The levels that are still to be shown of a frame; its slot comes before that of what follows from the frame.
        self._bits = structure(CAN_BITS)()
        self._bits_slot = chip.pins.fabric.add_device(
            f"{place.name}.bits", "can_bits", 0, ctypes.addressof(self._bits),
            act=lambda _ns: None, answer=self._tries_changed, deliver=lambda: None,
        )  # fmt: skip
        super().__init__(chip, place)
        self._sinks: list[Sink] = []
        #: The outputs as they were last set.
        self._levels: tuple[bool, ...] | None = None
        self._alone = CanNetwork()
        self._alone.join(self)
        self._joined: CanNetwork | None = None
        self._pin_names = PINS[0]
        self._find_pins()
        self._clear()
        self.on_reset()
        chip.pins.route_listeners.append(self._route_changed)

    def _clear(self) -> None:
        self._mailboxes: dict[int, _Mailbox] = {}
        self._order = 0
        self._fifos: tuple[deque[_Message], deque[_Message]] = (deque(), deque())
        #: Ends of frames that are to come.
        self._ends: deque[CanEnd] = deque()
        self._sync_ns: Nanos | None = None
        self._recover_ns: Nanos | None = None
        self._tec = self._rec = 0
        self._timer_ns: Nanos = 0
        #: Mailboxes that have lost an arbitration and do not try again.
        self._lost: tuple[int, ...] = ()
        #: Its clock stands still: nothing is heard, and what it has begun to send ends with the clock.
        self._is_stopped = False
        #: What a try that nobody acknowledged has left, if nothing was written since.
        self._tried: _Tried | None = None
        self._forget_bits()
        self._bits.tx = 1

    # From outside the chip.

    def attach(self, network: CanNetwork) -> None:
        """Join a network."""
        self._settle()
        self._joined = network
        network.join(self)
        self._pull_up()

    def subscribe(self, sink: Sink) -> Callable[[], None]:
        """Have `sink` called with each frame at its end, its own and what it hears of others, whatever the filters.

        Returns:
            A function that ends it.
        """
        self._settle()
        self._sinks.append(sink)
        return lambda: self._sinks.remove(sink)

    def sends_at(self, pin: str) -> bool:
        """Whether something outside sends on a pin: a network does so on RX."""
        return self._joined is not None and pin == self._pin_names[0]

    @property
    def joined(self) -> CanNetwork | None:
        """The network that it was put on; None: it is alone."""
        return self._joined

    # For the network.

    @property
    def network(self) -> CanNetwork:
        """The one that it is on now."""
        return self._alone if self._joined is None or self.words[BTR] & LBKM else self._joined

    @property
    def now_ns(self) -> Nanos | None:
        """The time reached."""
        return self.chip.now_ns

    @property
    def bit_rate(self) -> Fraction:
        """Bits a second."""
        return _bit_rate(self.chip.clocks.pclk1_hz, self.words[BTR])

    @property
    def is_on(self) -> bool:
        """Whether it takes part in the traffic."""
        is_there = self.hears_itself or self._is_wired()
        return is_there and not self._is_stopped and not self.words[MSR] & (INAK | SLAK) and not self.words[ESR] & BOFF

    @property
    def hears_itself(self) -> bool:
        """Whether it is in loop-back mode."""
        return bool(self.words[BTR] & LBKM)

    @property
    def acknowledges(self) -> bool:
        """Whether it drives the bus where it hears a frame."""
        return self.is_on and not self.words[BTR] & (SILM | LBKM)

    @property
    def is_passive(self) -> bool:
        """Whether it is error passive."""
        return bool(self.words[ESR] & EPVF)

    def offer(self, at_ns: Nanos) -> CanFrame | None:
        """Return the frame of the best mailbox, if there is one."""
        best = self._best(at_ns)
        is_mute = self.words[BTR] & SILM and not self.words[BTR] & LBKM
        return None if best is None or is_mute or not self.is_on else self._mailboxes[best].frame

    def lose(self, at_ns: Nanos) -> bool:
        """Try again, but for NART."""
        if not self.words[MCR] & NART:
            return True
        best = self._best(at_ns)
        self._lost += () if best is None else (best,)
        return False

    def end(self, end: CanEnd) -> None:
        """Take the end of a frame, to act on it at its time."""
        if end.is_own or not self._is_stopped:
            self._ends.append(end)
        self.plan()

    def plan(self) -> None:
        """Work out when it acts next."""
        if self._is_stopped:  # the others go on
            next_ns = self.network.next_ns
            self.due_ns = None if next_ns is None else max(next_ns, self.chip.now_ns)
            return
        times = [self._sync_ns, self._recover_ns, self.network.next_ns if self._mailboxes or self._joined else None]
        if self._ends:
            times.append(self._ends[0].end_ns)
        if not self._is_showing and self._is_watched and self.network.start_ns != self._bits.shown_ns:
            times.append(self.network.start_ns)
        if self._lost:
            times.append(self.chip.now_ns)
        known = [time for time in times if time is not None]
        self.due_ns = max(min(known), self.chip.now_ns) if known else None

    # For the chip.

    def advance_to(self, now_ns: Nanos) -> None:
        """Act on what is due: ends of frames, changes of mode, what the network has to decide."""
        self._take_back()
        self.due_ns = None
        if self._is_stopped:
            self.network.advance_to(now_ns)
            self.plan()
            return
        self._show(now_ns)
        last = self._take_ends(now_ns)
        if self._sync_ns is not None and self._sync_ns <= now_ns:
            self._sync_ns = None
            self._synchronise(now_ns)
        if self._recover_ns is not None and self._recover_ns <= now_ns:
            self._recover_ns = None
            self._tec = self._rec = 0
            self._count_errors(0)
            self._want()
        self.network.advance_to(now_ns)
        self._show(now_ns)  # a frame that has begun meanwhile
        for mailbox in self._lost:
            self._complete(mailbox, ALST)
        self._lost = ()
        self._take_ends(now_ns)  # a chip that others have left behind is notified of what is over
        self._update()
        self.plan()
        if last is not None and last.is_own and last.error is CanError.ACKNOWLEDGE:
            self._repeat(last)

    def write(self, offset: int, size: int, value: int) -> None:
        """Take what the bus writes, at the try that is under way."""
        self._settle()
        super().write(offset, size, value)

    def clock_changed(self) -> None:
        """Go on with the tries at another bit rate."""
        self._settle()

    def clock_stopped(self) -> None:
        """Stand still in Stop, or by DBG_CAN_STOP: frames of others that have not ended are lost."""
        self.advance_to(self.chip.now_ns)
        self._is_stopped = True
        self._show_level(1, 1)
        self._forget_bits()
        self._ends = deque(end for end in self._ends if end.is_own)
        self.plan()

    def clock_resumed(self, stopped_ns: int) -> None:
        """Go on: an own frame ends that much later."""
        if not self._is_stopped:  # reset meanwhile
            return
        self._is_stopped = False
        self._ends = deque(replace(end, end_ns=end.end_ns + stopped_ns) for end in self._ends)
        self._sync_ns, self._recover_ns = (
            None if at is None else at + stopped_ns for at in (self._sync_ns, self._recover_ns)
        )
        self._timer_ns += stopped_ns
        self._want()
        self.plan()

    def on_reset(self) -> None:
        """Drop everything, tries that C repeats too; it stays on its network."""
        for network in filter(None, (self._alone, self._joined)):
            network.forget(self)
        self.due_ns = None
        self._show_level(1, 1)
        self._clear()
        self._route_changed()
        self._update()
        if self._joined is not None:
            self.plan()  # the others go on

    def _restored(self) -> None:
        self._find_pins()
        self._levels = None

    # Registers.

    def _write_mcr(self, written: int, previous: int) -> None:
        now_ns = self.chip.now_ns
        if written & RESET:
            self.reset()
            return
        status = self.words[MSR]
        if written & INRQ:  # with SLEEP too: ST's drivers ask for it before they clear that
            status = status & ~SLAK | INAK
            self._sync_ns = None
        elif written & SLEEP:
            if not status & SLAK and not previous & SLEEP:
                status |= SLAK | (SLAKI if self.words[IER] & SLKIE else 0)
            status &= ~INAK
            self._sync_ns = None
        elif status & (INAK | SLAK) and (self._sync_ns is None):
            self._sync_ns = now_ns + self._ns_of(_SYNC_BITS)
        self.words[MSR] = status
        self._connect()
        self._update()
        self.plan()

    def _synchronise(self, now_ns: Nanos) -> None:
        """Leave initialisation or sleep after eleven bits at 1."""
        rx = self.chip.pins[self._pin_names[0]]
        if not self.words[BTR] & LBKM and not rx.level and not rx.is_floating:
            self._sync_ns = now_ns + self._ns_of(_SYNC_BITS)
            return
        if self.words[MSR] & INAK:
            self._timer_ns = now_ns
            if self.words[ESR] & BOFF:
                self._recover(now_ns)
        self.words[MSR] &= ~(INAK | SLAK)
        self._connect()
        if not self._is_wired() and not self.words[BTR] & LBKM:
            self.chip.warn(
                f"CAN: it is on no bus: {self._pin_names[1]} is no alternate-function output", once="CAN:pins"
            )
        self._want()

    def _ns_of(self, bits: int) -> int:
        return int(bits * NS_PER_S / self.bit_rate)

    def _recover(self, now_ns: Nanos) -> None:
        self._recover_ns = now_ns + self._ns_of(_RECOVERY_BITS)

    def _write_btr(self, _written: int, previous: int) -> None:
        if not self.words[MSR] & INAK:
            self.words[BTR] = previous
            self.chip.warn("CAN_BTR: written outside initialisation: ignored", once="CAN:btr")

    def _write_flags(self, _written: int, _previous: int) -> None:
        self._update()

    def _write_tsr(self, written: int, _previous: int) -> None:
        for n in range(_MAILBOXES):
            field = written >> 8 * n
            if field & RQCP:
                self.words[TSR] &= ~((RQCP | TXOK | ALST | TERR) << 8 * n)
            if field & ABRQ and n in self._mailboxes:
                start_ns = self.network.start_ns
                is_sending = start_ns is not None and start_ns <= self.chip.now_ns and n == self._best(start_ns)
                if is_sending or any(end.is_own and n == self._best(end.start_ns) for end in self._ends):
                    self.words[TSR] |= ABRQ << 8 * n  # it goes out, unless that fails
                else:
                    self._complete(n, 0)
        self._update()
        self.plan()

    def _write_ti(self, n: int, written: int, previous: int) -> None:
        if n in self._mailboxes:
            self._write_mail(n, 0, written, previous)
        elif written & TXRQ:
            self._mailboxes[n] = _Mailbox(self._frame_at(TI0R + 4 * n), self.chip.now_ns, self._order)
            self._order += 1
            self.words[TSR] &= ~((RQCP | TXOK | ALST | TERR | ABRQ) << 8 * n)
            self._want()
            self._update()
            self.plan()

    _write_ti0r = partialmethod(_write_ti, 0)
    _write_ti1r = partialmethod(_write_ti, 1)
    _write_ti2r = partialmethod(_write_ti, 2)

    def _write_mail(self, n: int, word: int, _written: int, previous: int) -> None:
        """Take a word of a mailbox, while that is empty (RM0008 24.9.3)."""
        if n in self._mailboxes:
            self.words[TI0R + 4 * n + word] = previous
            self.chip.warn(f"CAN: mailbox {n} written while its request waits: ignored", once="CAN:mailbox")

    def _write_rf(self, n: int, written: int, _previous: int) -> None:
        if written & RFOM and self._fifos[n]:
            self._fifos[n].popleft()
        self._update()

    _write_rf0r = partialmethod(_write_rf, 0)
    _write_rf1r = partialmethod(_write_rf, 1)

    def _write_filter_mode(self, index: int, _written: int, previous: int) -> None:
        if not self.words[FMR] & 1:
            self.words[index] = previous
            self.chip.warn("CAN: modes of filters written while FINIT is 0: ignored", once="CAN:finit")

    _write_fm1r = partialmethod(_write_filter_mode, FM1R)
    _write_fs1r = partialmethod(_write_filter_mode, FS1R)
    _write_ffa1r = partialmethod(_write_filter_mode, FFA1R)

    def _write_filter(self, n: int, _written: int, previous: int) -> None:
        """Take half of a bank, while that is off or filters are initialised (RM0008 24.9.4)."""
        if self.words[FA1R] >> n // 2 & 1 and not self.words[FMR] & 1:
            self.words[F0R1 + n] = previous
            self.chip.warn(f"CAN: filter bank {n // 2} written while it is on and FINIT is 0: ignored", once="CAN:bank")

    # Sending.

    def _frame_at(self, at: int) -> CanFrame:
        identifier, control, low, high = self.words[at : at + 4]
        length = min(control & 15, 8)
        is_remote, is_extended = bool(identifier & RTR), bool(identifier & IDE)
        data = (low | high << 32).to_bytes(8, "little")[:length]
        if self.words[MCR] & TTCM and control >> 8 & 1 and length == 8:
            data = data[:6] + self._time(self.chip.now_ns).to_bytes(2, "little")
        return CanFrame(
            identifier=identifier >> 3 if is_extended else identifier >> 21,
            data=b"" if is_remote else data,
            is_extended=is_extended,
            is_remote=is_remote,
            remote_bytes=length if is_remote else 0,
        )

    def _best(self, at_ns: Nanos) -> int | None:
        """Return the mailbox that goes next: the lowest identifier, or with TXFP the first that was asked for."""
        ready = [n for n, box in self._mailboxes.items() if box.asked_ns <= at_ns]
        if not ready:
            return None
        if self.words[MCR] & TXFP:
            return min(ready, key=lambda n: self._mailboxes[n].order)
        return min(ready, key=lambda n: (_rank(self._mailboxes[n].frame), n))

    def _want(self) -> None:
        if self._mailboxes and self.is_on:
            self.network.want(self, self.chip.now_ns)
            if self._bits.shown_ns == self.chip.now_ns:  # it takes part in the arbitration that has just begun
                self._forget_bits()

    def _complete(self, n: int, flags: int) -> None:
        """End a mailbox's request."""
        if self._mailboxes.pop(n, None) is None:
            return
        self.words[TI0R + 4 * n] &= ~TXRQ
        self.words[TSR] = self.words[TSR] & ~(ABRQ << 8 * n) | (RQCP | flags) << 8 * n

    def _take_ends(self, now_ns: Nanos) -> CanEnd | None:
        """Act on the ends of frames up to now; return the last."""
        end = None
        while self._ends and self._ends[0].end_ns <= now_ns:
            end = self._ends.popleft()
            self._take_end(end)
        return end

    def _take_end(self, end: CanEnd) -> None:
        if end.is_own or self.is_on:
            for sink in list(self._sinks):
                sink((end,))
        if end.is_own:
            self._take_own_end(end)
        elif self.is_on and end.error is CanError.NONE:
            self._rec = min(self._rec - 1, _PASSIVE - 8) if self._rec else 0
            self._count_errors(0)
            self._receive(end)
        elif self.is_on and end.error is CanError.BIT_DOMINANT:
            self._rec = min(self._rec + 1, 255)
            self._count_errors(_CRC_ERROR)
        elif self.words[MSR] & SLAK and self.words[MCR] & SLEEP:
            self._wake()

    def _take_own_end(self, end: CanEnd) -> None:
        n = next(
            (n for n, box in self._mailboxes.items() if box.frame == end.frame and n == self._best(end.start_ns)), None
        )
        if n is None:
            return
        if end.error is CanError.NONE:
            self.words[TI0R + 4 * n + 1] = self.words[TI0R + 4 * n + 1] & 0xFFFF | self._time(end.start_ns) << 16
            self._complete(n, TXOK)
            self._tec = max(self._tec - 1, 0)
            self._count_errors(0)
            if self.words[BTR] & LBKM:
                self._receive(end)
        else:
            if not (end.error is CanError.ACKNOWLEDGE and self._tec >= _PASSIVE):
                self._tec += 8
            self._count_errors(end.error)
            if self.words[MCR] & NART or self.words[TSR] >> 8 * n & ABRQ:
                self._complete(n, TERR)
        self._want()

    # Receiving.

    def _receive(self, end: CanEnd) -> None:
        found = self._filtered(end.frame)
        if found is None:
            return
        n, number = found
        fifo, frame = self._fifos[n], end.frame
        identifier = frame.identifier << 3 | IDE if frame.is_extended else frame.identifier << 21
        data = frame.data.ljust(8, b"\0")
        message = _Message((
            identifier | (RTR if frame.is_remote else 0),
            frame.dlc | number << 8 | self._time(end.start_ns) << 16,
            int.from_bytes(data[:4], "little"),
            int.from_bytes(data[4:], "little"),
        ))  # fmt: skip
        if len(fifo) == _FIFO_DEPTH:
            self.words[RF0R + n] |= FOVR
            if self.words[MCR] & RFLM:
                return
            fifo.pop()
        fifo.append(message)
        self.words[RF0R + n] |= FULL if len(fifo) == _FIFO_DEPTH else 0

    def _filtered(self, frame: CanFrame) -> tuple[int, int] | None:
        """Return the FIFO of a frame and the number of the filter that lets it in: RM0008 24.7.4."""
        best: tuple[int, int, int, int] | None = None
        numbers = [0, 0]
        if self.words[FMR] & 1:
            return None
        for bank in range(_BANKS):
            fifo, is_active, is_wide, is_list = (self.words[index] >> bank & 1 for index in (FFA1R, FA1R, FS1R, FM1R))
            one, two = self.words[F0R1 + 2 * bank], self.words[F0R1 + 2 * bank + 1]
            tests = _tests(one, two, is_wide=bool(is_wide), is_list=bool(is_list))
            wanted = _wide_word(frame) if is_wide else _narrow_word(frame)
            for value, mask in tests:
                if is_active and not (wanted ^ value) & mask:
                    rank = (1 - is_wide, 1 - is_list, numbers[fifo], fifo)
                    best = rank if best is None else min(best, rank)
                numbers[fifo] += 1
        return None if best is None else (best[3], best[2])

    def _time(self, at_ns: Nanos) -> int:
        """Return the 16-bit time of TTCM: bits since it left initialisation."""
        if not self.words[MCR] & TTCM:
            return 0
        return int(max(at_ns - self._timer_ns, 0) * self.bit_rate / NS_PER_S) & 0xFFFF

    def _wake(self) -> None:
        """A frame has passed while it slept: with AWUM it leaves sleep."""
        self.words[MSR] |= WKUI
        if self.words[MCR] & AWUM:
            self.words[MCR] &= ~SLEEP
            self._sync_ns = self.chip.now_ns + self._ns_of(_SYNC_BITS)

    # Errors and what is shown of it all.

    def _count_errors(self, code: int) -> None:
        before = self.words[ESR]
        is_off = self._tec >= _OFF
        highest = max(self._tec, self._rec)
        flags = (EWGF if highest >= _WARNING else 0) | (EPVF if highest >= _PASSIVE else 0) | (BOFF if is_off else 0)
        self.words[ESR] = min(self._tec, 255) << 16 | self._rec << 24 | code << 4 | flags
        if is_off and not before & BOFF and self.words[MCR] & ABOM:
            self._recover(self.chip.now_ns)
        enabled = self.words[IER]
        new = flags & ~before
        causes = (EWGIE if new & EWGF else 0) | (EPVIE if new & EPVF else 0) | (BOFIE if new & BOFF else 0)
        if enabled & (causes | (LECIE if code else 0)):
            self.words[MSR] |= ERRI

    def _update(self) -> None:
        words = self.words
        for n, fifo in enumerate(self._fifos):
            words[RF0R + n] = words[RF0R + n] & (FULL | FOVR) | len(fifo)
            if fifo:
                at = RI0R + 4 * n
                for k, word in enumerate(fifo[0].words):
                    words[at + k] = word
        free = [n for n in range(_MAILBOXES) if n not in self._mailboxes]
        flags = words[TSR] & 0xFF_FFFF | sum(_TME << n for n in free)
        last = self._last()
        flags |= 0 if last is None or len(self._mailboxes) < 2 else _LOW_PRIORITY << last
        words[TSR] = flags | (free[0] if free else last or 0) << _CODE_AT
        enabled, status = words[IER], words[MSR]
        received = []
        for n in range(2):
            shift, fifo_status = 3 * n + 1, words[RF0R + n]
            causes = (1 if fifo_status & 3 else 0) | (2 if fifo_status & FULL else 0) | (4 if fifo_status & FOVR else 0)
            received.append(bool(enabled >> shift & causes))
        changed = (status & ERRI and enabled & ERRIE) or (status & WKUI and enabled & WKUIE)
        levels = (
            not status & (INAK | SLAK),
            bool(enabled & TMEIE and words[TSR] & 0x01_0101),
            *received,
            bool(changed or (status & SLAKI and enabled & SLKIE)),
        )
        if levels != self._levels:
            self._levels = levels
            for name, level in zip(_UPDATED, levels, strict=True):
                self.set_output(name, level)

    def _last(self) -> int | None:
        """Return the mailbox that goes last."""
        if not self._mailboxes:
            return None
        if self.words[MCR] & TXFP:
            return max(self._mailboxes, key=lambda n: self._mailboxes[n].order)
        return max(self._mailboxes, key=lambda n: (_rank(self._mailboxes[n].frame), n))

    # Pins.

    def _is_wired(self) -> bool:
        return self.chip.pins[self._pin_names[1]].carries("CAN_TX")

    def _route_changed(self) -> None:
        self._settle()
        self.chip.pins[self._pin_names[1]].disconnect("CAN_TX")
        self.chip.pins[self._pin_names[0]].hold_low(False)
        self._find_pins()
        if self._joined is not None:
            self._pull_up()
        self._connect()

    def _pull_up(self) -> None:
        """Have RX high, as a transceiver has it while nobody sends."""
        rx = self.chip.pins[self._pin_names[0]]
        if rx.board_pull is PinDrive.NONE:
            rx.board_pull = PinDrive.PULL_UP

    def _connect(self) -> None:
        """Offer the pin unless it sleeps, as it does from reset on: chosen (docs/peripherals.md)."""
        pin = self.chip.pins[self._pin_names[1]]
        self._bits.is_offered = not self.words[MSR] & SLAK
        if self.words[MSR] & SLAK:
            pin.disconnect("CAN_TX")
        else:
            pin.connect("CAN_TX", level=bool(self._bits.tx))

    def _find_pins(self) -> None:
        self._pin_names = PINS.get(self.chip.pins.remaps.get("CAN", 0), PINS[0])
        pins = self.chip.pins
        self._bits.rx_pin, self._bits.tx_pin = (pins[name].index for name in self._pin_names)
        self._bits.source = ALTERNATE_FUNCTIONS.index("CAN_TX")

    @property
    def _is_watched(self) -> bool:
        return any(self.chip.pins[name].is_watched for name in self._pin_names)

    def _show(self, now_ns: Nanos) -> None:
        """Begin to show the bits of a frame that begins."""
        start_ns = self.network.start_ns
        is_new = start_ns is not None and start_ns <= now_ns and start_ns != self._bits.shown_ns
        if start_ns is not None and is_new and not self._is_showing and self._is_watched:
            self._put_bits(start_ns)
            self._bits.first = 0
            self.chip.pins.fabric.command(self._bits_slot, _GO_ON)

    @property
    def _is_showing(self) -> bool:
        return bool(self._bits.first < self._bits.count)

    @property
    def _bits_held(self) -> bytes:
        return bytes(self._bits)

    @_bits_held.setter
    def _bits_held(self, held: bytes) -> None:
        ctypes.memmove(ctypes.addressof(self._bits), held, len(held))

    @property
    def _bits_due_ns(self) -> Nanos | None:
        return self.chip.pins.fabric.due(self._bits_slot)

    @_bits_due_ns.setter
    def _bits_due_ns(self, at_ns: Nanos | None) -> None:
        self.chip.pins.fabric.schedule(self._bits_slot, at_ns)

    def _forget_bits(self) -> None:
        """Have no more levels shown of a frame, and none of it again."""
        self._bits.first = self._bits.count = 0
        self._bits.phase, self._bits.shown_ns = _IS_SINGLE, NO_TIME
        self.chip.pins.fabric.command(self._bits_slot, _GO_ON)

    def _put_bits(self, start_ns: Nanos) -> None:
        """Put down the levels of TX and RX in the frame that begins then; none is shown yet."""
        rows, bits = self._rows_of(start_ns), self._bits
        ctypes.memmove(ctypes.addressof(bits.rows), rows, len(rows))
        bits.first = bits.count = len(rows) // EDGE.size
        bits.shown_ns = start_ns

    def _rows_of(self, start_ns: Nanos) -> bytes:
        """Return when the levels of TX and RX change in the frame that begins, as C has it."""
        coming = self.network.coming()
        if coming is None:
            return b""
        sender, frame, error = coming
        acts = _Part.SENDS if sender is self else _Part.ACKNOWLEDGES if self.acknowledges else _Part.LISTENS
        if self.hears_itself:
            acts = _Part.IS_MUTE if self.words[BTR] & SILM else _Part.IS_ALONE
        is_flagged = error is not CanError.NONE and not sender.is_passive
        rate = sender.bit_rate or self.bit_rate
        return _frame_rows(rate, frame, self.offer(start_ns), acts, error is CanError.NONE, is_flagged)

    # A frame that is tried over and over.

    def _repeat(self, end: CanEnd) -> None:
        """Have C repeat the tries of a frame that nobody acknowledges, if this one has left everything as the last."""
        tried = _Tried(end.end_ns - end.start_ns, self._order, tuple(self._mailboxes), self.words[:TI0R].tobytes())
        is_same, self._tried = tried == self._tried, tried
        start_ns = self.network.start_ns
        is_free = self._sync_ns is self._recover_ns is None and not self._sinks and not self._is_showing
        if not is_same or not is_free or start_ns is None or self.network is not self._alone or not self._is_wired():
            return
        bits, shown_ns = self._bits, self._bits.shown_ns
        self._put_bits(start_ns)
        bits.shown_ns, bits.start_ns, bits.phase = shown_ns, start_ns, _TO_START
        bits.decided_ns = (self.network.next_ns or start_ns) - start_ns
        bits.end_ns, bits.period_ns = end.end_ns - end.start_ns, start_ns - end.start_ns
        self.due_ns = None
        self.chip.pins.fabric.command(self._bits_slot, _GO_ON)

    def _settle(self) -> None:
        """Take the tries back, since something acts on CAN: whatever they left, the next may leave something else."""
        self._tried = None
        self._take_back()

    def _take_back(self) -> None:
        """Go on from the tries that C repeats, at the phase that the last of them has come to by now."""
        bits, fabric = self._bits, self.chip.pins.fabric
        if bits.phase == _IS_SINGLE:
            return
        fabric.catch_up(self._bits_slot, self.chip.now_ns)
        phase, start_ns, end_ns = bits.phase, bits.start_ns, bits.start_ns + bits.end_ns
        bits.phase = _IS_SINGLE
        if phase == _IS_SINGLE:  # it has lost its pin by now
            return
        if phase == _TO_END:
            frame = self._mailboxes[self._best(start_ns) or 0].frame
            self._ends.append(CanEnd(start_ns, end_ns, frame, is_own=True, error=CanError.ACKNOWLEDGE))
            self._alone.put(self, None, start_ns + bits.period_ns)
            self.due_ns = end_ns
        else:
            self._alone.put(self, end_ns - bits.period_ns, start_ns)
            self.due_ns = start_ns + (bits.decided_ns if phase == _TO_DECIDE else 0)
        fabric.command(self._bits_slot, _GO_ON)

    def _tries_changed(self, _what: int, _value: int) -> None:
        self._settle()  # it has lost its pin

    def _show_level(self, tx: int, rx: int) -> None:
        self._connect()
        self.fabric.command(self._bits_slot, _SHOW, tx, rx)


for _half in range(2 * _BANKS):
    setattr(Can, f"_write_filter_{_half}", partialmethod(Can._write_filter, _half))  # noqa: SLF001 - it is its own
for _mailbox in range(_MAILBOXES):
    for _word in (1, 2, 3):
        _taken = partialmethod(Can._write_mail, _mailbox, _word)  # noqa: SLF001 - it is its own
        setattr(Can, f"_write_mail_{_mailbox}_{_word}", _taken)


@lru_cache(maxsize=64)  # of frames that are sent or tried again and again
def _frame_rows(
    rate: Fraction, frame: CanFrame, own: CanFrame | None, part: _Part, is_good: bool, is_flagged: bool
) -> bytes:
    """Return the rows of TX and RX of a frame in one of its ends, in ns from its start.

    Args:
        rate: Bits a second.
        frame: What stands on the bus.
        own: What this end offers meanwhile.
        part: What this end does.
        is_good: Whether somebody acknowledges it, or nobody has to.
        is_flagged: Whether an error flag follows.
    """
    bits = frame_bits(frame)
    sent = bits if part is _Part.SENDS else _until_lost(frame_bits(own), bits) if own is not None else []
    # The delimiter of the CRC, the acknowledge, and of an error the flag behind it, unless its sender is passive.
    flag = [0 if is_flagged else 1] * _FLAG_BITS
    own_flag = flag if part in (_Part.SENDS, _Part.ACKNOWLEDGES) else [1] * _FLAG_BITS
    bus = [*bits, 1, 0 if is_good else 1, *flag, 1]
    acknowledge = 0 if part is _Part.ACKNOWLEDGES and is_good else 1
    tx = [*sent, *[1] * (len(bits) - len(sent)), 1, acknowledge, *own_flag, 1]
    if part in (_Part.IS_ALONE, _Part.IS_MUTE):  # RX does not count then, and with SILM nothing goes out
        bus = [1] * len(tx)
        tx = bus if part is _Part.IS_MUTE else [*bits, *[1] * (len(tx) - len(bits))]
    rows, before = bytearray(), (1, 1)
    for n, now in enumerate(zip(tx, bus, strict=True)):
        if now != before:
            rows += EDGE.pack(n * NS_PER_S * rate.denominator // rate.numerator, 0, *now, 0, 0)
        before = now
    return bytes(rows)


@lru_cache(maxsize=64)  # asked for at each of hundreds of steps of a frame
def _bit_rate(pclk1_hz: int, timing: int) -> Fraction:
    """Return bits a second that a clock and a value of BTR make."""
    quanta = 1 + (timing >> 16 & 15) + 1 + (timing >> 20 & 7) + 1
    return Fraction(pclk1_hz, quanta * ((timing & 0x3FF) + 1))


def _until_lost(own: Sequence[int], bits: Sequence[int]) -> list[int]:
    """Return the bits of a frame that has lost against another, up to where it is recessive and the other is not."""
    place = next((n for n, (one, other) in enumerate(zip(own, bits, strict=False)) if one != other), len(own))
    return [*own[:place], 1][: len(bits)]


def _rank(frame: CanFrame) -> tuple[int, int, int, int]:
    """Return what decides between two frames: the base identifier, then standard before extended."""
    base = frame.identifier >> 18 if frame.is_extended else frame.identifier
    return base, int(frame.is_extended), frame.identifier, int(frame.is_remote)


def _wide_word(frame: CanFrame) -> int:
    """Return a frame as a filter of 32 bits sees it."""
    flags = (IDE if frame.is_extended else 0) | (RTR if frame.is_remote else 0)
    return (frame.identifier << 3 if frame.is_extended else frame.identifier << 21) | flags


def _narrow_word(frame: CanFrame) -> int:
    """Return a frame as a filter of 16 bits sees it: STID, RTR, IDE, EXID 17 to 15."""
    base = frame.identifier >> 18 if frame.is_extended else frame.identifier
    high = frame.identifier >> 15 & 7 if frame.is_extended else 0
    return base << 5 | int(frame.is_remote) << 4 | int(frame.is_extended) << 3 | high


def _tests(one: int, two: int, *, is_wide: bool, is_list: bool) -> tuple[tuple[int, int], ...]:
    """Return the filters of a bank as (value, mask), in the order of their numbers: RM0008 figure 230."""
    if is_wide:
        return ((one, 0xFFFF_FFFE), (two, 0xFFFF_FFFE)) if is_list else ((one, two & 0xFFFF_FFFE),)
    halves = (one & 0xFFFF, one >> 16, two & 0xFFFF, two >> 16)
    if is_list:
        return tuple((half, 0xFFFF) for half in halves)
    return (halves[0], halves[1]), (halves[2], halves[3])
