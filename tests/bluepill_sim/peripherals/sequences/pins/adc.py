"""ADC: power, calibration and clock before the first conversion; what starts one, and what its flags wait for."""

from hypothesis import strategies as st

from tests.bluepill_sim.peripherals.sequences.bench import Bench
from tests.bluepill_sim.peripherals.sequences.row import Sequences
from tests.bluepill_sim.peripherals.sequences.sources import HAL, HAL_EX, KLIPPER, LOCM3, RIOT, RUST, ours, rm

ADC = Sequences("ADC")
#: A cycle of ADCCLK after a reset: 8 MHz / 2.
CYCLE_NS = 250
#: Sampling of 1.5 cycles and 12.5 more.
CONVERSION_NS = 14 * CYCLE_NS
ADON, CONT, CAL, RSTCAL, DMA, ALIGN = 1, 2, 4, 8, 1 << 8, 1 << 11
EXTTRIG, JEXTTRIG, SWSTART, JSWSTART, TSVREFE = 1 << 20, 1 << 15, 1 << 22, 1 << 21, 1 << 23
SOFTWARE, JSOFTWARE = EXTTRIG | 7 << 17, JEXTTRIG | 7 << 12
SCAN, DISCEN, JAUTO, JDISCEN, AWDEN, AWDSGL, EOCIE = 1 << 8, 1 << 11, 1 << 10, 1 << 12, 1 << 23, 1 << 9, 1 << 5
AWD, EOC, JEOC, JSTRT, STRT = 1, 2, 4, 8, 16


def switch_on(chip: Bench, cr2: int = 0, cr1: int = 0) -> None:
    """ADC1 on its analog pins, stable, with 1 V at PA0, 2 V at PA1 and 3 V at PA2."""
    chip.clock("GPIOA", "ADC1")
    chip["GPIOA.CRL"] = 0
    for pin, volts in (("PA0", 1.0), ("PA1", 2.0), ("PA2", 3.0)):
        chip.pins[pin].set_volts(volts)
    chip["ADC1.CR1"] = cr1
    chip["ADC1.CR2"] = cr2 | ADON
    chip.run(1_000)


def start(chip: Bench) -> None:
    chip["ADC1.CR2"] |= SOFTWARE | SWSTART


def flags(chip: Bench) -> int:
    """Return SR without reading it."""
    return int(chip.parts.by_name["ADC1"].look(0))


def code(volts: float) -> int:
    return int(volts * 4096 / 3.3 + 0.5)


@ADC.row(
    "power-first",
    "ADON 0 to 1 only powers the converter: neither this nor a trigger while it is off converts.",
    LOCM3("f1/adc", 117),
    HAL("adc", 343),
    rm("11.3.1"),
)
def _(chip: Bench) -> None:
    chip.clock("ADC1")
    chip["ADC1.CR2"] = SOFTWARE | SWSTART
    chip.run(100_000)
    assert flags(chip) == 0
    switch_on(chip, SOFTWARE)
    chip.run(100_000)
    assert flags(chip) == 0


@ADC.row(
    "stable-first",
    "A conversion begins only when the converter has been stable for tSTAB.",
    HAL("adc", 2246),
    RUST("adc", 300),
    LOCM3("f1/adc", 100),
    rm("11.3.1"),
    choice="1 us, the data sheet's, as ST waits; libopencm3 asks for 3 us; an earlier start waits for it",
)
def _(chip: Bench) -> None:
    chip.clock("ADC1")
    chip["ADC1.CR2"] = ADON
    start(chip)
    chip.run(1_000 + CONVERSION_NS - 1)
    assert not flags(chip) & EOC
    chip.run(1)
    assert flags(chip) & EOC


@ADC.row(
    "adon-again",
    "A second write of ADON that changes no other bit of CR2 starts a conversion; with another bit it does not.",
    RUST("adc", 406),
    HAL("adc", 1116),
    rm("11.12.3"),
)
def _(chip: Bench) -> None:
    switch_on(chip)
    chip["ADC1.CR2"] = ADON | ALIGN
    chip.run(10 * CONVERSION_NS)
    assert not flags(chip) & EOC
    chip["ADC1.CR2"] = ADON | ALIGN
    chip.run(CONVERSION_NS)
    assert flags(chip) & EOC


@ADC.row(
    "trigger-needs-exttrig",
    "SWSTART starts only with EXTTRIG set and EXTSEL at software.",
    HAL("adc", 1121),
    RIOT("adc_f1", 120),
    LOCM3("common/adc_common_v1", 712),
    rm("11.3.7"),
    values=st.integers(0, 7),
)
def _(chip: Bench, source: int) -> None:
    switch_on(chip, source << 17 | (EXTTRIG if source != 7 else 0))
    chip["ADC1.CR2"] |= SWSTART
    chip.run(10 * CONVERSION_NS)
    assert not flags(chip) & EOC
    start(chip)
    chip.run(CONVERSION_NS)
    assert flags(chip) & EOC


