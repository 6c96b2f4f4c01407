"""RTC: a counter of seconds that VBAT and a crystal of its own keep going.

Theory of operation. Cycles of RTCCLK run the divider down from PRL to 0; the cycle after that it starts anew and the
counter goes up. Both follow from the time: cycles are counted from `_origin_ns`, and in cycle `_base_cycle` they held
`_base_div` and `_base_count`. In the last cycle of a second (DIV = 0) SECF rises, and with it ALRF where the counter
is at ALR, OWF where it is at its end. An event comes for a flag that is 0, since one that is set cannot rise, and for
the alarm, which EXTI line 17 hears.

Writes of PRL, CNT and ALR are kept while CNF is set, and go to the core of the RTC three cycles of RTCCLK after CNF is
cleared, at the beginning of one; until then RTOFF is 0. RSF rises with the next cycle. After a reset CNT and DIV read 0
up to then (RM0008 18.3.3).

Modelled: the above, IRQ 3, the clocks LSE, LSI and HSE / 128, calibration by BKP, PWR_CR DBP. Chosen: a new PRL is in
effect when DIV next starts anew, a write of CNT leaves DIV alone; ALR reads as written, since ST's HAL reads it, PRL
reads 0; a write of PRL, CNT or ALR outside configuration, or of CNF while RTOFF is 0, is ignored and warned of; what
is written takes effect before the flags of that cycle; a change of RTCCLK begins a cycle. Not modelled: that CNT and
DIV are old after Stop until RSF has risen.

Source: RM0008 section 18.
Invariant: counter and divider never depend on who looked at them.
"""

from functools import partialmethod

from bluepill_sim.fabric.ports import ChipPorts
from bluepill_sim.fabric.registers import WORD, Peripheral, PeripheralMapping, Register, bits, masks
from simbase.timing import NS_PER_S, Nanos

CRH, CRL, PRLH, PRLL, DIVH, DIVL, CNTH, CNTL, ALRH, ALRL = range(10)

#: Fields of CRL, from the left.
_CRL = "RTOFF 5, CNF 4, RSF 3, OWF 2, ALRF 1, SECF 0"
SECF, ALRF, OWF, RSF, CNF, RTOFF = masks(_CRL, "SECF ALRF OWF RSF CNF RTOFF")
_INTERRUPTS = SECF | ALRF | OWF
_HALFWORD = bits((15, 0))
_PRLH_BITS = bits((3, 0))
#: Reset values of PRL and of ALR (RM0008 18.4.3, 18.4.6).
PRESCALER, ALARM = 0x8000, WORD
#: A write takes so many cycles of RTCCLK (RM0008 18.3.4).
WRITE_CYCLES = 3
#: Cycles of RTCCLK of which calibration takes some (RM0008 6.4.2).
CALIBRATED_CYCLES = 1 << 20
#: What comes later than a queue of nanoseconds in 64 bits holds does not come.
_NEVER_NS = 1 << 62


