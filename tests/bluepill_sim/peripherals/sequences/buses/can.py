"""bxCAN: modes and who acknowledges them, mailboxes, FIFOs, filters, and what is written only in which mode."""

from hypothesis import strategies as st

from bluepill_sim.parts import CanFrame, CanNode
from tests.bluepill_sim.peripherals.buses import test_can as bus
from tests.bluepill_sim.peripherals.buses import test_can_flags
from tests.bluepill_sim.peripherals.sequences.bench import Bench
from tests.bluepill_sim.peripherals.sequences.row import Sequences
from tests.bluepill_sim.peripherals.sequences.sources import (
    CHIBIOS,
    HAL,
    HAL_H,
    KLIPPER,
    LOCM3,
    PANDA,
    RIOT,
    SPL,
    ours,
    rm,
)

CAN = Sequences("CAN")
INRQ, SLEEP, TXFP, RFLM, NART, AWUM, ABOM = 1, 2, 4, 8, 16, 32, 64
TXOK, TERR = 2, 8
INAK, SLAK = 1, 2
BIT_NS = bus.BIT_NS
EMPTY = 0x1C00_0000


def on_bus(chip: Bench, control: int = 0, mode: int = 0) -> CanNode:
    """CAN at 500 kbit/s with an open filter, and a node that acknowledges."""
    chip.clock("CAN", "GPIOA")
    node = CanNode()
    bus.network(chip, node)
    bus.set_up(chip, mode, control)
    return node


def hear(chip: Bench, node: CanNode, *identifiers: int) -> None:
    bus.receive(chip, node, *(CanFrame(identifier=one) for one in identifiers))


@CAN.row(
    "asleep-at-first",
    "After a reset CAN is asleep; SLEEP is cleared, or INRQ set, before anything else.",
    LOCM3("can", 99),
    HAL("can", 355),
    rm("24.4.3"),
)
def _(chip: Bench) -> None:
    chip.clock("CAN")
    assert (chip["CAN.MCR"], chip["CAN.MSR"] & 3) == (1 << 16 | SLEEP, SLAK)
    chip["CAN.MCR"] = INRQ
    assert chip["CAN.MSR"] & 3 == INAK


@CAN.row(
    "init-before-wake",
    "INRQ is acknowledged by INAK whether SLEEP was cleared before or is cleared after it.",
    HAL("can", 334),
    LOCM3("can", 102),
    RIOT("classiccan", 147),
    choice="ST asks for INRQ and waits with SLEEP still set, libopencm3 and RIOT clear SLEEP first: both get INAK",
)
def _(chip: Bench) -> None:
    chip.clock("CAN")
    chip["CAN.MCR"] |= INRQ
    assert chip["CAN.MSR"] & 3 == INAK
    chip["CAN.MCR"] &= ~SLEEP
    assert chip["CAN.MSR"] & 3 == INAK
    chip["CAN.MCR"] = SLEEP
    chip["CAN.MCR"] = 0
    chip["CAN.MCR"] = INRQ
    assert chip["CAN.MSR"] & INAK


@CAN.row(
    "btr-in-init",
    "BTR is written only in initialisation.",
    KLIPPER("can", 316),
    LOCM3("can", 168),
    rm("24.9.2"),
)
def _(chip: Bench) -> None:
    chip.clock("CAN")
    chip["CAN.BTR"] = bus.TIMING
    assert chip["CAN.BTR"] == 0x0123_0000
    chip["CAN.MCR"] = INRQ
    chip["CAN.BTR"] = bus.TIMING
    assert chip["CAN.BTR"] == bus.TIMING


@CAN.row(
    "eleven-bits",
    "INAK falls eleven recessive bits after INRQ does, and no earlier.",
    LOCM3("can", 49),
    KLIPPER("can", 321),
    rm("24.4.1"),
)
def _(chip: Bench) -> None:
    chip.clock("CAN")
    chip["CAN.MCR"] = INRQ
    chip["CAN.BTR"] = bus.TIMING
    chip["CAN.MCR"] = 0
    chip.run(11 * BIT_NS - 1)
    assert chip["CAN.MSR"] & INAK
    chip.run(1)
    assert not chip["CAN.MSR"] & INAK