@ADC.row(
    "calibrate-after-power",
    "Calibration comes once the converter is on, for two cycles at least, and before the first conversion.",
    HAL_EX("adc", 135),
    LOCM3("f1/adc", 334),
    KLIPPER("adc", 60),
    RUST("adc", 237),
    rm("11.4"),
    choice="with ADON, as ST, Klipper and the manual want it; libopencm3 wants it off for two cycles before; warned of "
    "where ADON is 0",
)
def _(chip: Bench) -> None:
    chip.clock("ADC1")
    chip["ADC1.CR2"] = CAL
    chip.run(100_000)
    assert [name for name in chip.warnings if name.startswith("ADC1")] != []
    chip.warnings.clear()
    switch_on(chip)
    chip["ADC1.CR2"] = ADON | CAL
    chip.run(83 * CYCLE_NS - 1)
    assert chip["ADC1.CR2.CAL"]
    chip.run(1)
    assert (chip["ADC1.CR2.CAL"], chip.warnings) == (0, {})


@ADC.row(
    "rstcal-until-clear",
    "RSTCAL reads 1 until the registers of the calibration are reset, and is waited for before CAL.",
    RIOT("adc_f1", 105),
    HAL_EX("adc", 163),
    rm("11.12.3"),
)
def _(chip: Bench) -> None:
    switch_on(chip)
    chip["ADC1.CR2"] = ADON | RSTCAL
    assert chip["ADC1.CR2.RSTCAL"]
    chip.run(4 * CYCLE_NS)
    assert not chip["ADC1.CR2.RSTCAL"]


@ADC.row(
    "eoc-by-dr",
    "EOC is cleared by a read of DR, or by writing 0.",
    HAL("adc", 1767),
    RUST("adc", 420),
    rm("11.12.1"),
)
def _(chip: Bench) -> None:
    switch_on(chip)
    for clear in (lambda: chip["ADC1.DR"], lambda: chip.__setitem__("ADC1.SR", 0)):
        start(chip)
        chip.run(CONVERSION_NS)
        assert flags(chip) & EOC
        clear()
        assert not flags(chip) & EOC


@ADC.row(
    "strt-stays",
    "STRT rises with the conversion and stays until 0 is written: a read of DR leaves it.",
    RIOT("adc_f1", 156),
    rm("11.12.1"),
    choice="RIOT's comment has the read of DR clear STRT; the manual says by software",
)
def _(chip: Bench) -> None:
    switch_on(chip)
    start(chip)
    assert flags(chip) == STRT
    chip.run(CONVERSION_NS)
    _dr = chip["ADC1.DR"]
    assert flags(chip) == STRT
    chip["ADC1.SR"] = 0x1F & ~STRT
    assert flags(chip) == 0


@ADC.row(
    "eoc-after-scan",
    "Of a scanned group EOC rises behind the last conversion alone, so that DMA, or a wait, has to take the others.",
    HAL("adc", 1228),
    LOCM3("f1/adc", 36),
    rm("11.3.8"),
    values=st.integers(2, 6),
)
def _(chip: Bench, count: int) -> None:
    switch_on(chip, cr1=SCAN)
    chip["ADC1.SQR1"] = count - 1 << 20
    start(chip)
    chip.run(count * CONVERSION_NS - 1)
    assert not flags(chip) & EOC
    chip.run(1)
    assert flags(chip) & EOC


@ADC.row(
    "scan-for-more-than-one",
    "Without SCAN a group converts its first channel alone, whatever L says.",
    HAL("adc", 1236),
    rm("11.12.2"),
)
def _(chip: Bench) -> None:
    switch_on(chip)
    chip["ADC1.SQR1"] = 2 << 20
    chip["ADC1.SQR3"] = 1 | 2 << 5
    start(chip)
    chip.run(CONVERSION_NS)
    assert (flags(chip) & EOC, chip["ADC1.DR"]) == (EOC, code(2.0))
    chip.run(10 * CONVERSION_NS)
    assert not flags(chip) & EOC


@ADC.row(
    "continuous-until-stopped",
    "With CONT conversions follow each other from one start until CONT or ADON is cleared.",
    rm("11.3.5"),
    RUST("adc", 618),
)
def _(chip: Bench) -> None:
    switch_on(chip, CONT)
    start(chip)
    for _ in range(3):
        chip.run(CONVERSION_NS)
        assert flags(chip) & EOC
        _dr = chip["ADC1.DR"]
    chip["ADC1.CR2"] &= ~(CONT | SWSTART)
    chip.run(CONVERSION_NS)
    _dr = chip["ADC1.DR"]
    chip.run(5 * CONVERSION_NS)
    assert not flags(chip) & EOC


