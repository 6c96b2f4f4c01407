"""ADC1 and ADC2 as RM0008 chapter 11 and docs/peripherals.md have them, in plain Python, one conversion after the
other: what the device in C, which passes over what nobody sees, is held against."""

from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction

AWD, EOC, JEOC, JSTRT, STRT = (1 << n for n in range(5))
EOCIE, AWDIE, JEOCIE, SCAN, AWDSGL, JAUTO, DISCEN, JDISCEN = (1 << n for n in range(5, 13))
JAWDEN, AWDEN = 1 << 22, 1 << 23
ADON, CONT, CAL, RSTCAL, DMA, ALIGN = (1 << n for n in (0, 1, 2, 3, 8, 11))
JEXTTRIG, EXTTRIG, JSWSTART, SWSTART, TSVREFE = (1 << n for n in (15, 20, 21, 22, 23))
SAMPLING = [Fraction(n) + Fraction(1, 2) for n in (1, 7, 13, 28, 41, 55, 71, 239)]
#: What ADC2 does in each dual mode.
REGULAR, INJECTED, FAST, SLOW, ALTERNATE = "regular", "injected", "fast", "slow", "alternate"
DUAL = (
    (), (REGULAR, INJECTED), (REGULAR, ALTERNATE), (INJECTED, FAST), (INJECTED, SLOW),
    (INJECTED,), (REGULAR,), (FAST,), (SLOW,), (ALTERNATE,), *[()] * 6,
)  # fmt: skip


@dataclass
class Unit:
    """One ADC."""

    sr: int = 0
    words: dict[str, int] = field(default_factory=lambda: {"HTR": 0xFFF})
    jdr: list[int] = field(default_factory=lambda: [0] * 4)
    dr: int = 0
    is_requesting: bool = False
    ready_ns: int = 0
    calibrated_ns: int | None = None
    #: Of the run: where it began, and cycles of ADCCLK since.
    start_ns: int = 0
    cycles: Fraction = Fraction(0)
    group: str | None = None
    channel: int = 0
    code: int | None = None
    sample_ns: int = 0
    end_ns: int = 0
    rank: int = 0
    left: int = 0
    is_interrupted: bool = False
    injected_rank: int = 0
    injected_left: int = 0
    is_automatic: bool = False

    def __getitem__(self, name: str) -> int:
        return self.words.get(name, 0)

    def has(self, name: str, bits: int) -> bool:
        return bool(self[name] & bits)

    @property
    def regular(self) -> list[int]:
        every = [self[f"SQR{3 - n // 6}"] >> 5 * (n % 6) & 31 for n in range(16)]
        return every[: (self["SQR1"] >> 20 & 15) + 1 if self.has("CR1", SCAN) else 1]

    @property
    def injected(self) -> list[int]:
        every = [self["JSQR"] >> 5 * n & 31 for n in range(4)][3 - (self["JSQR"] >> 20 & 3) :]
        return every if self.has("CR1", SCAN) else every[:1]

    def sampling(self, channel: int) -> Fraction:
        word = self["SMPR2"] if channel < 10 else self["SMPR1"]
        return SAMPLING[word >> 3 * (channel % 10) & 7 if channel < 18 else 0]


