"""Walks of what counts, converts and copies: TIM1 to TIM4, both ADCs, DMA1."""

from bluepill_sim.fabric.signals import Oscillation, Waveform
from bluepill_sim.stm32f103 import BASES
from tests.bluepill_sim.peripherals.walks.walker import BUFFER, RegisterWalk, RegisterWalker

_TIM_PINS = {
    1: ("PA8", "PA9", "PA10", "PA11", "PA12", "PB12", "PB13"), 2: ("PA0", "PA1", "PA2", "PA3"),
    3: ("PA6", "PA7", "PB0", "PB1"), 4: ("PB6", "PB7", "PB8", "PB9"),
}  # fmt: skip
_TIM_REMAPS = {1: (0x40, 0xC0), 2: (0x100, 0x200, 0x300), 3: (0x800, 0xC00), 4: (0x1000,)}
#: Output modes of two channels; inputs with filters and prescalers; one of each.
_MODES = (
    0x6060, 0x6868, 0x7070, 0x7878, 0x3030, 0x1131, 0x4050, 0x0101, 0x3201, 0x0D25, 0x6803, 0x0168, 0x6C6C, 0x1020,
    0x2010,
)  # fmt: skip
_SLAVES = (
    0, 0, 0, 0, 0, 1, 2, 3, 0x44, 0x54, 0x55, 0x56, 0x57, 0x64, 0x77, 0x05, 0x16, 0x67, 0x4477, 0x80, 0xB2F7, 0x4000,
    0x7000, 0xC007, 0x5071,
)  # fmt: skip


