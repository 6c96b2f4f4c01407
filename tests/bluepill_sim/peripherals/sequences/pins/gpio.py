"""GPIO and AFIO: what a pin does after its configuration, and what comes first."""

from hypothesis import strategies as st

from bluepill_sim.peripherals.rcc import ResetCause
from tests.bluepill_sim.peripherals.sequences.bench import Bench
from tests.bluepill_sim.peripherals.sequences.row import Sequences
from tests.bluepill_sim.peripherals.sequences.sources import HAL, KLIPPER, LOCM3, RUST, ours, rm

GPIO, AFIO = Sequences("GPIO"), Sequences("AFIO")
OUTPUT, OPEN_DRAIN, PULLED, FLOATING, ANALOG = 0b0011, 0b0111, 0b1000, 0b0100, 0
LCKK = 1 << 16


def configure(chip: Bench, pin: int, nibble: int, port: str = "GPIOB") -> None:
    name = f"{port}.{'CRH' if pin > 7 else 'CRL'}"
    shift = pin % 8 * 4
    chip[name] = chip[name] & ~(15 << shift) | nibble << shift


@GPIO.row(
    "input-after-reset",
    "During and after a reset every pin but those of JTAG is a floating input.",
    HAL("gpio", 88),
    rm("9.1.2"),
)
def _(chip: Bench) -> None:
    chip.clock("GPIOA", "GPIOB", "GPIOC")
    for port in "ABC":
        assert (chip[f"GPIO{port}.CRL"], chip[f"GPIO{port}.CRH"], chip[f"GPIO{port}.ODR"]) == (0x4444_4444,) * 2 + (0,)
    chip.drive("PB9", True)
    assert chip["GPIOB.IDR.IDR9"] == 1
    chip.drive("PB9", False)
    assert chip["GPIOB.IDR.IDR9"] == 0


@GPIO.row(
    "clock-before-init",
    "A port is configured only after its APB2 clock is on.",
    HAL("gpio", 63),
    rm("7.3.7"),
)
def _(chip: Bench) -> None:
    chip["GPIOC.CRH"] = 0x4434_4444
    chip.clock("GPIOC")
    assert chip["GPIOC.CRH"] == 0x4444_4444
    chip["GPIOC.CRH"] = 0x4434_4444
    assert chip["GPIOC.CRH"] == 0x4434_4444


@GPIO.row(
    "level-before-output",
    "ODR is taken in any mode: a level set first is that of the output when it becomes one.",
    RUST("gpio", 511),
    rm("9.1.1"),
    values=st.integers(0, 1),
)
def _(chip: Bench, level: int) -> None:
    chip.clock("GPIOB")
    edges: list[bool] = []
    chip["GPIOB.BSRR"] = 1 << (8 if level else 24)
    configure(chip, 8, OUTPUT)
    edges.append(chip.level("PB8"))
    assert edges == [bool(level)]


@GPIO.row(
    "pull-by-odr",
    "Which pull a pulled input has is what ODR says, before or after the mode.",
    HAL("gpio", 256),
    rm("9.1.1"),
    values=st.integers(0, 15).filter(lambda pin: pin not in {2, 3, 4}),
)
def _(chip: Bench, pin: int) -> None:
    chip.clock("GPIOB")
    configure(chip, pin, PULLED)
    assert not chip["GPIOB.IDR"] >> pin & 1
    chip["GPIOB.BSRR"] = 1 << pin
    assert chip["GPIOB.IDR"] >> pin & 1
    chip["GPIOB.BRR"] = 1 << pin
    assert not chip["GPIOB.IDR"] >> pin & 1


@GPIO.row(
    "set-wins",
    "Where BSRR sets and resets a bit in one write, the set wins.",
    rm("9.2.5"),
    values=st.integers(0, 0xFFFF_FFFF),
)
def _(chip: Bench, word: int) -> None:
    chip.clock("GPIOB")
    chip["GPIOB.ODR"] = 0x5A5A
    chip["GPIOB.BSRR"] = word
    assert chip["GPIOB.ODR"] == 0x5A5A & ~(word >> 16) | word & 0xFFFF
    assert chip["GPIOB.BSRR"] == 0


@GPIO.row(
    "others-stay",
    "A write of BSRR or BRR leaves every pin alone whose bit is 0: nothing has to be read before.",
    HAL("gpio", 498),
    rm("9.1.3"),
    values=st.integers(0, 0xFFFF),
)
def _(chip: Bench, word: int) -> None:
    chip.clock("GPIOB")
    chip["GPIOB.ODR"] = 0xC35A
    chip["GPIOB.BRR"] = word
    assert chip["GPIOB.ODR"] == 0xC35A & ~word


