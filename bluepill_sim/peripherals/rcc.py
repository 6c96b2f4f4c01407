"""RCC: oscillators, PLL, clock tree, clock gates and reset flags.

Modelled: every multiplier and divider, ready flags after typical start-up
times, the RM's rules of what may not be changed while in use, a switch of
SYSCLK that waits until its source is ready, ready interrupts, peripheral
reset, reset causes; HSI trimming (40 kHz a step), MCO on PA8, LSI that IWDG
keeps on, BDCR that PWR_CR DBP protects; a crystal that fails, and the clock
security system, which then takes HSI and raises NMI until CSSC. Chosen: NMI
comes again a microsecond after its handler has returned with CSSF set; LSION
reads 1 while IWDG keeps LSI on; without CSS a crystal that fails under SYSCLK
stops the core until a reset.

Oscillators, PLL, SYSCLK, dividers, gates and resets are `source/devices/rcc.c`.

Source: RM0008 section 7; start-up times from the data sheet DS5319 section 5.3.6 to 5.3.8.
"""

import ctypes
from collections.abc import Callable, Mapping
from enum import Enum, IntEnum

from bluepill_sim.extension.layout import RCC
from bluepill_sim.extension.windows import NO_TIME
from bluepill_sim.fabric.clocks import CRYSTAL_HZ, HSI_HZ, LEAST_LSI_HZ, LSE_HZ, MOST_LSI_HZ, illegal_settings
from bluepill_sim.fabric.fabric import OWN_COMMANDS
from bluepill_sim.fabric.ports import ChipPorts
from bluepill_sim.fabric.registers import (
    NATIVE,
    OWN_ANSWERS,
    ClockBit,
    Peripheral,
    PeripheralMapping,
    Register,
    bits,
    indices,
    masks,
)

#: Fields of the registers, from the left.
_CR = "PLLRDY 25, PLLON 24, CSSON 19, HSEBYP 18, HSERDY 17, HSEON 16, HSICAL 15:8, HSITRIM 7:3, HSIRDY 1, HSION 0"
_CFGR = (
    "MCO 26:24, USBPRE 22, PLLMUL 21:18, PLLXTPRE 17, PLLSRC 16, ADCPRE 15:14, PPRE2 13:11, PPRE1 10:8, HPRE 7:4, "
    "SWS 3:2, SW 1:0"
)
_CIR = (
    "CSSC 23, PLLRDYC 20, HSERDYC 19, HSIRDYC 18, LSERDYC 17, LSIRDYC 16, "
    "PLLRDYIE 12, HSERDYIE 11, HSIRDYIE 10, LSERDYIE 9, LSIRDYIE 8, CSSF 7, "
    "PLLRDYF 4, HSERDYF 3, HSIRDYF 2, LSERDYF 1, LSIRDYF 0"
)
#: Those of the enable registers, by the peripheral that each clocks; the reset registers have the same.
_APB2 = "USART1 14, SPI1 12, TIM1 11, ADC2 10, ADC1 9, IOPE 6, IOPD 5, IOPC 4, IOPB 3, IOPA 2, AFIO 0"
_APB1 = (
    "PWR 28, BKP 27, CAN 25, USB 23, I2C2 22, I2C1 21, USART3 18, USART2 17, SPI2 14, WWDG 11, TIM4 2, TIM3 1, TIM2 0"
)
_AHB = "CRC 6, FLITF 4, SRAM 2, DMA1 0"
_BDCR = "BDRST 16, RTCEN 15, RTCSEL 9:8, LSEBYP 2, LSERDY 1, LSEON 0"
_CSR = "LPWRRSTF 31, WWDGRSTF 30, IWDGRSTF 29, SFTRSTF 28, PORRSTF 27, PINRSTF 26, RMVF 24, LSIRDY 1, LSION 0"

