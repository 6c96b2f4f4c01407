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

Source: RM0008 section 7; start-up times from the data sheet DS5319 section 5.3.6 to 5.3.8.
Invariant: `chip.clocks` is what SWS and the dividers say.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum, IntEnum

from bluepill_sim.extension.layout import RCC
from bluepill_sim.fabric.clocks import CRYSTAL_HZ, HSI_HZ, LEAST_LSI_HZ, LSE_HZ, MOST_LSI_HZ, illegal_settings
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
_APB2 = "USART1 14, SPI1 12, TIM1 11, ADC2 10, ADC1 9, IOPE 6, IOPD 5, IOPC 4, IOPB 3, IOPA 2, AFIO 0"
_APB1 = (
    "PWR 28, BKP 27, CAN 25, USB 23, I2C2 22, I2C1 21, USART3 18, USART2 17, SPI2 14, WWDG 11, TIM4 2, TIM3 1, TIM2 0"
)
_AHB = "CRC 6, FLITF 4, SRAM 2, DMA1 0"
_BDCR = "BDRST 16, RTCEN 15, RTCSEL 9:8, LSEBYP 2, LSERDY 1, LSEON 0"
_CSR = "LPWRRSTF 31, WWDGRSTF 30, IWDGRSTF 29, SFTRSTF 28, PORRSTF 27, PINRSTF 26, RMVF 24, LSIRDY 1, LSION 0"
#: Bits of the enable registers that a medium-density F103 has.
_AHB_GATES = bits(0, 2, 4, 6)
_APB2_GATES = bits(0, (6, 2), (12, 9), 14)
_APB1_GATES = bits((2, 0), 11, 14, 17, 18, (23, 21), 25, 27, 28)

HSION, HSIRDY, HSEON, HSERDY, HSEBYP, PLLON, PLLRDY, CSSON = masks(
    _CR, "HSION HSIRDY HSEON HSERDY HSEBYP PLLON PLLRDY CSSON"
)
#: chosen: so long a forbidden setting must last to be warned of; ST's own code passes through some.
ILLEGAL_NS = 1_000_000
#: CFGR's PLLSRC, PLLXTPRE and PLLMUL: fixed while the PLL is on.
PLLSRC, PLLXTPRE, _PLLMUL, _USBPRE, _SW = masks(_CFGR, "PLLSRC PLLXTPRE PLLMUL USBPRE SW")
_PLL_SETTINGS = PLLSRC | PLLXTPRE | _PLLMUL
#: MCO: 0xx is no clock, then SYSCLK, HSI, HSE, PLL / 2.
_MCO_AT, _MCO_SYSCLK = 24, 4
_MCO_PIN, _MCO = "PA8", "MCO"
CSSF, CSSC = masks(_CIR, "CSSF CSSC")
#: chosen: so long after its handler NMI comes again while CSSF is set.
NMI_AGAIN_NS = 1_000
#: CR HSITRIM: the middle, and what a step does to HSI (DS5319 5.3.7).
_TRIM_AT, _TRIM_MIDDLE, TRIM_STEP_HZ = 3, 16, 40_000
#: BDCR: RTCSEL's place, which keeps its first choice; RTCEN.
_RTCSEL_AT = 8
_BDRST, _RTCSEL, _RTCEN = masks(_BDCR, "BDRST RTCSEL RTCEN")
#: HSE is divided by this for the RTC.
_RTC_HSE_DIVIDER = 128
(_RMVF,) = masks(_CSR, "RMVF")
_CSR_FLAGS = bits((31, 26))

#: AHB divider by CFGR HPRE; APB divider by PPRE1/PPRE2.
_AHB_DIVIDERS = (1,) * 8 + (2, 4, 8, 16, 64, 128, 256, 512)
_APB_DIVIDERS = (1,) * 4 + (2, 4, 8, 16)
_ADC_DIVIDERS = (2, 4, 6, 8)
#: PLL factor by CFGR PLLMUL.
_PLL_FACTORS = (2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 16)


