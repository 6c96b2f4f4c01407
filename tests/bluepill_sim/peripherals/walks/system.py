"""Walks of what the chip lives by: clocks, supply, flash, backup domain, watchdogs, ports, CRC."""

import zlib

from tests.bluepill_sim.peripherals.walks.walker import RegisterWalk, RegisterWalker

# RCC.


def _rcc_begin(w: RegisterWalker) -> None:
    w.write("PWR.CR", w.pick((0x100, 0x100, 0)))
    w.write("FLASH.ACR", 0x12)
    w.write("GPIOA.CRH", 0x4444_444B)
    w.write("RCC.CIR", w.some(*(1 << n for n in range(8, 13))))
    w.turn("RCC.CR", on=1 << 16)
    w.run(w.pick((1_000, 2_100_000)))


def _rcc_move(w: RegisterWalker) -> None:
    register, words = w.pick((
        ("CR", (0x83, 0x1_0083, 0x9_0083, 0x101_0083, 0x109_0083, 0x100_0083, 0x101_00FB, 0x5_0082, 0x100_0082)),
        ("CFGR", (0, 1, 2, 3, 0x1C_0000, 0x1D_0402, 0x1D_A402, 0x1F_0002, 0x80, 0x92, 0x0400_0000, 0x0500_0001,
                  0x0700_0002, 0x0600_0000, 0x41_3700, 0x5C_0002)),
        ("CIR", (0x1F00, 0x9F_0000, 0x9F_1F00)),
        ("BDCR", (0, 1, 0x101, 0x8101, 0x200, 0x8300, 0x1_0000, 4)),
        ("CSR", (0, 1, 1 << 24)),
        ("APB1RSTR", (0, 1 << 17, 0x20_0000)), ("APB2RSTR", (0, 4, 0x4004)),
        ("APB1ENR", (0, 0x1800_0000, 0xFFFF_FFFF)), ("APB2ENR", (0, 0xFFFF_FFFF)), ("AHBENR", (0, 0x14, 0x55)),
    ))  # fmt: skip
    w.write(f"RCC.{register}", w.pick(words))


def _rcc_crystal(w: RegisterWalker) -> None:
    w.board.crystal_works = not w.board.crystal_works
    w.note(f"crystal {w.board.crystal_works}")


def _rcc_security(w: RegisterWalker) -> None:
    """The crystal breaks under what it clocks, watched by CSS or not."""
    w.board.crystal_works = True
    w.turn("RCC.CR", on=1 << 16)
    w.run(2_000_000)
    w.turn("RCC.CR", on=w.pick((1 << 19, 1 << 19, 0)))
    w.turn("RCC.CFGR", on=w.pick((1, 0, 1 << 16 | 2, 1 << 16)), off=0x3F_0003)
    if w.look("RCC.CFGR") & 1 << 16:
        w.turn("RCC.CR", on=1 << 24)
        w.run(200_000)
    w.run(1_000)
    w.board.crystal_works = False
    w.note("crystal breaks")
    w.run(w.pick((125, 1_000, 50_000)))
    w.write("RCC.CIR", w.pick((*(0x80_0000,) * 7, 0)))
    w.board.crystal_works = bool(w.number(2))


def _rcc_backup(w: RegisterWalker) -> None:
    w.turn("RCC.APB1ENR", on=0x1800_0000)
    w.write("PWR.CR", w.pick((0x100, 0x100, 0x100, 0)))
    for word in w.pick(((0x1_0000, 0), (0x101, 0x201, 0x8101), (0x1_0000, 0x8300), (1, 0x8101))):
        w.write("RCC.BDCR", word)
        w.run(w.pick((125, 1_000)))


def _rcc_low_power(w: RegisterWalker) -> None:
    """What a mode of low power does to the clocks."""
    kind, rcc = w.number(3), w.part("RCC")
    w.note(("stop", "standby", "stops")[kind])
    if kind < 2:
        (rcc.stop, rcc.stand_by)[kind]()
    else:
        rcc.clock_stopped()
        w.run(1_000)
        rcc.clock_resumed(1_000)