@CAN.row(
    "nothing-in-init",
    "In initialisation nothing is sent or received; a request waits.",
    rm("24.4.1"),
    HAL("can", 1015),
)
def _(chip: Bench) -> None:
    node = on_bus(chip)
    chip["CAN.MCR"] = INRQ
    bus.send(chip, 5)
    hear(chip, node, 6)
    assert (node.received, chip["CAN.RF0R"]) == ([], 0)
    chip["CAN.MCR"] = 0
    chip.run(300 * BIT_NS)
    assert [frame.identifier for _, frame in node.received] == [5]


@CAN.row(
    "txrq-last",
    "TXRQ is set after the rest of a mailbox: TME falls with it, and the frame is what stood there then.",
    HAL("can", 1291),
    LOCM3("can", 434),
    KLIPPER("can", 123),
    rm("24.7.1"),
)
def _(chip: Bench) -> None:
    node = on_bus(chip)
    chip["CAN.TI0R"] = 0x123 << 21
    chip["CAN.TDT0R"] = 2
    chip["CAN.TDL0R"] = 0xBBAA
    chip.run(300 * BIT_NS)
    assert (node.received, chip["CAN.TSR.TME0"]) == ([], 1)
    chip["CAN.TI0R"] = 0x123 << 21 | 1
    assert chip["CAN.TSR.TME0"] == 0
    chip.run(300 * BIT_NS)
    assert [frame for _, frame in node.received] == [CanFrame(identifier=0x123, data=b"\xaa\xbb")]


@CAN.row(
    "empty-mailbox-first",
    "A mailbox is filled only while its TME is 1; CODE names the next free one.",
    HAL("can", 1246),
    LOCM3("can", 365),
    KLIPPER("can", 110),
    rm("24.9.2"),
)
def _(chip: Bench) -> None:
    on_bus(chip)
    for n in range(3):
        assert (chip["CAN.TSR.CODE"], chip[f"CAN.TSR.TME{n}"]) == (n, 1)
        bus.send(chip, 0x10 + n, mailbox=n)
        chip[f"CAN.TDL{n}R"] = 0x55
        assert (chip[f"CAN.TSR.TME{n}"], chip[f"CAN.TDL{n}R"]) == (0, 0)
    chip.run(1_000 * BIT_NS)
    assert chip["CAN.TSR"] >> 26 & 7 == 7


@CAN.row(
    "rqcp-clears-all",
    "Writing 1 to RQCP clears it with TXOK, ALST and TERR of its mailbox, and of no other.",
    HAL("can", 1713),
    rm("24.9.2"),
)
def _(chip: Bench) -> None:
    on_bus(chip)
    bus.send(chip, 1)
    bus.send(chip, 2, mailbox=1)
    chip.run(500 * BIT_NS)
    assert chip["CAN.TSR"] & 0xFFFF == 0x0303
    chip["CAN.TSR"] = 1
    assert chip["CAN.TSR"] & 0xFFFF == 0x0300


@CAN.row(
    "request-clears-all",
    "A new request clears RQCP, TXOK and TERR of its mailbox, which the last one has left.",
    PANDA("bxcan", 137),
    rm("24.9.2", looked_up=False),
    values=st.integers(0, 2),
)
def _(chip: Bench, mailbox: int) -> None:
    chip.clock("CAN", "GPIOA")
    network = bus.network(chip, CanNode())
    bus.set_up(chip, control=NART)
    for damaged, flag in ((1, TERR), (0, TXOK)):
        network.damage(damaged)
        bus.send(chip, 1, mailbox=mailbox)
        assert chip["CAN.TSR"] & 0xFF_FFFF == 0
        chip.run(500 * BIT_NS)
        assert chip["CAN.TSR"] & 0xFF_FFFF == (1 | flag) << 8 * mailbox
    bus.send(chip, 1, mailbox=mailbox)
    assert chip["CAN.TSR"] & 0xFF_FFFF == 0