@GPIO.row(
    "lock-sequence",
    "A lock needs LCKK 1, 0, 1 with the same pins, then a read; the second read shows LCKK.",
    HAL("gpio", 523),
    LOCM3("common/gpio_common_all", 136),
    rm("9.2.7"),
    values=st.integers(1, 0xFFFF),
)
def _(chip: Bench, pins: int) -> None:
    chip.clock("GPIOB")
    for word in (LCKK | pins, pins, LCKK | pins):
        chip["GPIOB.LCKR"] = word
    assert chip["GPIOB.LCKR"] == pins
    assert chip["GPIOB.LCKR"] == LCKK | pins


@GPIO.row(
    "lock-broken",
    "Other pins, or another order of LCKK, in one of the three writes make no lock.",
    rm("9.2.7"),
    values=st.integers(0, 2),
)
def _(chip: Bench, wrong: int) -> None:
    chip.clock("GPIOB")
    words = [LCKK | 3, 3, LCKK | 3]
    for broken in (words[wrong] ^ 1, words[wrong] ^ LCKK):
        for word in [*words[:wrong], broken, *words[wrong + 1 :]]:
            chip["GPIOB.LCKR"] = word
        assert not (chip["GPIOB.LCKR"], chip["GPIOB.LCKR"])[1] & LCKK
    configure(chip, 0, OUTPUT)
    assert chip["GPIOB.CRL"] & 15 == OUTPUT


@GPIO.row(
    "locked-until-reset",
    "A locked pin keeps its configuration until the next reset; its data go on.",
    HAL("gpio", 504),
    LOCM3("common/gpio_common_all", 123),
    rm("9.2.7"),
    values=st.integers(5, 15),
)
def _(chip: Bench, pin: int) -> None:
    chip.clock("GPIOB")
    configure(chip, pin, OUTPUT)
    for word in (LCKK | 1 << pin, 1 << pin, LCKK | 1 << pin):
        chip["GPIOB.LCKR"] = word
    assert chip["GPIOB.LCKR"] == 1 << pin
    configure(chip, pin, FLOATING)
    configure(chip, (pin + 1) % 16, ANALOG)
    nibbles = chip["GPIOB.CRH"] << 32 | chip["GPIOB.CRL"]
    assert (nibbles >> 4 * pin & 15, nibbles >> 4 * ((pin + 1) % 16) & 15) == (OUTPUT, ANALOG)
    chip["GPIOB.ODR"] = 1 << pin
    assert chip.level(f"PB{pin}")
    chip.parts.reset(ResetCause.SOFTWARE)
    chip.clock("GPIOB")
    configure(chip, pin, ANALOG)
    assert (chip["GPIOB.CRH"] << 32 | chip["GPIOB.CRL"]) >> 4 * pin & 15 == ANALOG


@GPIO.row(
    "open-drain-reads-wire",
    "An open-drain output lets its pin go at 1: IDR then reads what the wire is.",
    rm("9.1.9"),
    HAL("gpio", 218),
)
def _(chip: Bench) -> None:
    chip.clock("GPIOB")
    chip["GPIOB.ODR"] = 1 << 6
    configure(chip, 6, OPEN_DRAIN)
    chip.drive("PB6", True)
    assert chip["GPIOB.IDR.IDR6"]
    chip.drive("PB6", False)
    assert not chip["GPIOB.IDR.IDR6"]
    chip.drive("PB6", None)
    chip["GPIOB.BRR"] = 1 << 6
    chip.pins["PB6"].drive(True, is_weak=True)
    assert not chip["GPIOB.IDR.IDR6"]


@GPIO.row("analog-reads-0", "IDR of an analog pin reads 0, whatever is on it.", rm("9.1.11"))
def _(chip: Bench) -> None:
    chip.clock("GPIOB")
    chip.drive("PB1", True)
    configure(chip, 1, ANALOG)
    assert not chip["GPIOB.IDR.IDR1"]
    configure(chip, 1, FLOATING)
    assert chip["GPIOB.IDR.IDR1"]


@GPIO.row(
    "odr-not-wire",
    "ODR reads what was written, IDR what the wire is.",
    rm("9.1.8"),
    ours("GPIOA to GPIOE"),
)
def _(chip: Bench) -> None:
    chip.clock("GPIOB")
    chip["GPIOB.ODR"] = 1 << 5
    chip.drive("PB5", False)
    assert (chip["GPIOB.ODR.ODR5"], chip["GPIOB.IDR.IDR5"]) == (1, 0)
    configure(chip, 5, OUTPUT)
    chip.drive("PB5", None)
    assert chip["GPIOB.IDR.IDR5"] == 1


@GPIO.row(
    "word-by-byte",
    "GPIO is behind a bridge: a byte is written to all four of its word.",
    LOCM3("f1/gpio", 20),
    rm("3.1"),
    choice="the copies count, and are warned of; libopencm3 says that ODR must be written as a word",
)
def _(chip: Bench) -> None:
    chip.clock("GPIOB")
    chip.store("GPIOB.ODR", 0xA5, 1)
    assert chip["GPIOB.ODR"] == 0xA5A5


