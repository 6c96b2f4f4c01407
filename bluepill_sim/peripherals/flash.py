"""FLASH: access control, and the program/erase controller.

Modelled: wait states and prefetch (the CPU's block costs read them from
`chip.clocks`), the two keys, halfword programming, page and mass erase with
typical times, the error flags; option bytes: their keys, erasing, programming
(the controller makes the complement), what a reset loads of them; protection of
groups of four pages (WRP), of the first four by RDP, and the mass erase that
takes RDP away. That the core waits meanwhile is `chip.py`'s. Chosen: erasing
the option bytes takes as long as a page. Not modelled: the half-cycle access,
and that RDP keeps a debugger and code in SRAM from reading the flash.

Source: RM0008 section 3.3.3, PM0075 sections 2 and 3; times from DS5319 table 28.
Invariant: the memory changes only while CR is unlocked and PG, PER or MER says so.
"""

from enum import IntEnum
from typing import Protocol

from bluepill_sim.fabric.ports import ChipPorts
from bluepill_sim.fabric.registers import (
    NATIVE,
    OWN_ANSWERS,
    Peripheral,
    PeripheralMapping,
    Register,
    bits,
    indices,
    masks,
)

KEY1, KEY2 = 0x4567_0123, 0xCDEF_89AB
#: Fields, from the left.
_SR = "EOP 5, WRPRTERR 4, PGERR 2, BSY 0"
_CR = "EOPIE 12, ERRIE 10, OPTWRE 9, LOCK 7, STRT 6, OPTER 5, OPTPG 4, MER 2, PER 1, PG 0"
_OBR = "Data1 25:18, Data0 17:10, UNUSED 9:5, nRST_STDBY 4, nRST_STOP 3, WDG_SW 2, RDPRT 1, OPTERR 0"
PG, PER, MER, OPTPG, OPTER, STRT, LOCK, OPTWRE, ERRIE, EOPIE = masks(
    _CR, "PG PER MER OPTPG OPTER STRT LOCK OPTWRE ERRIE EOPIE"
)
BSY, PGERR, WRPRTERR, EOP = masks(_SR, "BSY PGERR WRPRTERR EOP")

#: Bytes of a page of a medium-density part (PM0075 table 2).
PAGE_BYTES = 1024
#: Halfword programming, page erase, mass erase (DS5319 table 28, typical; erase: the lower bound given).
PROGRAM_NS, PAGE_ERASE_NS, MASS_ERASE_NS = 52_500, 20_000_000, 20_000_000
#: Where the flash appears besides its alias at 0.
FLASH_BASE = 0x0800_0000

#: Option bytes: each a halfword, the complement above the byte (PM0075 2.2).
RDP, USER, DATA0, DATA1, WRP0 = range(5)
OPTION_BYTES = 16
#: As delivered: readable, nothing chosen, no page protected.
DELIVERED = b"\xa5\x5a" + b"\xff\x00" * 7
UNPROTECTED = 0xA5
#: USER: 0 starts IWDG with the chip, resets where Stop or Standby begins.
WDG_SW, N_RST_STOP, N_RST_STDBY = 1, 2, 4
#: OBR.
OPTERR, RDPRT = masks(_OBR, "OPTERR RDPRT")
_USER_AT, _DATA0_AT, _DATA1_AT = 2, 10, 18
#: One bit of WRPR protects so much; RDP protects the first one.
GROUP_BYTES = 4 * PAGE_BYTES
_ERASED, _HALFWORD = 0xFF, 0xFFFF


class FlashQuestion(IntEnum):
    """What Python is told beside what a listener hears."""

    #: A write, with the word before it.
    WRITTEN = OWN_ANSWERS
    #: Wait states or prefetch are others now.
    ACCESS = OWN_ANSWERS + 1
    #: A LATENCY that there is not.
    RESERVED = OWN_ANSWERS + 2