def _lsi(w: RegisterWalker) -> None:
    hz = w.pick((40_000, 30_000, 60_000, 45_000, 29_999, 60_001))
    w.note(f"LSI {hz}")
    w.attempt(lambda: setattr(w.board, "lsi_hz", hz))


_RCC = RegisterWalk(
    name="RCC", parts=("RCC",), begin=_rcc_begin,
    moves=(*(_rcc_move,) * 9, _rcc_crystal, _rcc_security, _rcc_security, _rcc_backup, _rcc_low_power, _lsi),
    spans_ns=(125, 5_000, 100_000, 300_000, 2_100_000), episodes=24,
)  # fmt: skip

# FLASH: what only a program does, a write to the array, is `chip.parts.flash.program`.


def _flash_begin(w: RegisterWalker) -> None:
    if w.number(4):
        w.write("FLASH.KEYR", 0x4567_0123)
        w.write("FLASH.KEYR", w.pick((0xCDEF_89AB,) * 7 + (0,)))
    if w.number(2):
        w.write("FLASH.OPTKEYR", 0x4567_0123)
        w.write("FLASH.OPTKEYR", w.pick((0xCDEF_89AB,) * 7 + (0,)))


def _flash_move(w: RegisterWalker) -> None:
    register, words = w.pick((
        ("CR", (0, 1, 0x81, 2, 0x42, 4, 0x10, 0x210, 0x260, 0x220, 0x1401, 0x1600, 0x80)),
        ("AR", (0x0800_0400, 0x0800_0C00, 0x0800_1400)),
        ("SR", (0x34, 4, 0x20)), ("ACR", (0x10, 0x12, 0x38)), ("CR", (0x42, 0x1442, 0x210, 1)),
        ("KEYR", (0x4567_0123, 0xCDEF_89AB)), ("OPTKEYR", (0x4567_0123, 0xCDEF_89AB)),
    ))  # fmt: skip
    w.write(f"FLASH.{register}", w.pick(words))


def _flash_program(w: RegisterWalker) -> None:
    flash = w.part("FLASH")
    offset, size, word = w.pick((0x800, 0x1800)) + 2 * w.number(4), w.pick((2, 2, 2, 2, 1, 4)), w.number(0x10000)
    call = w.pick((flash.program, flash.program, flash.program_option))
    if call == flash.program_option:
        offset, word = 2 * w.number(8), w.pick((word, 0xA5))
    if w.number(2):
        w.write("FLASH.CR", (w.look("FLASH.CR") & 0x200) | w.pick((1, 0x10, 0x1410)))
    w.note(f"{call.__name__} {offset:#x} {size} {word:#x}: {call(offset, size, word)}")


def _flash_open(w: RegisterWalker) -> None:
    w.reset()
    for register in ("KEYR", "OPTKEYR"):
        w.write(f"FLASH.{register}", 0x4567_0123)
        w.write(f"FLASH.{register}", 0xCDEF_89AB)


def _flash_halfwords(w: RegisterWalker) -> None:
    """Program what is blank and what is not, as soon as it is ready or sooner."""
    flash = w.part("FLASH")
    _flash_open(w)
    w.write("FLASH.CR", w.pick((1, 0x401, 0x1401)))
    for _ in range(4):
        offset, word = w.pick((0x800, 0xFFE, 0x1000, 0x1802)) + 2 * w.number(2), w.pick((0, 0xFFFF, 0x1234))
        call = w.pick((flash.program, flash.program, flash.program_at_once))
        answer = call(offset) if call == flash.program_at_once else call(offset, w.pick((2, 2, 2, 2, 2, 1, 4)), word)
        w.note(f"{offset:#x} {word:#x}: {answer} {flash.memory.read(offset, 2).hex()}")
        w.run(w.pick((52_500, 52_500, 52_499, 20_000)))
    w.write("FLASH.SR", 0x34)