class Rtc(Peripheral):
    """The real-time clock."""

    STATE = (
        "_origin_ns", "_base_cycle", "_base_div", "_base_count", "_prescaler", "_alarm", "_clock",
        "_staged", "_written_ns", "_cleared_ns", "_is_stale", "_pulse_end_ns",
    )  # fmt: skip
    OUTPUTS = ("irq", "alarm", "second")
    SOURCE = "RM0008 18.4"
    REGISTERS = (
        Register(
            name="CRH",
            offset=0x00,
            mask=_INTERRUPTS,
            on_write="_write_crh",
            fields="OWIE 2, ALRIE 1, SECIE 0",
        ),
        Register(
            name="CRL",
            offset=0x04,
            reset=RTOFF,
            readable=bits((5, 0)),
            writable=CNF,
            write_zero_to_clear=_INTERRUPTS | RSF,
            on_write="_write_crl",
            fields=_CRL,
        ),
        Register(name="PRLH", offset=0x08, readable=0, writable=_PRLH_BITS, on_write="_write_prlh", fields="PRL 3:0"),
        Register(name="PRLL", offset=0x0C, readable=0, writable=_HALFWORD, on_write="_write_prll", fields="PRL 15:0"),
        Register(name="DIVH", offset=0x10, readable=_PRLH_BITS, writable=0, on_read="_read_divh", fields="RTC_DIV 3:0"),
        Register(name="DIVL", offset=0x14, readable=_HALFWORD, writable=0, on_read="_read_divl", fields="RTC_DIV 15:0"),
        Register(
            name="CNTH",
            offset=0x18,
            readable=_HALFWORD,
            on_read="_read_cnth",
            on_write="_write_cnth",
            fields="RTC_CNT 15:0",
        ),
        Register(
            name="CNTL",
            offset=0x1C,
            readable=_HALFWORD,
            on_read="_read_cntl",
            on_write="_write_cntl",
            fields="RTC_CNT 15:0",
        ),
        Register(
            name="ALRH",
            offset=0x20,
            readable=_HALFWORD,
            on_read="_read_alrh",
            on_write="_write_alrh",
            fields="RTC_ALR 15:0",
        ),
        Register(
            name="ALRL",
            offset=0x24,
            readable=_HALFWORD,
            on_read="_read_alrl",
            on_write="_write_alrl",
            fields="RTC_ALR 15:0",
        ),
    )

    def __init__(self, chip: ChipPorts, place: PeripheralMapping) -> None:
        super().__init__(chip, place)
        #: When cycle 0 of RTCCLK began, and the cycle in which divider and counter held these.
        self._origin_ns: Nanos = 0
        self._base_cycle = 0
        self._base_div, self._base_count = PRESCALER, 0
        self._prescaler, self._alarm = PRESCALER, ALARM
        #: RTCCLK in Hz and how many of its cycles calibration takes.
        self._clock = (0, 0)
        #: What is written in configuration, by index of the register.
        self._staged: dict[int, int] = {}
        #: When CNF was cleared, and when RSF was, while what follows is under way.
        self._written_ns: Nanos | None = None
        self._cleared_ns: Nanos | None = 0
        #: Whether the bus does not see counter and divider yet.
        self._is_stale = False
        #: When the outputs of alarm and second fall.
        self._pulse_end_ns: Nanos | None = None

    @property
    def has_alarm(self) -> bool:
        """Whether ALRF is set."""
        return bool(self.words[CRL] & ALRF)

    def write(self, offset: int, size: int, value: int) -> None:
        """Take what the bus writes, where PWR_CR DBP allows it."""
        if self.chip.power.is_backup_open:
            super().write(offset, size, value)
        else:
            self.chip.warn("RTC: written while PWR_CR DBP is 0: ignored", once="RTC:dbp")

    def reset(self) -> None:
        """Go back to the state after a system reset: CRH and CRL; all else belongs to the backup domain."""
        pulse_end_ns = self._pulse_end_ns
        if self.words[CRL] & CNF:
            self._staged.clear()
        super().reset()
        if self._written_ns is not None:
            self.words[CRL] &= ~RTOFF
        self._pulse_end_ns = pulse_end_ns
        self._cleared_ns, self._is_stale = self.chip.now_ns if self._clock[0] else 0, True
        self._update_irq()
        self._schedule(self.chip.now_ns)

    def backup_reset(self) -> None:
        """Forget the time."""
        self._base_cycle, self._base_div, self._base_count = self._cycle(self.chip.now_ns), PRESCALER, 0
        self._prescaler, self._alarm = PRESCALER, ALARM
        self._staged.clear()
        self._written_ns = None
        self.words[CRL] |= RTOFF
        self._schedule(self.chip.now_ns)

    def clock_changed(self) -> None:
        """Go on at the RTCCLK that is now."""
        now_ns = self.chip.now_ns
        clock = self.chip.clocks.rtcclk_hz, self.chip.clocks.rtc_calibration
        if clock != self._clock:
            self.advance_to(now_ns)
            self._base_div, self._base_count = self._at(now_ns)
            self._origin_ns, self._base_cycle, self._clock = now_ns if clock[0] else 0, 0, clock
            self._written_ns = None if self._written_ns is None else now_ns
            self._cleared_ns = None if self._cleared_ns is None else now_ns
        self._schedule(now_ns)

    def advance_to(self, now_ns: Nanos) -> None:
        """Do what is due: take what was written, raise flags, end pulses."""
        while self.due_ns is not None and self.due_ns <= now_ns:
            at_ns = self.due_ns
            if at_ns == self._pulse_end_ns:
                self._pulse_end_ns = None
                self.set_output("alarm", False)
                self.set_output("second", False)
            if at_ns == self._write_done_ns():
                self._take_written(at_ns)
            if at_ns == self._synchronized_ns():
                self.words[CRL] |= RSF
                self._cleared_ns, self._is_stale = None, False
            if self._clock[0] and self._begins(self._cycle(at_ns)) == at_ns:
                self._raise_flags(at_ns)
            self._schedule(at_ns)

    def _raise_flags(self, at_ns: Nanos) -> None:
        div, count = self._at(at_ns)
        if div:
            return
        self.words[CRL] |= SECF | (ALRF if count == self._alarm else 0) | (OWF if count == WORD else 0)
        self._update_irq()
        if self.chip.clocks.rtc_seconds_shown:
            self._pulse_end_ns = self._begins(self._cycle(at_ns) + 1)
            self.set_output("second", True)
        if count == self._alarm:
            self._pulse_end_ns = self._begins(self._cycle(at_ns) + 1)
            self.set_output("alarm", True)

    # Registers.

    def _write_crh(self, _written: int, _previous: int) -> None:
        self._update_irq()

    def _write_crl(self, written: int, previous: int) -> None:
        now_ns = self.chip.now_ns
        if written & CNF and not previous & (CNF | RTOFF):
            self.words[CRL] &= ~CNF
            self.chip.warn("RTC_CRL: CNF set while RTOFF is 0: ignored", once="RTC:rtoff")
        elif previous & CNF and not written & CNF:
            self.words[CRL] &= ~RTOFF
            self._written_ns = now_ns
        if not self.words[CRL] & RSF and self._cleared_ns is None:
            self._cleared_ns = now_ns
        self._update_irq()
        self._schedule(now_ns)

    def _stage(self, index: int, written: int, _previous: int) -> None:
        """Keep what is written to PRL, CNT or ALR."""
        if self.words[CRL] & CNF:
            self._staged[index] = written & (_PRLH_BITS if index == PRLH else _HALFWORD)
        else:
            name = self.REGISTERS[index].name
            self.chip.warn(f"RTC_{name}: written without RTC_CRL CNF: ignored", once="RTC:cnf")

    _write_prlh = partialmethod(_stage, PRLH)
    _write_prll = partialmethod(_stage, PRLL)
    _write_cnth = partialmethod(_stage, CNTH)
    _write_cntl = partialmethod(_stage, CNTL)
    _write_alrh = partialmethod(_stage, ALRH)
    _write_alrl = partialmethod(_stage, ALRL)

    def _seen(self, which: int, shift: int) -> int:
        """Return half of what the bus sees of DIV (0) or CNT (1)."""
        return 0 if self._is_stale and self._clock[0] else self._at(self.chip.now_ns)[which] >> shift & _HALFWORD

    _read_divh = partialmethod(_seen, 0, 16)
    _read_divl = partialmethod(_seen, 0, 0)
    _read_cnth = partialmethod(_seen, 1, 16)
    _read_cntl = partialmethod(_seen, 1, 0)

    def _read_alrh(self) -> int:
        return self._staged.get(ALRH, self._alarm >> 16)

    def _read_alrl(self) -> int:
        return self._staged.get(ALRL, self._alarm & _HALFWORD)

    def _take_written(self, at_ns: Nanos) -> None:
        div, count = self._at(at_ns)
        self._prescaler = self._merged(PRLH, self._prescaler)
        self._alarm = self._merged(ALRH, self._alarm)
        self._base_cycle, self._base_div, self._base_count = self._cycle(at_ns), div, self._merged(CNTH, count)
        self._staged.clear()
        self._written_ns = None
        self.words[CRL] |= RTOFF

    def _merged(self, high: int, present: int) -> int:
        """Return a value with the halves that were written; that of the lower one stands behind the upper."""
        upper = self._staged.get(high, present >> 16)
        return upper << 16 | self._staged.get(high + 1, present & _HALFWORD)

    def _update_irq(self) -> None:
        self.set_output("irq", bool(self.words[CRH] & self.words[CRL] & _INTERRUPTS))

    # Time.

    def _cycle(self, at_ns: Nanos) -> int:
        """Return which cycle of RTCCLK runs at a time."""
        hz, lost = self._clock
        return (at_ns - self._origin_ns) * hz * (CALIBRATED_CYCLES - lost) // (NS_PER_S * CALIBRATED_CYCLES)

    def _begins(self, cycle: int) -> Nanos:
        """Return the first nanosecond of a cycle; only while there is a clock."""
        hz, lost = self._clock
        return self._origin_ns - (-cycle * NS_PER_S * CALIBRATED_CYCLES // (hz * (CALIBRATED_CYCLES - lost)))

    def _at(self, at_ns: Nanos) -> tuple[int, int]:
        """Return divider and counter at a time."""
        past = self._cycle(at_ns) - self._base_cycle - self._base_div - 1
        if past < 0:
            return -past - 1, self._base_count
        seconds, rest = divmod(past, self._prescaler + 1)
        return self._prescaler - rest, (self._base_count + 1 + seconds) & WORD

    def _second_after(self, at_ns: Nanos) -> int:
        """Return which second, counted from the base, is the first whose last cycle begins after a time."""
        past = self._cycle(at_ns) - self._base_cycle - self._base_div
        return 0 if past < 0 else past // (self._prescaler + 1) + 1

    def _write_done_ns(self) -> Nanos | None:
        if self._written_ns is None or not self._clock[0]:
            return None
        first = self._cycle(self._written_ns)
        is_begin = self._begins(first) == self._written_ns
        return self._begins(first + WRITE_CYCLES + (not is_begin))

    def _synchronized_ns(self) -> Nanos | None:
        if self._cleared_ns is None or not self._clock[0]:
            return None
        return self._begins(self._cycle(self._cleared_ns) + 1)

    def _schedule(self, now_ns: Nanos) -> None:
        """Work out when something is next due after a time."""
        times = [self._write_done_ns(), self._synchronized_ns(), self._pulse_end_ns]
        if self._clock[0]:
            first, flags = self._second_after(now_ns), self.words[CRL]
            seconds = [first + (self._alarm - self._base_count - first & WORD)]
            if not flags & SECF or self.chip.clocks.rtc_seconds_shown:
                seconds.append(first)
            if not flags & OWF:
                seconds.append(first + (WORD - self._base_count - first & WORD))
            times += [self._begins(self._base_cycle + self._base_div + min(seconds) * (self._prescaler + 1))]
        due_ns = min((at for at in times if at is not None and at < _NEVER_NS), default=None)
        if due_ns != self.due_ns:
            self.due_ns = due_ns