@ADC.row(
    "discontinuous-parts",
    "With DISCEN each trigger converts the next DISCNUM + 1 of the group, and begins anew behind its end.",
    LOCM3("common/adc_common_v1", 170),
    rm("11.3.10"),
)
def _(chip: Bench) -> None:
    switch_on(chip, cr1=SCAN | DISCEN)
    chip["ADC1.SQR1"] = 2 << 20
    chip["ADC1.SQR3"] = 0 | 1 << 5 | 2 << 10
    for volts in (1.0, 2.0, 3.0, 1.0):
        start(chip)
        chip.run(CONVERSION_NS)
        assert chip["ADC1.DR"] == code(volts)


@ADC.row(
    "continuous-or-discontinuous",
    "DISCEN and CONT are not set together.",
    HAL("adc", 531),
    rm("11.12.2"),
    choice="DISCEN wins over CONT",
)
def _(chip: Bench) -> None:
    switch_on(chip, CONT, SCAN | DISCEN)
    start(chip)
    chip.run(CONVERSION_NS)
    _dr = chip["ADC1.DR"]
    chip.run(10 * CONVERSION_NS)
    assert not flags(chip) & EOC


@ADC.row(
    "injected-data",
    "An injected group ends with JEOC, its data in JDR1 up; JEOC is cleared by 0, and by no read.",
    HAL_EX("adc", 398),
    rm("11.12.14"),
)
def _(chip: Bench) -> None:
    switch_on(chip)
    chip["ADC1.JSQR"] = 1 << 15
    chip["ADC1.CR2"] |= JSOFTWARE | JSWSTART
    chip.run(CONVERSION_NS - 1)
    assert flags(chip) == JSTRT
    chip.run(1)
    assert (flags(chip) & (JEOC | JSTRT), chip["ADC1.JDR1"]) == (JEOC | JSTRT, code(2.0))
    assert flags(chip) & JEOC
    chip["ADC1.SR"] = 0
    assert flags(chip) == 0


@ADC.row(
    "jsqr-from-the-end",
    "An injected group that is shorter than four stands in the last places of JSQR.",
    LOCM3("common/adc_common_v1", 641),
    rm("11.12.12"),
)
def _(chip: Bench) -> None:
    switch_on(chip, cr1=SCAN)
    chip["ADC1.JSQR"] = 1 << 20 | 1 << 10 | 2 << 15
    chip["ADC1.CR2"] |= JSOFTWARE | JSWSTART
    chip.run(2 * CONVERSION_NS)
    assert (chip["ADC1.JDR1"], chip["ADC1.JDR2"]) == (code(2.0), code(3.0))


@ADC.row(
    "offset-subtracted",
    "JOFR is taken from the injected result after the conversion, which may be negative.",
    LOCM3("common/adc_common_v1", 653),
    rm("11.12.6"),
    values=st.integers(0, 4095),
)
def _(chip: Bench, offset: int) -> None:
    switch_on(chip)
    chip["ADC1.JOFR1"] = offset
    chip["ADC1.JSQR"] = 1 << 15
    chip["ADC1.CR2"] |= JSOFTWARE | JSWSTART
    chip.run(CONVERSION_NS)
    assert chip["ADC1.JDR1"] == code(2.0) - offset & 0xFFFF


@ADC.row(
    "automatic-after-regular",
    "With JAUTO the injected group follows the regular one by itself, and JEXTTRIG must be 0.",
    HAL_EX("adc", 286),
    LOCM3("common/adc_common_v1", 232),
    rm("11.3.9"),
)
def _(chip: Bench) -> None:
    switch_on(chip, cr1=JAUTO)
    chip["ADC1.JSQR"] = 1 << 15
    start(chip)
    chip.run(CONVERSION_NS)
    assert flags(chip) & (EOC | JEOC) == EOC
    chip.run(2 * CONVERSION_NS)
    assert (flags(chip) & JEOC, chip["ADC1.JDR1"]) == (JEOC, code(2.0))


@ADC.row(
    "injected-first",
    "An injected trigger interrupts the regular conversion, which begins anew behind the injected group.",
    rm("11.3.9"),
    ours("ADC1, ADC2"),
)
def _(chip: Bench) -> None:
    switch_on(chip)
    chip["ADC1.JSQR"] = 1 << 15
    start(chip)
    chip.run(CONVERSION_NS - CYCLE_NS)
    chip["ADC1.CR2"] = chip["ADC1.CR2"] | JSOFTWARE | JSWSTART
    chip.run(CONVERSION_NS)
    assert flags(chip) & JEOC
    assert not chip["ADC1.CR2"] & SWSTART
    chip.run(CONVERSION_NS)
    assert chip["ADC1.DR"] == code(1.0)


