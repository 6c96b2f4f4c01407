"""Writes the pins of a run as a value change dump (VCD), which GTKWave, PulseView and sigrok-cli open.

Source: IEEE 1364-2005, chapter 18 (four-state VCD).

Invariant: exact to the nanosecond; the same run gives the same bytes.
"""

from collections.abc import Iterator
from pathlib import Path

from bluepill_sim.analysis.vcd import identifier
from robot_bench.recording.run_record import RunRecord
from robot_bench.recording.signals import grouped


def write_vcd(record: RunRecord, path: Path) -> None:
    """Write every net's edges, in nanoseconds; the same run gives the same bytes."""
    path.write_text("\n".join(_lines(record)) + "\n", encoding="ascii")


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
