"""Walks of what talks to others: USART, SPI, I2C, CAN, USB."""

import zlib

from bluepill_sim.fabric.usb_bus import BusState, Handshake, Token, Transaction
from bluepill_sim.parts import CanFrame
from bluepill_sim.peripherals.usart import ReceiveError
from tests.bluepill_sim.peripherals.walks.walker import BUFFER, RegisterWalk, RegisterWalker

#: Alternate functions everywhere: push-pull, and open drain.
_PUSH, _OPEN = 0xBBBB_BBBB, 0xFFFF_FFFF


def _pins(w: RegisterWalker, mode: int = _PUSH, *, inputs: str = "", analog: str = "") -> None:
    """Give all pins of A and B to the peripherals, but some that are inputs, "A3 A10", and some that are analog."""
    words = {f"GPIO{port}.CR{half}": mode for port in "AB" for half in "LH"}
    for pins, setting in ((inputs, 0x4), (analog, 0)):
        for pin in pins.split():
            number = int(pin[1:])
            name = f"GPIO{pin[0]}.CR{'LH'[number > 7]}"
            words[name] = words[name] & ~(0xF << number % 8 * 4) | setting << number % 8 * 4
    for name, word in words.items():
        w.write(name, word)


def _dma(w: RegisterWalker, channel: int, address: int, *, to_memory: bool, wide: int) -> None:
    """Set up a channel of DMA1, circular or not."""
    w.put(bytes((7 * n + 3) & 0xFF for n in range(0x40)))
    w.write(f"DMA1.CPAR{channel}", address)
    w.write(f"DMA1.CMAR{channel}", BUFFER + 0x40 * to_memory)
    w.write(f"DMA1.CNDTR{channel}", 1 + w.number(6))
    control = 0x8F | wide | w.some(1 << 5) | (0 if to_memory else 1 << 4)
    w.write(f"DMA1.CCR{channel}", control)


# USART.

_UE, _M, _PCE, _PS, _TE, _RE, _RWU, _SBK = (1 << n for n in (13, 12, 10, 9, 3, 2, 1, 0))
#: Control registers 2 and 3 of each mode, and what is turned on at random beside them.
_USART_MODES = (
    (0, 0, (), ()),
    (0, 0, (1 << 12, 1 << 13), ()),
    (1 << 14, 0, (1 << 5, 1 << 6), ()),  # LIN
    (1 << 11, 0, (1 << 10, 1 << 9, 1 << 8), ()),  # synchronous
    (0, 1 << 1, (), (1 << 2,)),  # IrDA
    (0, 1 << 3, (), ()),  # half duplex
    (3 << 12 | 1 << 11, 1 << 5, (), (1 << 4,)),  # smartcard
    (0, 3 << 8, (), (1 << 10,)),  # flow control
    (0, 3 << 6, (), (1,)),  # DMA
    (5, 0, (1 << 13,), ()),  # multiprocessor: address 5
)
_USART_DMA = {1: (4, 5), 2: (7, 6), 3: (2, 3)}


