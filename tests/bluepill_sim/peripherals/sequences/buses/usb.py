"""USB device: reset and power before anything else, toggles, who may answer, suspend and resume."""

from hypothesis import strategies as st

from bluepill_sim.fabric.usb_bus import BusState, Token, Transaction
from tests.bluepill_sim.peripherals.buses.usb import test_usb_registers as bus
from tests.bluepill_sim.peripherals.sequences.bench import Bench
from tests.bluepill_sim.peripherals.sequences.row import Sequences
from tests.bluepill_sim.peripherals.sequences.sources import CHIBIOS, KLIPPER, LOCM3, RIOT, TINYUSB, ours, rm

USB = Sequences("USB")
DCD, COMMON, COMMON_H = "dcd_stm32_fsdev.c", "fsdev_common.c", "fsdev_common.h"
CTR_RX, CTR_TX, SETUP = bus.CTR_RX, bus.CTR_TX, bus.SETUP
STAT_RX, STAT_TX = 3 << 12, 3 << 4


def set_up(chip: Bench, mask: int = 0) -> object:
    """USB on at 48 MHz, address 5."""
    chip.clock("USB", "GPIOA")
    return bus.set_up(chip, mask)


def flags(chip: Bench) -> int:
    return chip["USB.ISTR"]


@USB.row(
    "reset-state",
    "After a reset the transceiver is off and the device held in reset: PDWN and FRES are 1.",
    TINYUSB(COMMON, 22),
    RIOT("usbdev_fs", 380),
    rm("23.5.1"),
)
def _(chip: Bench) -> None:
    chip.clock("USB")
    assert chip["USB.CNTR"] == 3


@USB.row(
    "power-then-reset",
    "PDWN is cleared first, then FRES, then ISTR: nothing is heard until both are 0 and the flag of RESET is gone.",
    TINYUSB(COMMON, 27),
    RIOT("usbdev_fs", 382),
    rm("23.4.2"),
)
def _(chip: Bench) -> None:
    usb = set_up(chip)
    bus.endpoint(chip, 0, bus.CONTROL, stat=bus.rx(bus.VALID))
    setup = Transaction(Token.SETUP, 5, 0, 0, bytes(8))
    for control in (2, 1):
        chip["USB.CNTR"] = control
        assert usb.begin(setup) is None
    chip["USB.CNTR"] = 0
    chip["USB.DADDR"] = 0x85
    bus.endpoint(chip, 0, bus.CONTROL, stat=bus.rx(bus.VALID))
    assert usb.begin(setup) is None
    chip["USB.ISTR"] = 0
    assert usb.begin(setup) is not None


@USB.row(
    "clock-48-mhz",
    "The PLL and USBPRE make 48 MHz before the device is switched on.",
    RIOT("usbdev_fs", 359),
    rm("7.3.2"),
    choice="with another clock nothing is heard, and it is warned of",
)
def _(chip: Bench) -> None:
    usb = set_up(chip)
    bus.endpoint(chip, 0, bus.CONTROL, stat=bus.rx(bus.VALID))
    chip["RCC.CFGR.USBPRE"] = 1
    assert usb.begin(Transaction(Token.SETUP, 5, 0, 0, bytes(8))) is None
    chip["RCC.CFGR.USBPRE"] = 0
    assert usb.begin(Transaction(Token.SETUP, 5, 0, 0, bytes(8))) is not None


@USB.row(
    "ef-first",
    "No address is answered until EF is set in DADDR.",
    TINYUSB(DCD, 241),
    KLIPPER("usbfs", 388),
    rm("23.5.1"),
)
def _(chip: Bench) -> None:
    usb = set_up(chip)
    bus.endpoint(chip, 0, bus.CONTROL, stat=bus.tx(bus.VALID))
    chip["USB.DADDR"] = 5
    assert usb.begin(Transaction(Token.IN, 5, 0)) is None
    chip["USB.DADDR"] = 0x85
    assert usb.begin(Transaction(Token.IN, 5, 0)) is not None


@USB.row(
    "address-after-status",
    "A new address counts from the write of DADDR on: a driver writes it only after the status stage has gone.",
    TINYUSB(DCD, 209),
    KLIPPER("usbfs", 416),
    rm("23.5.1"),
)
def _(chip: Bench) -> None:
    usb = set_up(chip)
    bus.endpoint(chip, 0, bus.CONTROL, stat=bus.tx(bus.VALID))
    chip["USB.DADDR"] = 0x80 | 9
    assert usb.begin(Transaction(Token.IN, 5, 0)) is None
    assert usb.begin(Transaction(Token.IN, 9, 0)) is not None


