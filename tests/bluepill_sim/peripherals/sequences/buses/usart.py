"""USART: which flag comes when, and which read or write clears it."""

from hypothesis import strategies as st

from bluepill_sim.peripherals.usart import ReceiveError
from tests.bluepill_sim.peripherals.sequences.bench import Bench
from tests.bluepill_sim.peripherals.sequences.row import Sequences
from tests.bluepill_sim.peripherals.sequences.sources import CHIBIOS, HAL, HAL_H, KLIPPER, LOCM3, RIOT, RUST, ours, rm

USART = Sequences("USART")
#: BRR 80 at 8 MHz: 10 us a bit, 100 us a character.
BIT_NS = 10_000
CHARACTER_NS = 10 * BIT_NS
IRQ = 37
UE, TE, RE = 1 << 13, 8, 4


def set_up(chip: Bench, control: int = UE | TE | RE) -> list[int]:
    """USART1 at PA9 and PA10; returns what comes out. Ends when the idle character of TE has gone."""
    chip.clock("GPIOA", "USART1")
    chip["GPIOA.CRH"] = 0x4444_44B4
    chip["USART1.BRR"] = 80
    sent: list[int] = []
    chip.parts.usart(1).sinks.append(lambda rows: sent.extend(word for word, _ in rows))
    chip["USART1.CR1"] = control
    chip.drive("PA10", True)
    chip.run(2 * CHARACTER_NS)
    return sent


def receive(chip: Bench, data: bytes = b"a") -> None:
    chip.parts.usart(1).receive(data)
    chip.run(len(data) * CHARACTER_NS)


def flags(chip: Bench) -> int:
    """Return SR without reading it."""
    return int(chip.parts.usart(1).words[0])


@USART.row("after-reset", "After a reset TXE and TC are 1 and nothing else of SR.", rm("27.6.1"))
def _(chip: Bench) -> None:
    chip.clock("USART1")
    assert chip["USART1.SR"] == 0xC0


@USART.row(
    "enable-first",
    "Nothing is sent until UE and TE are set, with a rate in BRR.",
    LOCM3("common/usart_common_all", 285),
    HAL("uart", 413),
    rm("27.3.2"),
    values=st.sampled_from([0, UE, TE]),
)
def _(chip: Bench, control: int) -> None:
    sent = set_up(chip, control)
    chip["USART1.DR"] = 0x55
    chip.run(3 * CHARACTER_NS)
    assert sent == []
    chip["USART1.CR1"] = UE | TE
    chip["USART1.DR"] = 0x56
    chip.run(4 * CHARACTER_NS)
    assert sent[-1:] == [0x56]


@USART.row(
    "idle-frame-first",
    "TE sends an idle character before the first word: that begins a character later.",
    rm("27.3.2"),
    ours("USART1 to USART3"),
)
def _(chip: Bench) -> None:
    sent = set_up(chip, UE)
    chip["USART1.CR1"] = UE | TE
    chip["USART1.DR"] = 0x31
    chip.run(2 * CHARACTER_NS - 1)
    assert sent == []
    chip.run(1)
    chip.deliver()
    assert sent == [0x31]


@USART.row(
    "txe-when-shifted",
    "TXE falls with a write of DR and rises when the word goes to the shift register, at once where that is empty.",
    LOCM3("common/usart_common_f124", 80),
    HAL_H("uart", 492),
    rm("27.3.2"),
)
def _(chip: Bench) -> None:
    set_up(chip)
    chip["USART1.DR"] = 1
    assert flags(chip) & 0x80
    chip["USART1.DR"] = 2
    assert not flags(chip) & 0x80
    chip.run(CHARACTER_NS - 1)
    assert not flags(chip) & 0x80
    chip.run(1)
    assert flags(chip) & 0x80


@USART.row(
    "txe-not-by-sr",
    "TXE is cleared by a write of DR alone: no write of SR takes it away.",
    HAL_H("uart", 492),
    rm("27.6.1"),
    values=st.integers(0, 0x3FF),
)
def _(chip: Bench, word: int) -> None:
    chip.clock("USART1")
    chip["USART1.SR"] = word
    assert chip["USART1.SR.TXE"]


@USART.row(
    "tc-after-last-stop",
    "TC rises at the end of the last stop bit while nothing waits in DR: only then may a line be turned.",
    HAL("uart", 1194),
    RUST("serial", 587),
    rm("27.3.2"),
)
def _(chip: Bench) -> None:
    set_up(chip)
    chip["USART1.SR"] = 0
    chip["USART1.DR"] = 1
    chip["USART1.DR"] = 2
    chip.run(2 * CHARACTER_NS - 1)
    assert not flags(chip) & 0x40
    chip.run(1)
    assert flags(chip) & 0x40