def _usart(number: int) -> RegisterWalk:  # noqa: C901 - a function a move
    name = f"USART{number}"
    inputs = {1: "A10 A11", 2: "A3 A0", 3: "B11 B13"}[number]
    cts = {1: "PA11", 2: "PA0", 3: "PB13"}[number]

    def begin(w: RegisterWalker) -> None:
        _pins(w, inputs=inputs, analog="" if w.number(8) else inputs)
        two, three, more_two, more_three = w.turn_of(_USART_MODES)
        w.write(f"{name}.BRR", w.pick((16, 17, 24, 40, 69)))
        w.write(f"{name}.GTPR", w.pick((0, 1, 2, 0x101, 0x1005)))
        w.write(f"{name}.CR2", two | w.some(*more_two))
        w.write(f"{name}.CR3", three | w.some(*more_three))
        w.write(f"{name}.CR1", _UE | _TE | _RE | w.some(_M, _PCE, _PS, 16, 32, 64, 128, 256, _RWU, 1 << 11))
        if three & 3 << 6:
            out, into = _USART_DMA[number]
            _dma(w, out, w.part(name).base + 4, to_memory=False, wide=0)
            _dma(w, into, w.part(name).base + 4, to_memory=True, wide=0)
        if not w.number(4):
            w.board.serial_ports[name.lower()].far_baud = w.pick((9_600, 115_200, 500_000))

    def send(w: RegisterWalker) -> None:
        w.write(f"{name}.DR", w.number(512))

    def take(w: RegisterWalker) -> None:
        w.read(f"{name}.SR")
        w.read(f"{name}.DR")

    def hear(w: RegisterWalker) -> None:
        data = [w.pick((0, 5, 0x55, 0x85, 0xFF, 0x105, w.number(512))) for _ in range(1 + w.number(3))]
        data *= w.pick((*(1,) * 9, 20, 150))
        damage = ReceiveError(w.some(*ReceiveError)) if not w.number(3) else ReceiveError(0)
        w.note(f"hears {data} {damage.value}")
        w.part(name).receive(data, damage)

    def hear_break(w: RegisterWalker) -> None:
        bits = 8 + w.number(7)
        w.note(f"hears a break of {bits}")
        w.attempt(lambda: w.part(name).receive_break(bits))
        w.note(f"{w.part(name).bit_ns}")

    def hold(w: RegisterWalker) -> None:
        w.drive(cts, w.pick((False, True, None)))

    def control(w: RegisterWalker) -> None:
        w.turn(f"{name}.CR1", on=w.some(_SBK, _RWU), off=w.pick((0, 0, _TE, _RE, _RWU)))

    def cut(w: RegisterWalker) -> None:
        """Turn off what is under way."""
        w.write(f"{name}.DR", w.number(256))
        w.part(name).receive([0x55, 0x56])
        w.run(w.pick((3_000, 9_000, 20_000)))
        w.turn(f"{name}.CR1", off=w.pick((_TE, _RE, _TE | _RE, _UE)))
        w.run(w.pick((9_000, 43_000, 86_000)))
        w.turn(f"{name}.CR1", on=_UE | _TE | _RE)

    return RegisterWalk(
        name=name, parts=(name, "DMA1") if number == 1 else (name,), begin=begin,
        remaps=((4,), (8,), (0x10, 0x30))[number - 1],
        moves=(send, send, send, take, take, hear, hear, hear_break, hold, control, cut),
        spans_ns=(125, 900, 2_000, 9_000, 21_500, 43_000, 86_250, 200_000), episodes=31 if number == 1 else 11,
    )  # fmt: skip


# SPI.

_SPI_PINS = {1: ("PA4", "PA5", "PA7", "PA6"), 2: ("PB12", "PB13", "PB15", "PB14")}
_MSTR, _SPE, _LSBFIRST, _SSI, _SSM, _RXONLY, _DFF, _CRCNEXT, _CRCEN, _BIDIOE, _BIDIMODE = (
    1 << n for n in (2, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15)
)
_SPI_MODES = (
    _MSTR | _SSM | _SSI, _MSTR | _SSM | _SSI | _CRCEN, _MSTR | _SSM | _SSI | _RXONLY,
    _MSTR | _SSM | _SSI | _BIDIMODE | _BIDIOE, _MSTR | _SSM | _SSI | _BIDIMODE, _MSTR,
    _SSM, 0, _CRCEN | _SSM, _RXONLY | _SSM, _BIDIMODE | _BIDIOE | _SSM,
)  # fmt: skip


