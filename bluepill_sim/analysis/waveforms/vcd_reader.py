"""Reads a value change dump: of ours, of sigrok, of a simulator.

Variables of one bit are signals; vectors and real numbers are passed over. Of a name that stands in several scopes
each has its scope before it.

Source: IEEE 1364-2005, chapter 18 (four-state VCD).
"""

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from bluepill_sim.analysis.waveforms.levels import UNKNOWN, CaptureError, Waveforms, signal_of
from bluepill_sim.analysis.waveforms.sample_rate import rate_in_words
from simbase.files import lines_of
from simbase.terminal import readable

_NS_PER = {"s": 1e9, "ms": 1e6, "us": 1e3, "ns": 1.0, "ps": 1e-3, "fs": 1e-6}
_SCALE = re.compile(r"(1|10|100)\s*(s|ms|us|ns|ps|fs)")
_LEVELS = {"0": 0, "1": 1, "x": UNKNOWN, "X": UNKNOWN, "z": UNKNOWN, "Z": UNKNOWN}
_SKIPPED = {"$dumpvars", "$dumpall", "$dumpon", "$dumpoff", "$end"}
_HINT = "a value change dump, as PulseView and sigrok-cli write it"


class _Dump:
    """What has been read of a dump so far."""

    def __init__(self) -> None:
        self.scale_ns = 1.0
        self.comment = ""
        self.scopes: list[str] = []
        #: (scope, name) of each code; of several names of a code the last.
        self.names: dict[str, tuple[str, str]] = {}
        self.changes: dict[str, list[tuple[float, int]]] = {}
        self.start: int | None = None
        self.now = 0


def read_vcd(path: Path) -> Waveforms:
    """Read a dump.

    Raises:
        CaptureError: It cannot be read, or is damaged; the message names the line.
    """
    dump = _Dump()
    words = _words(path)
    for number, word in words:
        try:
            _take(dump, word, words)
        except (ValueError, LookupError) as error:
            raise CaptureError(f"{path}:{number}: {readable(word[:40])!r} is no value change", hint=_HINT) from error
    if not dump.names:
        raise CaptureError(f"{path}: no signals of one bit", hint=_HINT)
    scale, end_ns = dump.scale_ns, dump.now * dump.scale_ns
    often = Counter(name for _, name in dump.names.values())
    signals = {
        f"{scope}.{name}" if often[name] > 1 else name: signal_of(dump.changes[code], end_ns)
        for code, (scope, name) in dump.names.items() if dump.changes[code]
    }  # fmt: skip
    rate_hz = rate_in_words(dump.comment)
    return Waveforms(
        name=path.name, signals=signals, start_ns=(dump.start or 0) * scale, end_ns=end_ns,
        sample_ns=1e9 / rate_hz if rate_hz else scale,
        rate_from="the file" if rate_hz else "",
    )  # fmt: skip


def _words(path: Path) -> Iterator[tuple[int, str]]:
    for number, line in enumerate(lines_of(path, CaptureError, hint=_HINT), start=1):
        if line.startswith("META "):  # sigrok-cli puts what it says of the session into the file
            continue
        for word in line.split():
            yield number, word


def _take(dump: _Dump, word: str, words: Iterator[tuple[int, str]]) -> None:
    """Take a word in, and what belongs to it."""
    kind = word[0]
    if kind == "#":
        at = int(word[1:])
        if at < dump.now and dump.start is not None:
            raise ValueError(word)
        dump.now = at
        dump.start = at if dump.start is None else dump.start
    elif kind in _LEVELS:
        dump.changes[word[1:]].append((dump.now * dump.scale_ns, _LEVELS[kind]))
    elif kind in "bBrRsS":
        next(words, None)
    elif kind != "$":
        raise ValueError(word)
    elif word not in _SKIPPED:
        _declare(dump, word, _until_end(word, words))


def _until_end(word: str, words: Iterator[tuple[int, str]]) -> list[str]:
    found: list[str] = []
    for _, each in words:
        if each == "$end":
            return found
        found.append(each)
    raise ValueError(word)


def _declare(dump: _Dump, word: str, said: list[str]) -> None:
    if word == "$timescale":
        scale = _SCALE.fullmatch(" ".join(said))
        if scale is None:
            raise ValueError(word)
        dump.scale_ns = int(scale[1]) * _NS_PER[scale[2]]
    elif word == "$scope":
        dump.scopes.append(said[-1])
    elif word == "$upscope":
        dump.scopes.pop()
    elif word == "$comment":
        dump.comment += " ".join(said) + "\n"
    elif word == "$var" and said[1] == "1" and said[0] != "real":
        dump.names[said[2]] = (".".join(dump.scopes), "".join(said[3:]))
        dump.changes.setdefault(said[2], [])
    elif word == "$var":
        dump.changes.setdefault(said[2], [])