@USART.row(
    "tc-cleared",
    "TC is cleared by a read of SR followed by a write of DR, or by writing 0; a write of DR alone leaves it.",
    HAL_H("uart", 490),
    HAL("uart", 1417),
    CHIBIOS("LLD/USARTv1/hal_uart_lld", 1171),
    rm("27.6.1"),
)
def _(chip: Bench) -> None:
    set_up(chip)
    chip["USART1.DR"] = 1
    assert flags(chip) & 0x40
    chip.run(CHARACTER_NS)
    assert chip["USART1.SR.TC"]
    chip["USART1.DR"] = 2
    assert not flags(chip) & 0x40
    chip.run(CHARACTER_NS)
    assert flags(chip) & 0x40
    chip["USART1.SR"] = 0x3FF & ~0x40
    assert not flags(chip) & 0x40


@USART.row(
    "tcie-at-once",
    "TCIE while TC still stands interrupts at once: it is set after TC has been cleared.",
    CHIBIOS("LLD/USARTv1/hal_uart_lld", 281),
    CHIBIOS("LLD/USARTv1/hal_uart_lld", 1069),
    rm("27.4"),
)
def _(chip: Bench) -> None:
    set_up(chip)
    chip["USART1.CR1.TCIE"] = 1
    assert chip.irqs[IRQ]
    chip["USART1.SR"] = 0x3FF & ~0x40
    assert not chip.irqs[IRQ]


@USART.row(
    "txeie-while-empty",
    "TXEIE interrupts for as long as DR is empty: a program with nothing to send takes it back.",
    KLIPPER("serial", 88),
    RUST("serial", 652),
    rm("27.4"),
)
def _(chip: Bench) -> None:
    set_up(chip)
    chip["USART1.CR1.TXEIE"] = 1
    assert chip.irqs[IRQ]
    chip["USART1.DR"] = 1
    assert chip.irqs[IRQ]
    chip["USART1.DR"] = 2
    assert not chip.irqs[IRQ]
    chip.run(CHARACTER_NS)
    assert chip.irqs[IRQ]
    chip["USART1.CR1.TXEIE"] = 0
    assert not chip.irqs[IRQ]