GPIO.not_modelled(
    "speed",
    "MODE of an output is how fast its edges are.",
    HAL("gpio", 69),
    rm("9.2.1"),
    why="edges have no slope; every MODE but 00 is an output",
)
GPIO.not_modelled(
    "two-clocks-late",
    "IDR follows its pin through two stages of synchronisation.",
    rm("9.1.7"),
    why="the input synchroniser's clocks are left out, as peripherals.md says",
)


@AFIO.row(
    "jtag-first",
    "PB3, PB4 and PA15 belong to the debug port until SWJ_CFG gives them up; the configuration then counts.",
    LOCM3("f1/gpio", 155),
    RUST("gpio", 37),
    rm("9.3.5"),
    values=st.sampled_from(["PB3", "PB4", "PA15"]),
)
def _(chip: Bench, pin: str) -> None:
    chip.clock("GPIOA", "GPIOB", "AFIO")
    port, number = f"GPIO{pin[1]}", int(pin[2:])
    chip[f"{port}.BSRR"] = 1 << 16 + number
    configure(chip, number, OUTPUT, port)
    held = chip.pins[pin].holder
    chip["AFIO.MAPR"] = 2 << 24
    assert held is not None
    assert chip.pins[pin].holder is None
    chip[f"{port}.BSRR"] = 1 << number
    assert chip.level(pin)


@AFIO.row(
    "swd-stays",
    "SWJ_CFG 010 leaves PA13 and PA14 to SWD; 100 gives up all five.",
    LOCM3("f1/gpio", 155),
    rm("9.4.2"),
)
def _(chip: Bench) -> None:
    chip.clock("AFIO")
    for value, count in ((0, 5), (1, 4), (2, 2), (4, 0)):
        chip["AFIO.MAPR"] = value << 24
        held = [name for name in ("PA13", "PA14", "PA15", "PB3", "PB4") if chip.pins[name].holder]
        assert len(held) == count
    assert chip["AFIO.MAPR"] == 0


@AFIO.row(
    "swj-write-only",
    "SWJ_CFG does not read back: each write of MAPR must say it anew, or the debug port is back.",
    LOCM3("f1/gpio", 170),
    KLIPPER("stm32f1", 103),
    LOCM3("f1/gpio", 157),
    rm("9.4.2"),
    choice="it reads 0; libopencm3 clears the field it has read, Klipper keeps a copy of its own",
)
def _(chip: Bench) -> None:
    chip.clock("AFIO")
    chip["AFIO.MAPR"] = 2 << 24
    assert chip["AFIO.MAPR"] == 0
    chip["AFIO.MAPR.USART1"] = 1
    assert chip.pins["PB4"].holder is not None
    assert chip["AFIO.MAPR"] == 1 << 2


@AFIO.row(
    "afio-clock-first",
    "EXTICR and MAPR take nothing until AFIO has its clock.",
    HAL("gpio", 290),
    rm("9.4"),
)
def _(chip: Bench) -> None:
    chip["AFIO.EXTICR1"] = 1
    chip["AFIO.MAPR"] = 1
    chip.clock("AFIO")
    assert (chip["AFIO.EXTICR1"], chip["AFIO.MAPR"]) == (0, 0)
    chip["AFIO.EXTICR1"] = 1
    assert chip["AFIO.EXTICR1"] == 1


@AFIO.row(
    "crystal-pins",
    "PD0 and PD1 are the crystal's until PD01_REMAP is set.",
    rm("9.3.2"),
    ours("AFIO"),
)
def _(chip: Bench) -> None:
    chip.clock("AFIO", "GPIOD")
    configure(chip, 1, OUTPUT, "GPIOD")
    chip["GPIOD.ODR"] = 2
    assert not chip.level("PD1")
    chip["AFIO.MAPR"] = 1 << 15
    assert chip.level("PD1")


@AFIO.row(
    "remap-moves",
    "A remapped USART1 leaves PA9 and has PB6; the pin is an alternate function before it shows.",
    rm("9.3.8"),
    LOCM3("f1/gpio", 15),
)
def _(chip: Bench) -> None:
    chip.clock("AFIO", "GPIOA", "GPIOB", "USART1")
    configure(chip, 9, 0b1011, "GPIOA")
    configure(chip, 6, 0b1011)
    chip["USART1.CR1"] = 1 << 13 | 1 << 3
    assert (chip.level("PA9"), chip.level("PB6")) == (True, False)
    chip["AFIO.MAPR"] = 1 << 2
    assert (chip.level("PA9"), chip.level("PB6")) == (False, True)


AFIO.not_modelled(
    "event-output",
    "EVCR's port and pin are chosen before EVOE gives the core's SEV to that pin.",
    HAL("gpio_ex", 31),
    LOCM3("f1/gpio", 141),
    why="the event output is warned of and does nothing",
)