@CAN.row(
    "tmeie-while-rqcp",
    "TMEIE interrupts while the RQCP of any mailbox stands: all three are cleared before the handler ends.",
    CHIBIOS("LLD/CANv1/hal_can_lld", 229),
    rm("24.8"),
    values=st.integers(0, 2),
)
def _(chip: Bench, mailbox: int) -> None:
    on_bus(chip)
    bus.send(chip, 1, mailbox=mailbox)
    chip.run(200 * BIT_NS)
    assert not chip.irqs[19]
    chip["CAN.IER"] = 1
    assert chip.irqs[19]
    chip["CAN.TSR"] = 1 << 8 * mailbox
    assert not chip.irqs[19]
    bus.send(chip, 1, mailbox=(mailbox + 1) % 3)
    chip.run(20 * BIT_NS)
    bus.send(chip, 2, mailbox=mailbox)
    chip["CAN.TSR"] = 1 << 8 * mailbox + 7
    assert chip.irqs[19]


@CAN.row(
    "abort-only-waiting",
    "ABRQ takes back a mailbox that waits, at once; one whose frame is on the bus goes on.",
    HAL("can", 1335),
    rm("24.7.1"),
)
def _(chip: Bench) -> None:
    node = on_bus(chip)
    bus.send(chip, 1)
    bus.send(chip, 2, mailbox=1)
    chip.run(20 * BIT_NS)
    chip["CAN.TSR"] = 1 << 7 | 1 << 15
    assert (chip["CAN.TSR"] & 0x8383, chip["CAN.TSR.TME1"]) == (0x180, 1)
    chip.run(500 * BIT_NS)
    assert [frame.identifier for _, frame in node.received] == [1]
    assert chip["CAN.TSR"] & 0x8383 == 0x103


@CAN.row(
    "txfp-by-request",
    "Without TXFP the lowest identifier goes first, with it the first request.",
    KLIPPER("can", 318),
    HAL("can", 426),
    rm("24.7.1"),
    values=st.integers(0, 1),
)
def _(chip: Bench, by_request: int) -> None:
    node = on_bus(chip, by_request * TXFP)
    node.send(CanFrame(identifier=0))
    for mailbox, identifier in enumerate((0x300, 0x100, 0x200)):
        bus.send(chip, identifier, mailbox=mailbox)
    chip.run(1_000 * BIT_NS)
    order = [frame.identifier for _, frame in node.received]
    assert order == ([0x300, 0x100, 0x200] if by_request else [0x100, 0x200, 0x300])


@CAN.row(
    "release-after-read",
    "A message stays in the FIFO's registers until RFOM is written; then the next one stands there.",
    LOCM3("can", 460),
    rm("24.7.3"),
)
def _(chip: Bench) -> None:
    node = on_bus(chip)
    hear(chip, node, 7, 8)
    assert chip["CAN.RF0R.FMP0"] == 2
    assert (chip["CAN.RI0R.STID"], chip["CAN.RI0R.STID"]) == (7, 7)
    chip["CAN.RF0R"] = 1 << 5
    assert (chip["CAN.RI0R.STID"], chip["CAN.RF0R.FMP0"]) == (8, 1)
    chip["CAN.RF0R"] = 1 << 5
    assert chip["CAN.RF0R"] == 0


@CAN.row(
    "pending-interrupt",
    "FMPIE interrupts for as long as a message is pending: the FIFO is emptied, or the enable taken back, first.",
    CHIBIOS("LLD/CANv1/hal_can_lld", 254),
    rm("24.8"),
)
def _(chip: Bench) -> None:
    node = on_bus(chip)
    chip["CAN.IER"] = 2
    hear(chip, node, 1, 2)
    chip["CAN.RF0R"] = 1 << 5
    assert chip.irqs[20]
    chip["CAN.IER"] = 0
    assert not chip.irqs[20]
    chip["CAN.IER"] = 2
    chip["CAN.RF0R"] = 1 << 5
    assert not chip.irqs[20]


@CAN.row(
    "overrun",
    "A fourth message raises FOVR, cleared by 1, as FULL; it takes the third's place, unless RFLM keeps the three.",
    HAL("can", 1848),
    HAL("can", 416),
    rm("24.7.3"),
    values=st.integers(0, 1),
)
def _(chip: Bench, is_locked: int) -> None:
    node = on_bus(chip, is_locked * RFLM)
    hear(chip, node, 1, 2, 3)
    assert chip["CAN.RF0R"] == 3 | 1 << 3
    hear(chip, node, 4)
    assert chip["CAN.RF0R"] == 3 | 1 << 3 | 1 << 4
    chip["CAN.RF0R"] = 1 << 4
    assert chip["CAN.RF0R"] == 3 | 1 << 3
    for _ in range(2):
        chip["CAN.RF0R"] = 1 << 5
    assert chip["CAN.RI0R.STID"] == (3 if is_locked else 4)