class FlashMemory(Protocol):
    """The flash array, as its controller needs it; offsets are from its start."""

    @property
    def size(self) -> int:
        """Size of the array in bytes."""

    def read(self, offset: int, size: int) -> bytes:
        """Return `size` bytes."""

    def write(self, offset: int, data: bytes) -> None:
        """Replace bytes, and drop whatever was translated from them."""

    @property
    def options(self) -> bytes:
        """The option bytes, with their complements."""

    def write_options(self, options: bytes) -> None:
        """Replace the option bytes."""


class Flash(Peripheral):
    """Flash memory interface."""

    KIND = "flash"
    HAS_BYTE_LANES = True
    STATE = ("_key_step", "_option_key_step", "_address")
    OUTPUTS = ("irq",)
    ENUMS = (FlashQuestion,)
    SOURCE = "PM0075 3"
    REGISTERS = (
        Register(
            name="ACR",
            offset=0x00,
            reset=bits(5, 4),
            readable=bits((5, 0)),
            writable=bits(4, 3, (2, 0)),
            on_write=NATIVE,
            fields="PRFTBS 5, PRFTBE 4, HLFCYA 3, LATENCY 2:0",
        ),
        Register(name="KEYR", offset=0x04, readable=0, on_write="_write_keyr"),
        Register(name="OPTKEYR", offset=0x08, readable=0, on_write="_write_optkeyr"),
        Register(
            name="SR",
            offset=0x0C,
            readable=BSY | PGERR | WRPRTERR | EOP,
            writable=0,
            write_one_to_clear=PGERR | WRPRTERR | EOP,
            on_write=NATIVE,
            fields=_SR,
        ),
        Register(
            name="CR",
            offset=0x10,
            reset=LOCK,
            on_write=NATIVE,
            fields=_CR,
        ),
        Register(name="AR", offset=0x14, readable=0, on_write="_write_ar"),
        Register(
            name="OBR",
            offset=0x1C,
            reset=0x03FF_FFFC,
            readable=bits((25, 0)),
            writable=0,
            doc="option bytes as the last reset found them",
            fields=_OBR,
        ),
        Register(
            name="WRPR",
            offset=0x20,
            reset=0xFFFF_FFFF,
            writable=0,
            doc="likewise: 0 protects four pages",
            fields="WRP 31:0",
        ),
    )

    def __init__(self, chip: ChipPorts, place: PeripheralMapping) -> None:
        super().__init__(chip, place)
        #: The array; the board sets it. None: programming is warned of and does nothing.
        self.memory: FlashMemory | None = None
        #: Keys of the unlock sequence seen; -1: a wrong one, locked until reset.
        self._key_step = self._option_key_step = 0
        self._address = 0

    @property
    def is_busy(self) -> bool:
        """Whether it is being programmed or erased."""
        return bool(self.words[SR] & BSY)

    def program(self, offset: int, size: int, value: int) -> bool:
        """Take a write by the CPU to the flash array itself; False: the bus answers with an error.

        Args:
            offset: Byte offset from the start of the array.
            size: 1, 2 or 4 bytes; only halfwords can be programmed: the rest is a bus error (PM0075 2.3.3).
            value: The data.
        """
        if size != 2 and self.words[CR] & PG and not self.words[CR] & LOCK:
            return self._refuse_width(size)
        self._program(offset, value)
        return True

    def program_at_once(self, offset: int) -> bool:
        """Program a halfword up to its end, of which EOP alone is seen; False: it is not so simple, nothing was done.

        The CPU itself stores the value, and nothing else acts meanwhile.
        """
        control = self.words[CR]
        is_ready = self.memory is not None and control & (PG | LOCK | EOPIE) == PG and not self.is_busy
        if not is_ready or self.memory is None or self._is_protected(offset):
            return False
        if self.memory.read(offset, 2) != b"\xff\xff":
            return False
        self.words[SR] |= EOP
        return True

    def _refuse_width(self, size: int) -> bool:
        self.chip.warn(f"flash programmed by {8 * size} bits: only halfwords can be, a bus error", once="FLASH:width")
        return False

    def _program(self, offset: int, value: int) -> None:
        if not self.words[CR] & PG or self.words[CR] & LOCK:
            self.chip.warn("write to flash without FLASH_CR PG: ignored", once="FLASH:write")
            return
        if self.is_busy:
            self._finish(PGERR)
            return
        memory = self._array()
        if memory is None:
            return
        if self._is_protected(offset):
            self._finish(WRPRTERR)
            return
        if memory.read(offset, 2) != b"\xff\xff" and value:
            self._finish(PGERR)
            return
        memory.write(offset, value.to_bytes(2, "little"))
        self._begin(PROGRAM_NS)

    def program_option(self, offset: int, size: int, value: int) -> bool:
        """Take a write by the CPU to the option bytes; False: the bus answers with an error.

        Args:
            offset: Byte offset from the first of them.
            size: 1, 2 or 4 bytes; only halfwords can be programmed.
            value: The data; the controller makes the complement of its lower byte.
        """
        control = self.words[CR]
        if not control & OPTPG or not control & OPTWRE or control & LOCK:
            self.chip.warn("write to the option bytes without FLASH_CR OPTPG and OPTWRE: ignored", once="FLASH:options")
            return True
        if size != 2:
            return self._refuse_width(size)
        memory = self._array()
        if memory is None:
            return True
        options, byte = memory.options, value & 0xFF
        if self.is_busy or options[offset : offset + 2] != b"\xff\xff":
            self._finish(PGERR)
            return True
        took_ns = PROGRAM_NS
        if offset == 2 * RDP and byte == UNPROTECTED and self.words[OBR] & RDPRT:
            memory.write(0, b"\xff" * memory.size)
            took_ns += MASS_ERASE_NS
        memory.write_options(options[:offset] + bytes((byte, byte ^ 0xFF)) + options[offset + 2 :])
        self._begin(took_ns)
        return True

    def advance_to(self, now_ns: int) -> None:
        """End the operation that is due."""
        if self.due_ns is not None and self.due_ns <= now_ns:
            self.due_ns = None
            self.words[SR] &= ~BSY
            self.words[CR] &= ~STRT
            self._finish(EOP)

    def on_reset(self) -> None:
        """Lock the controller; load the option bytes."""
        self._key_step = self._option_key_step = 0
        self._address = 0
        self._load_options()
        self.set_output("irq", False)

    def _write_keyr(self, written: int, _previous: int) -> None:
        if self._key_step < 0 or not self.words[CR] & LOCK:
            return
        if written != (KEY1, KEY2)[self._key_step]:
            self._key_step = -1
            self.chip.warn("FLASH_KEYR: wrong key, locked until reset", once="FLASH:key")
        elif self._key_step == 1:
            self._key_step = 0
            self.words[CR] &= ~LOCK
        else:
            self._key_step = 1

    def _write_optkeyr(self, written: int, _previous: int) -> None:
        if self.words[CR] & (LOCK | OPTWRE):
            return
        if written != (KEY1, KEY2)[self._option_key_step]:
            self._option_key_step = 0
            self.chip.warn("FLASH_OPTKEYR: wrong key", once="FLASH:option-key")
        elif self._option_key_step:
            self._option_key_step = 0
            self.words[CR] |= OPTWRE
        else:
            self._option_key_step = 1

    def answer(self, what: int, value: int) -> None:
        """Take what the device in C hears: a write after which something is to be done."""
        if what == FlashQuestion.ACCESS:
            self.chip.clock_changed()
            return
        if what == FlashQuestion.RESERVED:
            self.chip.warn(f"FLASH_ACR: LATENCY = {value} is reserved", once="FLASH:latency")
            return
        index, previous = value >> 16, value & _HALFWORD
        if index == CR:
            self._write_cr(self.words[CR], previous)
        else:
            self._update_irq()

    def _write_cr(self, written: int, previous: int) -> None:
        if previous & LOCK or self.is_busy:
            self.words[CR] = previous
            if previous & LOCK and written & ~LOCK:
                self.chip.warn("FLASH_CR: written while locked: ignored", once="FLASH:locked")
            return
        # LOCK can be set by software, not cleared: `previous` was unlocked, so a 1 is new. OPTWRE is the opposite.
        self.words[CR] &= ~OPTWRE | previous
        if written & STRT:
            self._erase(written)
        self._update_irq()

    def _write_ar(self, written: int, _previous: int) -> None:
        self._address = written

    def _erase(self, control: int) -> None:
        memory = self._array()
        erases_options = control & OPTER and self.words[CR] & OPTWRE
        if memory is None or not (control & (MER | PER) or erases_options):
            self.words[CR] &= ~STRT
            return
        if erases_options:
            memory.write_options(bytes((_ERASED,)) * OPTION_BYTES)
            self._begin(PAGE_ERASE_NS)
            return
        if control & MER:
            if any(self._is_protected(at) for at in range(0, memory.size, GROUP_BYTES)):
                self.words[CR] &= ~STRT
                self._finish(WRPRTERR)
                return
            memory.write(0, b"\xff" * memory.size)
            self._begin(MASS_ERASE_NS)
            return
        page = (self._address - FLASH_BASE) // PAGE_BYTES * PAGE_BYTES
        if not 0 <= page < memory.size or self._is_protected(page):
            self.words[CR] &= ~STRT
            self._finish(WRPRTERR)
            return
        memory.write(page, b"\xff" * PAGE_BYTES)
        self._begin(PAGE_ERASE_NS)

    def _is_protected(self, offset: int) -> bool:
        """Tell whether the page at an offset must not be changed."""
        group = offset // GROUP_BYTES
        return not self.words[WRPR] >> group & 1 or bool(self.words[OBR] & RDPRT and not group)

    def _load_options(self) -> None:
        """Take over the option bytes; one that does not fit its complement counts as 0xFF (PM0075 2.2)."""
        options = DELIVERED if self.memory is None else self.memory.options
        values, obr = [], 0
        for at in range(0, OPTION_BYTES, 2):
            byte, complement = options[at], options[at + 1]
            if byte ^ complement != 0xFF:
                obr |= OPTERR if (byte, complement) != (_ERASED, _ERASED) else 0
                byte = _ERASED
            values.append(byte)
        obr |= RDPRT if values[RDP] != UNPROTECTED else 0
        obr |= values[USER] << _USER_AT | values[DATA0] << _DATA0_AT | values[DATA1] << _DATA1_AT
        self.words[OBR] = obr
        self.words[WRPR] = int.from_bytes(bytes(values[WRP0:]), "little")
        power = self.chip.power
        power.starts_watchdog = not values[USER] & WDG_SW
        power.resets_at_stop, power.resets_at_standby = not values[USER] & N_RST_STOP, not values[USER] & N_RST_STDBY

    def _array(self) -> FlashMemory | None:
        if self.memory is None:
            self.chip.warn("FLASH: programming and erasing are not modelled on this board", once="FLASH:memory")
        return self.memory

    def _begin(self, duration_ns: int) -> None:
        self.words[SR] |= BSY
        self.due_ns = self.chip.now_ns + duration_ns
        self.chip.flash_began()

    def _finish(self, flag: int) -> None:
        self.words[SR] |= flag
        self._update_irq()

    def _update_irq(self) -> None:
        status, control = self.words[SR], self.words[CR]
        done = status & EOP and control & EOPIE
        failed = status & (PGERR | WRPRTERR) and control & ERRIE
        self.set_output("irq", bool(done or failed))


ACR, SR, CR, OBR, WRPR = indices(Flash.REGISTERS, "ACR SR CR OBR WRPR")