def _tim(number: int) -> RegisterWalk:  # noqa: C901, PLR0915 - a function a move
    name = f"TIM{number}"
    other = "TIM1" if number == 2 else "TIM2"

    def begin(w: RegisterWalker) -> None:
        for port in "AB":
            for half in "LH":
                w.write(f"GPIO{port}.CR{half}", w.pick((0xBBBB_BBBB, 0x4444_4444, 0xBB44_BB44, 0x8B8B_8B8B)))
        for pin in _TIM_PINS[number]:
            w.drive(pin, w.pick((False, True, None)))
        w.write(f"{name}.PSC", w.pick((0, 0, 1, 7)))
        w.write(f"{name}.ARR", w.pick((0, 1, 9, 30, 200)))
        for n in range(1, 5):
            w.write(f"{name}.CCR{n}", w.pick((0, 1, 5, 9, 29, 30, 300)))
        w.write(f"{name}.CCMR1", w.turn_of(_MODES))
        w.write(f"{name}.CCMR2", w.pick(_MODES))
        if number == 1 and not w.number(3):
            w.turn("RCC.CR", on=1 << 16)
            w.run(2_000_000)
            w.turn("RCC.CR", on=1 << 19)
        w.write(f"{name}.CCER", w.pick((0x1111, 0x3333, 0x0555, 0x0DDD, 0x0F7B, 0x1010, 0x1331)))
        w.write(f"{name}.SMCR", w.turn_of(_SLAVES))
        w.write(f"{name}.DIER", w.pick((0, 0, 0x1F, 0x5F, 0xFFFF, 0x7F00)))
        w.write(f"{name}.CR2", w.pick((0, 0x10, 0x20, 0x30, 0x40, 0x50, 0x70, 0x80, 0xFF, 5)))
        if number == 1:
            w.write("TIM1.BDTR", w.pick((0x8000, 0x8000, 0xC010, 0xD005, 0xFC83, 0xBC20)) | w.number(16))
            w.write("TIM1.RCR", w.pick((0, 0, 1, 3)))
        if w.number(3) == 0:
            w.write("DMA1.CPAR1", w.part(name).base + w.pick((0x4C, 0x34)))
            _channels(w)
            w.write(f"{name}.DCR", w.pick((0, 0x20D, 0x107)))
        w.write(f"{other}.ARR", 40)
        w.write(f"{other}.CR2", 0x20)
        w.write(f"{other}.CR1", 1)
        w.write(f"{name}.CR1", w.pick((1, 1, 0x11, 0x21, 0x41, 0x61, 0x81, 0x9, 0x385, 0x3)))

    def _channels(w: RegisterWalker) -> None:
        for channel in range(1, 8):
            w.write(f"DMA1.CMAR{channel}", BUFFER + 16 * channel)
            w.write(f"DMA1.CPAR{channel}", w.part(name).base + w.pick((0x4C, 0x34, 0x3C)))
            w.write(f"DMA1.CNDTR{channel}", 1 + w.number(6))
            w.write(f"DMA1.CCR{channel}", 0x5A1 | w.some(16))

    def pin(w: RegisterWalker) -> None:
        for _ in range(w.pick((1, 1, 4))):
            w.drive(w.pick(_TIM_PINS[number]), w.pick((False, True, False, True, None)))
            w.run(w.pick((125, 1_000, 3_000)))

    def glitch(w: RegisterWalker) -> None:
        """Levels that are shorter than a filter."""
        name_of_pin, first = w.pick(_TIM_PINS[number]), w.number(2)
        for n in range(w.pick((3, 4, 5))):
            w.drive(name_of_pin, bool((n + first) % 2))
            w.run(w.pick((250, 500, 625, 1_125, 2_000)))
        if not w.number(3):
            w.write(f"{name}.CCMR{1 + w.number(2)}", w.pick((0x0101, 0x2121)))

    def crystal(w: RegisterWalker) -> None:
        w.board.crystal_works = not w.board.crystal_works
        w.note(f"crystal {w.board.crystal_works}")

    def duty(w: RegisterWalker) -> None:
        """A wave, and other lengths of its pulse in the midst of it."""
        n = 1 + w.number(4)
        w.write(f"{name}.CCMR{(n + 1) // 2}", w.pick((0x6060, 0x7070, 0x6868)))
        w.write(f"{name}.ARR", 39)
        for _ in range(3):
            w.run(w.pick((6_000, 11_000, 20_125)))
            w.write(f"{name}.CCR{n}", w.pick((0, 3, 10, 20, 30, 39, 40, 50)))

    def preload(w: RegisterWalker) -> None:
        """Write a compare value that waits for the update event: others, and the one that is active."""
        n, active = 1 + w.number(4), w.pick((0, 1, 6, 7))
        w.write(f"{name}.CCMR{(n + 1) // 2}", w.pick((0x6868, 0x6868, 0x7878, 0x6860, 0x6968)))
        w.write(f"{name}.ARR", 39)
        w.turn(f"{name}.CR1", on=1)
        w.write(f"{name}.CCR{n}", active)
        w.write(f"{name}.EGR", 1)
        for change in (3, *(w.pick((0, 1, 2, 0x1_0000, 0x1_0003)) for _ in range(4))):
            w.write(f"{name}.CCR{n}", active ^ change)

    def compare(w: RegisterWalker) -> None:
        w.write(f"{name}.CCR{1 + w.number(4)}", w.number(40))

    def clear(w: RegisterWalker) -> None:
        w.write(f"{name}.SR", w.pick((0, 0xFFFE, 0xFFFD, 0xE1E1)))
        w.read(f"{name}.CCR{1 + w.number(4)}")

    def generate(w: RegisterWalker) -> None:
        w.write(f"{name}.EGR", w.some(*(1 << n for n in range(8))))

    def shape(w: RegisterWalker) -> None:
        register, words = w.pick((
            ("ARR", (0, 3, 30, 31)), ("PSC", (0, 1, 3)), ("CNT", (0, 5, 29, 32, 65_500, 65_535)),
            ("CR1", (0, 1, 0x11, 0x81, 0x61)),
            ("SMCR", _SLAVES), ("BDTR" if number == 1 else "CR2", (0x8000, 0x50, 0x9000, 0xB000)),
            ("CCER", (0, 0x1111, 0x3333, 0x0DDD)), ("CCMR1", _MODES), ("CCMR2", _MODES),
        ))  # fmt: skip
        w.write(f"{name}.{register}", w.pick(words))

    def burst(w: RegisterWalker) -> None:
        """Write registers through DMAR, with a write of another in between."""
        w.write(f"{name}.DCR", w.pick((0x20D, 0x307, 0x10B)))
        for _ in range(4):
            w.write(f"{name}.DMAR", w.number(60))
            if not w.number(3):
                other_register = w.pick(("BDTR", "DIER", "SR") if number == 1 else ("DIER", "SR", "CR2"))
                w.write(f"{name}.{other_register}", w.look(f"{name}.{other_register}"))

    moves = (pin, pin, glitch, glitch, compare, clear, clear, generate, shape, shape, duty, burst, preload)
    return RegisterWalk(
        name=name, parts=(name, "DMA1"), begin=begin, remaps=_TIM_REMAPS[number],
        moves=(*moves, crystal) if number == 1 else moves,
        spans_ns=(125, 250, 1_000, 1_125, 4_000, 10_000, 31_000), beside=(other,), episodes=30 if number < 3 else 10,
    )  # fmt: skip


