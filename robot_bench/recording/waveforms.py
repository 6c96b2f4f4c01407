"""Writes the pins of a run for waveform viewers: a value change dump (VCD) and a sigrok session (.sr).

The VCD, which GTKWave and sigrok open, is exact to the nanosecond. The sigrok session,
which PulseView opens, samples each net evenly from 0 on.

Source: IEEE 1364-2005, chapter 18 (four-state VCD).

Invariant: the same run gives the same bytes.
"""

from collections.abc import Iterator
from pathlib import Path

from bluepill_sim.analysis.sigrok import MAX_SAMPLES, runs, sample_at, write_session
from bluepill_sim.analysis.vcd import identifier
from robot_bench.recording.run_record import RunRecord
from robot_bench.recording.signals import grouped

#: Sample rates to choose from, Hz, the finest first: each divides 10**9.
RATES_HZ = (1_000_000, 100_000, 10_000)


def write_vcd(record: RunRecord, path: Path) -> None:
    """Write every net's edges, in nanoseconds; the same run gives the same bytes."""
    path.write_text("\n".join(_lines(record)) + "\n", encoding="ascii")


def write_sigrok(record: RunRecord, path: Path) -> None:
    """Write every net's levels, sampled evenly over the run."""
    end_ns = record.last_ns
    rate_hz = next((rate for rate in RATES_HZ if sample_at(end_ns, rate) + 1 <= MAX_SAMPLES), RATES_HZ[-1])
    write_session(path, nets_in_order(record), rate_hz, runs(edges_in_order(record), 0, end_ns, rate_hz))


def nets_in_order(record: RunRecord) -> list[str]:
    """Return the nets in the order in which a person reads them."""
    return [name for _, names in grouped(sorted(record.pins)) for name in names]


def edges_in_order(record: RunRecord) -> Iterator[tuple[int, int, int]]:
    """Return (ns, index of the net in `nets_in_order`, level) of every edge, by time."""
    names = nets_in_order(record)
    yield from sorted((at, index, level) for index, name in enumerate(names) for at, level in record.pins[name])


def _lines(record: RunRecord) -> Iterator[str]:
    names = nets_in_order(record)
    codes = [identifier(index) for index in range(len(names))]
    yield "$version p2os test bench $end"
    yield "$timescale 1 ns $end"
    yield "$scope module bench $end"
    for code, name in zip(codes, names, strict=True):
        yield f"$var wire 1 {code} {name} $end"
    yield "$upscope $end"
    yield "$enddefinitions $end"
    now = -1
    for at, index, level in edges_in_order(record):
        if at != now:
            now = at
            yield f"#{at}"
        yield f"{level}{codes[index]}"
    if record.last_ns > now:
        yield f"#{record.last_ns}"
