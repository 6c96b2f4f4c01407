"""Writes what a probe has recorded as a value change dump, which GTKWave and sigrok open.

Source: IEEE 1364-2005, chapter 18 (four-state VCD).
Invariant: the same recording gives the same bytes; times are in nanoseconds.
"""

from collections.abc import Iterator
from pathlib import Path

from bluepill_sim.errors import BluePillError
from bluepill_sim.sight.probe import Probe, signals_in_order

_FIRST_CODE, _LAST_CODE = 33, 126
_LETTERS = "01z"
_WORD_BITS = 9


def write_vcd(probe: Probe, path: Path) -> None:
    """Write the recording.

    Raises:
        BluePillError: the file cannot be written.
    """
    try:
        path.write_text("\n".join(vcd_lines(probe)) + "\n", encoding="ascii")
    except OSError as error:
        raise BluePillError(f"cannot write {path}: {error.strerror}", hint="give a file in a folder") from error


def vcd_lines(probe: Probe) -> Iterator[str]:
    """Return the lines of the dump."""
    signals, words = signals_in_order(probe), sorted(probe.words)
    codes = {name: _code(index) for index, name in enumerate([*signals, *words])}
    yield "$version p2os bluepill_sim $end"
    yield "$timescale 1 ns $end"
    yield "$scope module bluepill $end"
    for name in signals:
        yield f"$var wire 1 {codes[name]} {name} $end"
    for name in words:
        yield f"$var reg {_WORD_BITS} {codes[name]} {name} $end"
    yield "$upscope $end"
    yield "$enddefinitions $end"
    yield f"#{probe.start_ns}"
    yield "$dumpvars"
    for name in signals:
        yield f"{_LETTERS[probe.initial[name]]}{codes[name]}"
    for name in words:
        yield f"bx {codes[name]}"
    yield "$end"
    yield from _changes(probe, signals, words, codes)


def _changes(probe: Probe, signals: list[str], words: list[str], codes: dict[str, str]) -> Iterator[str]:
    changes = [
        (at, order, f"{_LETTERS[value]}{codes[name]}")
        for order, name in enumerate(signals)
        for at, value in probe.edges.get(name, ())
    ]
    changes += [
        (at, len(signals) + order, f"b{word:b} {codes[name]}")
        for order, name in enumerate(words)
        for at, word in probe.words[name]
    ]
    now = probe.start_ns
    for at, _order, line in sorted(changes, key=lambda change: change[:2]):
        if at > now:
            now = at
            yield f"#{at}"
        yield line
    if probe.end_ns > now:
        yield f"#{probe.end_ns}"


def _code(index: int) -> str:
    """Return the identifier code of a variable: printable ASCII, shortest first."""
    base = _LAST_CODE - _FIRST_CODE + 1
    code = chr(_FIRST_CODE + index % base)
    return code if index < base else _code(index // base - 1) + code
