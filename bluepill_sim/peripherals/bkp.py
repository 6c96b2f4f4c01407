"""BKP: ten data registers that VBAT keeps, the tamper pin, and the RTC's output and calibration.

Theory of operation. All but TPIE and TIF belongs to the backup domain: it outlives every reset and Standby, and goes
with a power cut (no battery is on VBAT), with BDRST of RCC_BDCR, or, the data, with a tamper event. An event is an
edge of "PC13 is at the level of TPAL, and TPE is set"; while TEF is set the data registers are held at 0.

Modelled: the above, TPIE and IRQ 2, write protection by PWR_CR DBP, on PC13 the clock / 64 (CCO) and the pulses of
alarm and second (ASOE, ASOS), CAL. Chosen: with TPE the pin is what GPIO has configured, as an input; of TPE, CCO and
ASOE the first that is set has the pin; cycles that CAL takes out are spread evenly.

Source: RM0008 section 6.
Invariant: a data register is 0 while TEF is set.
"""

from bluepill_sim.fabric.pins import PinDrive
from bluepill_sim.fabric.registers import LISTENER, Peripheral, Register, masks
from simbase.timing import NS_PER_S, Nanos

#: Data registers of a medium-density part.
DATA_REGISTERS = range(1, 11)
RTCCR, CR, CSR = 11, 12, 13

#: Fields, from the left.
_RTCCR, _CR = "ASOS 9, ASOE 8, CCO 7, CAL 6:0", "TPAL 1, TPE 0"
_CSR = "TIF 9, TEF 8, TPIE 2, CTI 1, CTE 0"
CAL, CCO, ASOE, ASOS = masks(_RTCCR, "CAL CCO ASOE ASOS")
TPE, TPAL = masks(_CR, "TPE TPAL")
CTE, CTI, TPIE, TEF, TIF = masks(_CSR, "CTE CTI TPIE TEF TIF")
_PORT, _PIN, _OWNER = "C", 13, "RTC output"
#: CCO changes the pin after so many cycles of RTCCLK.
_HALF_PERIOD = 32


