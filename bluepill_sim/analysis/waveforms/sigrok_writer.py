"""The sigrok session file (.sr, version 2), which PulseView opens: levels sampled evenly.

A session is a ZIP file with `version`, `metadata` and the samples in
`logic-1-1`, `unitsize` bytes a sample, probe 1 in bit 0 of the first byte. A
sample shows the level of its own instant: an edge appears at the first sample
at or after it, and exact times stand in the VCD. A floating wire shows as 0.

Source: sigrok wiki, "File format:Sigrok/v2".
Invariant: the same edges give the same bytes.
"""

import zipfile
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from bluepill_sim.analysis.probe import Probe, signals_in_order
from simbase.files import writing
from simbase.timing import NS_PER_S, Nanos

#: Sample rates in Hz and as the file names them, the finest first.
RATE_NAMES = {20_000_000: "20 MHz", 1_000_000: "1 MHz", 100_000: "100 kHz", 10_000: "10 kHz"}
#: chosen: a few tens of megabytes before they are packed.
MAX_SAMPLES = 16_000_000
#: The oldest time stamp that ZIP knows; a fixed one keeps the bytes the same.
_ZIP_DATE = (1980, 1, 1, 0, 0, 0)
#: Samples written at a time.
_CHUNK = 1 << 20
#: Of deflate. chosen: 3 MB a second of a run take 4 ms in place of 12 at the usual level, and 13 kB in place of 3.
_LEVEL = 1


def write_sigrok(probe: Probe, path: Path) -> None:
    """Write the recording, sampled evenly at the finest rate that keeps it small.

    Raises:
        FileError: the file cannot be written.
    """
    names = signals_in_order(probe)
    start_ns, span_ns = probe.start_ns, probe.end_ns - probe.start_ns
    rate_hz = next((rate for rate in RATE_NAMES if span_ns * rate // NS_PER_S < MAX_SAMPLES), min(RATE_NAMES))
    by_name = probe.edges
    edges = sorted((at - start_ns, n, value) for n, name in enumerate(names) for at, value in by_name.get(name, ()))
    bits = sum((probe.initial[name] & 1) << n for n, name in enumerate(names))
    with writing(path):
        write_session(path, names, rate_hz, _samples(runs(edges, bits, span_ns, rate_hz), len(names)))


def write_session(path: Path, names: Sequence[str], rate_hz: int, samples: Iterable[bytes]) -> None:
    """Write a session.

    Args:
        path: the file.
        names: of the probes.
        rate_hz: one of `RATE_NAMES`.
        samples: one after the other, each of as many whole bytes as the probes need, the first probe as bit 0.

    Raises:
        OSError: the file cannot be written.
    """
    unit = max(1, (len(names) + 7) // 8)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(_entry("version"), "2")
        archive.writestr(_entry("metadata"), _metadata(names, RATE_NAMES[rate_hz], unit))
        with archive.open(_entry("logic-1-1"), "w") as file:
            for part in samples:
                file.write(part)


def _samples(stretches: Iterable[tuple[int, int]], probes: int) -> Iterator[bytes]:
    """Yield the samples of stretches: (levels as bits, number of samples)."""
    for bits, count in stretches:
        sample = bits.to_bytes(max(1, (probes + 7) // 8), "little")
        for start in range(0, count, _CHUNK):
            yield sample * min(_CHUNK, count - start)


def sample_at(ns: Nanos, rate_hz: int) -> int:
    """Return the number of the first sample at or after a time."""
    return -(-ns * rate_hz // NS_PER_S)


def runs(edges: Iterable[tuple[Nanos, int, int]], bits: int, end_ns: Nanos, rate_hz: int) -> Iterator[tuple[int, int]]:
    """Return (levels as bits, number of samples) for each stretch without a change.

    Args:
        edges: (time from the start, number of the probe, level), by time; the level's bit 0 counts.
        bits: the levels at the start.
        end_ns: the time of the last sample.
        rate_hz: samples a second.
    """
    begin = 0
    for at, number, level in edges:
        sample = sample_at(at, rate_hz)
        if sample > begin:
            yield bits, sample - begin
            begin = sample
        bits = bits | 1 << number if level & 1 else bits & ~(1 << number)
    yield bits, max(sample_at(end_ns, rate_hz) + 1 - begin, 1)


def _entry(name: str) -> zipfile.ZipInfo:
    entry = zipfile.ZipInfo(name, _ZIP_DATE)
    entry.compress_type = zipfile.ZIP_DEFLATED
    entry._compresslevel = _LEVEL  # type: ignore[attr-defined]  # noqa: SLF001 - public from Python 3.13 on
    return entry


def _metadata(names: Sequence[str], rate: str, unit: int) -> str:
    lines = [
        "[global]", "sigrok version=0.5.2", "", "[device 1]", "capturefile=logic-1",
        f"total probes={len(names)}", f"samplerate={rate}", "total analog=0",
    ]  # fmt: skip
    lines += [f"probe{number}={name}" for number, name in enumerate(names, start=1)]
    return "\n".join([*lines, f"unitsize={unit}", ""])