HSION, HSIRDY, HSEON, HSERDY, HSEBYP, PLLON, PLLRDY, CSSON = masks(
    _CR, "HSION HSIRDY HSEON HSERDY HSEBYP PLLON PLLRDY CSSON"
)
#: chosen: so long a forbidden setting must last to be warned of; ST's own code passes through some.
ILLEGAL_NS = 1_000_000
PLLSRC, _SW = masks(_CFGR, "PLLSRC SW")
#: SW: HSE, and the PLL, which may have it.
_HSE, _HSE_BY_PLL = 1, 2
#: MCO: 0xx is no clock, then SYSCLK, HSI, HSE, PLL / 2.
_MCO_AT, _MCO_SYSCLK = 24, 4
_MCO_PIN, _MCO = "PA8", "MCO"
CSSF, CSSC = masks(_CIR, "CSSF CSSC")
#: chosen: so long after its handler NMI comes again while CSSF is set.
NMI_AGAIN_NS = 1_000
#: BDCR: RTCSEL's place, which keeps its first choice; RTCEN.
_RTCSEL_AT = 8
_BDRST, _RTCSEL, _LSEON = masks(_BDCR, "BDRST RTCSEL LSEON")
_CSR_FLAGS = bits((31, 26))


class RccQuestion(IntEnum):
    """What Python is told beside what a listener hears."""

    #: The device in a slot is to be reset.
    RESETS = OWN_ANSWERS
    #: The gates have changed.
    GATES = OWN_ANSWERS + 1
    #: A frequency has changed; what MCO shows may have.
    CLOCKS = OWN_ANSWERS + 2
    SHOWS = OWN_ANSWERS + 3
    #: CSSC was written.
    CSS_CLEARED = OWN_ANSWERS + 4
    #: What the program tried in vain.
    IN_USE = OWN_ANSWERS + 5
    PLL_IS_ON = OWN_ANSWERS + 6
    NO_SOURCE = OWN_ANSWERS + 7


class RccCommand(IntEnum):
    """What C does for Python."""

    #: Start and stop oscillators, switch SYSCLK, and bring the clocks up to date.
    SETTLE_CLOCKS = OWN_COMMANDS
    #: `python_ns` has changed.
    WAIT = OWN_COMMANDS + 1


class RccTime(IntEnum):
    """How long each oscillator takes to start, in ns."""

    HSI_START_NS = 2_000  # DS5319 table 24: at most 2 µs
    HSE_START_NS = 2_000_000  # DS5319 table 22: 2 ms typical
    PLL_START_NS = 200_000  # DS5319 table 27: lock time of at most 200 µs
    LSE_START_NS = 1_500_000_000  # DS5319 table 23: 1.5 s typical
    LSI_START_NS = 85_000  # DS5319 table 25: at most 85 µs


class RccFrequency(IntEnum):
    """Frequencies in Hz."""

    HSI_HZ = HSI_HZ
    LSE_HZ = LSE_HZ
    #: A step of HSITRIM (DS5319 5.3.7).
    TRIM_STEP_HZ = 40_000


#: What is tried in vain.
_WARNINGS = {
    RccQuestion.IN_USE: ("RCC_CR: an oscillator that clocks SYSCLK cannot be stopped", "RCC:in-use"),
    RccQuestion.PLL_IS_ON: ("RCC_CFGR: PLL settings written while the PLL is on: ignored", "RCC:pll-on"),
    RccQuestion.NO_SOURCE: ("RCC_CFGR: SW = 3 is not a clock: ignored", "RCC:sw"),
}


class ResetCause(Enum):
    """What reset the chip; the value is the set of CSR flags (each cause also pulls the NRST pin)."""

    #: Power came up.
    POWER = bits(26, 27)
    #: The NRST pin.
    PIN = bits(26)
    #: SYSRESETREQ.
    SOFTWARE = bits(26, 28)
    #: The independent watchdog.
    IWDG = bits(26, 29)
    #: The window watchdog.
    WWDG = bits(26, 30)
    #: The end of Standby, which leaves the flags alone.
    STANDBY = 0
    #: Entry of a low-power mode that the option bytes forbid.
    LOW_POWER = bits(26, 31)


#: What no program does by itself.
OUTSIDE = frozenset({ResetCause.POWER, ResetCause.PIN})