def _flash_all(w: RegisterWalker) -> None:
    """Erase all, or the option bytes, and write such."""
    flash = w.part("FLASH")
    _flash_open(w)
    for control in w.pick(((4, 0x44), (0x20, 0x260), (0x200, 0x240), (6, 0x46))):
        w.write("FLASH.CR", control)
        w.run(1_000)
    w.run(w.pick((40_000_000, 19_999_000, 39_999_000)))
    if w.number(2):
        w.write("FLASH.CR", 0x210)
        for offset in (2 * w.number(8), 2):
            w.note(f"{flash.program_option(offset, w.pick((2, 2, 2, 4)), w.pick((0xFE, 0xFF, 0xA5, 0xF9)))}")
            w.run(w.pick((52_500, 52_499)))
    w.note(f"{zlib.crc32(flash.memory.read(0, flash.memory.size)):08x} {flash.memory.options.hex()}")


def _flash_unprotect(w: RegisterWalker) -> None:
    """Take the protection against reading back, which erases all."""
    flash = w.part("FLASH")
    _flash_open(w)
    w.write("FLASH.CR", 0x260)
    w.run(20_000_000)
    _flash_open(w)
    w.write("FLASH.CR", 0x210)
    w.note(f"{flash.program_option(w.pick((0, 0, 0, 2)), 2, w.pick((0xA5, 0xA5, 0xA5, 0xA4)))}")
    w.run(w.pick((52_500, 20_052_499, 40_052_499, 40_052_500)))
    w.note(f"{zlib.crc32(flash.memory.read(0, flash.memory.size)):08x} {flash.memory.options.hex()}")


def _flash_protect(w: RegisterWalker) -> None:
    """Erase the option bytes, or write a group's, and have a reset load them."""
    flash = w.part("FLASH")
    w.write("FLASH.CR", 0x260)
    w.run(20_000_000)
    if w.number(2):
        w.write("FLASH.CR", 0x210)
        for offset, word in ((0, w.pick((0xA5, 0xA5, 0x11))), (8, w.pick((0xFE, 0xFC, 0xFD))), (2, w.number(8))):
            w.note(f"{flash.program_option(offset, 2, word)}")
            w.run(52_500)
    w.reset()
    w.write("FLASH.KEYR", 0x4567_0123)
    w.write("FLASH.KEYR", 0xCDEF_89AB)
    w.write("FLASH.CR", 2)
    w.write("FLASH.AR", w.pick((0x0800_0400, 0x0800_1400)))
    w.write("FLASH.CR", 0x42)


_FLASH = RegisterWalk(
    name="FLASH", parts=("FLASH",), begin=_flash_begin,
    moves=(*(_flash_move, _flash_program) * 3, _flash_move, _flash_protect, _flash_halfwords, _flash_halfwords,
           _flash_all, _flash_unprotect),
    spans_ns=(125, 20_000, 52_500, 70_000, 20_000_000, 40_000_000), at_random=12, episodes=26,
)  # fmt: skip

# The backup domain and the supply.


def _backup_begin(w: RegisterWalker) -> None:
    w.write("PWR.CR", 0x100 | w.pick((0, 0x10, 0x70, 0xF0)))
    w.write("RCC.CSR", 1)
    w.write("RCC.BDCR", w.pick((0x8101, 0x8201, 0x8300, 0x8101)))
    w.turn("RCC.CR", on=1 << 16)
    w.run(w.pick((3_000_000, 1_200_000_000)))
    w.write("RTC.CRL", 0x10)
    w.write("RTC.PRLL", w.pick((0, 1, 7, 0x7F)))
    w.write("RTC.ALRL", w.pick((2, 5)))
    w.write("RTC.ALRH", 0)
    w.write("RTC.CNTL", w.pick((0, 4, 0xFFFE)))
    w.write("RTC.CNTH", w.pick((0, 0xFFFF)))
    w.write("RTC.CRL", 0)
    w.write("RTC.CRH", w.some(1, 2, 4))
    w.write("EXTI.IMR", w.some(1 << 16, 1 << 17))
    w.write("EXTI.RTSR", 3 << 16)
    w.write("EXTI.FTSR", w.some(1 << 16, 1 << 17))