@CAN.row(
    "fifo-by-its-own",
    "Each FIFO is released by the RFOM of its own register, and interrupts by its own three enables.",
    LOCM3("can", 446),
    HAL_H("can", 521),
    rm("24.7.3", looked_up=False),
    rm("24.8", looked_up=False),
    values=st.integers(0, 1),
)
def _(chip: Bench, fifo: int) -> None:
    chip.clock("CAN", "GPIOA")
    test_can_flags.test_each_fifo_is_released_by_its_own_register_and_interrupts_by_its_own_enables(chip, fifo)


@CAN.row(
    "passive-counts-from-120",
    "A good frame takes one from REC, and sets it to 120 where it was above that of a passive node.",
    SPL("can", 940),
    rm("24.9.2", looked_up=False),
)
def _(chip: Bench) -> None:
    chip.clock("CAN", "GPIOA")
    test_can_flags.test_a_passive_receiver_that_hears_a_good_frame_counts_from_120(chip)


@CAN.row(
    "abort-in-any-bit",
    "ABRQ within any bit of a frame lets that go out, and takes what waits back.",
    HAL("can", 1335),
    rm("24.7.1"),
    values=st.integers(0, 40),
)
def _(chip: Bench, bits: int) -> None:
    chip.clock("CAN", "GPIOA")
    test_can_flags.test_an_abort_leaves_the_frame_on_the_bus_in_any_of_its_bits(chip, bits)


@CAN.row(
    "filter-first",
    "Without an active filter nothing is received.",
    HAL("can", 954),
    LOCM3("can", 241),
    rm("24.7.4"),
)
def _(chip: Bench) -> None:
    node = on_bus(chip)
    chip["CAN.FA1R"] = 0
    hear(chip, node, 1)
    assert chip["CAN.RF0R"] == 0
    chip["CAN.FA1R"] = 1
    hear(chip, node, 2)
    assert chip["CAN.RI0R.STID"] == 2


@CAN.row(
    "filter-modes-in-finit",
    "Scale, mode and FIFO of a bank are written only with FINIT.",
    LOCM3("can", 205),
    HAL("can", 874),
    KLIPPER("can", 144),
    rm("24.9.4"),
    values=st.sampled_from(["FM1R", "FS1R", "FFA1R"]),
)
def _(chip: Bench, name: str) -> None:
    chip.clock("CAN")
    assert chip["CAN.FMR.FINIT"]
    chip["CAN.FMR"] = 0
    chip[f"CAN.{name}"] = 0x2AAA
    assert chip[f"CAN.{name}"] == 0
    chip["CAN.FMR"] = 1
    chip[f"CAN.{name}"] = 0x2AAA
    assert chip[f"CAN.{name}"] == 0x2AAA


@CAN.row(
    "bank-off-first",
    "The words of a bank are written only while it is off or with FINIT: drivers switch it off before.",
    LOCM3("can", 208),
    KLIPPER("can", 146),
    rm("24.9.4"),
    values=st.integers(0, 27),
)
def _(chip: Bench, half: int) -> None:
    chip.clock("CAN")
    name = f"CAN.F{half // 2}R{half % 2 + 1}"
    chip["CAN.FMR"] = 0
    chip[name] = 0x11
    chip["CAN.FA1R"] = 1 << half // 2
    chip[name] = 0x22
    assert chip[name] == 0x11
    chip["CAN.FMR"] = 1
    chip[name] = 0x33
    assert chip[name] == 0x33


@CAN.row(
    "finit-deaf",
    "While FINIT is set no frame is received.",
    rm("24.7.4"),
    HAL("can", 954),
)
def _(chip: Bench) -> None:
    node = on_bus(chip)
    chip["CAN.FMR"] = 1
    hear(chip, node, 1)
    assert chip["CAN.RF0R"] == 0
    chip["CAN.FMR"] = 0
    hear(chip, node, 2)
    assert chip["CAN.RI0R.STID"] == 2