class AdcModel:
    """Both ADCs; `now_ns` is moved by `advance`."""

    def __init__(self, pclk2_hz: int, divider: int, uv: Callable[[int, int], int], now_ns: int = 0) -> None:
        self.clock = Fraction(pclk2_hz, divider)
        self.divider = divider
        self.uv = uv
        self.vdda_uv = 3_300_000
        self.now_ns = now_ns
        self.units = (Unit(), Unit())
        self.turns = 0

    @property
    def mode(self) -> tuple[str, ...]:
        return DUAL[self.units[0]["CR1"] >> 16 & 15]

    @property
    def irq(self) -> bool:
        return any(
            unit.sr & flag and unit.has("CR1", enable)
            for unit in self.units
            for flag, enable in ((EOC, EOCIE), (JEOC, JEOCIE), (AWD, AWDIE))
        )

    def advance(self, to_ns: int) -> None:
        while True:
            times = [(unit.end_ns, n) for n, unit in enumerate(self.units) if unit.group]
            if not times or min(times)[0] > to_ns:
                break
            self.now_ns, n = min(times)
            self._finish(self.units[n])
        self.now_ns = to_ns
        for unit in self.units:
            if unit.group and unit.sample_ns <= to_ns and unit.code is None:
                unit.code = self._convert(unit)
            if unit.calibrated_ns is not None and unit.calibrated_ns <= to_ns:
                unit.words["CR2"] &= ~(CAL | RSTCAL)
                unit.calibrated_ns = None

    def read_dr(self, n: int) -> int:
        unit = self.units[n]
        unit.sr &= ~EOC
        unit.is_requesting = False
        return unit.dr | (self.units[1].dr << 16 if n == 0 and self.mode else 0)

    def write(self, n: int, name: str, value: int) -> None:
        unit = self.units[n]
        before = unit[name]
        if name == "SR":
            unit.sr &= value
            return
        if name == "CR2":
            self._write_cr2(unit, before, value)
            return
        unit.words[name] = value
        if name == "CR1" and n == 0 and DUAL[value >> 16 & 15] != DUAL[before >> 16 & 15]:
            self.turns = 0
        if name == "JSQR" and value != before and unit.group == "J":
            unit.injected_rank = 0
            unit.injected_left = 1 if unit.has("CR1", JDISCEN) else len(unit.injected)
            self._begin_run(unit, "J")
        if name in {"SQR1", "SQR2", "SQR3"} and value != before and (unit.group == "R" or unit.is_interrupted):
            unit.rank, unit.left = 0, self._part(unit, 0)
            if unit.group == "R":
                self._begin_run(unit, "R")

    def trigger(self, source: int, *, is_injected: bool) -> None:
        """Take a rising edge of trigger 0 to 6 of a group, which goes to both."""
        for unit in self.units:
            at, enable = (12, JEXTTRIG) if is_injected else (17, EXTTRIG)
            if unit.has("CR2", enable) and unit["CR2"] >> at & 7 == source:
                self._trigger(unit, is_injected=is_injected)

    def _write_cr2(self, unit: Unit, before: int, value: int) -> None:
        starts = value & (SWSTART | JSWSTART)
        new = value & ~starts | before & (CAL | RSTCAL)
        if unit is self.units[1]:
            new &= ~(DMA | TSVREFE)
        unit.words["CR2"] = new
        if fresh := new & ~before & (CAL | RSTCAL):
            cycles = (83 if new & CAL else 0) + (4 if new & RSTCAL else 0)
            assert fresh
            unit.calibrated_ns = self.now_ns + int(cycles * 1_000_000_000 / self.clock)
            unit.ready_ns = max(unit.ready_ns, unit.calibrated_ns)
        if not new & ADON:
            unit.group, unit.is_interrupted, unit.is_automatic, unit.is_requesting = None, False, False, False
            unit.rank = unit.injected_rank = 0
            if unit is self.units[0]:
                self.turns = 0
            return
        if not new & DMA:
            unit.is_requesting = False
        if not before & ADON:
            unit.ready_ns = max(unit.ready_ns, self.now_ns + 1000)
            return
        by_software = starts & SWSTART and new & EXTTRIG and new >> 17 & 7 == 7
        if by_software or (new == before and not starts):
            self._trigger(unit, is_injected=False)
        if starts & JSWSTART and new & JEXTTRIG and new >> 12 & 7 == 7:
            self._trigger(unit, is_injected=True)

    def _trigger(self, unit: Unit, *, is_injected: bool) -> None:
        mode, other = self.mode, self.units[1]
        shared = {INJECTED, ALTERNATE} if is_injected else {REGULAR, FAST, SLOW}
        if unit is other:
            if not shared & set(mode):
                self._start(unit, is_injected=is_injected)
            return
        if is_injected and ALTERNATE in mode:
            self.turns += 1
            self._start(self.units[0] if self.turns % 2 else other, is_injected=True)
            return
        if shared & set(mode):
            self._start(other, is_injected=is_injected)
        delay = 0 if is_injected else 7 if FAST in mode else 14 if SLOW in mode else 0
        self._start(unit, is_injected=is_injected, delay=delay)

    def _start(self, unit: Unit, *, is_injected: bool, delay: int = 0) -> None:
        if not unit.has("CR2", ADON):
            return
        if is_injected:
            if unit.group == "J" or unit.has("CR1", JAUTO):
                return
            unit.is_interrupted |= unit.group == "R"
            in_parts = unit.has("CR1", JDISCEN)
            if not in_parts or unit.injected_rank >= len(unit.injected):
                unit.injected_rank = 0
            unit.injected_left = 1 if in_parts else len(unit.injected)
            self._begin_run(unit, "J")
            return
        if unit.group == "R" or unit.is_interrupted:
            return
        if not unit.has("CR1", DISCEN) or unit.rank >= len(unit.regular):
            unit.rank = 0
        unit.left = self._part(unit, unit.rank)
        if unit.group == "J":
            unit.is_interrupted = True
            unit.sr |= STRT
        else:
            self._begin_run(unit, "R", delay)

    def _part(self, unit: Unit, rank: int) -> int:
        left = len(unit.regular) - rank
        return min(left, (unit["CR1"] >> 13 & 7) + 1) if unit.has("CR1", DISCEN) else left

    def _begin_run(self, unit: Unit, group: str, delay: int = 0) -> None:
        unit.start_ns, unit.cycles = max(self.now_ns, unit.ready_ns), Fraction(0)
        self._begin(unit, group, delay)

    def _begin(self, unit: Unit, group: str, delay: int = 0) -> None:
        # A sequence may have been made shorter meanwhile: what its registers name counts, as in the device.
        sequence = [unit[f"SQR{3 - n // 6}"] >> 5 * (n % 6) & 31 for n in range(16)]
        first = 3 - (unit["JSQR"] >> 20 & 3)
        unit.group, unit.code = group, None
        unit.channel = sequence[unit.rank] if group == "R" else unit["JSQR"] >> 5 * (first + unit.injected_rank) & 31
        unit.cycles += delay + unit.sampling(unit.channel)
        unit.sample_ns = unit.start_ns + int(unit.cycles * 1_000_000_000 / self.clock)
        unit.cycles += Fraction(25, 2)
        unit.end_ns = unit.start_ns + int(unit.cycles * 1_000_000_000 / self.clock)
        unit.sr |= STRT if group == "R" else JSTRT

    def _convert(self, unit: Unit) -> int:
        channel, is_master = unit.channel, unit is self.units[0]
        uv = 0
        if channel < 10:
            uv = self.uv(channel, unit.sample_ns)
        elif is_master and unit.has("CR2", TSVREFE):
            uv = {16: 1_430_000, 17: 1_200_000}.get(channel, 0)
        return max(0, min(4095, int(Fraction(uv * 4096, self.vdda_uv) + Fraction(1, 2))))

    def _finish(self, unit: Unit) -> None:
        code = self._convert(unit) if unit.code is None else unit.code
        is_regular = unit.group == "R"
        if unit.has("CR1", AWDEN if is_regular else JAWDEN) and (
            not unit.has("CR1", AWDSGL) or unit["CR1"] & 31 == unit.channel
        ):
            unit.sr |= AWD * (not unit["LTR"] <= code <= unit["HTR"])
        unit.group = None
        if is_regular:
            self._finish_regular(unit, code)
        else:
            self._finish_injected(unit, code)

    def _finish_regular(self, unit: Unit, code: int) -> None:
        unit.dr = code << 4 if unit.has("CR2", ALIGN) else code
        unit.is_requesting |= unit is self.units[0] and unit.has("CR2", DMA)
        unit.rank += 1
        unit.left -= unit.left > 0
        is_last = unit.rank >= len(unit.regular)
        if is_last or unit.has("CR1", DISCEN):
            unit.sr |= EOC
        if not is_last:
            if unit.left:
                self._begin(unit, "R")
            return
        unit.rank = 0
        if unit.has("CR1", JAUTO):
            unit.injected_rank, unit.injected_left, unit.is_automatic = 0, len(unit.injected), True
            self._begin(unit, "J", 2 if self.divider == 2 else 1)
        elif SLOW in self.mode:
            unit.left = len(unit.regular)
            took = unit.sampling(unit.channel) + Fraction(25, 2)
            self._begin(unit, "R", max(0, int(28 - took)))
        elif unit.has("CR2", CONT) and not unit.has("CR1", DISCEN):
            unit.left = len(unit.regular)
            self._begin(unit, "R")

    def _finish_injected(self, unit: Unit, code: int) -> None:
        result = (code - unit[f"JOFR{unit.injected_rank + 1}"]) * (8 if unit.has("CR2", ALIGN) else 1)
        unit.jdr[unit.injected_rank] = result & 0xFFFF
        unit.injected_rank += 1
        unit.injected_left -= 1
        is_last = unit.injected_rank >= len(unit.injected)
        was_automatic = unit.is_automatic
        if is_last:
            unit.sr |= JEOC | EOC
            unit.injected_rank = 0
        elif unit.injected_left > 0:
            self._begin(unit, "J")
            return
        unit.is_automatic = False
        if unit.is_interrupted:
            unit.is_interrupted = False
            self._begin(unit, "R", (2 if self.divider == 2 else 1) if was_automatic else 0)
        elif was_automatic and unit.has("CR2", CONT) and not unit.has("CR1", DISCEN):
            unit.left = len(unit.regular)
            self._begin(unit, "R", 2 if self.divider == 2 else 1)