def _rtc_move(w: RegisterWalker) -> None:
    register, words = w.pick((
        ("CRL", (0x10, 0, 0x1F, 0x07, 0x08)), ("CRH", (0, 1, 2, 7)), ("PRLL", (0, 3, 50)), ("CNTL", (0, 0xFFFF)),
        ("ALRL", (0, 1, 3)), ("ALRH", (0, 0xFFFF)), ("PRLH", (0, 1)), ("CNTH", (0, 1)),
    ))  # fmt: skip
    if register not in {"CRL", "CRH"} and w.number(4):
        w.turn("RTC.CRL", on=0x10)
        w.write(f"RTC.{register}", w.pick(words))
        w.turn("RTC.CRL", off=0x10)
    else:
        w.write(f"RTC.{register}", w.pick(words))


def _rtc_read(w: RegisterWalker) -> None:
    for register in ("CNTH", "CNTL", "DIVL", "CRL"):
        w.read(f"RTC.{register}")
    w.note(f"alarm {w.part('RTC').has_alarm}")


def _rtc_cut(w: RegisterWalker) -> None:
    """A reset while it is configured."""
    w.turn("RTC.CRL", on=0x10)
    w.write("RTC.ALRL", 9)
    w.write("RTC.PRLL", 3)
    w.part("RTC").reset()
    w.note("reset")
    w.turn("RTC.CRL", on=0x10)
    w.turn("RTC.CRL", off=0x10)


def _rtc_alarm(w: RegisterWalker) -> None:
    """Seconds of a few periods of its clock up to an alarm, shown at PC13 or not."""
    w.turn("RCC.APB1ENR", on=0x1800_0000)
    w.write("PWR.CR", 0x100)
    w.write("RCC.CSR", 1)
    if w.look("RCC.BDCR") & 0x8300 != 0x8200:
        w.write("RCC.BDCR", 1 << 16)
        w.write("RCC.BDCR", 0x8200)
        w.run(100_000)
    w.write("BKP.RTCCR", w.pick((0, 0x100, 0x300, 0x80)))
    w.turn("RTC.CRL", on=0x10)
    high, low = w.pick((0, 0, 0xFFFF)), w.pick((0, 7, 0xFFFE))
    for register, word in (("CNTH", high), ("CNTL", low), ("ALRH", high), ("ALRL", low + 1), ("PRLL", w.number(4))):
        w.write(f"RTC.{register}", word)
    w.turn("RTC.CRL", off=0x10)
    for span_ns in (200_000, 24_999, 75_000, 100_000):
        w.run(span_ns)
    w.read("RTC.CRL")


def _bkp_move(w: RegisterWalker) -> None:
    register, words = w.pick((
        ("DR1", (0x1234,)), ("DR10", (0xABCD, 0)), ("RTCCR", (0, 0x80, 0x100, 0x300, 0x85)), ("CR", (0, 1, 2, 3)),
        ("CSR", (0, 1, 2, 3, 4, 7)),
    ))  # fmt: skip
    w.write(f"BKP.{register}", w.pick(words))
    if not w.number(3):
        w.drive("PC13", w.pick((False, True, None)))


def _pwr_move(w: RegisterWalker) -> None:
    w.write(
        "PWR.CR",
        0x100 & ~w.some(0x100) | w.pick((0, 1, 2, 4, 8, 0x10, 0x12, 0x70, 0xF0, 0xB0)) | 0x100 * bool(w.number(5)),
    )
    w.write("PWR.CSR", w.pick((0, 0x100)))
    if w.number(2):
        w.board.supply_v = w.pick((3.3, 2.2, 2.5, 2.65, 2.9, 3.0))
        w.note(f"{w.board.supply_v} V")
    w.drive("PA0", w.pick((False, True)))
    part = w.part("PWR")
    w.note(f"{part.stands_by} {part.is_woken} {part.regulator_is_slow}")
    if not w.number(4):
        w.pick((part.note_standby, part.forget_flags))()


def _pwr_low(w: RegisterWalker) -> None:
    """The detector of a low supply sees one, and is reset then, or not."""
    w.write("PWR.CR", w.pick((0xF0, 0xF0, 0xE0)))
    w.board.supply_v = w.pick((2.5, 2.2))
    w.note(f"{w.board.supply_v} V")
    if w.number(3):
        w.reset()


