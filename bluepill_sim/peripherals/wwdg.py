"""WWDG: the window watchdog, which resets the chip when it is fed too late or too early.

Modelled: the counter from PCLK1 / 4096 with its four prescalers, the window,
the reset as T6 falls, the early wake-up interrupt (IRQ 0). Not modelled: the
phase of the divider (a count begins anew with each write of CR or CFR and with
each change of PCLK1), counting before it is activated, a clock gate that stops
it.

Source: RM0008 section 20.
Invariant: while it is active, `due_ns` is the earlier of the early wake-up and the reset.
"""

from bluepill_sim.fabric.registers import Peripheral, Register, indices, masks
from simbase.timing import NS_PER_S, Nanos

#: Fields, from the left.
_CR, _CFR, _SR = "WDGA 7, T 6:0", "EWI 9, WDGTB 8:7, W 6:0", "EWIF 0"
(WDGA, _T), T6 = masks(_CR, "WDGA T"), 1 << 6
(EWI,), (EWIF,) = masks(_CFR, "EWI"), masks(_SR, "EWIF")
#: PCLK1 is divided by this before the prescaler.
_DIVIDER = 4096


class Wwdg(Peripheral):
    """The window watchdog."""

    STATE = ("_base_ns", "_base_count", "_pclk1_hz")
    OUTPUTS = ("irq",)
    SOURCE = "RM0008 20.6"
    REGISTERS = (
        Register(
            name="CR", offset=0x00, reset=_T, on_read="_read_cr",
            on_write="_write_cr", fields=_CR,
        ),
        Register(
            name="CFR", offset=0x04, reset=_T, on_write="_write_cfr",
            fields=_CFR,
        ),
        Register(
            name="SR", offset=0x08, readable=EWIF, writable=0, write_zero_to_clear=EWIF, on_write="_write_sr",
            fields=_SR,
        ),
    )  # fmt: skip
    #: The counter held `_base_count` from `_base_ns` on, and counts at this PCLK1.
    _base_ns: Nanos = 0
    _base_count = _T
    _pclk1_hz = 0

    @property
    def is_running(self) -> bool:
        """Whether it has been activated."""
        return bool(self.words[CR] & WDGA)

    def advance_to(self, now_ns: Nanos) -> None:
        """Warn early, and reset the chip when the time is up."""
        while self.due_ns is not None and self.due_ns <= now_ns:
            at_ns = self.due_ns
            if self._count_at(at_ns) & T6:
                self.words[SR] |= EWIF
                self._update_irq()
                self.due_ns = self._time_of(T6 - 1)
            else:
                self.due_ns = None
                self.chip.watchdog_expired(self.name)

    def clock_changed(self) -> None:
        """Go on at the new PCLK1."""
        if self.is_running and self.chip.clocks.pclk1_hz != self._pclk1_hz:
            self._count_from(self._count_at(self.chip.now_ns))

    def clock_stopped(self) -> None:
        """Stand still."""
        self.due_ns = None

    def clock_resumed(self, stopped_ns: Nanos) -> None:
        """Go on."""
        self._base_ns += stopped_ns
        if self.is_running:
            count = self._count_at(self.chip.now_ns)
            self.due_ns = self._time_of(T6 if count > T6 else T6 - 1)

    def on_reset(self) -> None:
        """Stop."""
        self._base_ns, self._base_count, self._pclk1_hz = 0, _T, 0
        self.set_output("irq", False)

    def _read_cr(self) -> int:
        return WDGA | self._count_at(self.chip.now_ns) if self.is_running else self.words[CR]

    def _write_cr(self, written: int, previous: int) -> None:
        was_running = bool(previous & WDGA)
        if was_running:
            self.words[CR] |= WDGA
        too_early = was_running and self._count_at(self.chip.now_ns) > self.words[CFR] & _T
        if not self.is_running:
            return
        self._count_from(written & _T)
        if too_early or not written & T6:
            self.due_ns = None
            self.chip.watchdog_expired(self.name)

    def _write_cfr(self, _written: int, previous: int) -> None:
        if previous & EWI:
            self.words[CFR] |= EWI
        if self.is_running:
            self._count_from(self._count_at(self.chip.now_ns, previous))
        self._update_irq()

    def _write_sr(self, _written: int, _previous: int) -> None:
        self._update_irq()

    def _update_irq(self) -> None:
        self.set_output("irq", bool(self.words[SR] & EWIF and self.words[CFR] & EWI))

    def _divider(self, configuration: int) -> int:
        return _DIVIDER << (configuration >> 7 & 3)

    def _count_at(self, at_ns: Nanos, configuration: int | None = None) -> int:
        divider = self._divider(self.words[CFR] if configuration is None else configuration)
        counts = (at_ns - self._base_ns) * self._pclk1_hz // (NS_PER_S * divider)
        return (self._base_count - counts) & _T

    def _time_of(self, count: int) -> Nanos:
        """Return when the counter comes to a lower value: the first nanosecond of it."""
        cycles = (self._base_count - count) * self._divider(self.words[CFR])
        return self._base_ns - (-cycles * NS_PER_S // self._pclk1_hz)

    def _count_from(self, count: int) -> None:
        self._base_ns, self._base_count = self.chip.now_ns, count
        self._pclk1_hz = self.chip.clocks.pclk1_hz
        self.due_ns = self._time_of(T6 if count > T6 else T6 - 1) if count & T6 else None


CR, CFR, SR = indices(Wwdg.REGISTERS, "CR CFR SR")
