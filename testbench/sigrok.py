"""Writes the pins of a run as a sigrok session (.sr, version 2), which PulseView opens.

A session is a ZIP file with `version`, `metadata` and the samples in
`logic-1-1`, `unitsize` bytes a sample, probe 1 in bit 0 of the first byte.
Source: sigrok wiki, "File format:Sigrok/v2".

A sample shows the level of its own instant, so an edge appears at the first
sample at or after it. The exact times stand in the VCD and in the trace.
"""

import zipfile
from collections.abc import Iterator
from pathlib import Path

from testbench.report.run_record import RunRecord
from testbench.vcd import edges_in_order, nets_in_order

#: Sample rates to choose from, Hz, the finest first: each divides 10**9.
RATES_HZ = (1_000_000, 100_000, 10_000)
_RATE_NAMES = {1_000_000: "1 MHz", 100_000: "100 kHz", 10_000: "10 kHz"}
#: chosen: 48 MB of samples at most for 22 nets, packed to a few kilobytes.
MOST_SAMPLES = 16_000_000
#: The oldest time stamp that ZIP knows; a fixed one keeps the bytes the same.
_ZIP_DATE = (1980, 1, 1, 0, 0, 0)


def write_sigrok(record: RunRecord, path: Path) -> None:
    """Write every net's levels, sampled evenly over the run."""
    names = nets_in_order(record)
    rate_hz = next((rate for rate in RATES_HZ if _samples(record, rate) <= MOST_SAMPLES), RATES_HZ[-1])
    unit = max(1, (len(names) + 7) // 8)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(_entry("version"), "2")
        archive.writestr(_entry("metadata"), _metadata(names, rate_hz, unit))
        with archive.open(_entry("logic-1-1"), "w") as samples:
            for level_bits, count in _runs(record, rate_hz):
                samples.write(level_bits.to_bytes(unit, "little") * count)


def _entry(name: str) -> zipfile.ZipInfo:
    entry = zipfile.ZipInfo(name, _ZIP_DATE)
    entry.compress_type = zipfile.ZIP_DEFLATED
    return entry


def _metadata(names: list[str], rate_hz: int, unit: int) -> str:
    lines = [
        "[global]", "sigrok version=0.5.2", "", "[device 1]", "capturefile=logic-1",
        f"total probes={len(names)}", f"samplerate={_RATE_NAMES[rate_hz]}", "total analog=0",
    ]  # fmt: skip
    lines += [f"probe{number}={name}" for number, name in enumerate(names, start=1)]
    return "\n".join([*lines, f"unitsize={unit}", ""])


def _samples(record: RunRecord, rate_hz: int) -> int:
    return _sample_at(record.last_ns, rate_hz) + 1


def _sample_at(ns: int, rate_hz: int) -> int:
    """Return the first sample at or after a time."""
    return -(-ns * rate_hz // 1_000_000_000)


def _runs(record: RunRecord, rate_hz: int) -> Iterator[tuple[int, int]]:
    """Return (levels as bits, number of samples) for each stretch without a change."""
    bits, begin = 0, 0
    for at, index, level in edges_in_order(record):
        sample = _sample_at(at, rate_hz)
        if sample > begin:
            yield bits, sample - begin
            begin = sample
        bits = bits | 1 << index if level else bits & ~(1 << index)
    yield bits, max(_samples(record, rate_hz) - begin, 1)