def _backup_domain(name: str, *parts: str) -> RegisterWalk:
    moves = {
        "RTC": (_rtc_move, _rtc_move, _rtc_read, _rtc_move, _rtc_alarm, _rtc_cut),
        "BKP": (_bkp_move,),
        "PWR": (_pwr_move, _pwr_move, _pwr_low),
    }[name]
    return RegisterWalk(
        name=name, parts=(name, *parts), begin=_backup_begin,
        moves=(*moves, *moves, _rtc_move, _bkp_move, _rtc_alarm, _lsi),
        spans_ns=(125, 31_000, 62_000, 100_000, 1_000_000, 30_000_000), beside=("RCC", "EXTI"),
    )  # fmt: skip


# Watchdogs.


def _dog_begin(w: RegisterWalker) -> None:
    w.write("IWDG.KR", 0x5555)
    w.write("IWDG.PR", w.pick((0, 1, 3, 7)))
    w.write("IWDG.RLR", w.pick((0, 3, 40, 0xFFF)))
    w.write("WWDG.CFR", w.pick((0x7F, 0x5F, 0x250, 0x1FF, 0x3C5)))
    w.write("WWDG.CR", w.pick((0x7F, 0xFF, 0xE0, 0xC1)))
    w.write("IWDG.KR", w.pick((0xAAAA, 0xCCCC, 0xAAAA)))


def _dog_by_itself(w: RegisterWalker) -> None:
    """A reset after which the option bytes may have IWDG run, or one key more or less."""
    w.board.chip.power.starts_watchdog = bool(w.number(2))
    w.part("IWDG").reset()
    w.note(f"{w.part('IWDG').is_running}")
    for key in w.pick(((0x5555, 0xCCCC), (0xCCCC, 0xCCCC), (0x5555, 0xAAAA), (0x1_5555,))):
        w.write("IWDG.KR", key)
        w.write("IWDG.RLR", w.number(0x1000))
        w.write("IWDG.PR", w.number(8))
        w.read("IWDG.SR")


def _dog_stands(w: RegisterWalker) -> None:
    part, span_ns = w.part("IWDG"), w.pick((1_000, 512_000, 8_000_000))
    w.note(f"IWDG frozen {span_ns}")
    part.freeze()
    w.run(span_ns)
    part.thaw(span_ns)


def _dog_move(w: RegisterWalker) -> None:
    register, words = w.pick((
        ("IWDG.KR", (0x5555, 0xAAAA, 0xAAAA, 0xCCCC, 0)), ("IWDG.PR", (0, 2, 5)), ("IWDG.RLR", (1, 30, 0xFFF)),
        ("WWDG.CR", (0xFF, 0xFF, 0xD0, 0xC0, 0x7F)), ("WWDG.CFR", (0x7F, 0x260, 0x1C5)), ("WWDG.SR", (0, 1)),
        ("RCC.CFGR", (0, 0x400, 0x80)),
    ))  # fmt: skip
    w.write(register, w.pick(words))


_DOGS = RegisterWalk(
    name="watchdogs", parts=("WWDG", "IWDG"), begin=_dog_begin,
    moves=(*(_dog_move,) * 6, _dog_by_itself, _dog_stands, _lsi), at_random=12,
    spans_ns=(1_000, 100_000, 512_000, 3_000_000, 8_000_000, 40_000_000), beside=("RCC",),
)  # fmt: skip

# Ports.

#: Values of MAPR: each field for itself.
_REMAPS = (
    0, 1, 2, 4, 8, 0x20, 0x40, 0xC0, 0x300, 0xC00, 0x1000, 0x6000, 0x8000, 0x1E_0000, 0x0200_0000, 0x0400_0000,
)  # fmt: skip


def _port_begin(w: RegisterWalker) -> None:
    w.write("AFIO.MAPR", w.pick((2 << 24, 2 << 24, 0, 1 << 24, 4 << 24)))
    for port in "ABC":
        w.write(f"GPIO{port}.CRL", w.pick((0x4444_4444, 0x3333_3333, 0x8888_8888, 0x7777_7777, 0x1248_B730)))
        w.write(f"GPIO{port}.CRH", w.pick((0x4444_4444, 0x3333_3333, 0x8888_8888, 0x7777_7777, 0x1248_B730)))
    for n in range(1, 5):
        w.write(f"AFIO.EXTICR{n}", w.pick((0, 0x1111, 0x2222, 0x2101)))
    w.write("EXTI.IMR", w.number(1 << 19))
    w.write("EXTI.EMR", w.number(1 << 19))
    w.write("EXTI.RTSR", w.number(1 << 19))
    w.write("EXTI.FTSR", w.number(1 << 19))