@USB.row(
    "reset-disables",
    "A reset of the bus clears DADDR and disables every endpoint: all are set up anew behind it.",
    TINYUSB(DCD, 221),
    KLIPPER("usbfs", 363),
    LOCM3("common/st_usbfs_core", 127),
    rm("23.4.2"),
)
def _(chip: Bench) -> None:
    usb = set_up(chip)
    bus.endpoint(chip, 1, bus.BULK, stat=bus.rx(bus.VALID))
    usb.bus_changed(BusState.RESET, chip.now_ns, 0)
    chip.run(bus.RESET_NS)
    assert (chip["USB.DADDR"], chip["USB.EP1R"], flags(chip) & bus.RESET) == (0, 0, bus.RESET)


@USB.row(
    "toggles",
    "DTOG and STAT turn over where 1 is written and stay where 0 is: a driver writes the difference.",
    TINYUSB(COMMON_H, 296),
    RIOT("usbdev_fs", 246),
    KLIPPER("usbfs", 199),
    rm("23.5.2"),
    values=st.integers(0, 0xFFFF),
)
def _(chip: Bench, word: int) -> None:
    chip.clock("USB")
    for start in (0x0000, 0x7070):
        chip["USB.EP3R"] = chip["USB.EP3R"] & 0x7070 ^ start
        chip["USB.EP3R"] = word
        assert chip["USB.EP3R"] & 0x7070 == start ^ word & 0x7070


@USB.row(
    "ctr-by-zero",
    "CTR is cleared by 0 and 1 leaves it: each write of an endpoint has 1 in what it does not mean.",
    TINYUSB(COMMON_H, 329),
    RIOT("usbdev_fs", 330),
    rm("23.5.2"),
)
def _(chip: Bench) -> None:
    usb = set_up(chip)
    bus.endpoint(chip, 1, bus.BULK, stat=bus.rx(bus.VALID))
    bus.send(usb, Token.OUT, 1, 0, b"x")
    chip["USB.EP1R"] = CTR_RX | CTR_TX | 1
    assert chip["USB.EP1R"] & (CTR_RX | CTR_TX) == CTR_RX
    chip["USB.EP1R"] = CTR_TX | 1
    assert not chip["USB.EP1R"] & (CTR_RX | CTR_TX)


@USB.row(
    "ctr-not-in-istr",
    "CTR of ISTR is no flag of its own: it is 1 until every endpoint's has been cleared.",
    TINYUSB(DCD, 420),
    CHIBIOS("LLD/USBv1/hal_usb_lld", 451),
    rm("23.5.1"),
)
def _(chip: Bench) -> None:
    usb = set_up(chip, bus.CTR)
    for n in (1, 2):
        bus.endpoint(chip, n, bus.BULK, stat=bus.rx(bus.VALID))
        bus.send(usb, Token.OUT, n, 0, b"x")
    chip["USB.ISTR"] = 0
    assert flags(chip) & bus.CTR
    assert chip.irqs[bus.LP]
    assert flags(chip) & 15 == 1
    chip["USB.EP1R"] = 1
    assert (flags(chip) & bus.CTR, flags(chip) & 15) == (bus.CTR, 2)
    chip["USB.EP2R"] = 2
    assert not flags(chip) & bus.CTR
    assert not chip.irqs[bus.LP]


@USB.row(
    "istr-by-zero",
    "The other flags of ISTR are cleared by 0, so that a driver writes the complement of what it served.",
    TINYUSB(DCD, 382),
    KLIPPER("usbfs", 424),
    CHIBIOS("LLD/USBv1/hal_usb_lld", 407),
    rm("23.5.1"),
)
def _(chip: Bench) -> None:
    usb = set_up(chip)
    usb.bus_changed(BusState.FRAMES, chip.now_ns, 0)
    chip.run(bus.MS)
    usb.bus_changed(BusState.IDLE, chip.now_ns, 0)
    chip.run(bus.MS)
    assert flags(chip) & (bus.SOF | bus.ESOF) == bus.SOF | bus.ESOF
    chip["USB.ISTR"] = 0xFFFF & ~bus.SOF
    assert flags(chip) & (bus.SOF | bus.ESOF) == bus.ESOF


@USB.row(
    "valid-then-nak",
    "An endpoint that has taken or sent a packet says NAK until the program makes it VALID again.",
    TINYUSB(DCD, 360),
    rm("23.4.2"),
    values=st.integers(0, 1),
)
def _(chip: Bench, is_in: int) -> None:
    usb = set_up(chip)
    token, stat, mask = (Token.IN, bus.tx, STAT_TX) if is_in else (Token.OUT, bus.rx, STAT_RX)
    bus.endpoint(chip, 1, bus.BULK, stat=stat(bus.VALID))
    assert bus.send(usb, token, 1, 0, b"" if is_in else b"x") is not None
    assert chip["USB.EP1R"] & mask == stat(bus.NAK)
    assert bus.send(usb, token, 1, 1, b"" if is_in else b"y") == bus.SAYS_NAK
    chip["USB.EP1R"] = CTR_RX | CTR_TX | stat(bus.VALID ^ bus.NAK) | 1
    assert bus.send(usb, token, 1, 1, b"" if is_in else b"y") != bus.SAYS_NAK


