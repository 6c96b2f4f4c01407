"""PWR: which low-power mode SLEEPDEEP means, the wake-up pin, the supply's detector, the lock of the backup domain.

Modelled: CR and CSR, DBP, the PVD with its eight thresholds and their hysteresis (typical values), WKUP on PA0. What a
mode stops and what ends it is `chip.py`'s; LPDS makes the end of Stop slower. Chosen: CWUF and CSBF act at once (two
cycles on silicon); the flags outlive every reset but that of the supply.

Source: RM0008 section 5; thresholds from the data sheet DS5319 table 12.
Invariant: PVDO is 1 exactly while PVDE is set and the supply was last seen below the threshold.
"""

from enum import IntEnum

from bluepill_sim.fabric.pins import PinDrive
from bluepill_sim.fabric.registers import NATIVE, OWN_ANSWERS, Peripheral, Register, indices, masks

#: Fields, from the left.
_CR, _CSR = "DBP 8, PLS 7:5, PVDE 4, CSBF 3, CWUF 2, PDDS 1, LPDS 0", "EWUP 8, PVDO 2, SBF 1, WUF 0"
LPDS, PDDS, CWUF, CSBF, PVDE, DBP, _PLS = masks(_CR, "LPDS PDDS CWUF CSBF PVDE DBP PLS")
_PLS_AT = 5
WUF, SBF, PVDO, EWUP = masks(_CSR, "WUF SBF PVDO EWUP")
#: The lowest threshold for a supply that falls, how far each PLS is above the one before, and how much higher the one
#: for a supply that rises is, in mV.
FALLING_MV, STEP_MV, HYSTERESIS_MV = 2_080, 100, 100
_PORT, _PIN, _OWNER = "A", 0, "WKUP"


class PwrQuestion(IntEnum):
    """What Python is notified of beside what a listener hears."""

    #: DBP has changed.
    BACKUP = OWN_ANSWERS
    #: A write with the supply's detector on, before it or behind it.
    SUPPLY = OWN_ANSWERS + 1
    #: EWUP has changed.
    WAKE_PIN = OWN_ANSWERS + 2


class Pwr(Peripheral):
    """Power control."""

    KIND = "pwr"
    ENUMS = (PwrQuestion,)
    OUTPUTS = ("pvd",)
    INPUTS = ("alarm",)
    SOURCE = "RM0008 5.4"
    REGISTERS = (
        Register(
            name="CR", offset=0x00, readable=LPDS | PDDS | PVDE | _PLS | DBP,
            writable=LPDS | PDDS | CWUF | CSBF | PVDE | _PLS | DBP, on_write=NATIVE,
            fields=_CR,
        ),
        Register(name="CSR", offset=0x04, readable=WUF | SBF | PVDO | EWUP, writable=EWUP, on_write=NATIVE,
            fields=_CSR),
    )  # fmt: skip

    @property
    def stands_by(self) -> bool:
        """Whether SLEEPDEEP means Standby (PDDS)."""
        return bool(self.words[CR] & PDDS)

    @property
    def is_woken(self) -> bool:
        """Whether WUF is set."""
        return bool(self.words[CSR] & WUF)

    @property
    def regulator_is_slow(self) -> bool:
        """Whether the regulator is in low-power mode in Stop (LPDS)."""
        return bool(self.words[CR] & LPDS)

    def note_standby(self) -> None:
        """Set SBF: Standby begins."""
        self.words[CSR] |= SBF

    def forget_flags(self) -> None:
        """Clear WUF and SBF: the supply came up."""
        self.words[CSR] &= ~(WUF | SBF)

    def reset(self) -> None:
        """Go back to the state after a system reset; SBF and WUF stay."""
        flags = self.words[CSR] & (WUF | SBF)
        super().reset()
        self.words[CSR] = flags

    def on_reset(self) -> None:
        """Lock the backup domain, and give up the pin."""
        self.chip.power.is_backup_open = False
        self._place_pin()
        self.supply_changed()

    def supply_changed(self) -> None:
        """Look at the supply."""
        threshold_mv = FALLING_MV + STEP_MV * ((self.words[CR] & _PLS) >> _PLS_AT)
        if self.words[CSR] & PVDO:
            threshold_mv += HYSTERESIS_MV
        is_low = bool(self.words[CR] & PVDE) and self.chip.power.supply_mv < threshold_mv
        self.words[CSR] = self.words[CSR] & ~PVDO | (PVDO if is_low else 0)
        self.set_output("pvd", is_low)

    def line_changed(self, name: str, level: bool) -> None:
        """Take the RTC's alarm for a wake-up event."""
        if name == "alarm" and level:
            self._wake()

    def pins_changed(self) -> None:
        """Take a rising edge of WKUP for a wake-up event."""
        if self.words[CSR] & EWUP and self.chip.pins[f"P{_PORT}{_PIN}"].input:
            self._wake()

    def _restored(self) -> None:
        self._listen()

    def answer(self, what: int, value: int) -> None:
        """Unlock or lock the backup domain, look at the supply, or hear a line or a pin."""
        if what == PwrQuestion.BACKUP:
            self.chip.power.is_backup_open = bool(value)
        elif what == PwrQuestion.SUPPLY:
            self.supply_changed()
        elif what == PwrQuestion.WAKE_PIN:
            self._place_pin()
        else:
            super().answer(what, value)

    def _place_pin(self) -> None:
        """Give PA0 to WKUP, with its pull-down, while EWUP is set (RM0008 5.4.2)."""
        pin = self.chip.pins[f"P{_PORT}{_PIN}"]
        if self.words[CSR] & EWUP:
            pin.hold(_OWNER, PinDrive.PULL_DOWN)
        elif pin.holder == _OWNER:
            pin.release()
        self._listen()
        self.pins_changed()

    def _listen(self) -> None:
        self.listen_to_pins(_PORT, 1 << _PIN if self.words[CSR] & EWUP else 0)

    def _wake(self) -> None:
        self.words[CSR] |= WUF
        self.chip.signal("wake")


CR, CSR = indices(Pwr.REGISTERS, "CR CSR")
