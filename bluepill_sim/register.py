"""A hardware register as a declaration: which bits store, which clear, which call code.

This is not a register's behaviour beyond its bits: what a write *causes* is a
method of the peripheral, named here by `on_read` and `on_write`. The table
that a peripheral makes of these declarations is executed by `peripheral.py`
(and may be executed by any other executor: nothing here is Python-specific).

Source: RM0008 section 2.1 (list of abbreviations for registers).
Invariant: a stored word never holds a bit outside `readable`, so that the
store of a register without `on_read` *is* what a read returns.
"""

from dataclasses import dataclass

#: Every bit of a 32-bit register.
WORD = 0xFFFF_FFFF


@dataclass(frozen=True, slots=True, kw_only=True)
class Register:
    """One register of a peripheral, as the reference manual tabulates it."""

    #: The manual's name without the peripheral's, such as "CRL".
    name: str
    #: Byte offset from the peripheral's base, a multiple of 4.
    offset: int
    #: Value after reset, as it reads.
    reset: int = 0
    #: Bits that read as stored; all others read 0.
    readable: int = WORD
    #: Bits that take the value written (r/w). Bits that are writable but not readable are seen by `on_write` only.
    writable: int = WORD
    #: Bits cleared by writing 1 and left alone by 0 (rc_w1).
    write_one_to_clear: int = 0
    #: Bits cleared by writing 0 and left alone by 1 (rc_w0).
    write_zero_to_clear: int = 0
    #: Name of the peripheral's method `() -> int` that answers a read in place of the stored word.
    on_read: str | None = None
    #: Offset of a hidden word, after the registers, in which each read leaves what it returned; None for none.
    latched_in: int | None = None
    #: Name of the peripheral's method `(written: int, previous: int) -> None`, called after the store.
    on_write: str | None = None
    #: One line for people.
    doc: str = ""

    def __post_init__(self) -> None:
        """Refuse a declaration that contradicts itself.

        Raises:
            ValueError: A mask is wider than a word, two kinds of bits overlap,
                or the reset value holds bits that do not read.
        """
        if self.offset % 4:
            raise ValueError(f"{self.name}: offset {self.offset:#x} is not that of a word")
        for mask in (self.reset, self.readable, self.writable, self.write_one_to_clear, self.write_zero_to_clear):
            if mask & ~WORD:
                raise ValueError(f"{self.name}: {mask:#x} is wider than a word")
        clears = self.write_one_to_clear | self.write_zero_to_clear
        if self.write_one_to_clear & self.write_zero_to_clear or clears & self.writable:
            raise ValueError(f"{self.name}: a bit is either writable, cleared by 1 or cleared by 0")
        if self.reset & ~self.readable:
            raise ValueError(f"{self.name}: the reset value holds bits that do not read")

    @property
    def is_plain_read(self) -> bool:
        """Whether a read returns the stored word and causes nothing."""
        return self.on_read is None

    def widen(self, previous: int, value: int, lanes: int) -> int:
        """Return the whole-word write that does what a write of some byte lanes does.

        Args:
            previous: The stored word.
            value: The data, already shifted to its lanes.
            lanes: 0xFF for each byte lane written, 0 for the others.
        """
        untouched = (previous & self.writable) | self.write_zero_to_clear
        return (value & lanes) | (untouched & ~lanes)

    def stored_after(self, previous: int, written: int) -> int:
        """Return the word stored after `written` (a whole word) meets `previous`."""
        kept = previous & ~self.writable & ~(written & self.write_one_to_clear)
        kept &= written | ~self.write_zero_to_clear
        return (kept | (written & self.writable)) & self.readable


def bits(*positions: int | tuple[int, int]) -> int:
    """Return a mask of bit positions and of (high, low) fields, as the manual prints them.

    >>> hex(bits(0, (7, 4)))
    '0xf1'
    """
    mask = 0
    for position in positions:
        high, low = position if isinstance(position, tuple) else (position, position)
        mask |= ((1 << (high - low + 1)) - 1) << low
    return mask