@USB.row(
    "setup-always-heard",
    "A SETUP is taken whatever STAT says, sets both directions to NAK and both toggles to 1, and is marked by SETUP.",
    TINYUSB(DCD, 303),
    TINYUSB(DCD, 430),
    rm("23.4.2"),
    values=st.sampled_from([bus.STALL, bus.NAK, bus.VALID]),
)
def _(chip: Bench, stat: int) -> None:
    usb = set_up(chip)
    bus.endpoint(chip, 0, bus.CONTROL, stat=bus.rx(stat) | bus.tx(stat))
    assert bus.send(usb, Token.SETUP, 0, 0, bytes(range(8))) == bus.ACK
    word = chip["USB.EP0R"]
    assert word & (STAT_RX | STAT_TX) == bus.rx(bus.NAK) | bus.tx(bus.NAK)
    assert word & (bus.DTOG_RX | bus.DTOG_TX | SETUP) == bus.DTOG_RX | bus.DTOG_TX | SETUP


@USB.row(
    "setup-read-before-clear",
    "Another SETUP is not heard until CTR_RX is cleared: its packet is copied before.",
    TINYUSB(DCD, 287),
    TINYUSB(DCD, 431),
    rm("23.4.2"),
)
def _(chip: Bench) -> None:
    usb = set_up(chip)
    bus.endpoint(chip, 0, bus.CONTROL, stat=bus.rx(bus.VALID))
    bus.send(usb, Token.SETUP, 0, 0, bytes(8))
    assert bus.send(usb, Token.SETUP, 0, 0, b"\1" * 8) is None
    assert bus.stored(chip, 128, 8) == bytes(8)
    chip["USB.EP0R"] = CTR_TX | bus.CONTROL << 9
    assert bus.send(usb, Token.SETUP, 0, 0, b"\1" * 8) == bus.ACK


@USB.row(
    "data0-after-stall",
    "A stall that is taken back begins with DATA0: the driver clears DTOG itself.",
    LOCM3("common/st_usbfs_core", 150),
    TINYUSB(DCD, 850),
    rm("23.4.2"),
)
def _(chip: Bench) -> None:
    usb = set_up(chip)
    bus.endpoint(chip, 1, bus.BULK, stat=bus.rx(bus.VALID))
    bus.send(usb, Token.OUT, 1, 0, b"x")
    chip["USB.EP1R"] = 1 | bus.rx(bus.NAK ^ bus.STALL)
    assert bus.send(usb, Token.OUT, 1, 1, b"y") == bus.SAYS_STALL
    assert chip["USB.EP1R"] & bus.DTOG_RX
    chip["USB.EP1R"] = 1 | bus.DTOG_RX | bus.rx(bus.STALL ^ bus.VALID)
    assert not chip["USB.EP1R"] & bus.DTOG_RX
    assert bus.send(usb, Token.OUT, 1, 0, b"z") == bus.ACK
    assert bus.stored(chip, 256, 1) == b"z"


@USB.row(
    "buffer-size-first",
    "The size of a buffer is written before its endpoint is VALID: a longer packet is stalled, and none of it stored.",
    TINYUSB(DCD, 352),
    rm("23.5.3"),
    values=st.integers(1, 31),
)
def _(chip: Bench, blocks: int) -> None:
    usb = set_up(chip)
    bus.endpoint(chip, 1, bus.BULK, stat=bus.rx(bus.VALID))
    chip["USB.PMA_00E"] = blocks << 10
    assert bus.send(usb, Token.OUT, 1, 0, b"\x55" * (2 * blocks + 1)) == bus.SAYS_STALL
    assert bus.stored(chip, 256, 2) == bytes(2)
    assert bus.send(usb, Token.OUT, 1, 0, b"\x55" * (2 * blocks)) == bus.ACK
    assert chip["USB.PMA_00E"] & 0x3FF == 2 * blocks


@USB.row(
    "packet-memory-halfwords",
    "The memory of packets has sixteen bits in each word of 32: byte n of it stands at 2n.",
    KLIPPER("usbfs", 19),
    RIOT("usbdev_fs", 55),
    rm("23.4.3"),
    values=st.integers(0, 0xFFFF_FFFF),
)
def _(chip: Bench, word: int) -> None:
    chip.clock("USB")
    chip["USB.PMA_010"] = word
    assert chip["USB.PMA_010"] == word & 0xFFFF
    assert chip["USB.PMA_012"] == 0