_REGISTERS = (
    Register(
        name="CR",
        offset=0x00,
        reset=HSION | HSIRDY | bits(7),
        readable=bits((19, 16), 24, 25, (15, 0)) & ~bits(2),
        writable=HSION | HSEON | HSEBYP | bits(19) | PLLON | bits((7, 3)),
        on_write=NATIVE,
        fields=_CR,
    ),
    Register(
        name="CFGR",
        offset=0x04,
        readable=bits((26, 24), (22, 0)),
        writable=bits((26, 24), (22, 4), (1, 0)),
        on_write=NATIVE,
        fields=_CFGR,
    ),
    Register(
        name="CIR",
        offset=0x08,
        readable=bits((12, 8), 7, (4, 0)),
        writable=bits((12, 8)),
        triggers=bits(23, (20, 16)),
        on_write=NATIVE,
        fields=_CIR,
    ),
    Register(
        name="APB2RSTR",
        offset=0x0C,
        on_write=NATIVE,
        fields=_APB2,
    ),
    Register(
        name="APB1RSTR",
        offset=0x10,
        on_write=NATIVE,
        fields=_APB1,
    ),
    Register(
        name="AHBENR",
        offset=0x14,
        reset=0x14,
        on_write=NATIVE,
        fields=_AHB,
    ),
    Register(
        name="APB2ENR",
        offset=0x18,
        on_write=NATIVE,
        fields=_APB2,
    ),
    Register(
        name="APB1ENR",
        offset=0x1C,
        on_write=NATIVE,
        fields=_APB1,
    ),
    Register(
        name="BDCR",
        offset=0x20,
        readable=bits(16, 15, 9, 8, 2, 1, 0),
        writable=bits(16, 15, 9, 8, 2, 0),
        on_write="_write_bdcr",
        fields=_BDCR,
    ),
    Register(
        name="CSR",
        offset=0x24,
        reset=ResetCause.POWER.value,
        readable=_CSR_FLAGS | bits(1, 0),
        writable=bits(0),
        triggers=bits(24),
        on_write=NATIVE,
        fields=_CSR,
    ),
)
CR, CFGR, CIR, APB2RSTR, APB1RSTR, AHBENR, APB2ENR, APB1ENR, BDCR, CSR = indices(
    _REGISTERS, "CR CFGR CIR APB2RSTR APB1RSTR AHBENR APB2ENR APB1ENR BDCR CSR"
)


#: Oscillators by their places in `ready_at`.
_HSI, _LSE, _LSI = 0, 3, 4