def _port_pin(w: RegisterWalker) -> None:
    port = w.pick("AABBC")
    number = 13 + w.number(3) if port == "C" else w.number(13)
    w.drive(f"P{port}{number}", w.pick((False, True, False, True, None)))


def _port_write(w: RegisterWalker) -> None:
    port = w.pick("ABC")
    register = w.pick(("ODR", "BSRR", "BRR", "LCKR"))
    w.write(f"GPIO{port}.{register}", w.number(1 << 32) if register == "BSRR" else w.number(1 << 16))


def _port_driven(w: RegisterWalker) -> None:
    """An output, and then an alternate function's, which somebody outside drives too."""
    port, number = w.pick("AB"), 1 + w.number(7)
    w.drive(f"P{port}{number}", w.pick((False, True)))
    for mode in (0x3333_3333, 0xBBBB_BBBB):
        w.write(f"GPIO{port}.CRL", mode)
        for level in (0, 16, 0):
            w.write(f"GPIO{port}.BSRR", 1 << number + level)
    w.drive(f"P{port}{number}", None)


def _port_lock(w: RegisterWalker) -> None:
    name, pins = f"GPIO{w.pick('ABC')}.LCKR", w.number(1 << 16)
    wrong, cut = w.pick((0, 0, 0, 0, 1, 2, 3)), w.pick((0, 0, 0, 0, 2, 3))
    for n, key in enumerate((1 << 16, 0, 1 << 16), 1):
        if n == cut:
            w.part(name[:5]).reset()
        w.write(name, (key ^ (1 << 16 if n == wrong else 0)) | pins)
    w.read(name)
    w.read(name)


def _port_exti(w: RegisterWalker) -> None:
    register = w.pick(("SWIER", "PR", "IMR", "RTSR", "EMR"))
    w.write(f"EXTI.{register}", w.pick((0, 0x7FFFF, 1 << w.number(19))))


def _port_wait(w: RegisterWalker) -> None:
    """Inputs that nobody drives, and pins of another, after a while."""
    port = w.pick("AABC")
    for half in "LH":
        w.write(f"GPIO{port}.CR{half}", w.pick((0x4444_4444, 0x4444_4484, 0x1444_4444, 0x3333_3333)))
    w.read(f"GPIO{port}.IDR")
    w.run(w.pick((999_000, 1_000_000, 1_100_000)))


def _port_remap(w: RegisterWalker) -> None:
    w.write("AFIO.MAPR", w.pick(_REMAPS))
    w.write("AFIO.EVCR", w.pick((0, 0x80, 0x9F)))


def _ports(name: str, *parts: str) -> RegisterWalk:
    return RegisterWalk(
        name=name, parts=(name, *parts), begin=_port_begin,
        moves=(_port_pin, _port_pin, _port_write, _port_lock, _port_exti, _port_remap, _port_wait, _port_driven),
        spans_ns=(125, 1_000), at_random=30, episodes=22,
    )  # fmt: skip


# CRC.


def _crc_begin(w: RegisterWalker) -> None:
    w.write("CRC.CR", 1)


def _crc_move(w: RegisterWalker) -> None:
    w.write("CRC.DR", w.number(1 << 32))
    w.read("CRC.DR")


_CRC = RegisterWalk(
    name="CRC", parts=("CRC",), begin=_crc_begin, moves=(_crc_move,), spans_ns=(125,), episodes=6, steps=16
)

SYSTEM = (
    _RCC, _FLASH, _backup_domain("RTC", "PWR"), _backup_domain("BKP", "PWR"), _backup_domain("PWR", "BKP"), _DOGS,
    _ports("GPIOA", "GPIOB", "AFIO"), _ports("EXTI", "AFIO", "GPIOC"), _ports("AFIO", "GPIOA"), _CRC,
)  # fmt: skip