@ADC.row(
    "watchdog-thresholds",
    "AWD rises with a conversion beyond HTR or LTR, which are set before AWDEN; it is cleared by 0.",
    LOCM3("common/adc_common_v1", 117),
    HAL("adc", 2101),
    rm("11.3.6"),
    values=st.sampled_from([(0, 4095, 0), (2482, 2482, 0), (2483, 4095, 1), (0, 2481, 1)]),
)
def _(chip: Bench, case: tuple[int, int, int]) -> None:
    low, high, flag = case
    switch_on(chip)
    chip["ADC1.LTR"], chip["ADC1.HTR"] = low, high
    chip["ADC1.SQR3"] = 1
    chip["ADC1.CR1"] = AWDEN
    start(chip)
    chip.run(CONVERSION_NS)
    assert flags(chip) & AWD == flag
    chip["ADC1.SR"] = 0
    assert not flags(chip) & AWD


@ADC.row(
    "sensor-needs-tsvrefe",
    "Channels 16 and 17 have a value only with TSVREFE set before, and at ADC1 alone.",
    HAL("adc", 2059),
    RIOT("adc_f1", 122),
    rm("11.10"),
)
def _(chip: Bench) -> None:
    switch_on(chip)
    chip["ADC1.SQR3"] = 17
    start(chip)
    chip.run(CONVERSION_NS)
    assert chip["ADC1.DR"] == 0
    chip["ADC1.CR2"] |= TSVREFE
    start(chip)
    chip.run(CONVERSION_NS)
    assert chip["ADC1.DR"] == code(1.2)


@ADC.row(
    "analog-pin-first",
    "A channel's pin is made an analog input before it is converted.",
    RIOT("adc_f1", 90),
    HAL("gpio", 71),
    rm("11.2"),
    choice="it is converted all the same, and warned of",
)
def _(chip: Bench) -> None:
    switch_on(chip)
    chip["GPIOA.CRL"] = 0x4444_4444
    start(chip)
    chip.run(CONVERSION_NS)
    assert any("PA0" in text for text in chip.warnings.values())


@ADC.row(
    "clock-below-14-mhz",
    "ADCPRE keeps ADCCLK at 14 MHz or less, and is set before the first conversion.",
    RIOT("adc_f1", 94),
    HAL("adc", 391),
    rm("7.3.2"),
)
def _(chip: Bench) -> None:
    chip.run_at_72_mhz()
    switch_on(chip)
    start(chip)
    chip.run(CONVERSION_NS)
    assert any("14" in text for name, text in chip.warnings.items() if name.startswith("ADC"))


@ADC.row(
    "dma-of-adc1",
    "With DMA each regular result of ADC1 asks channel 1 for a transfer of its own, which clears EOC.",
    HAL("adc", 1538),
    rm("11.8"),
)
def _(chip: Bench) -> None:
    switch_on(chip, DMA, SCAN)
    chip.clock("DMA1")
    for name, value in (("CPAR1", 0x4001_244C), ("CMAR1", 0x2000_0000), ("CNDTR1", 3), ("CCR1", 0x581)):
        chip[f"DMA1.{name}"] = value
    chip["ADC1.SQR1"] = 2 << 20
    chip["ADC1.SQR3"] = 0 | 1 << 5 | 2 << 10
    start(chip)
    chip.run(3 * CONVERSION_NS + 2_000)
    codes = b"".join(code(volts).to_bytes(2, "little") for volts in (1.0, 2.0, 3.0))
    assert (chip["DMA1.CNDTR1"], chip.got(0x2000_0000, 6)) == (0, codes)


@ADC.row(
    "interrupt-by-enable",
    "EOC interrupts only with EOCIE, while it stands.",
    rm("11.11"),
    HAL("adc", 1453),
)
def _(chip: Bench) -> None:
    switch_on(chip)
    start(chip)
    chip.run(CONVERSION_NS)
    assert not chip.irqs[18]
    chip["ADC1.CR1"] = EOCIE
    assert chip.irqs[18]
    _dr = chip["ADC1.DR"]
    assert not chip.irqs[18]


ADC.not_modelled(
    "sensor-settles",
    "The temperature sensor needs 10 us behind TSVREFE before it is right.",
    HAL("adc", 348),
    RUST("adc", 521),
    rm("11.10"),
    why="its value is there at once",
)
ADC.not_modelled(
    "calibration-code",
    "The calibration's code stands in DR when CAL has fallen.",
    rm("11.4"),
    why="converters have no error to correct, and DR stays",
)