def _spi(number: int) -> RegisterWalk:  # noqa: C901, PLR0915 - a function a move
    name = f"SPI{number}"
    nss, sck, mosi, miso = _SPI_PINS[number]

    def begin(w: RegisterWalker) -> None:
        mode = w.turn_of(_SPI_MODES)
        lost = w.pick((*("",) * 8, sck[1:], mosi[1:], miso[1:]))
        inputs = lost + f" {nss[1:]}" * (not mode & _SSM) if mode & _MSTR else f"{nss[1:]} {sck[1:]} {mosi[1:]}"
        _pins(w, inputs=inputs, analog=lost * w.number(2))
        w.write("GPIOB.CRL", 0xBBBB_BBB3)
        w.write("GPIOB.BSRR", w.pick((1, 1 << 16)))
        if not mode & (_MSTR | _SSM):
            w.drive(nss, w.pick((False, False, True)))
        w.write(f"{name}.CRCPR", w.pick((7, 0x1021, 0x31)))
        w.write(f"{name}.CR2", w.some(1, 2, 4, 32, 64, 128))
        settings = mode | w.pick((0, 0, 0, _LSBFIRST, _DFF, _LSBFIRST | _DFF)) | w.pick((0, 3, 1, 2)) | w.number(4) << 3
        w.write(f"{name}.CR1", settings)
        if w.look(f"{name}.CR2") & 3 and number == 1:
            _dma(w, 3, w.part(name).base + 12, to_memory=False, wide=0x100 if settings & _DFF else 0)
            _dma(w, 2, w.part(name).base + 12, to_memory=True, wide=0x100 if settings & _DFF else 0)
        w.write(f"{name}.CR1", settings | _SPE)

    def send(w: RegisterWalker) -> None:
        w.write(f"{name}.DR", w.pick((0xFF, w.number(0x10000))))

    def send_many(w: RegisterWalker) -> None:
        for _ in range(4):
            w.write(f"{name}.DR", w.pick((0xFF, 0xFF, 0xFF, 0)))
            w.run(w.pick((9_000, 20_000)))
            w.read(f"{name}.DR")

    def take(w: RegisterWalker) -> None:
        if w.number(2):
            w.read(f"{name}.DR")
        w.read(f"{name}.SR")

    def clock_in(w: RegisterWalker) -> None:
        words = [w.number(0x10000 if w.look(f"{name}.CR1") & _DFF else 0x100) for _ in range(1 + w.number(3))]
        w.note(f"is clocked {words}")
        hz = w.pick((100_000, 500_000, 1_000_000, 0, 1))
        w.attempt(lambda: w.part(name).clock_in(words, hz))

    def checked(w: RegisterWalker) -> None:
        """A word and its CRC."""
        w.write(f"{name}.DR", w.number(256))
        w.turn(f"{name}.CR1", on=_CRCNEXT)
        w.run(w.pick((9_000, 40_000)))
        w.read(f"{name}.DR")

    def wires(w: RegisterWalker) -> None:
        if w.look(f"{name}.CR1") & _MSTR:
            w.drive(nss, w.pick((False, True, None)))
            return
        w.drive(mosi, bool(w.number(2)))
        for level in (True, False) * w.pick((1, 3, 8)):
            w.drive(sck, level)
            w.run(500)
        if not w.number(3):
            w.drive(nss, bool(w.number(2)))

    def control(w: RegisterWalker) -> None:
        w.turn(f"{name}.CR1", on=w.some(_CRCNEXT, _SPE), off=w.pick((0, _SPE, _RXONLY)))
        w.write("GPIOB.BSRR", w.pick((1, 1 << 16)))

    return RegisterWalk(
        name=name, parts=(name, "DMA1") if number == 1 else (name,), begin=begin, remaps=(1,) * (number == 1),
        moves=(send, send, send_many, take, take, clock_in, wires, control, checked),
        spans_ns=(125, 250, 1_000, 2_000, 4_500, 9_000, 33_000), episodes=34 if number == 1 else 12,
    )  # fmt: skip


# I2C.

_PE, _ENPEC, _ENGC, _NOSTRETCH, _START, _STOP, _ACK, _POS, _PEC = (1 << n for n in (0, 5, 6, 7, 8, 9, 10, 11, 12))
_SB, _ADDR, _BTF, _ADD10, _STOPF, _RXNE, _TXE = 1, 2, 4, 8, 16, 64, 128
_I2C_PINS = {1: ("PB6", "PB7", "PB5"), 2: ("PB10", "PB11", "PB12")}
_I2C_DMA = {1: (6, 7), 2: (4, 5)}