# ADC.

_EXTTRIG, _JEXTTRIG, _SWSTART, _JSWSTART, _TSVREFE = 1 << 20, 1 << 15, 1 << 22, 1 << 21, 1 << 23
_DUALS = (0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9)


def _adc_begin(w: RegisterWalker) -> None:
    w.write("GPIOA.CRL", w.pick((0, 0, 0, 0x0000_4400)))
    w.board.temperature_c = w.pick((25.0, -20.0, 80.0))
    for n in range(4):
        w.board.pin(f"PA{n}").set_volts(0.5 * n + 0.2)
    wave = Oscillation(shape=Waveform.TRIANGLE, low_v=0, high_v=3.3, period_ns=70_000)
    w.board.pin("PA4").set_volts(wave)
    is_plain = not w.number(4)
    for name in ("ADC1", "ADC2"):
        dual = w.pick(_DUALS) << 16 if name == "ADC1" else 0
        scanned = w.some(0x20, 0x40, 0x80, 0x100, 0x200, 0x400, 0x800, 0x1000, 1 << 22, 1 << 23)
        plain = w.pick((0, 0x100, 1 << 10 | 0x100, 1 << 10))
        w.write(f"{name}.CR1", plain if is_plain else dual | scanned | w.pick((0, 4)) | w.number(2) << 13)
        w.write(f"{name}.SQR1", w.number(4) << 20)
        w.write(f"{name}.SQR3", w.pick((w.number(5), 16, 17)) | w.number(5) << 5 | w.number(18) << 10)
        w.write(f"{name}.JSQR", w.number(4) << 20 | w.number(5) << 15 | w.number(5) << 10 | w.number(5) << 5)
        w.write(f"{name}.SMPR2", w.pick((0, 0o1234567, 0o7777777)))
        w.write(f"{name}.HTR", w.pick((0xFFF, 0x700)))
        w.write(f"{name}.LTR", w.pick((0, 0x300)))
        w.write(f"{name}.JOFR{1 + w.number(4)}", w.number(0x400))
        select = w.pick((7, 7, 7, 0, 3, 6)) << 17 | w.pick((7, 7, 0, 1, 6)) << 12
        control = 1 | select | _EXTTRIG | _JEXTTRIG | w.some(2, 2048) | (w.some(256, _TSVREFE) if name == "ADC1" else 0)
        w.write(f"{name}.CR2", control & ~256 | 2 if is_plain else control)
    for register in ("IMR", "EMR", "RTSR"):
        w.write(f"EXTI.{register}", 1 << 11 | 1 << 15)
    w.write("DMA1.CPAR1", BASES["ADC1"] + 0x4C)
    w.write("DMA1.CMAR1", BUFFER)
    w.write("DMA1.CNDTR1", 8)
    w.write("DMA1.CCR1", w.pick((0x5A1, 0x581, 0xAA1)))
    w.write("TIM1.ARR", 399)
    w.write("TIM1.CCR1", 100)
    w.write("TIM1.CCMR1", 0x60)
    w.write("TIM1.CCER", 1)
    w.write("TIM1.BDTR", 0x8000)
    w.write("TIM1.CR2", 0x20)
    w.write("TIM1.CR1", 1)
    w.run(2_000)


def _adc_start(w: RegisterWalker) -> None:
    name = w.pick(("ADC1", "ADC1", "ADC2"))
    w.turn(f"{name}.CR2", on=w.pick((_SWSTART, _SWSTART, _JSWSTART, 1, _SWSTART | _JSWSTART)))


def _adc_trigger(w: RegisterWalker) -> None:
    w.write("EXTI.PR", 1 << 11 | 1 << 15)
    w.write("EXTI.SWIER", w.pick((1 << 11, 1 << 15)))


def _adc_in_parts(w: RegisterWalker) -> None:
    """Start a sequence part by part, which may become shorter under way, or go on as a whole."""
    name = w.pick(("ADC1", "ADC2"))
    discontinuous, start = w.pick(((0x1000, _JSWSTART), (0x1000, _JSWSTART), (0x800, _SWSTART)))
    w.turn(f"{name}.CR1", on=discontinuous, off=0x400)
    w.turn(f"{name}.CR2", on=1 | 7 << 17 | 7 << 12 | _EXTTRIG | _JEXTTRIG, off=2)
    for _ in range(3 + w.number(4)):
        w.turn(f"{name}.CR2", on=start)
        w.run(w.pick((5_000, 70_000, 70_000)))
        if not w.number(3):
            w.write(f"{name}.JSQR", w.number(4) << 20 | w.number(5) << 15 | w.number(5) << 10)
            w.write(f"{name}.SQR1", w.number(4) << 20)
        if not w.number(4):
            w.turn(f"{name}.CR1", off=discontinuous)
    for register in ("JDR1", "JDR2", "JDR3", "JDR4", "SR"):
        w.read(f"{name}.{register}")


