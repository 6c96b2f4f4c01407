"""Writes the pins of a run for waveform viewers: a value change dump (VCD) and a sigrok session (.sr).

The VCD, which GTKWave and sigrok open, is exact to the nanosecond. The sigrok session,
which PulseView opens, samples each net evenly from 0 on.

Source: IEEE 1364-2005, chapter 18 (four-state VCD).

Invariant: the same run gives the same bytes.
"""

from collections.abc import Iterator
from pathlib import Path

from bluepill_sim.analysis.sigrok import MAX_SAMPLES, sample_at, write_session
from bluepill_sim.analysis.vcd import identifier
from robot_bench.recording.run_record import RunRecord
from robot_bench.recording.signals import grouped
from robot_bench.wires.edges import dumped, sampled

#: Sample rates to choose from, Hz, the finest first: each divides 10**9.
RATES_HZ = (1_000_000, 100_000, 10_000)


def write_vcd(record: RunRecord, path: Path) -> None:
    """Write every net's edges, in nanoseconds; the same run gives the same bytes."""
    names = nets_in_order(record)
    codes = [identifier(index) for index in range(len(names))]
    tracks = [record.pins[name] for name in names]
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.writelines(f"{line}\n" for line in _head(names, codes))
        file.writelines(dumped(tracks, codes))
        if record.last_ns > max((track.times[-1] for track in tracks if track), default=-1):
            file.write(f"#{record.last_ns}\n")


def write_sigrok(record: RunRecord, path: Path) -> None:
    """Write every net's levels, sampled evenly over the run."""
    end_ns, names = record.last_ns, nets_in_order(record)
    rate_hz = next((rate for rate in RATES_HZ if sample_at(end_ns, rate) + 1 <= MAX_SAMPLES), RATES_HZ[-1])
    tracks = [record.pins[name] for name in names]
    write_session(path, names, rate_hz, sampled(tracks, rate_hz, sample_at(end_ns, rate_hz) + 1))


def nets_in_order(record: RunRecord) -> list[str]:
    """Return the nets in the order in which a person reads them."""
    return [name for _, names in grouped(sorted(record.pins)) for name in names]


def _head(names: list[str], codes: list[str]) -> Iterator[str]:
    yield "$version p2os test bench $end"
    yield "$timescale 1 ns $end"
    yield "$scope module bench $end"
    for code, name in zip(codes, names, strict=True):
        yield f"$var wire 1 {code} {name} $end"
    yield "$upscope $end"
    yield "$enddefinitions $end"