class Rcc(Peripheral):
    """Reset and clock control."""

    KIND, HOLDS = "rcc", RCC
    HAS_BYTE_LANES = True
    STATE = ("_illegal", "_nmi_ns", "_shown")
    OUTPUTS = ("irq", "css")
    INPUTS = ("lsi",)
    SOURCE = "RM0008 7.3"
    ENUMS = (RccQuestion, RccCommand, RccTime, RccFrequency)
    REGISTERS = _REGISTERS

    def __init__(
        self,
        chip: ChipPorts,
        place: PeripheralMapping,
        *,
        gates: Mapping[str, ClockBit],
        hse_hz: int | None = CRYSTAL_HZ,
    ) -> None:
        """Make the RCC.

        Args:
            chip: The chip around it.
            place: Its row of the chip's page.
            gates: Enable bit by peripheral name; a name that is missing is always clocked.
            hse_hz: The crystal on OSC_IN/OSC_OUT in Hz; None: none fitted, HSE never gets ready.
        """
        super().__init__(chip, place)
        self.fabric.set_clocks(chip.clocks.shared)
        self.hse_hz = hse_hz
        self.native.hsi_hz = HSI_HZ
        self.native.python_ns, self.native.ready_at[:] = NO_TIME, [NO_TIME] * len(self.native.ready_at)
        self.native.crystal_works = True
        register_index = {register.name: register.offset // 4 for register in self.REGISTERS}
        self._gates = {name: (register_index[gate.register], 1 << gate.bit) for name, gate in gates.items()}
        #: Called after each write of an enable register, while `native.watches_gates` says so.
        self.on_gates: Callable[[], None] | None = None
        #: When NMI is next raised, while CSSF is set.
        self._nmi_ns: int | None = None
        #: What MCO puts out: its source and frequency.
        self._shown = (0, 0)
        #: What the data sheet forbids and the clocks now are: key, when it is warned of (None: it was), and by whom.
        self._illegal: tuple[tuple[str, int | None, int], ...] = ()

    @property
    def hse_hz(self) -> int | None:
        """The crystal on OSC_IN/OSC_OUT in Hz; None: none fitted."""
        return self.native.hse_hz or None

    @hse_hz.setter
    def hse_hz(self, hse_hz: int | None) -> None:
        self.native.hse_hz = hse_hz or 0

    @property
    def crystal_works(self) -> bool:
        """Whether the crystal oscillates; `fail_crystal` breaks it."""
        return bool(self.native.crystal_works)

    def is_clocked(self, name: str) -> bool:
        """Return whether the peripheral `name` has its clock (True where it has no gate)."""
        gate = self._gates.get(name)
        return gate is None or bool(self.words[gate[0]] & gate[1])

    def gate_address(self, name: str) -> tuple[int, int]:
        """Return where in the host's memory the enable register of the peripheral `name` is, and its bit as a mask."""
        index, mask = self._gates[name]
        at = ctypes.addressof((ctypes.c_uint32 * len(self.words)).from_buffer(self.words))
        return at + index * self.words.itemsize, mask

    def reset(self, cause: ResetCause = ResetCause.POWER) -> None:
        """Go back to the state after a reset; the backup domain and the flags of CSR outlive all but a power cut."""
        flags, backup, lse = self.words[CSR] & _CSR_FLAGS, self.words[BDCR], self.native.ready_at[_LSE]
        super().reset()
        if cause is not ResetCause.POWER:
            self.words[CSR] = flags | cause.value
            self.words[BDCR] = backup
            self.native.ready_at[_LSE] = lse
        self._settle()

    def on_reset(self) -> None:
        """Forget what was to come."""
        self._illegal = ()
        self._nmi_ns = None
        self._schedule()

    def advance_to(self, now_ns: int) -> None:
        """Raise NMI again, or warn of settings."""
        if self._nmi_ns is not None and self._nmi_ns <= now_ns:
            self._nmi_ns = now_ns + NMI_AGAIN_NS
            self.chip.signal("nmi")
        self._warn_of_settings(now_ns)
        self._schedule()

    def answer(self, what: int, value: int) -> None:
        """Do what follows from the clocks, reset a peripheral, tell of the gates, or warn."""
        if what == RccQuestion.RESETS:
            self.chip.reset_peripheral(self.fabric.name_of(value))
        elif what == RccQuestion.GATES:
            if self.on_gates is not None:
                self.on_gates()
        elif what == RccQuestion.CLOCKS:
            self.chip.clock_changed()
        elif what == RccQuestion.SHOWS:
            self._show_clock()
        elif what == RccQuestion.CSS_CLEARED:
            self._nmi_ns = None
            self._schedule()
        else:
            message, key = _WARNINGS[RccQuestion(what)]
            self.chip.warn(message, once=key)

    def fail_crystal(self) -> None:
        """Break the crystal of HSE; `repair_crystal` mends it."""
        self.native.crystal_works = False
        source, on_pll = self.words[CFGR] >> 2 & 3, _HSE_BY_PLL if self.words[CFGR] & PLLSRC else None
        was_ready, in_use = self.words[CR] & HSERDY, source in {_HSE, on_pll}
        if was_ready and self.words[CR] & CSSON:
            self.words[CR] &= ~HSEON
            if in_use:
                self.words[CFGR] &= ~(_SW | _SW << 2)
                self.words[CR] |= HSION | HSIRDY
            if self.words[CFGR] & PLLSRC:
                self.words[CR] &= ~(PLLON | PLLRDY)
            self.words[CIR] |= CSSF
            self._nmi_ns = self.chip.now_ns + NMI_AGAIN_NS
            self.chip.signal("nmi")
            self.set_output("css", True)
            self.set_output("css", False)
            self._schedule()
        elif was_ready and in_use:
            self.chip.warn("HSE has failed under SYSCLK, and RCC_CR CSSON is 0: the core stops", once="RCC:hse")
            self.chip.signal("no clock")
        self._settle()

    def repair_crystal(self) -> None:
        """Mend the crystal; it starts anew where it is on."""
        self.native.crystal_works = True
        self._settle()

    def set_lsi(self, frequency_hz: int) -> None:
        """Give LSI another frequency.

        Raises:
            ValueError: It is not one that LSI can have (DS5319 table 25).
        """
        if not LEAST_LSI_HZ <= frequency_hz <= MOST_LSI_HZ:
            raise ValueError(f"LSI has {LEAST_LSI_HZ} to {MOST_LSI_HZ} Hz, not {frequency_hz}")
        self.chip.clocks.lsi_hz = frequency_hz
        self.chip.clock_changed()
        self._settle()

    def clock_stopped(self) -> None:
        """Put nothing out in Stop."""
        self._show_clock(is_stopped=True)

    def clock_resumed(self, stopped_ns: int) -> None:
        """Put the clock out again."""
        del stopped_ns
        self._show_clock()

    def stop(self) -> None:
        """Stop HSE and PLL, and take HSI: Stop mode begins, and HSI runs when that ends (RM0008 7.3.1, 7.3.2)."""
        self.words[CR] = self.words[CR] & ~(HSEON | HSERDY | PLLON | PLLRDY) | HSION | HSIRDY
        self.words[CFGR] &= ~_SW
        self.native.ready_at[_HSI] = NO_TIME
        self._settle()

    def stand_by(self) -> None:
        """Go to the reset state, but for the oscillators that Standby leaves running."""
        lsi, lsi_ready = self.words[CSR] & bits(1, 0), self.native.ready_at[_LSI]
        self.reset(ResetCause.STANDBY)
        self.words[CSR] |= lsi
        self.native.ready_at[_LSI] = lsi_ready
        self._settle()

    def _write_bdcr(self, written: int, previous: int) -> None:
        if not self.chip.power.is_backup_open:
            self.words[BDCR] = previous
            self.chip.warn("RCC_BDCR: written while PWR_CR DBP is 0: ignored", once="RCC:dbp")
            return
        if (chosen := previous & _RTCSEL) and (written & _RTCSEL) != chosen and not written & _BDRST:
            self.words[BDCR] = self.words[BDCR] & ~_RTCSEL | chosen
            self.chip.warn("RCC_BDCR: RTCSEL changes only by a reset with BDRST: ignored", once="RCC:rtcsel")
        if written & _BDRST:
            self.words[BDCR] = _BDRST
            self._settle()
            self.chip.reset_backup_domain()
            return
        self._settle()

    def _settle(self) -> None:
        """Start and stop oscillators, switch SYSCLK, and bring the clocks up to date."""
        self._hold_crystal_pins()
        self.command(RccCommand.SETTLE_CLOCKS)

    def clock_changed(self) -> None:
        """Look at what the data sheet forbids: it is warned of only where it lasts."""
        before = {key: (due_ns, pc) for key, due_ns, pc in self._illegal}
        new = self.chip.now_ns + ILLEGAL_NS, self.chip.access_pc
        self._illegal = tuple((key, *before.get(key, new)) for key, _ in illegal_settings(self.chip.clocks))
        self._schedule()

    def _warn_of_settings(self, now_ns: int) -> None:
        messages = dict(illegal_settings(self.chip.clocks))
        for key, due_ns, pc in self._illegal:
            if due_ns is not None and due_ns <= now_ns:
                self.chip.warn(messages[key], once=key, pc=pc)
        self._illegal = tuple(
            (key, None if due_ns is not None and due_ns <= now_ns else due_ns, pc) for key, due_ns, pc in self._illegal
        )

    def _schedule(self) -> None:
        """Work out when Python next acts."""
        times = (self._nmi_ns, *(due_ns for _, due_ns, _ in self._illegal))
        self.native.python_ns = min((at for at in times if at is not None), default=NO_TIME)
        self.command(RccCommand.WAIT)

    def _hold_crystal_pins(self) -> None:
        """Give PC14 and PC15 to the 32 kHz crystal while LSE is on (RM0008 9.3.1)."""
        is_on = bool(self.words[BDCR] & _LSEON)
        for name, owner in (("PC14", "OSC32_IN"), ("PC15", "OSC32_OUT")):
            pin = self.chip.pins[name]
            if is_on == (pin.holder == owner):
                continue
            if is_on:
                pin.hold(owner)
            else:
                pin.release()

    def _show_clock(self, *, is_stopped: bool = False) -> None:
        """Put the clock that MCO chooses on PA8; one that does not run is low."""
        chosen, ready = self.words[CFGR] >> _MCO_AT & 7, self.words[CR]
        frequencies = (
            self.chip.clocks.sysclk_hz,
            self.native.hsi_hz if ready & HSIRDY else 0,
            self.hse_hz or 0 if ready & HSERDY else 0,
            self.native.pll_hz // 2 if ready & PLLRDY else 0,
        )
        frequency_hz = 0 if is_stopped or chosen < _MCO_SYSCLK else frequencies[chosen - _MCO_SYSCLK]
        shown = chosen, frequency_hz
        if shown == self._shown:
            return
        self._shown = shown
        self.native.shows_clock = chosen >= _MCO_SYSCLK
        pin = self.chip.pins[_MCO_PIN]
        if chosen < _MCO_SYSCLK:
            pin.disconnect(_MCO)
        elif frequency_hz:
            pin.offer_wave(_MCO, 2 * frequency_hz, 2, 1)
        else:
            pin.connect(_MCO, level=False)