@USART.row(
    "te-stays-on",
    "TE is not cleared during a word: what is under way is lost.",
    rm("27.3.2"),
    HAL("uart", 1194),
    choice="the line goes to its idle level at once, and it is warned of",
)
def _(chip: Bench) -> None:
    sent = set_up(chip)
    chip["USART1.DR"] = 0x77
    chip.run(CHARACTER_NS // 2)
    chip["USART1.CR1.TE"] = 0
    chip.run(2 * CHARACTER_NS)
    assert sent == []


@USART.row(
    "rxne-by-dr",
    "RXNE rises when the stop bit has ended, and is cleared by a read of DR.",
    HAL_H("uart", 489),
    LOCM3("common/usart_common_f124", 95),
    rm("27.3.3"),
)
def _(chip: Bench) -> None:
    set_up(chip)
    chip.parts.usart(1).receive(b"Q")
    chip.run(CHARACTER_NS - 1)
    assert not flags(chip) & 0x20
    chip.run(1)
    assert flags(chip) & 0x20
    assert (chip["USART1.DR"], flags(chip) & 0x20) == (ord("Q"), 0)


@USART.row(
    "rxne-by-zero",
    "RXNE can be cleared by writing 0, and 1 leaves it; what is in DR stays.",
    rm("27.6.1"),
    HAL_H("uart", 483),
)
def _(chip: Bench) -> None:
    set_up(chip)
    receive(chip)
    chip["USART1.SR"] = 0x3FF
    assert flags(chip) & 0x20
    chip["USART1.SR"] = 0x3FF & ~0x20
    assert (flags(chip) & 0x20, chip["USART1.DR"]) == (0, ord("a"))


@USART.row(
    "re-first",
    "A character that arrives before RE is set is lost.",
    rm("27.3.3"),
    HAL("uart", 655),
)
def _(chip: Bench) -> None:
    set_up(chip, UE | TE)
    receive(chip)
    assert not flags(chip) & 0x20
    chip["USART1.CR1.RE"] = 1
    receive(chip, b"b")
    assert chip["USART1.DR"] == ord("b")


@USART.row(
    "overrun-keeps-first",
    "A character that comes while RXNE stands is lost, and ORE says so; DR keeps the one before.",
    rm("27.3.3"),
    KLIPPER("serial", 81),
)
def _(chip: Bench) -> None:
    set_up(chip)
    receive(chip, b"ab")
    assert flags(chip) & 0x28 == 0x28
    assert chip["USART1.DR"] == ord("a")


@USART.row(
    "ore-sr-then-dr",
    "ORE is cleared by a read of SR and then of DR, in this order; DR alone leaves it.",
    KLIPPER("serial", 81),
    RIOT("uart", 534),
    RUST("serial", 697),
    HAL_H("uart", 486),
    rm("27.6.1"),
)
def _(chip: Bench) -> None:
    set_up(chip)
    receive(chip, b"ab")
    assert (chip["USART1.DR"], flags(chip) & 8) == (ord("a"), 8)
    assert chip["USART1.SR.ORE"]
    assert (chip["USART1.DR"], flags(chip) & 8) == (ord("a"), 0)


@USART.row(
    "ore-interrupts",
    "With RXNEIE an overrun goes on interrupting after DR was read: a handler that looks at RXNE alone never ends.",
    KLIPPER("serial", 80),
    rm("27.4"),
)
def _(chip: Bench) -> None:
    set_up(chip)
    chip["USART1.CR1.RXNEIE"] = 1
    receive(chip, b"ab")
    _dr = chip["USART1.DR"]
    assert (flags(chip) & 0x28, chip.irqs[IRQ]) == (8, True)
    assert chip["USART1.SR.ORE"]
    _dr = chip["USART1.DR"]
    assert not chip.irqs[IRQ]


@USART.row(
    "errors-with-the-character",
    "FE, NE and PE rise with the character that they are about, and are cleared by SR, then DR.",
    CHIBIOS("LLD/USARTv1/hal_uart_lld", 1159),
    HAL_H("uart", 485),
    rm("27.3.3"),
    values=st.sampled_from([(ReceiveError.FRAMING, 2), (ReceiveError.NOISE, 4), (ReceiveError.PARITY, 1)]),
)
def _(chip: Bench, case: tuple[ReceiveError, int]) -> None:
    damage, bit = case
    set_up(chip, UE | TE | RE | 1 << 10 | 1 << 12)
    chip.parts.usart(1).receive(b"a", damage)
    chip.run(2 * CHARACTER_NS)
    assert flags(chip) & (0x20 | bit) == 0x20 | bit
    _dr = chip["USART1.DR"]
    assert flags(chip) & bit
    assert chip["USART1.SR"] & bit
    _dr = chip["USART1.DR"]
    assert not flags(chip) & bit


@USART.row(
    "tolerance",
    "A far end whose rate is within the tolerance raises no error; one at half of ours raises FE with its 0.",
    rm("27.3.5"),
    rm("27.3.3"),
    values=st.integers(98_000, 102_000),
)
def _(chip: Bench, far_baud: int) -> None:
    set_up(chip)
    usart = chip.parts.usart(1)
    usart.far_baud = far_baud
    receive(chip, b"Q")
    assert (flags(chip) & 0x3F, chip["USART1.DR"]) == (0x20, ord("Q"))
    usart.far_baud = 50_000
    receive(chip, b"\0")
    assert flags(chip) & 0x2F == 0x22


@USART.row(
    "rate-stays",
    "BRR is not changed while a word goes out.",
    HAL("uart", 402),
    rm("27.3.4", looked_up=False),
    choice="the word under way keeps its rate, and nothing follows it while BRR is 0",
)
def _(chip: Bench) -> None:
    sent = set_up(chip)
    chip.parts.usart(1).far_baud = 100_000
    chip["USART1.DR"] = 0x41
    chip.run(CHARACTER_NS // 2)
    chip["USART1.BRR"] = 0
    chip.run(CHARACTER_NS // 2)
    chip["USART1.DR"] = 0x42
    chip.run(2 * CHARACTER_NS)
    chip.deliver()
    assert sent == [0x41]


@USART.row(
    "idle-once",
    "IDLE rises once, a character after the line went idle, is cleared by SR and DR, and not again before a character.",
    RUST("serial", 747),
    HAL("uart", 1642),
    HAL_H("uart", 486),
    rm("27.3.3"),
)
def _(chip: Bench) -> None:
    set_up(chip)
    chip.run(10 * CHARACTER_NS)
    assert not flags(chip) & 0x10
    receive(chip)
    chip.run(CHARACTER_NS - 1)
    assert not flags(chip) & 0x10
    chip.run(1)
    assert chip["USART1.SR.IDLE"]
    _dr = chip["USART1.DR"]
    chip.run(20 * CHARACTER_NS)
    assert not flags(chip) & 0x10
    receive(chip)
    chip.run(CHARACTER_NS)
    assert flags(chip) & 0x10


@USART.row(
    "break-after-word",
    "SBK sends a break behind the word under way, and is 0 again at its end.",
    HAL("uart", 2785),
    rm("27.3.2"),
)
def _(chip: Bench) -> None:
    sent = set_up(chip)
    chip["USART1.DR"] = 0x41
    chip["USART1.CR1.SBK"] = 1
    chip.run(CHARACTER_NS)
    assert chip["USART1.CR1.SBK"] == 1
    chip.run(CHARACTER_NS + 2 * BIT_NS)
    assert (chip["USART1.CR1.SBK"], sent) == (0, [0x41])


@USART.row(
    "mute-until-idle",
    "In mute mode no character raises RXNE until the line has been idle for a character, which clears RWU.",
    rm("27.3.6"),
    HAL("uart", 2812),
)
def _(chip: Bench) -> None:
    set_up(chip)
    receive(chip, b"x")
    _dr = chip["USART1.DR"]
    chip["USART1.CR1.RWU"] = 1
    receive(chip, b"yz")
    assert not flags(chip) & 0x20
    chip.run(2 * CHARACTER_NS)
    assert not chip["USART1.CR1.RWU"]
    receive(chip, b"w")
    assert chip["USART1.DR"] == ord("w")


@USART.row(
    "parity-in-the-word",
    "With PCE the parity takes the place of the most significant bit that M gives; M is chosen with it.",
    rm("27.3.7"),
    HAL("uart", 326),
    values=st.integers(0, 255),
)
def _(chip: Bench, byte: int) -> None:
    set_up(chip, UE | TE | RE | 1 << 10)
    receive(chip, bytes((byte,)))
    assert chip["USART1.DR"] == byte & 0x7F | (byte & 0x7F).bit_count() % 2 << 7


@USART.row(
    "lbd-needs-linen",
    "A break raises LBD only with LINEN; LBD is cleared by writing 0.",
    CHIBIOS("LLD/USARTv1/hal_uart_lld", 1166),
    HAL("uart", 562),
    rm("27.3.8"),
)
def _(chip: Bench) -> None:
    set_up(chip)
    chip.parts.usart(1).receive_break(13)
    chip.run(3 * CHARACTER_NS)
    assert not flags(chip) & 0x100
    chip["USART1.CR2.LINEN"] = 1
    chip.parts.usart(1).receive_break(13)
    chip.run(3 * CHARACTER_NS)
    assert flags(chip) & 0x100
    chip["USART1.SR"] = 0x3FF & ~0x100
    assert not flags(chip) & 0x100


@USART.row(
    "dma-asks-while-txe",
    "DMAT asks for a word while TXE stands, so that its channel is set up before the bit.",
    HAL("uart", 1420),
    rm("27.3.13"),
)
def _(chip: Bench) -> None:
    sent = set_up(chip)
    chip.clock("DMA1")
    chip.put(0x2000_0000, b"xyz")
    chip["DMA1.CPAR4"] = 0x4001_3804
    chip["DMA1.CMAR4"] = 0x2000_0000
    chip["DMA1.CNDTR4"] = 3
    chip["DMA1.CCR4"] = 0x91
    chip.run(CHARACTER_NS)
    assert chip["DMA1.CNDTR4"] == 3
    chip["USART1.CR3.DMAT"] = 1
    chip.run(10_000)
    assert chip["DMA1.CNDTR4"] == 1
    chip.run(4 * CHARACTER_NS)
    assert bytes(sent) == b"xyz"


@USART.row(
    "pins-after-usart",
    "The line is high from the moment when TE has the pin: the USART is set up before the pin is its own.",
    RIOT("uart", 222),
    rm("27.3.2"),
)
def _(chip: Bench) -> None:
    chip.clock("GPIOA", "USART1")
    chip["GPIOA.CRH"] = 0x4444_44B4
    assert not chip.level("PA9")
    chip["USART1.CR1"] = UE | TE
    assert chip.level("PA9")


USART.not_modelled(
    "mute-after-a-character",
    "RWU is set only after a character has been received, else an idle line does not end mute mode.",
    rm("27.6.4"),
    why="RWU mutes from its write on; the next idle line behind a character ends that, whatever came before",
)
USART.not_modelled(
    "modes-apart",
    "IrDA and smartcard modes want LINEN, CLKEN and each other's bits cleared first.",
    HAL("uart", 407),
    HAL("uart", 555),
    rm("27.6.6"),
    why="those modes are not modelled, and warned of",
)
