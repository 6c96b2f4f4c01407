"""Writes the pins of a run for waveform viewers: a value change dump (VCD) and a sigrok session (.sr).

The VCD, which GTKWave and sigrok open, is exact to the nanosecond. The sigrok session,
which PulseView opens, samples each net evenly from 0 on.
A wave (PWM) is not drawn edge by edge: while a net shows one, it is x in the VCD, and two real numbers beside
it have its duty in percent and its frequency in Hz; in the sigrok session it is 0.

Source: IEEE 1364-2005, chapter 18 (four-state VCD).

Invariant: the same run gives the same bytes.
"""

from bisect import bisect_right
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

from adapter_sim.pinout import load_pinout
from bluepill_sim.analysis.waveforms.levels import Waveforms, signal_of
from bluepill_sim.analysis.waveforms.sigrok_writer import MAX_SAMPLES, sample_at, write_session
from bluepill_sim.analysis.waveforms.vcd_writer import identifier
from robot_bench.recording.run_record import RunRecord
from robot_bench.recording.signals import grouped
from robot_bench.wires.edges import dumped, sampled
from simbase.timing import NS_PER_S

#: Sample rates to choose from, Hz, the finest first: each divides 10**9.
RATES_HZ = (1_000_000, 100_000, 10_000)


def write_vcd(record: RunRecord, path: Path) -> None:
    """Write every net's edges, in nanoseconds; the same run gives the same bytes."""
    names = nets_in_order(record)
    waving = [name for name in names if name in record.waves]
    codes = [identifier(index) for index in range(len(names) + 2 * len(waving))]
    tracks = [record.pins[name] for name in names]
    with path.open("w", encoding="ascii", errors="backslashreplace", newline="\n") as file:
        file.writelines(f"{line}\n" for line in _head(names, waving, codes))
        if waving:
            file.writelines(_with_waves(record, names, waving, codes))
        else:
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


def _with_waves(record: RunRecord, names: list[str], waving: list[str], codes: list[str]) -> Iterator[str]:
    """Yield all changes in order of time, where some nets show waves."""
    code_of = dict(zip(names, codes, strict=False))
    rows: list[tuple[int, int, str]] = []
    for name in names:
        rows += [(at, 0, f"{level}{code_of[name]}\n") for at, level in record.pins[name]]
    for place, name in enumerate(waving):
        duty, frequency = codes[len(names) + 2 * place :][:2]
        for at, wave in record.waves[name]:
            level = record.pins[name].levels[bisect_right(record.pins[name].times, at) - 1]
            rows.append((at, 1, f"{level if wave is None else 'x'}{code_of[name]}\n"))
            rows.append((at, 1, f"r{100 * (level if wave is None else wave.duty):.6g} {duty}\n"))
            rows.append((at, 1, f"r{0 if wave is None else wave.frequency_hz:.9g} {frequency}\n"))
    now = -1
    for at, _, line in sorted(rows):
        if at != now:
            now = at
            yield f"#{at}\n"
        yield line


def _head(names: list[str], waving: list[str], codes: list[str]) -> Iterator[str]:
    yield "$version p2os test bench $end"
    yield "$timescale 1 ns $end"
    yield "$scope module bench $end"
    for code, name in zip(codes, names, strict=False):
        yield f"$var wire 1 {code} {name} $end"
    for place, name in enumerate(waving):
        for code, what in zip(codes[len(names) + 2 * place :][:2], ("duty_percent", "hz"), strict=True):
            yield f"$var real 64 {code} {name}_{what} $end"
    yield "$upscope $end"
    yield "$enddefinitions $end"


def waveforms_of(record: RunRecord, name: str) -> Waveforms:
    """Return a run's nets by the BluePill's pins, waves edge by edge; other nets keep their names."""
    pin_of = {wire.name: wire.bluepill for wire in load_pinout().wires}
    signals = {
        pin_of.get(net, net): signal_of([*_edges_with_waves(record, net)], record.last_ns)
        for net in nets_in_order(record) if record.pins[net]
    }  # fmt: skip
    return Waveforms(name=name, signals=signals, start_ns=0.0, end_ns=record.last_ns, sample_ns=1.0)


def _edges_with_waves(record: RunRecord, net: str) -> Iterator[tuple[float, int]]:
    """Yield a net's levels, with the edges of its waves."""
    waves = [*record.waves.get(net, ()), (record.last_ns, None)]
    levels: list[tuple[float, int]] = [(at, level) for at, level in record.pins[net]]
    for (begin, wave), (end, _) in pairwise(waves):
        if wave is None:
            continue
        tick_ns = NS_PER_S / wave.ticks_hz
        rise = begin - wave.at * tick_ns
        for n in range(int((end - rise) / (wave.period * tick_ns)) + 1):
            up = rise + n * wave.period * tick_ns
            levels += [(max(at, begin), level) for at, level in ((up, 1), (up + wave.high * tick_ns, 0)) if at < end]
        track = record.pins[net]
        levels.append((end, track.levels[bisect_right(track.times, end) - 1]))
    yield from sorted(levels, key=lambda edge: edge[0])
