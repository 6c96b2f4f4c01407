"""Reads a sigrok session (.sr, versions 1 and 2), as PulseView and sigrok-cli write it and as `p2os` does.

A session is a ZIP file: `metadata` in the manner of an INI file, and the samples in `logic-1` or, in pieces,
`logic-1-1`, `logic-1-2` and so on, `unitsize` bytes a sample, the first probe in bit 0 of the first byte.

Source: sigrok wiki, "File format:Sigrok/v2".
Invariant: no more samples are held than one block.
"""

import configparser
import re
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path

from bluepill_sim.analysis.waveforms.levels import CaptureError, Signal, Waveforms
from bluepill_sim.analysis.waveforms.sample_rate import rate_of
from simbase.files import reading

#: Samples looked at in one go, in bytes.
_BLOCK = 1 << 20
#: chosen: as much as an analyser of 24 MHz gives in three minutes.
MOST_BYTES = 4 << 30
_MOST_METADATA = 1 << 20
_MOST_UNIT = 16
_CHANGED = re.compile(rb"[^\0]")
_PROBE = re.compile(r"probe[1-9]\d{0,2}")
_PIECE = re.compile(r"-(\d+)$")
_HINT = "a session with logic channels, as PulseView and sigrok-cli write it"


def read_sigrok(path: Path) -> Waveforms:
    """Read a session.

    Raises:
        CaptureError: It cannot be read, or is none.
    """
    with reading(path):
        try:
            with zipfile.ZipFile(path) as archive:
                return _read(archive, path)
        except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError) as error:
            raise CaptureError(f"{path}: a damaged sigrok session: {error}", hint=_HINT) from error


def _read(archive: zipfile.ZipFile, path: Path) -> Waveforms:
    names = archive.namelist()
    if "metadata" not in names:
        raise CaptureError(f"{path}: a ZIP file without metadata, no sigrok session", hint=_HINT)
    with archive.open("metadata") as file:
        text = file.read(_MOST_METADATA).decode("utf-8", "replace")
    metadata = configparser.ConfigParser(interpolation=None, strict=False, delimiters=("=",))
    try:
        metadata.read_string(text)
        device = metadata["device 1"]
        prefix, unit = device["capturefile"], int(device["unitsize"])
        rate_hz = rate_of(device["samplerate"])
    except (configparser.Error, KeyError, ValueError) as error:
        raise CaptureError(f"{path}: its metadata lack what a session has: {error}", hint=_HINT) from error
    probes = {
        int(key.removeprefix("probe")) - 1: name for key, name in device.items() if _PROBE.fullmatch(key)
    }  # fmt: skip
    pieces = sorted(
        (name for name in names if name == prefix or (name.startswith(f"{prefix}-") and _PIECE.search(name))),
        key=lambda name: int(found[1]) if (found := _PIECE.search(name.removeprefix(prefix))) else 0,
    )
    if not 0 < unit <= _MOST_UNIT or not probes or not pieces or max(probes) >= 8 * unit:
        raise CaptureError(f"{path}: no logic channels with samples", hint=_HINT)
    return _waveforms(_blocks(archive, pieces, unit, path), probes, (unit, 1e9 / rate_hz), path)


def _blocks(archive: zipfile.ZipFile, pieces: list[str], unit: int, path: Path) -> Iterator[bytes]:
    """Yield the samples in blocks of whole ones."""
    left, rest = MOST_BYTES, b""
    for piece in pieces:
        with archive.open(piece) as file:
            while part := file.read(_BLOCK):
                left -= len(part)
                if left < 0:
                    raise CaptureError(f"{path}: more than {MOST_BYTES >> 30} GiB of samples", hint="capture less")
                whole = (len(rest) + len(part)) // unit * unit
                block = rest + part
                rest = block[whole:]
                if whole:
                    yield block[:whole]


def _waveforms(blocks: Iterator[bytes], probes: dict[int, str], grid: tuple[int, float], path: Path) -> Waveforms:
    unit, sample_ns = grid
    wanted = sum(1 << probe for probe in probes)
    before: bytes | None = None
    first = count = 0
    edges: dict[int, list[tuple[float, int]]] = {probe: [] for probe in probes}
    for block in blocks:
        if before is None:
            before = block[:unit]
            first = int.from_bytes(before, "little")
        shifted = before + block[:-unit]
        differs = (int.from_bytes(block, "little") ^ int.from_bytes(shifted, "little")).to_bytes(len(block), "little")
        last = -1
        for found in _CHANGED.finditer(differs):
            sample = found.start() // unit
            if sample == last:
                continue
            last = sample
            here = slice(sample * unit, (sample + 1) * unit)
            changed, levels = int.from_bytes(differs[here], "little") & wanted, int.from_bytes(block[here], "little")
            while changed:
                probe = (changed & -changed).bit_length() - 1
                edges[probe].append(((count + sample) * sample_ns, levels >> probe & 1))
                changed &= changed - 1
        count += len(block) // unit
        before = block[-unit:]
    if not count:
        raise CaptureError(f"{path}: no samples", hint=_HINT)
    signals = {name: Signal(first=first >> probe & 1, edges=edges[probe]) for probe, name in sorted(probes.items())}
    return Waveforms(name=path.name, signals=signals, start_ns=0.0, end_ns=(count - 1) * sample_ns, sample_ns=sample_ns)