def _i2c(number: int) -> RegisterWalk:  # noqa: C901, PLR0915 - a function a move
    name = f"I2C{number}"
    scl, sda, smba = _I2C_PINS[number]

    def begin(w: RegisterWalker) -> None:
        _pins(w, _OPEN)
        w.write(f"{name}.CR2", 8 | w.some(256, 512, 1024, 2048, 4096))
        w.write(f"{name}.CCR", w.pick((4, 10, 40, 0x8003, 0xC001, 0x8007)))
        w.write(f"{name}.TRISE", w.pick((2, 3, 9)))
        w.write(f"{name}.OAR1", w.pick((0x60, 0x4060, 0xC123)))
        w.write(f"{name}.OAR2", w.pick((0, 0x63)))
        w.write(
            f"{name}.CR1", _PE | w.some(_ACK, _ACK, _ENPEC, _ENGC, _NOSTRETCH, 16, _POS) | w.turn_of((0, 0, 2, 10, 8))
        )
        w.turn(f"{name}.CR1", on=w.pick((_ACK, _ACK, _ACK, 0)))
        if not w.number(3):
            w.turn(f"{name}.CR2", on=1 << 11 | w.some(1 << 12))
        if w.look(f"{name}.CR2") & 1 << 11:
            out, into = _I2C_DMA[number]
            _dma(w, out, w.part(name).base + 16, to_memory=False, wide=0)
            _dma(w, into, w.part(name).base + 16, to_memory=True, wide=0)

    def drive(w: RegisterWalker) -> None:
        """What a driver does next."""
        flags = w.look(f"{name}.SR1")
        if flags & _SB:
            w.read(f"{name}.SR1")
            w.write(f"{name}.DR", w.pick((0xA0, 0xA0, 0xA1, 0xA1, 0xF4, 0xF5, 0x22, 0x00)))
        elif flags & _ADD10:
            w.read(f"{name}.SR1")
            w.write(f"{name}.DR", w.pick((0xA5, 0xA5, 0x11)))
        elif flags & _ADDR:
            w.turn(f"{name}.CR1", on=w.some(_STOP), off=w.some(_ACK))
            w.read(f"{name}.SR1")
            w.read(f"{name}.SR2")
        elif flags & _STOPF:
            w.read(f"{name}.SR1")
            w.turn(f"{name}.CR1", on=_PE)
        elif flags & _RXNE:
            w.read(f"{name}.DR")
        elif flags & _TXE:
            w.write(f"{name}.DR", w.number(256))
            if not w.number(4):
                w.turn(f"{name}.CR1", on=w.pick((_STOP, _START, _PEC)))
        else:
            w.turn(f"{name}.CR1", on=w.pick((_START, _START, _STOP, _START | _ACK)))

    def flags(w: RegisterWalker) -> None:
        w.read(f"{name}.SR1")
        w.write(f"{name}.SR1", w.pick((0, 0xFFFF ^ 1 << 8 + w.number(8))))
        w.turn(f"{name}.CR1", off=w.pick((0, _PE, 0)), on=w.pick((_ACK, _PE | _ACK)))

    def called(w: RegisterWalker) -> None:
        address = w.pick((0x30, 0x30, 0x30, 0x31, 0x123, 0, 0x44, 0x50, 0x2A5, 0xC, 8, 0x3FF, 0x400))
        data, count = bytes(w.number(256) for _ in range(w.number(4))), w.number(4)
        w.note(f"is called {address:#x} {data.hex()} {count}")
        if not address:
            w.turn(f"{name}.CR1", on=_ENGC | _ACK)
        hz = w.pick((100_000,) * 4 + (400_000,) * 4 + (0, 1_000))
        w.attempt(lambda: w.part(name).call(address, data, count, hz=hz))

    def wires(w: RegisterWalker) -> None:
        """Levels from outside: a START, a STOP, a clock that is held, an alert."""
        moves = w.pick(((scl, False), (scl, False, scl, None), (sda, False, sda, None), (smba, False, smba, None),
                        (sda, False, scl, False, sda, None, scl, None), (scl, None, sda, None)))  # fmt: skip
        for pin, level in zip(moves[::2], moves[1::2], strict=True):
            w.drive(str(pin), level if isinstance(level, bool) else None)
            w.run(w.pick((125, 3_000, 12_000, 90_000)))

    def checked(w: RegisterWalker) -> None:
        """The packet's error code, as the last byte."""
        w.turn(f"{name}.CR1", on=_PEC | _ENPEC)
        w.run(100_000)
        w.turn(f"{name}.CR1", on=w.some(_STOP))
        w.read(f"{name}.DR")

    def unheeded(w: RegisterWalker) -> None:
        """It is called, and no program does anything; as SMBus's host it may be alerted."""
        w.turn(f"{name}.CR1", on=_PE | _ACK | w.pick((_NOSTRETCH, 10, 0)))
        w.drive(smba, w.pick((True, False)))
        if not w.number(3):
            _called_twice(w)
        elif w.number(2):
            w.part(name).call(0x30, bytes(w.number(256) for _ in range(w.number(5))), w.number(4))
        w.run(w.pick((300_000, 600_000)))
        w.drive(smba, False)
        w.turn(f"{name}.CR1", on=_STOP * w.number(2))

    def _called_twice(w: RegisterWalker) -> None:
        """Its second address, or everybody's, is called, written and read; between, it may be its own no longer."""
        w.write(f"{name}.OAR2", 0x63)
        w.turn(f"{name}.CR1", on=_ENGC)
        w.part(name).call(w.pick((0x31, 0x31, 0)), bytes((1, 2)), 2)
        for _ in range(6):
            w.run(60_000)
            drive(w)
            if not w.number(3):
                w.write(f"{name}.OAR2", w.pick((0, 0x63)))
                w.turn(f"{name}.CR1", off=_ENGC)

    def disturbed(w: RegisterWalker) -> None:
        w.note("is disturbed")
        w.pick((w.part(name).disturb, w.part(name).lose_arbitration))()

    return RegisterWalk(
        name=name, parts=(name, "DMA1") if number == 1 else (name,), begin=begin, remaps=(2,) * (number == 1),
        moves=(*(drive,) * 18, flags, called, called, called, disturbed, wires, wires, unheeded, checked),
        spans_ns=(125, 3_000, 10_000, 25_000, 90_000, 90_000, 100_000, 300_000, 26_000_000), at_random=14, steps=34,
        episodes=40 if number == 1 else 16,
    )  # fmt: skip


