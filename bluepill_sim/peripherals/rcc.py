"""RCC: oscillators, PLL, clock tree, clock gates and reset flags.

Modelled: every multiplier and divider, ready flags after typical start-up
times, the RM's rules of what may not be changed while in use, a switch of
SYSCLK that waits until its source is ready, ready interrupts, peripheral
reset, reset causes. Not modelled: the clock security system (no crystal ever
fails), HSI trimming, MCO, and the write protection of BDCR by PWR_CR DBP.

Source: RM0008 section 7; start-up times from the data sheet DS5319 section 5.3.6 to 5.3.8.
Invariant: `chip.clocks` is what SWS and the dividers say.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

from bluepill_sim.fabric.clocks import HSI_HZ, illegal_settings
from bluepill_sim.fabric.ports import ChipPorts
from bluepill_sim.fabric.registers import ClockBit, Peripheral, Place, Register, bits

CR, CFGR, CIR, APB2RSTR, APB1RSTR, AHBENR, APB2ENR, APB1ENR, BDCR, CSR = range(10)

#: Bits of the enable registers that a medium-density F103 has.
_AHB_GATES = bits(0, 2, 4, 6)
_APB2_GATES = bits(0, (6, 2), (12, 9), 14)
_APB1_GATES = bits((2, 0), 11, 14, 17, 18, (23, 21), 25, 27, 28)

HSION, HSIRDY, HSEON, HSERDY, HSEBYP, PLLON, PLLRDY = (1 << n for n in (0, 1, 16, 17, 18, 24, 25))
#: chosen: so long a forbidden setting must last to be warned of; ST's own code passes through some.
ILLEGAL_NS = 1_000_000
#: CFGR's PLLSRC, PLLXTPRE and PLLMUL: fixed while the PLL is on.
PLLSRC, PLLXTPRE = 1 << 16, 1 << 17
_PLL_SETTINGS = bits((21, 16))
_SW = bits((1, 0))
#: MCO: 0xx is no clock.
_MCO_ON = 1 << 26
_BDRST = 1 << 16
_RMVF = 1 << 24
_CSR_FLAGS = bits((31, 26))

#: AHB divider by CFGR HPRE; APB divider by PPRE1/PPRE2.
_AHB_DIVIDERS = (1,) * 8 + (2, 4, 8, 16, 64, 128, 256, 512)
_APB_DIVIDERS = (1,) * 4 + (2, 4, 8, 16)
_ADC_DIVIDERS = (2, 4, 6, 8)
#: PLL factor by CFGR PLLMUL.
_PLL_FACTORS = (2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 16)


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
    #: Entry of a low-power mode that the option bytes forbid.
    LOW_POWER = bits(26, 31)


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
_HSE, _PLL = 1, 2
#: CR's ready bit by SW.
_SOURCE_READY = (HSIRDY, HSERDY, PLLRDY)


#: Fields of the registers, from the left.
_CR = "PLLRDY 25, PLLON 24, CSSON 19, HSEBYP 18, HSERDY 17, HSEON 16, HSICAL 15:8, HSITRIM 7:3, HSIRDY 1, HSION 0"
_CFGR = (
    "MCO 26:24, USBPRE 22, PLLMUL 21:18, PLLXTPRE 17, PLLSRC 16, ADCPRE 15:14, PPRE2 13:11, PPRE1 10:8, HPRE 7:4, "
    "SWS 3:2, SW 1:0"
)
_CIR = (
    "PLLRDYIE 12, HSERDYIE 11, HSIRDYIE 10, LSERDYIE 9, LSIRDYIE 8, CSSF 7, "
    "PLLRDYF 4, HSERDYF 3, HSIRDYF 2, LSERDYF 1, LSIRDYF 0"
)
_APB2 = "USART1 14, SPI1 12, TIM1 11, ADC2 10, ADC1 9, IOPE 6, IOPD 5, IOPC 4, IOPB 3, IOPA 2, AFIO 0"
_APB1 = (
    "PWR 28, BKP 27, CAN 25, USB 23, I2C2 22, I2C1 21, USART3 18, USART2 17, SPI2 14, WWDG 11, TIM4 2, TIM3 1, TIM2 0"
)
_AHB = "CRC 6, FLITF 4, SRAM 2, DMA1 0"
_CSR = "LPWRRSTF 31, WWDGRSTF 30, IWDGRSTF 29, SFTRSTF 28, PORRSTF 27, PINRSTF 26, LSIRDY 1, LSION 0"


class Rcc(Peripheral):
    """Reset and clock control."""

    HAS_BYTE_LANES = True
    STATE = ("_ready_at", "_illegal")
    OUTPUTS = ("irq",)
    REGISTERS = (
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
            on_write="_write_cir",
            fields=_CIR,
        ),
        Register(
            name="APB2RSTR",
            offset=0x0C,
            readable=_APB2_GATES,
            writable=_APB2_GATES,
            on_write="_write_apb2rstr",
            fields=_APB2,
        ),
        Register(
            name="APB1RSTR",
            offset=0x10,
            readable=_APB1_GATES,
            writable=_APB1_GATES,
            on_write="_write_apb1rstr",
            fields=_APB1,
        ),
        Register(name="AHBENR", offset=0x14, reset=0x14, readable=_AHB_GATES, writable=_AHB_GATES, fields=_AHB),
        Register(name="APB2ENR", offset=0x18, readable=_APB2_GATES, writable=_APB2_GATES, fields=_APB2),
        Register(name="APB1ENR", offset=0x1C, readable=_APB1_GATES, writable=_APB1_GATES, fields=_APB1),
        Register(
            name="BDCR",
            offset=0x20,
            readable=bits(16, 15, 9, 8, 2, 1, 0),
            writable=bits(16, 15, 9, 8, 2, 0),
            on_write="_write_bdcr",
            fields="BDRST 16, RTCEN 15, RTCSEL 9:8, LSEBYP 2, LSERDY 1, LSEON 0",
        ),
        Register(
            name="CSR",
            offset=0x24,
            reset=ResetCause.POWER.value,
            readable=_CSR_FLAGS | bits(1, 0),
            writable=bits(0),
            on_write="_write_csr",
            fields=_CSR,
        ),
    )

    def __init__(
        self, chip: ChipPorts, place: Place, *, gates: Mapping[str, ClockBit], hse_hz: int | None = 8_000_000
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
        #: When each oscillator that is starting gets ready, in the order of `OSCILLATORS`.
        self._ready_at: tuple[int | None, ...] = (None,) * len(OSCILLATORS)
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
        self.set_output("irq", False)

    def advance_to(self, now_ns: int) -> None:
        """Raise the ready flags that are due."""
        while self.due_ns is not None and self.due_ns <= now_ns:
            at_ns = self.due_ns
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

    def _write_cr(self, written: int, previous: int) -> None:
        in_use = self._oscillators_in_use() & previous & ~written
        if in_use:
            self.words[CR] |= in_use
            self.chip.warn("RCC_CR: an oscillator that clocks SYSCLK cannot be stopped", once="RCC:in-use")
        if previous & HSEON and (written ^ previous) & HSEBYP:
            self.words[CR] ^= HSEBYP
        self._settle()

    def _write_cfgr(self, written: int, previous: int) -> None:
        if written & _MCO_ON:
            self.chip.warn("RCC_CFGR: MCO, the clock on PA8, is not modelled", once="RCC:mco")
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
        self._update_irq()

    def _write_apb2rstr(self, _written: int, previous: int) -> None:
        self._reset_peripherals(APB2ENR, self.words[APB2RSTR] & ~previous)

    def _write_apb1rstr(self, _written: int, previous: int) -> None:
        self._reset_peripherals(APB1ENR, self.words[APB1RSTR] & ~previous)

    def _write_bdcr(self, written: int, _previous: int) -> None:
        if written & _BDRST:
            self.words[BDCR] = _BDRST
        self._settle()

    def _write_csr(self, written: int, _previous: int) -> None:
        if written & _RMVF:
            self.words[CSR] &= ~_CSR_FLAGS
        self._settle()

    def _reset_peripherals(self, enable_register: int, mask: int) -> None:
        """Reset every modelled peripheral whose bit of APBxRSTR has just gone to 1."""
        for name, (register, gate) in self._gates.items():
            if register == enable_register and gate & mask:
                self.chip.reset_peripheral(name)

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
            return self.hse_hz is not None
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
        times = (*self._ready_at, *(due_ns for _, due_ns, _ in self._illegal))
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

    def _pll_hz(self) -> int:
        cfgr = self.words[CFGR]
        factor = _PLL_FACTORS[(cfgr >> 18) & 0xF]
        if not cfgr & PLLSRC:
            return HSI_HZ // 2 * factor
        return (self.hse_hz or 0) // (2 if cfgr & PLLXTPRE else 1) * factor

    def _update_frequencies(self) -> None:
        cfgr = self.words[CFGR]
        source = (cfgr >> 2) & 3
        sysclk_hz = (HSI_HZ, self.hse_hz or HSI_HZ, self._pll_hz())[source]
        hclk_hz = sysclk_hz // _AHB_DIVIDERS[(cfgr >> 4) & 0xF]
        divider1, divider2 = _APB_DIVIDERS[(cfgr >> 8) & 7], _APB_DIVIDERS[(cfgr >> 11) & 7]
        clocks = self.chip.clocks
        before = clocks.snapshot()
        clocks.sysclk_hz, clocks.hclk_hz = sysclk_hz, hclk_hz
        clocks.pclk1_hz, clocks.pclk2_hz = hclk_hz // divider1, hclk_hz // divider2
        clocks.adc_divider = _ADC_DIVIDERS[(cfgr >> 14) & 3]
        clocks.timer1_hz = clocks.pclk1_hz * (1 if divider1 == 1 else 2)
        clocks.timer2_hz = clocks.pclk2_hz * (1 if divider2 == 1 else 2)
        if clocks.snapshot() != before:
            self.chip.clock_changed()
