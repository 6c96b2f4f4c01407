"""Files that are often given as a firmware and are none: their kinds, told by their contents.

Not the check of a real firmware (`image.py`).
Invariant: no program for this chip is taken for one of these; their first word would be no stack pointer in the SRAM.
"""

_NOT_TEXT = frozenset(range(0x20)) - frozenset(b"\t\n\r\f") | {0x7F}
_BUILD = "build it with arm-none-eabi-gcc and give the ELF, HEX or BIN"
_UNPACK = "unpack it and give the ELF, HEX or BIN in it"
#: First bytes, what such a file is, and what to do.
_KINDS = (
    (b"!<arch>\n", "a library (ar archive)", "link a program with it"),
    (b"UF2\n", "a UF2 file, for boot loaders of other chips", "give the ELF, HEX or BIN that it was made from"),
    (b"\x1f\x8b", "a gzip file", _UNPACK),
    (b"PK\x03\x04", "a ZIP archive", _UNPACK),
    (b"BZh", "a bzip2 file", _UNPACK),
    (b"\xfd7zXZ", "an xz file", _UNPACK),
    (b"MZ", "a program for Windows", _BUILD),
    (b"DfuSe", "a DfuSe file", "dfu-util's files hold a BIN: give that one"),
    (b"\xcf\xfa\xed\xfe", "a program for macOS", _BUILD),
    (b"\x89PNG", "a picture", _BUILD),
    (b"%PDF", "a PDF document", _BUILD),
)


def wrong_kind(data: bytes) -> tuple[str, str] | None:
    """Return what a file is that is no firmware, and what to do; None where nothing speaks against it."""
    for magic, what, hint in _KINDS:
        if data.startswith(magic):
            return what, hint
    if not _is_text(data):
        return None
    if data[:1] == b"S" and data[1:2].isdigit() and all(c in b"0123456789ABCDEFabcdef\r\n" for c in data[2:16]):
        return "a Motorola S-record file", "arm-none-eabi-objcopy -I srec -O ihex makes a HEX file of it"
    return "a text file, no firmware", _BUILD


def _is_text(data: bytes) -> bool:
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        return False
    return not _NOT_TEXT.intersection(data)