# CAN.

_INRQ, _SLEEP = 1, 2


def _can_begin(w: RegisterWalker) -> None:
    _pins(w, inputs="A11")
    w.write("CAN.MCR", _INRQ)
    mode = w.turn_of((0, 0, 1 << 30, 0, 0, 3 << 30, 0, 1 << 31))
    w.write("CAN.BTR", mode | w.pick((0x14_0001, 0x14_0001, 0x23_0001, 0x130_0000, 0x1C_0003)))
    _can_filters(w)
    w.write("CAN.IER", w.some(*(1 << n for n in (0, 1, 2, 3, 4, 5, 6, 8, 9, 10, 11, 15, 16, 17))))
    w.write("CAN.MCR", w.some(4, 8, 16, 32, 64, 128))
    w.run(30_000)


def _can_filters(w: RegisterWalker) -> None:
    """Set up banks 0, 1, 2 and 13: each a filter of another kind, of 32 or 16 bits, a mask or a list."""
    w.write("CAN.FMR", 1)
    kinds = w.number(1 << 6)
    w.write("CAN.FM1R", kinds & 7 | (kinds & 1) << 13)
    w.write("CAN.FS1R", kinds >> 3 | (kinds >> 3 & 1) << 13)
    w.write("CAN.FFA1R", w.pick((0, 1, 2, 5, 0x2002)))
    w.write("CAN.FA1R", w.pick((1, 3, 7, 0x2003, 0x3FFF)))
    for bank in (0, 1, 2, 13):
        is_list, is_wide = (w.look(f"CAN.{name}") >> bank & 1 for name in ("FM1R", "FS1R"))
        words = _wide_filters(w) if is_wide else (_narrow_filters(w), _narrow_filters(w))
        for half, word in enumerate(words):
            masks = word if is_list else (word & 0xFFFF_0000, word & 0xFFFF)[half] if is_wide else word
            w.write(f"CAN.F{bank}R{half + 1}", masks)
    if w.number(5):
        w.write("CAN.FMR", 0)


def _wide_filters(w: RegisterWalker) -> tuple[int, int]:
    """Return an identifier, and one more or a mask of it, as a bank of 32 bits has them."""
    frame = _frame(w)
    word = frame.identifier << 3 | 4 if frame.is_extended else frame.identifier << 21
    return word | 2 * frame.is_remote, w.pick((0, 0xFFE0_0000, 0xFFFF_FFFF, 4, word ^ 8, 6, 0xFFFF_FFF8))


