"""Writes what a probe has recorded as a sigrok session (.sr, version 2), which PulseView opens.

A session is a ZIP file with `version`, `metadata` and the samples, `unitsize`
bytes a sample, probe 1 in bit 0 of the first byte. A sample shows the level of
its own instant: an edge appears at the first sample at or after it, and exact
times stand in the VCD. A floating wire shows as 0.

Source: sigrok wiki, "File format:Sigrok/v2".
Invariant: the same recording gives the same bytes.
"""

import zipfile
from collections.abc import Iterator
from pathlib import Path

from bluepill_sim.errors import BluePillError
from bluepill_sim.sight.probe import Probe, signals_in_order
from bluepill_sim.timing import NS_PER_S

#: Sample rates to choose from, Hz, the finest first.
RATES = ((20_000_000, "20 MHz"), (1_000_000, "1 MHz"), (100_000, "100 kHz"), (10_000, "10 kHz"))
#: chosen: a few tens of megabytes before they are packed.
MOST_SAMPLES = 16_000_000
#: The oldest time stamp that ZIP knows; a fixed one keeps the bytes the same.
_ZIP_DATE = (1980, 1, 1, 0, 0, 0)
#: Samples written at a time.
_CHUNK = 1 << 20


def write_sigrok(probe: Probe, path: Path) -> None:
    """Write the recording, sampled evenly at the finest rate that keeps it small.

    Raises:
        BluePillError: the file cannot be written.
    """
    names = signals_in_order(probe)
    span_ns = probe.end_ns - probe.start_ns
    rate_hz, rate_name = next((r for r in RATES if span_ns * r[0] // NS_PER_S < MOST_SAMPLES), RATES[-1])
    unit = max(1, (len(names) + 7) // 8)
    try:
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr(_entry("version"), "2")
            archive.writestr(_entry("metadata"), _metadata(names, rate_name, unit))
            with archive.open(_entry("logic-1-1"), "w") as samples:
                for bits, count in _runs(probe, names, rate_hz):
                    sample = bits.to_bytes(unit, "little")
                    for start in range(0, count, _CHUNK):
                        samples.write(sample * min(_CHUNK, count - start))
    except OSError as error:
        raise BluePillError(f"cannot write {path}: {error.strerror}", hint="give a file in a folder") from error


def _runs(probe: Probe, names: list[str], rate_hz: int) -> Iterator[tuple[int, int]]:
    """Return (levels as bits, number of samples) for each stretch without a change."""

    def sample_at(ns: int) -> int:
        return -(-(ns - probe.start_ns) * rate_hz // NS_PER_S)

    edges = sorted((at, n, value) for n, name in enumerate(names) for at, value in probe.edges.get(name, ()))
    bits = sum((probe.initial[name] & 1) << n for n, name in enumerate(names))
    begin = 0
    for at, number, value in edges:
        sample = sample_at(at)
        if sample > begin:
            yield bits, sample - begin
            begin = sample
        bits = bits | 1 << number if value & 1 else bits & ~(1 << number)
    yield bits, max(sample_at(probe.end_ns) + 1 - begin, 1)


def _entry(name: str) -> zipfile.ZipInfo:
    entry = zipfile.ZipInfo(name, _ZIP_DATE)
    entry.compress_type = zipfile.ZIP_DEFLATED
    return entry


def _metadata(names: list[str], rate: str, unit: int) -> str:
    lines = [
        "[global]", "sigrok version=0.5.2", "", "[device 1]", "capturefile=logic-1",
        f"total probes={len(names)}", f"samplerate={rate}", "total analog=0",
    ]  # fmt: skip
    lines += [f"probe{number}={name}" for number, name in enumerate(names, start=1)]
    return "\n".join([*lines, f"unitsize={unit}", ""])