@CAN.row(
    "sleep-after-frame",
    "SLEEP is acknowledged by SLAK, and nothing is sent or received until it has been cleared again.",
    HAL("can", 1120),
    RIOT("classiccan", 138),
    rm("24.4.3"),
)
def _(chip: Bench) -> None:
    node = on_bus(chip)
    chip["CAN.MCR"] |= SLEEP
    chip.run(20 * BIT_NS)
    assert chip["CAN.MSR"] & SLAK
    hear(chip, node, 1)
    assert chip["CAN.RF0R"] == 0
    chip["CAN.MCR"] &= ~SLEEP
    chip.run(11 * BIT_NS)
    assert not chip["CAN.MSR"] & SLAK
    chip.run(400 * BIT_NS)
    assert chip["CAN.RI0R.STID"] == 1


@CAN.row(
    "wakes-by-itself",
    "With AWUM a frame on the bus ends the sleep; WKUI says so and is cleared by 1.",
    HAL("can", 396),
    HAL("can", 1962),
    rm("24.4.3"),
)
def _(chip: Bench) -> None:
    node = on_bus(chip, AWUM)
    chip["CAN.MCR"] |= SLEEP
    chip.run(20 * BIT_NS)
    chip["CAN.MSR"] = 0x1C
    hear(chip, node, 1)
    assert (chip["CAN.MSR"] & SLAK, chip["CAN.MSR.WKUI"], chip["CAN.MCR"] & SLEEP) == (0, 1, 0)
    chip["CAN.MSR"] = 1 << 3
    assert not chip["CAN.MSR.WKUI"]


@CAN.row(
    "abom-or-init",
    "Bus-off ends by itself only with ABOM; else the program goes through initialisation.",
    KLIPPER("can", 319),
    rm("24.7.6"),
    values=st.integers(0, 1),
)
def _(chip: Bench, by_itself: int) -> None:
    chip.clock("CAN", "GPIOA")
    network = bus.network(chip, CanNode())
    bus.set_up(chip, control=by_itself * ABOM)
    network.damage(32)
    bus.send(chip, 1)
    chip.run(3_000 * BIT_NS)
    chip.run(128 * 11 * BIT_NS)
    assert chip["CAN.ESR.BOFF"] == 1 - by_itself
    chip["CAN.MCR"] = INRQ | by_itself * ABOM
    chip["CAN.MCR"] = by_itself * ABOM
    chip.run(130 * 11 * BIT_NS)
    assert not chip["CAN.ESR.BOFF"]


@CAN.row(
    "no-acknowledge",
    "Without a node that acknowledges a frame is tried again without end, and counts TEC up to 128 alone.",
    rm("24.7.6"),
    ours("bxCAN"),
)
def _(chip: Bench) -> None:
    chip.clock("CAN", "GPIOA")
    bus.set_up(chip)
    bus.send(chip, 1)
    chip.run(3_000 * BIT_NS)
    assert (chip["CAN.ESR.TEC"], chip["CAN.ESR.BOFF"], chip["CAN.ESR.EPVF"], chip["CAN.TSR.RQCP0"]) == (128, 0, 1, 0)


@CAN.row(
    "loop-back-alone",
    "In loop-back a frame comes back without any node that acknowledges, and does not show.",
    rm("24.5.2"),
    ours("bxCAN"),
)
def _(chip: Bench) -> None:
    node = on_bus(chip, mode=bus.LOOP)
    bus.send(chip, 0x21, b"x")
    chip.run(200 * BIT_NS)
    assert (chip["CAN.TSR"] & 3, chip["CAN.RI0R.STID"], node.received) == (3, 0x21, [])


CAN.not_modelled(
    "init-after-frame",
    "A request to initialise is granted when the frame under way has ended.",
    LOCM3("can", 43),
    rm("24.4.1"),
    why="it is granted at once, as peripherals.md says",
)
CAN.not_modelled(
    "can-and-usb",
    "CAN is not used beside USB: they share their memory.",
    rm("24.1"),
    ours("bxCAN"),
    why="both go on, each with a memory of its own, and it is warned of",
)