def _narrow_filters(w: RegisterWalker) -> int:
    """Return two identifiers, or one and a mask, as half a bank of 16 bits has them."""
    frame = _frame(w)
    base, high = (frame.identifier >> 18, frame.identifier >> 15 & 7) if frame.is_extended else (frame.identifier, 0)
    word = base << 5 | frame.is_remote << 4 | frame.is_extended << 3 | high
    return word | w.pick((0, 0xFFFF, 0xFFE0, 0xFFF8, 0xF, 0x18, word)) << 16


def _frame(w: RegisterWalker) -> CanFrame:
    identifier = w.pick((0x123, 0x123, 0x123, 0x124, 0x7FF, 0))
    if w.number(3) == 0:
        low = w.pick((0x155, 0x1_0155, 0x2_8000, 0x2_8000, 0x8000, 0))
        return CanFrame(identifier=identifier << 18 | low, is_extended=True, data=bytes(range(w.number(9))))
    if w.number(5) == 0:
        return CanFrame(identifier=identifier, is_remote=True, remote_bytes=w.number(9))
    return CanFrame(identifier=identifier, data=bytes(w.number(256) for _ in range(w.number(9))))


def _can_send(w: RegisterWalker) -> None:
    mailbox, frame = w.number(3), _frame(w)
    padded = frame.data.ljust(8, b"\0")
    w.write(f"CAN.TDT{mailbox}R", w.pick((frame.dlc, frame.dlc, frame.dlc, 8, 9, 15)) | w.some(1 << 8))
    w.write(f"CAN.TDL{mailbox}R", int.from_bytes(padded[:4], "little"))
    w.write(f"CAN.TDH{mailbox}R", int.from_bytes(padded[4:], "little"))
    identifier = frame.identifier << 3 | 4 if frame.is_extended else frame.identifier << 21
    w.write(f"CAN.TI{mailbox}R", identifier | 2 * frame.is_remote | 1)


def _can_hear(w: RegisterWalker) -> None:
    frame = _frame(w)
    w.note(f"hears {frame.identifier:x} {frame.data.hex()} {frame.dlc}")
    w.node.send(frame)


def _can_take(w: RegisterWalker) -> None:
    fifo = w.number(2)
    w.read(f"CAN.RI{fifo}R")
    w.read(f"CAN.RDT{fifo}R")
    w.read(f"CAN.RDL{fifo}R")
    w.write(f"CAN.RF{fifo}R", 32 | w.some(8, 16))


def _can_flags(w: RegisterWalker) -> None:
    w.write("CAN.TSR", w.some(*(1 << n for n in (0, 7, 8, 15, 16, 23))))
    w.write("CAN.MSR", w.some(4, 8, 16))
    w.write("CAN.ESR", w.pick((0, 0x70)))


def _can_mode(w: RegisterWalker) -> None:
    for _ in range(w.pick((1, 1, 2))):
        w.turn("CAN.MCR", on=w.pick((0, _INRQ, _SLEEP)), off=w.pick((_INRQ, _SLEEP, 3)))


def _can_wire(w: RegisterWalker) -> None:
    w.drive("PA11", w.pick((False, True, None)))


def _can_damage(w: RegisterWalker) -> None:
    w.note("damaged")
    w.network.damage(w.pick((1, 3, 17, 40)))


def _can_flood(w: RegisterWalker) -> None:
    """More frames than a FIFO holds."""
    w.turn("CAN.MCR", on=w.some(8), off=w.some(8))
    for _ in range(4):
        _can_hear(w)
    w.run(1_200_000)
    for _ in range(w.number(5)):
        _can_take(w)


def _can_off(w: RegisterWalker) -> None:
    """Become error passive or go off the bus, and come back, by ABOM or by a program."""
    w.turn("CAN.MCR", on=w.some(64), off=16 | _INRQ | _SLEEP)
    _can_send(w)
    w.network.damage(w.pick((15, 16, 31, 32, 33)))
    w.run(w.pick((3_000_000, 7_000_000)))
    w.turn("CAN.MCR", on=_INRQ)
    w.run(3_000)
    w.turn("CAN.MCR", off=_INRQ)
    w.run(w.pick((2_500_000, 3_200_000, 300_000)))


