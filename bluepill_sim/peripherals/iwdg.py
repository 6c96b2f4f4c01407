"""IWDG: the independent watchdog, which resets the chip unless it is fed in time.

Modelled: the three keys, every prescaler and reload value, the flags of an
update that is under way, a counter that only a reset stops. It counts in sleep
too, and whatever the core does, a lockup included; it may start with the chip
(option byte), and keeps LSI on, which RCC_CSR shows.

Source: RM0008 section 19; LSI from the data sheet DS5319 table 25 (40 kHz typical, 30 to 60).
Invariant: while it runs, `due_ns` is when the chip is reset.
"""

from bluepill_sim.fabric.clocks import LSI_HZ
from bluepill_sim.fabric.registers import Peripheral, Register, masks
from simbase.timing import NS_PER_S, Nanos

KR, PR, RLR, SR = range(4)

START, FEED, UNLOCK = 0xCCCC, 0xAAAA, 0x5555
#: RM0008 19.4.2: an update takes up to five cycles of LSI.
UPDATE_CYCLES = 5
_SR = "RVU 1, PVU 0"
_PVU, _RVU = masks(_SR, "PVU RVU")
#: Divider of LSI by PR.
DIVIDERS = (4, 8, 16, 32, 64, 128, 256, 256)
_COUNTS = 0xFFF


class Iwdg(Peripheral):
    """The independent watchdog."""

    STATE = ("_is_running", "_is_unlocked", "_base_ns", "_base_count", "_lsi_hz", "_updated_ns")
    OUTPUTS = ("lsi",)
    SOURCE = "RM0008 19.4"
    REGISTERS = (
        Register(name="KR", offset=0x00, readable=0, on_write="_write_kr"),
        Register(
            name="PR", offset=0x04, on_write="_write_pr", fields="PR 2:0"
        ),
        Register(
            name="RLR", offset=0x08, reset=_COUNTS, on_write="_write_rlr",
            fields="RL 11:0",
        ),
        Register(name="SR", offset=0x0C, readable=_PVU | _RVU, writable=0, on_read="_read_sr", fields=_SR),
    )  # fmt: skip
    _is_running = False
    _is_unlocked = False
    #: The counter held `_base_count` from `_base_ns` on.
    _base_ns: Nanos = 0
    _base_count = _COUNTS
    _lsi_hz = LSI_HZ
    #: When the last writes of PR and of RLR are done.
    _updated_ns: tuple[Nanos, Nanos] = (0, 0)

    @property
    def is_running(self) -> bool:
        """Whether it has been started."""
        return self._is_running

    def advance_to(self, now_ns: Nanos) -> None:
        """Reset the chip when the time is up."""
        if self.due_ns is not None and self.due_ns <= now_ns:
            self.due_ns = None
            self.chip.watchdog_expired(self.name)

    def clock_changed(self) -> None:
        """Go on at the LSI that is now."""
        if self._is_running and self.chip.clocks.lsi_hz != self._lsi_hz:
            self._count_from(self._count(DIVIDERS[self.words[PR]]))

    def freeze(self) -> None:
        """Stand still."""
        self.due_ns = None

    def thaw(self, frozen_ns: Nanos) -> None:
        """Go on."""
        if self._is_running:
            self._base_ns += frozen_ns
            self.due_ns = self._expiry_ns()

    def on_reset(self) -> None:
        """Stop, or start where the option bytes say so."""
        self._is_running = self._is_unlocked = False
        self._base_count = _COUNTS
        self._updated_ns = (0, 0)
        self.set_output("lsi", False)
        if self.chip.power.starts_watchdog:
            self._start()

    def _write_kr(self, written: int, _previous: int) -> None:
        key = written & 0xFFFF
        self._is_unlocked = key == UNLOCK
        if key == START and not self._is_running:
            self._start()
        elif key == FEED and self._is_running:
            self._count_from(self.words[RLR])
        elif key not in {START, FEED, UNLOCK}:
            self.chip.warn(f"IWDG_KR: {key:#06x} is no key", once="IWDG:key")

    def _start(self) -> None:
        self._is_running = True
        self._count_from(_COUNTS)
        self.set_output("lsi", True)

    def _write_pr(self, _written: int, previous: int) -> None:
        count = self._count(DIVIDERS[previous])
        if self._may_update(PR, previous) and self._is_running:
            self._count_from(count)

    def _write_rlr(self, _written: int, previous: int) -> None:
        self._may_update(RLR, previous)

    def _read_sr(self) -> int:
        prescaler_ns, reload_ns = self._updated_ns
        now = self.chip.now_ns
        return (_PVU if now < prescaler_ns else 0) | (_RVU if now < reload_ns else 0)

    def _may_update(self, register: int, previous: int) -> bool:
        """Take a write of PR or RLR, or undo it where it is locked or the last one is still under way."""
        flag = _PVU if register == PR else _RVU
        if not self._is_unlocked or self._read_sr() & flag:
            self.words[register] = previous
            why = "locked" if not self._is_unlocked else "written while the last update is under way"
            self.chip.warn(f"IWDG_{self.REGISTERS[register].name}: {why}: ignored", once=f"IWDG:{register}:{why}")
            return False
        done = self.chip.now_ns - (-UPDATE_CYCLES * NS_PER_S // self.chip.clocks.lsi_hz)
        self._updated_ns = (done, self._updated_ns[1]) if register == PR else (self._updated_ns[0], done)
        return True

    def _count(self, divider: int) -> int:
        return max(0, self._base_count - (self.chip.now_ns - self._base_ns) * self._lsi_hz // (divider * NS_PER_S))

    def _count_from(self, count: int) -> None:
        self._base_ns, self._base_count, self._lsi_hz = self.chip.now_ns, count, self.chip.clocks.lsi_hz
        self.due_ns = self._expiry_ns()

    def _expiry_ns(self) -> Nanos:
        return self._base_ns - (-(self._base_count + 1) * DIVIDERS[self.words[PR]] * NS_PER_S // self._lsi_hz)