def _adc_calibrate(w: RegisterWalker) -> None:
    name = w.pick(("ADC1", "ADC2"))
    w.turn(f"{name}.CR2", on=w.pick((8, 4, 4, 1)), off=w.pick((0, 1, 2)))


def _adc_take(w: RegisterWalker) -> None:
    name = w.pick(("ADC1", "ADC2"))
    w.read(f"{name}.{w.pick(('DR', 'DR', 'JDR1', 'JDR2', 'JDR4', 'SR'))}")
    w.write(f"{name}.SR", w.pick((0, 0x1E, 0x1D, 0xF)))


def _adc_pin(w: RegisterWalker) -> None:
    pin = w.pick(("PA0", "PA1", "PA3"))
    volts = w.pick((0.0, 1.0, 1.65, 3.3))
    w.note(f"{pin} {volts} V")
    w.board.pin(pin).set_volts(volts)


_ADC = RegisterWalk(
    name="ADC", parts=("ADC1", "ADC2", "DMA1"), begin=_adc_begin,
    moves=(_adc_start, _adc_start, _adc_start, _adc_trigger, _adc_take, _adc_take, _adc_calibrate, _adc_pin,
           _adc_in_parts),
    spans_ns=(125, 1_000, 3_500, 7_000, 14_000, 30_000, 100_000), beside=("TIM1",), at_random=18, episodes=36,
)  # fmt: skip


# DMA.

_REGISTERS = ("DMA1.CCR2", "DMA1.CCR5", "GPIOA.ODR", "TIM2.CCR1", "CRC.DR", "USART1.DR", "GPIOB.BSRR")


def _dma_begin(w: RegisterWalker) -> None:
    w.put(bytes((11 * n + 5) & 0xFF for n in range(0x100)))
    w.write("GPIOA.CRL", 0x3333_3333)
    w.write("TIM2.ARR", w.pick((15, 40)))
    w.write("TIM2.DIER", 0xFF00)
    for n in range(1, 5):
        w.write(f"TIM2.CCR{n}", 3 * n)
    for _ in range(3):
        _dma_channel(w)
    w.write("TIM2.CR1", 1)


def _dma_channel(w: RegisterWalker) -> None:
    n = 1 + w.number(7)
    w.write(f"DMA1.CCR{n}", 0)
    is_memory = w.number(2)
    base, _, register = w.pick(_REGISTERS).partition(".")
    place = w.part(base).base + next(one.offset for one in w.part(base).REGISTERS if one.name == register)
    odd = w.pick((0, 0, 0, 1, 2))
    w.write(f"DMA1.CPAR{n}", BUFFER + 0x80 + odd if is_memory else place)
    w.write(f"DMA1.CMAR{n}", w.pick((BUFFER + 16 * w.number(8) + odd,) * 9 + (0x0800_0010, 0x3000_0000)))
    w.write(f"DMA1.CNDTR{n}", w.pick((0, 1, 2, 5, 9)))
    modes = w.pick((0, 0x100, 0x200, 0x500, 0xA00, 0x400, 0x800, 0x900))
    control = modes | w.number(4) << 12 | w.some(2, 4, 8, 16, 32, 64) | (0x4080 if is_memory and w.number(3) else 0x80)
    w.write(f"DMA1.CCR{n}", control)
    w.write(f"DMA1.CCR{n}", control | 1)


def _dma_clear(w: RegisterWalker) -> None:
    w.write("DMA1.IFCR", w.pick((0x0FFF_FFFF, w.some(*(1 << n for n in range(28))))))


def _dma_stop(w: RegisterWalker) -> None:
    w.turn(f"DMA1.CCR{1 + w.number(7)}", off=1)


_DMA = RegisterWalk(
    name="DMA1", parts=("DMA1",), begin=_dma_begin,
    moves=(_dma_channel, _dma_channel, _dma_clear, _dma_stop), spans_ns=(125, 500, 1_000, 3_000, 12_000, 50_000),
    beside=("TIM2", "CRC"), episodes=24,
)  # fmt: skip

TIMERS = (*map(_tim, (1, 2, 3, 4)), _ADC, _DMA)