def _can_listener(w: RegisterWalker) -> None:
    """Somebody listens to frames for a while."""
    part = w.part("CAN")
    end = part.subscribe(
        lambda ends: w.note(" ".join(f"{one.start_ns} {one.end_ns} {one.error.value}" for one in ends))
    )
    _can_send(w)
    _can_hear(w)
    w.run(700_000)
    end()
    w.note(f"{part.sends_at('PA11')} {part.sends_at('PB8')} {part.bit_rate}")


def _can_unwired(w: RegisterWalker) -> None:
    """Take its pin, and give it back."""
    w.write("GPIOA.CRH", w.pick((0xBBB4_4BBB, 0xBBB3_4BBB, 0xBBBF_4BBB)))
    if w.number(2):
        w.turn("CAN.MCR", on=_INRQ)
        w.turn("CAN.MCR", off=_INRQ | _SLEEP)
        w.run(30_000)
        _can_send(w)
    w.run(w.pick((125, 200_000)))
    w.write("GPIOA.CRH", 0xBBBB_4BBB)


def _can_repeated(w: RegisterWalker) -> None:
    """The same frame for long, and what ends its tries."""
    w.turn("CAN.MCR", off=3 | 16 | 0x8000)
    _can_send(w)
    w.run(w.pick((4_000_000, 6_000_000, 6_100_123)))
    w.run(w.pick((125, 100_000, 333_333)))
    w.pick((_can_flags, _can_send, _can_unwired, _can_mode, _can_wire, _can_take, RegisterWalker.reset))(w)


_CAN = RegisterWalk(
    name="CAN", parts=("CAN",), begin=_can_begin, remaps=(0x4000, 0x6000),
    moves=(*(_can_send, _can_send, _can_hear, _can_hear, _can_take, _can_take, _can_flags, _can_mode, _can_damage) * 2,
           _can_flood, _can_off, _can_listener, _can_unwired, _can_filters),
    spans_ns=(125, 2_000, 22_000, 100_000, 250_000, 600_000, 3_000_000), at_random=20, episodes=30,
)  # fmt: skip


#: With nobody who acknowledges: the same frame again and again, which C alone repeats.
_CAN_ALONE = RegisterWalk(
    name="CAN-alone", parts=("CAN",), begin=_can_begin, is_alone=True, remaps=(0x4000,),
    moves=(_can_send, _can_send, _can_take, _can_flags, _can_mode, _can_wire, _can_repeated, _can_repeated),
    spans_ns=(2_000, 22_000, 100_000, 300_000, 900_000, 3_000_000), at_random=12, episodes=18,
)  # fmt: skip

# USB.

_USB_ADDRESS = 5
#: Control, bulk, bulk with two buffers, isochronous, interrupt; and what stalls or answers NAK.
_ENDPOINTS = (0x3230, 0x3030, 0x3630, 0x3130, 0x3430, 0x3630, 0x1010, 0x2620)


def _usb_begin(w: RegisterWalker) -> None:
    if w.board.hclk_hz == 8_000_000:
        w.hurry()
    if not w.number(8):
        w.turn("RCC.CFGR", on=7 << 8)
    w.drive("PA12", None)
    w.write("USB.CNTR", 1)
    w.write("USB.CNTR", w.some(*(1 << n for n in range(8, 16))))
    w.write("USB.ISTR", 0)
    w.write("USB.DADDR", 0x80 | _USB_ADDRESS)
    w.write("USB.BTABLE", w.pick((0, 0, 0x40)))
    for n in range(3):
        at = 2 * w.look("USB.BTABLE")
        sizes = w.pick((8 * n, 8 * n, 64, 0x1FF, 0x201, 0x3FF)), w.pick((0x8400, 0x1000, 0x7C00, 0xFC00, 0x8000, 0x400))
        for word, value in enumerate((64 + 128 * n, sizes[0], 128 + 128 * n, sizes[1])):
            w.part("USB").write(0x400 + at + 16 * n + 4 * word, 4, value)
        mode = _ENDPOINTS[(w.episode + 3 * n) % len(_ENDPOINTS)]
        w.write(f"USB.EP{n}R", mode | w.some(0x40, 0x4000) | n)
    _usb_bus(w)


def _usb_bus(w: RegisterWalker) -> None:
    state = w.pick((BusState.FRAMES, BusState.FRAMES, *BusState))
    w.note(f"bus {state.value}")
    w.part("USB").bus_changed(state, w.board.now_ns, w.pick((0, 7, 2047)))
    w.part("USB").plan()


