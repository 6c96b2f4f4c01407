"""Writes what a probe has recorded as a value change dump, which GTKWave and sigrok open.

Source: IEEE 1364-2005, chapter 18 (four-state VCD).
Invariant: the same recording gives the same bytes, whichever log holds it; times are in nanoseconds.
"""

import os
from collections.abc import Iterator
from pathlib import Path

from bluepill_sim.analysis.probe import Probe, signals_in_order, words_in_order
from simbase.files import writing

_FIRST_CODE, _LAST_CODE = 33, 126
_LETTERS = "01z"
_WORD_BITS = 9


def write_vcd(probe: Probe, path: Path) -> None:
    """Write the recording.

    Raises:
        FileError: the file cannot be written.
    """
    signals, words = signals_in_order(probe), words_in_order(probe)
    codes = {name: identifier(index) for index, name in enumerate([*signals, *words])}
    with writing(path):
        with path.open("w", encoding="ascii", newline="\n") as file:
            file.writelines(f"{line}\n" for line in _head(probe, codes, words))
        texts = [codes.get(name, "") for name in probe.names]
        probe.log.write(os.fsencode(path), texts, probe.first_word, (probe.start_ns, probe.end_ns))


def identifier(index: int) -> str:
    """Return the identifier code of a variable: printable ASCII, shortest first."""
    base = _LAST_CODE - _FIRST_CODE + 1
    code = chr(_FIRST_CODE + index % base)
    return code if index < base else identifier(index // base - 1) + code


def _head(probe: Probe, codes: dict[str, str], words: list[str]) -> Iterator[str]:
    yield "$version bluepill_sim $end"
    yield "$timescale 1 ns $end"
    yield "$scope module bluepill $end"
    for name, code in codes.items():
        yield f"$var reg {_WORD_BITS} {code} {name} $end" if name in words else f"$var wire 1 {code} {name} $end"
    yield "$upscope $end"
    yield "$enddefinitions $end"
    yield f"#{probe.start_ns}"
    yield "$dumpvars"
    for name, code in codes.items():
        yield f"bx {code}" if name in words else f"{_LETTERS[probe.initial[name]]}{code}"
    yield "$end"