@USB.row(
    "double-buffers-wait",
    "A double-buffered endpoint says NAK while DTOG and SW_BUF are alike, until the program turns SW_BUF over.",
    KLIPPER("usbfs", 204),
    KLIPPER("usbfs", 233),
    rm("23.4.3"),
)
def _(chip: Bench) -> None:
    usb = set_up(chip)
    bus.endpoint(chip, 1, bus.BULK, stat=bus.rx(bus.VALID), flags=bus.KIND | bus.DTOG_TX)
    chip["USB.PMA_00A"] = chip["USB.PMA_00E"] = 1 << 15 | 1 << 10
    assert bus.send(usb, Token.OUT, 1, 0, b"a") == bus.ACK
    assert bus.send(usb, Token.OUT, 1, 1, b"b") == bus.SAYS_NAK
    chip["USB.EP1R"] = bus.BULK << 9 | bus.KIND | bus.DTOG_TX | 1
    assert bus.send(usb, Token.OUT, 1, 1, b"b") == bus.ACK


@USB.row(
    "susp-after-fsusp",
    "SUSP is cleared after FSUSP has been set: while FSUSP is 0 it comes again each three milliseconds.",
    TINYUSB(DCD, 404),
    rm("23.4.5"),
)
def _(chip: Bench) -> None:
    usb = set_up(chip)
    usb.bus_changed(BusState.FRAMES, chip.now_ns, 0)
    chip.run(bus.MS)
    usb.bus_changed(BusState.IDLE, chip.now_ns, 0)
    chip.run(3 * bus.MS)
    assert flags(chip) & bus.SUSP
    chip["USB.ISTR"] = 0
    chip.run(3 * bus.MS)
    assert flags(chip) & bus.SUSP
    chip["USB.CNTR"] = bus.FSUSP
    chip["USB.ISTR"] = 0
    chip.run(10 * bus.MS)
    assert not flags(chip) & bus.SUSP


@USB.row(
    "wakeup-needs-suspend",
    "A resume raises WKUP only while FSUSP is set, and takes LP_MODE away; FSUSP is the program's to clear.",
    TINYUSB(DCD, 388),
    CHIBIOS("LLD/USBv1/hal_usb_lld", 423),
    rm("23.4.5"),
)
def _(chip: Bench) -> None:
    usb = set_up(chip)
    usb.bus_changed(BusState.RESUME, chip.now_ns, 0)
    assert not flags(chip) & bus.WKUP
    usb.bus_changed(BusState.IDLE, chip.now_ns, 0)
    chip["USB.CNTR"] = bus.FSUSP | bus.LP_MODE
    usb.bus_changed(BusState.RESUME, chip.now_ns, 0)
    assert flags(chip) & bus.WKUP
    assert chip["USB.CNTR"] == bus.FSUSP


@USB.row(
    "esof-counts-silence",
    "ESOF comes each millisecond without a frame, so that a driver can time its resume.",
    TINYUSB(DCD, 217),
    TINYUSB(DCD, 409),
    rm("23.5.1"),
)
def _(chip: Bench) -> None:
    usb = set_up(chip)
    usb.bus_changed(BusState.FRAMES, chip.now_ns, 0)
    chip.run(bus.MS)
    usb.bus_changed(BusState.IDLE, chip.now_ns, 0)
    for _ in range(2):
        chip["USB.ISTR"] = 0
        chip.run(bus.MS - 1)
        assert not flags(chip) & bus.ESOF
        chip.run(1)
        assert flags(chip) & bus.ESOF


@USB.row(
    "pins-while-powered",
    "PA11 and PA12 are the device's while PDWN is 0, whatever GPIO says, and GPIO's again behind it.",
    ours("USB"),
    RIOT("usbdev_fs", 377),
    rm("9.1.10"),
)
def _(chip: Bench) -> None:
    chip.clock("USB", "GPIOA")
    assert chip.pins["PA12"].holder is None
    chip["USB.CNTR"] = 1
    assert chip.pins["PA12"].holder is not None
    chip["USB.CNTR"] = 3
    assert chip.pins["PA12"].holder is None


USB.not_modelled(
    "transceiver-start",
    "The transceiver needs about a microsecond behind PDWN before FRES is cleared.",
    TINYUSB(COMMON, 29),
    rm("23.4.2"),
    why="it is there at once, as peripherals.md says",
)
USB.not_modelled(
    "long-interrupts",
    "An overrun of the packet memory raises PMAOVR where the memory is not served in time.",
    TINYUSB(COMMON, 89),
    rm("23.5.1"),
    why="the bus side of the memory never waits, so that PMAOVR never rises",
)