def _usb_transaction(w: RegisterWalker) -> None:
    usb, token = w.part("USB"), w.pick((*Token, Token.OUT, Token.IN))
    length = (
        w.pick((7, 8, 8, 8)) if token is Token.SETUP else w.pick((0, 1, 7, 8, 9, 32, 33, 62, 63, 64, 65, 513, 1023))
    )
    data = bytes(n & 0xFF for n in range(length))
    one = Transaction(
        token, w.pick((*(_USB_ADDRESS,) * 9, 6)), w.pick((0, 1, 2, 0, 1, 2, 3)), w.number(2),
        b"" if token is Token.IN else data, is_damaged=not w.number(12),
    )  # fmt: skip
    answer = usb.begin(one)
    said = "" if answer is None else f"{answer.handshake} {answer.pid} {len(answer.data)} {zlib.crc32(answer.data):08x}"
    w.note(f"{one.token.value} {one.endpoint} {one.pid} {len(one.data)}: {said}")
    w.note(f"{usb.would_nak(one.endpoint, is_in=True)} {usb.would_nak(one.endpoint, is_in=False)}")
    if not w.number(20):
        w.write("USB.DADDR", w.pick((0, 0x80 | 6)))
    if answer is not None and answer.handshake in {None, Handshake.ACK} and w.number(8):
        usb.end(one)


def _usb_again(w: RegisterWalker) -> None:
    n = w.number(3)
    now = w.look(f"USB.EP{n}R")
    w.write(
        f"USB.EP{n}R", now & 0x070F | 0x8080 & ~w.some(0x8000, 0x80) | (now ^ 0x3030) & 0x3030 | w.some(0x4000, 0x40)
    )
    w.write("USB.ISTR", 0xFFFF & ~w.some(*(1 << n for n in range(8, 15))))


def _usb_mode(w: RegisterWalker) -> None:
    w.turn("USB.CNTR", on=w.pick((0, 8, 12, 16, 1, 2)), off=w.pick((31, 31, 8, 16)))
    if not w.number(4):
        w.turn("CAN.MCR", on=w.some(1, 2), off=3)


def _usb_sleep(w: RegisterWalker) -> None:
    """Be suspended, and be woken by the host or wake it."""
    w.turn("USB.CNTR", on=8 | w.some(4), off=3)
    w.run(w.pick((125, 1_000_000, 4_000_000)))
    if w.number(2):
        state = w.pick((BusState.RESET, BusState.RESUME, BusState.IDLE))
        w.note(f"bus {state.value}")
        w.part("USB").bus_changed(state, w.board.now_ns, 9)
    else:
        w.turn("USB.CNTR", on=16)
        w.run(w.pick((125, 1_000_000)))
        w.turn("USB.CNTR", off=w.pick((16, 16, 24)))
    w.read("USB.FNR")
    w.note(f"host {w.host.sum:x}")


def _usb_iso(w: RegisterWalker) -> None:
    """Make an endpoint isochronous, or a bulk one of two buffers."""
    n = w.number(3)
    now = w.look(f"USB.EP{n}R")
    w.write(f"USB.EP{n}R", now & 0xF | w.pick((0x400, 0x100, 0x500, 0x200)) | 0x8080 | (now ^ 0x3030) & 0x3030)


def _usb_cable(w: RegisterWalker) -> None:
    wanted = bool(w.number(3))
    w.note(f"the pull-up counts: {wanted}")
    w.part("USB").heed_pull_up(wanted)
    w.drive("PA12", w.pick((False, True, None)))


_USB = RegisterWalk(
    name="USB", parts=("USB",), begin=_usb_begin, beside=(),
    moves=(*(*(_usb_transaction,) * 6, _usb_again, _usb_again, _usb_again, _usb_bus, _usb_mode, _usb_cable) * 2,
           _usb_sleep, _usb_iso),
    spans_ns=(1_000, 50_000, 400_000, 1_000_000, 3_100_000), at_random=12, episodes=30, steps=30,
)  # fmt: skip

BUSES = (*map(_usart, (1, 2, 3)), *map(_spi, (1, 2)), *map(_i2c, (1, 2)), _CAN, _CAN_ALONE, _USB)