class RccQuestion(IntEnum):
    """What Python is told beside what a listener hears."""

    #: The device in a slot is to be reset.
    RESETS = OWN_ANSWERS
    #: The gates have changed.
    GATES = OWN_ANSWERS + 1


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
        on_write="_write_cr",
        fields=_CR,
    ),
    Register(
        name="CFGR",
        offset=0x04,
        readable=bits((26, 24), (22, 0)),
        writable=bits((26, 24), (22, 4), (1, 0)),
        on_write="_write_cfgr",
        fields=_CFGR,
    ),
    Register(
        name="CIR",
        offset=0x08,
        readable=bits((12, 8), 7, (4, 0)),
        writable=bits((12, 8)),
        triggers=bits(23, (20, 16)),
        on_write="_write_cir",
        fields=_CIR,
    ),
    Register(
        name="APB2RSTR",
        offset=0x0C,
        mask=_APB2_GATES,
        on_write=NATIVE,
        fields=_APB2,
    ),
    Register(
        name="APB1RSTR",
        offset=0x10,
        mask=_APB1_GATES,
        on_write=NATIVE,
        fields=_APB1,
    ),
    Register(
        name="AHBENR",
        offset=0x14,
        reset=0x14,
        mask=_AHB_GATES,
        on_write=NATIVE,
        fields=_AHB,
    ),
    Register(
        name="APB2ENR",
        offset=0x18,
        mask=_APB2_GATES,
        on_write=NATIVE,
        fields=_APB2,
    ),
    Register(
        name="APB1ENR",
        offset=0x1C,
        mask=_APB1_GATES,
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
        triggers=_RMVF,
        on_write="_write_csr",
        fields=_CSR,
    ),
)
CR, CFGR, CIR, APB2RSTR, APB1RSTR, AHBENR, APB2ENR, APB1ENR, BDCR, CSR = indices(
    _REGISTERS, "CR CFGR CIR APB2RSTR APB1RSTR AHBENR APB2ENR APB1ENR BDCR CSR"
)


@dataclass(frozen=True, slots=True)
class Oscillator:
    """A clock source: where its bits are and how long it takes to start."""

    name: str
    #: Index of the register that holds its bits.
    register: int
    on: int
    ready: int
    #: Bit number of its ready flag in CIR; its enable is 8 above, its clear 16 above.
    flag: int
    start_ns: int


OSCILLATORS = (
    Oscillator("HSI", CR, HSION, HSIRDY, 2, 2_000),  # DS5319 table 24: at most 2 µs
    Oscillator("HSE", CR, HSEON, HSERDY, 3, 2_000_000),  # DS5319 table 22: 2 ms typical
    Oscillator("PLL", CR, PLLON, PLLRDY, 4, 200_000),  # DS5319 table 27: lock time of at most 200 µs
    Oscillator("LSE", BDCR, 1, 2, 1, 1_500_000_000),  # DS5319 table 23: 1.5 s typical
    Oscillator("LSI", CSR, 1, 2, 0, 85_000),  # DS5319 table 25: at most 85 µs
)
_HSE, _PLL, _LSE, _LSI = 1, 2, 3, 4
#: CR's ready bit by SW.
_SOURCE_READY = (HSIRDY, HSERDY, PLLRDY)