class Bkp(Peripheral):
    """Backup registers."""

    KIND = LISTENER
    STATE = ("_was_active", "_base_ns", "_edges", "_rtcclk_hz")
    OUTPUTS = ("irq",)
    INPUTS = ("second", "alarm")
    SOURCE = "RM0008 6.4"
    REGISTERS = (
        *(
            Register(
                name=f"DR{n}",
                offset=4 * n,
                on_write="_write_data",
                fields="D 15:0",
            )
            for n in DATA_REGISTERS
        ),
        Register(
            name="RTCCR",
            offset=4 * RTCCR,
            on_write="_write_rtccr",
            fields=_RTCCR,
        ),
        Register(
            name="CR",
            offset=4 * CR,
            on_write="_write_cr",
            fields=_CR,
        ),
        Register(
            name="CSR",
            offset=4 * CSR,
            readable=TPIE | TEF | TIF,
            writable=TPIE,
            triggers=CTE | CTI,
            on_write="_write_csr",
            fields=_CSR,
        ),
    )
    #: Whether TPE was set and the pin at the level of TPAL.
    _was_active = False
    #: CCO: when the first of its edges came, how many there were since, and at which RTCCLK.
    _base_ns: Nanos = 0
    _edges = 0
    _rtcclk_hz = 0

    def write(self, offset: int, size: int, value: int) -> None:
        """Take what the bus writes, where PWR_CR DBP allows it."""
        if self.chip.power.is_backup_open:
            super().write(offset, size, value)
        else:
            self.chip.warn("BKP: written while PWR_CR DBP is 0: ignored", once="BKP:dbp")

    def reset(self) -> None:
        """Go back to the state after a system reset: only TPIE and TIF belong to it."""
        kept = self.words[:]
        cco_ns = self.due_ns
        super().reset()
        self.words[:] = kept
        self.words[CSR] &= TEF
        self.due_ns = cco_ns
        self._update_irq()

    def backup_reset(self) -> None:
        """Forget everything."""
        for index in (*DATA_REGISTERS, RTCCR, CR, CSR):
            self.words[index] = 0
        self._was_active = False
        self._update_irq()
        self._calibrate()
        self._place_pin()

    def advance_to(self, now_ns: Nanos) -> None:
        """Make the edges of CCO that are due."""
        while self.due_ns is not None and self.due_ns <= now_ns:
            self._edges += 1
            self._show(bool(self._edges & 1))
            self.due_ns = self._edge_ns(self._edges + 1)

    def clock_changed(self) -> None:
        """Put out the clock that is RTCCLK now."""
        if self.chip.clocks.rtcclk_hz != self._rtcclk_hz:
            self._place_pin()

    def line_changed(self, name: str, level: bool) -> None:
        """Show the pulse of the RTC that is chosen."""
        if self._output() == ASOE and name == ("second" if self.words[RTCCR] & ASOS else "alarm"):
            self._show(level)

    def pins_changed(self) -> None:
        """Look for a tamper event."""
        control = self.words[CR]
        is_active = bool(control & TPE) and self.chip.pins[f"P{_PORT}{_PIN}"].input is not bool(control & TPAL)
        was_active, self._was_active = self._was_active, is_active
        if is_active and not was_active:
            self.words[CSR] |= TEF | (TIF if self.words[CSR] & TPIE else 0)
            self._clear_data()
            self._update_irq()

    def _restored(self) -> None:
        self._listen()

    def _write_data(self, _written: int, _previous: int) -> None:
        if self.words[CSR] & TEF:
            self._clear_data()

    def _write_rtccr(self, written: int, previous: int) -> None:
        self._calibrate()
        if (previous ^ written) & (CCO | ASOE | ASOS):
            self._place_pin()

    def _write_cr(self, written: int, previous: int) -> None:
        if (previous ^ written) & TPE:
            self._listen()
            self._place_pin()
        self.pins_changed()

    def _write_csr(self, written: int, _previous: int) -> None:
        self.words[CSR] &= ~((TEF if written & CTE else 0) | (TIF if written & CTI else 0))
        self._update_irq()

    def _clear_data(self) -> None:
        for index in DATA_REGISTERS:
            self.words[index] = 0

    def _update_irq(self) -> None:
        self.set_output("irq", bool(self.words[CSR] & TIF and self.words[CSR] & TPIE))

    def _calibrate(self) -> None:
        """Publish CAL, and whether somebody sees the RTC's seconds."""
        clocks, control = self.chip.clocks, self.words[RTCCR]
        wanted = control & CAL, bool(control & ASOE and control & ASOS)
        if (clocks.rtc_calibration, clocks.rtc_seconds_shown) != wanted:
            clocks.rtc_calibration, clocks.rtc_seconds_shown = wanted
            self.chip.clock_changed()

    # The pin.

    def _output(self) -> int:
        """Return which output has the pin: CCO, ASOE, or 0."""
        control = self.words[RTCCR]
        return 0 if self.words[CR] & TPE else control & CCO or control & ASOE

    def _place_pin(self) -> None:
        self.due_ns = None
        self._rtcclk_hz = self.chip.clocks.rtcclk_hz
        output = self._output()
        pin = self.chip.pins[f"P{_PORT}{_PIN}"]
        if output:
            self._show(False)
        elif pin.holder == _OWNER:
            pin.release()
        if output == CCO and self._rtcclk_hz:
            self._base_ns, self._edges = self.chip.now_ns, 0
            self.due_ns = self._edge_ns(1)

    def _edge_ns(self, number: int) -> Nanos:
        return self._base_ns - (-number * _HALF_PERIOD * NS_PER_S // self._rtcclk_hz)

    def _show(self, level: bool) -> None:
        self.chip.pins[f"P{_PORT}{_PIN}"].hold(_OWNER, PinDrive.HIGH if level else PinDrive.LOW)

    def _listen(self) -> None:
        self.listen_to_pins(_PORT, 1 << _PIN if self.words[CR] & TPE else 0)