class Rcc(Peripheral):
    """Reset and clock control."""

    KIND, HOLDS = "rcc", RCC
    HAS_BYTE_LANES = True
    STATE = ("_ready_at", "_illegal", "_nmi_ns", "_keeps_lsi", "crystal_works", "_shown")
    OUTPUTS = ("irq", "css")
    INPUTS = ("lsi",)
    SOURCE = "RM0008 7.3"
    ENUMS = (RccQuestion,)
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
        self.hse_hz = hse_hz
        register_index = {register.name: register.offset // 4 for register in self.REGISTERS}
        self._gates = {name: (register_index[gate.register], 1 << gate.bit) for name, gate in gates.items()}
        #: Called after each write of an enable register, while `native.watches_gates` says so.
        self.on_gates: Callable[[], None] | None = None
        #: When each oscillator that is starting gets ready, in the order of `OSCILLATORS`.
        self._ready_at: tuple[int | None, ...] = (None,) * len(OSCILLATORS)
        #: Whether the crystal oscillates; `fail_crystal` breaks it.
        self.crystal_works = True
        #: When NMI is next raised, while CSSF is set.
        self._nmi_ns: int | None = None
        #: Whether IWDG keeps LSI on.
        self._keeps_lsi = False
        #: What MCO puts out: its source and frequency.
        self._shown = (0, 0)
        #: What the data sheet forbids and the clocks now are: key, when it is warned of (None: it was), and by whom.
        self._illegal: tuple[tuple[str, int | None, int], ...] = ()

    def is_clocked(self, name: str) -> bool:
        """Return whether the peripheral `name` has its clock (True where it has no gate)."""
        gate = self._gates.get(name)
        return gate is None or bool(self.words[gate[0]] & gate[1])

    def gate_address(self, name: str) -> tuple[int, int]:
        """Return where in the host's memory the enable register of the peripheral `name` is, and its bit as a mask."""
        index, mask = self._gates[name]
        return self.words.buffer_info()[0] + index * self.words.itemsize, mask

    def reset(self, cause: ResetCause = ResetCause.POWER) -> None:
        """Go back to the state after a reset; the backup domain and the flags of CSR outlive all but a power cut."""
        flags, backup, lse = self.words[CSR] & _CSR_FLAGS, self.words[BDCR], self._ready_at[3]
        super().reset()
        if cause is not ResetCause.POWER:
            self.words[CSR] = flags | cause.value
            self.words[BDCR] = backup
            self._ready_at = (None, None, None, lse, None)
        self._settle()

    def on_reset(self) -> None:
        """Stop every oscillator but HSI."""
        self._ready_at = (None,) * len(OSCILLATORS)
        self._illegal = ()
        self._nmi_ns = None
        self.set_output("irq", False)

    def advance_to(self, now_ns: int) -> None:
        """Raise the ready flags that are due."""
        while self.due_ns is not None and self.due_ns <= now_ns:
            at_ns = self.due_ns
            if at_ns == self._nmi_ns:
                self._nmi_ns = at_ns + NMI_AGAIN_NS
                self.chip.signal("nmi")
                self._schedule()
                continue
            if at_ns not in self._ready_at:
                self._warn_of_settings(at_ns)
                self._schedule()
                continue
            index = self._ready_at.index(at_ns)
            oscillator = OSCILLATORS[index]
            self.words[oscillator.register] |= oscillator.ready
            self.words[CIR] |= 1 << oscillator.flag
            self._set_ready_at(index, None)
            self._settle(at_ns)
            self._update_irq()

    def answer(self, what: int, value: int) -> int:
        """Reset a peripheral whose bit of APBxRSTR has just gone to 1, tell of the gates, or hear a line."""
        if what == RccQuestion.RESETS:
            self.chip.reset_peripheral(self.fabric.name_of(value))
        elif what == RccQuestion.GATES:
            if self.on_gates is not None:
                self.on_gates()
        else:
            self.line_changed(self.INPUTS[value >> 1], bool(value & 1))
        return 0

    def line_changed(self, name: str, level: bool) -> None:
        """Keep LSI on for IWDG."""
        if name == "lsi":
            self._keeps_lsi = level
            self.words[CSR] &= ~1  # it ends with a reset, as what a program has set does
            self._settle()

    def fail_crystal(self) -> None:
        """Break the crystal of HSE; `repair_crystal` mends it."""
        self.crystal_works = False
        was_ready, in_use = self.words[CR] & HSERDY, self._oscillators_in_use() & HSEON
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
        elif was_ready and in_use:
            self.chip.warn("HSE has failed under SYSCLK, and RCC_CR CSSON is 0: the core stops", once="RCC:hse")
            self.chip.signal("no clock")
        self._settle()

    def repair_crystal(self) -> None:
        """Mend the crystal; it starts anew where it is on."""
        self.crystal_works = True
        self._settle()

    def set_lsi(self, frequency_hz: int) -> None:
        """Give LSI another frequency.

        Raises:
            ValueError: It is not one that LSI can have (DS5319 table 25).
        """
        if not LEAST_LSI_HZ <= frequency_hz <= MOST_LSI_HZ:
            raise ValueError(f"LSI has {LEAST_LSI_HZ} to {MOST_LSI_HZ} Hz, not {frequency_hz}")
        self.chip.clocks.lsi_hz = frequency_hz
        self.chip.clocks.rtcclk_hz = self._rtcclk_hz()
        self.chip.clock_changed()

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
        self.words[CFGR] &= ~(_SW | _SW << 2)
        self._set_ready_at(0, None)
        self._settle()

    def stand_by(self) -> None:
        """Go to the reset state, but for the oscillators that Standby leaves running."""
        lsi, lsi_ready = self.words[CSR] & bits(1, 0), self._ready_at[_LSI]
        self.reset(ResetCause.STANDBY)
        self.words[CSR] |= lsi
        self._set_ready_at(_LSI, lsi_ready)
        self._settle()

    def _write_cr(self, written: int, previous: int) -> None:
        in_use = self._oscillators_in_use() & previous & ~written
        if in_use:
            self.words[CR] |= in_use
            self.chip.warn("RCC_CR: an oscillator that clocks SYSCLK cannot be stopped", once="RCC:in-use")
        if previous & HSEON and (written ^ previous) & HSEBYP:
            self.words[CR] ^= HSEBYP
        self._settle()

    def _write_cfgr(self, written: int, previous: int) -> None:
        changed = (written ^ previous) & _PLL_SETTINGS
        if changed and self.words[CR] & PLLON:
            self.words[CFGR] ^= changed
            self.chip.warn("RCC_CFGR: PLL settings written while the PLL is on: ignored", once="RCC:pll-on")
        if written & _SW == _SW:
            self.words[CFGR] = (self.words[CFGR] & ~_SW) | (previous & _SW)
            self.chip.warn("RCC_CFGR: SW = 3 is not a clock: ignored", once="RCC:sw")
        self._settle()

    def _write_cir(self, written: int, _previous: int) -> None:
        self.words[CIR] &= ~((written >> 16) & bits(7, (4, 0)))
        if written & CSSC:
            self._nmi_ns = None
            self._schedule()
        self._update_irq()

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

    def _write_csr(self, written: int, _previous: int) -> None:
        if written & _RMVF:
            self.words[CSR] &= ~_CSR_FLAGS
        self._settle()

    def _update_irq(self) -> None:
        flags = self.words[CIR]
        self.set_output("irq", bool(flags & (flags >> 8) & bits((4, 0))))

    def _oscillators_in_use(self) -> int:
        """Return the on bits of CR that SYSCLK hangs on."""
        cfgr = self.words[CFGR]
        source = (cfgr >> 2) & 3
        if source == _PLL:
            return PLLON | (HSEON if cfgr & PLLSRC else HSION)
        return HSEON if source == _HSE else HSION

    def _can_start(self, index: int) -> bool:
        """Return whether an oscillator that is on has what it needs to get ready."""
        if index == _HSE:
            return self.hse_hz is not None and self.crystal_works
        if index == _PLL:
            return bool(self.words[CR] & (HSERDY if self.words[CFGR] & PLLSRC else HSIRDY))
        return True

    def _set_ready_at(self, index: int, at_ns: int | None) -> None:
        times = list(self._ready_at)
        times[index] = at_ns
        self._ready_at = tuple(times)

    def _settle(self, now_ns: int | None = None) -> None:
        """Start and stop oscillators, switch SYSCLK, and bring the clocks up to date."""
        now_ns = self.chip.now_ns if now_ns is None else now_ns
        if self._keeps_lsi:
            self.words[CSR] |= 1
        for index, oscillator in enumerate(OSCILLATORS):
            word = self.words[oscillator.register]
            starts = bool(word & oscillator.on) and self._can_start(index)
            if not starts:
                self.words[oscillator.register] &= ~oscillator.ready
                self._set_ready_at(index, None)
            elif not word & oscillator.ready and self._ready_at[index] is None:
                self._set_ready_at(index, now_ns + oscillator.start_ns)
        self._hold_crystal_pins()
        wanted = self.words[CFGR] & _SW
        if self.words[CR] & _SOURCE_READY[wanted]:
            self.words[CFGR] = (self.words[CFGR] & ~(_SW << 2)) | (wanted << 2)
        self._update_frequencies()
        self._schedule()

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
        """Work out when something is next due."""
        times = (self._nmi_ns, *self._ready_at, *(due_ns for _, due_ns, _ in self._illegal))
        due_ns = min((at for at in times if at is not None), default=None)
        if due_ns != self.due_ns:
            self.due_ns = due_ns

    def _hold_crystal_pins(self) -> None:
        """Give PC14 and PC15 to the 32 kHz crystal while LSE is on (RM0008 9.3.1)."""
        is_on = bool(self.words[BDCR] & 1)
        for name, owner in (("PC14", "OSC32_IN"), ("PC15", "OSC32_OUT")):
            pin = self.chip.pins[name]
            if is_on and pin.holder is None:
                pin.hold(owner)
            elif not is_on and pin.holder == owner:
                pin.release()

    def _hsi_hz(self) -> int:
        """Return what HSITRIM makes of HSI."""
        trim = self.words[CR] >> _TRIM_AT & 0x1F
        return HSI_HZ + (trim - _TRIM_MIDDLE) * TRIM_STEP_HZ

    def _show_clock(self, *, is_stopped: bool = False) -> None:
        """Put the clock that MCO chooses on PA8; one that does not run is low."""
        chosen, ready = self.words[CFGR] >> _MCO_AT & 7, self.words[CR]
        frequencies = (
            self.chip.clocks.sysclk_hz,
            self._hsi_hz() if ready & HSIRDY else 0,
            self.hse_hz or 0 if ready & HSERDY else 0,
            self._pll_hz() // 2 if ready & PLLRDY else 0,
        )
        frequency_hz = 0 if is_stopped or chosen < _MCO_SYSCLK else frequencies[chosen - _MCO_SYSCLK]
        shown = chosen, frequency_hz
        if shown == self._shown:
            return
        self._shown = shown
        pin = self.chip.pins[_MCO_PIN]
        if chosen < _MCO_SYSCLK:
            pin.disconnect(_MCO)
        elif frequency_hz:
            pin.offer_wave(_MCO, 2 * frequency_hz, 2, 1)
        else:
            pin.connect(_MCO, level=False)

    def _pll_hz(self) -> int:
        cfgr = self.words[CFGR]
        factor = _PLL_FACTORS[(cfgr >> 18) & 0xF]
        if not cfgr & PLLSRC:
            return self._hsi_hz() // 2 * factor
        return (self.hse_hz or 0) // (2 if cfgr & PLLXTPRE else 1) * factor

    def _rtcclk_hz(self) -> int:
        """Return the frequency of the source that RTCSEL chooses; 0 while it does not run, or without RTCEN."""
        backup = self.words[BDCR]
        source = (backup & _RTCSEL) >> _RTCSEL_AT if backup & _RTCEN else 0
        hse_hz = (self.hse_hz or 0) // _RTC_HSE_DIVIDER
        rows = ((_LSE, LSE_HZ), (_LSI, self.chip.clocks.lsi_hz), (_HSE, hse_hz))
        if not source:
            return 0
        index, frequency_hz = rows[source - 1]
        oscillator = OSCILLATORS[index]
        return frequency_hz if self.words[oscillator.register] & oscillator.ready else 0

    def _update_frequencies(self) -> None:
        cfgr = self.words[CFGR]
        source = (cfgr >> 2) & 3
        sysclk_hz = (self._hsi_hz(), self.hse_hz or HSI_HZ, self._pll_hz())[source]
        hclk_hz = sysclk_hz // _AHB_DIVIDERS[(cfgr >> 4) & 0xF]
        divider1, divider2 = _APB_DIVIDERS[(cfgr >> 8) & 7], _APB_DIVIDERS[(cfgr >> 11) & 7]
        clocks = self.chip.clocks
        before = clocks.snapshot()
        clocks.sysclk_hz, clocks.hclk_hz = sysclk_hz, hclk_hz
        clocks.pclk1_hz, clocks.pclk2_hz = hclk_hz // divider1, hclk_hz // divider2
        clocks.adc_divider = _ADC_DIVIDERS[(cfgr >> 14) & 3]
        pll_hz = self._pll_hz() if self.words[CR] & PLLRDY else 0
        clocks.usb_hz = pll_hz if cfgr & _USBPRE else pll_hz * 2 // 3
        clocks.timer1_hz = clocks.pclk1_hz * (1 if divider1 == 1 else 2)
        clocks.timer2_hz = clocks.pclk2_hz * (1 if divider2 == 1 else 2)
        clocks.rtcclk_hz = self._rtcclk_hz()
        if clocks.snapshot() != before:
            self.chip.clock_changed()
        self._show_clock()
