"""`p2os compare-pins`: what a logic analyser saw on a board, beside what the model did."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from p2os.cli.groups import BENCH
from simbase.errors import MissingDependencyError, UsageError

if TYPE_CHECKING:
    from bluepill_sim.analysis.waveforms.comparison import PinComparison, Unexplained
    from bluepill_sim.analysis.waveforms.levels import Waveforms

HELP = """Compare a logic analyser's capture with a run of the same program.

RUN is a run folder, or the output of `p2os mcu pins --vcd`. CAPTURE is a VCD, a
sigrok session (.sr) or Saleae's CSV. Start time and clock difference are found
from the edges; then each edge is explained by the run, or not. Channels named
like pins need no --wire.

Exit code: 0 every edge is explained, 1 one is not, 2 wrong usage or file.

\b
Examples:
  p2os compare-pins model.vcd board.sr --wire D0=PB0 --wire D1=PB1
  p2os compare-pins runs/dodge-001 board.csv --wire "Channel 0=PB7"
  p2os compare-pins model.vcd board.vcd --picture first.svg
"""


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("compare-pins", help=HELP, rich_help_panel=BENCH)(compare_pins)


def compare_pins(
    run: Annotated[Path, typer.Argument(help="A run folder, or pins as VCD.", metavar="RUN")],
    capture: Annotated[Path, typer.Argument(help="What the analyser saw.", metavar="CAPTURE")],
    wire: Annotated[
        list[str] | None,
        typer.Option("--wire", help="Which pin a channel is at; repeatable.", metavar="CHANNEL=PIN"),
    ] = None,
    rate: Annotated[
        str, typer.Option("--rate", help="Samples a second, where the file does not tell: 24MHz.", metavar="RATE")
    ] = "",
    jitter: Annotated[
        float,
        typer.Option("--jitter", help="By how many samples more an edge may be off.", metavar="N", min=0.0, max=1000.0),
    ] = 1.0,
    ppm: Annotated[
        float,
        typer.Option(
            "--ppm",
            help="By how much the clocks may differ; 25000 without a crystal.",
            metavar="PPM",
            min=0.0,
            max=50_000.0,
        ),
    ] = 500.0,
    picture: Annotated[
        Path | None,
        typer.Option("--picture", help="Draw both around the first edge not explained, PNG or SVG.", metavar="FILE"),
    ] = None,
    json_output: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Compare a capture with a run."""
    from bluepill_sim.analysis.waveforms.comparison import compare_pins as compared
    from bluepill_sim.analysis.waveforms.comparison import wires_of
    from bluepill_sim.analysis.waveforms.reading import read_waveforms

    if picture is not None:
        _drawing(picture)
    model, aliases = _model(run)
    seen = read_waveforms(capture, _rate(rate))
    named = {channel: aliases[channel.lower()] for channel in seen.signals if channel.lower() in aliases}
    of_names = {channel: pin for channel, pin in named.items() if pin in model.signals}
    wires = wires_of(seen, model, _declared(wire or [], aliases) or of_names)
    found = compared(model, seen, wires, jitter_samples=jitter, most_error=max(ppm, 0.001) / 1e6)
    if picture is not None:
        from robot_bench.report.edge_picture import write_edge_picture

        write_edge_picture(found, picture, _title(found))
    if json_output:
        typer.echo(json.dumps(_plain(found, seen), indent=2))
    else:
        for line in _lines(found, model, seen):
            typer.echo(line)
    if found.unexplained:
        raise typer.Exit(1)


def _drawing(path: Path) -> None:
    try:
        from robot_bench.report.edge_picture import refuse_other_formats
    except ImportError as error:
        raise MissingDependencyError("--picture needs Matplotlib", extra="sim") from error
    refuse_other_formats(path)


def _model(path: Path) -> "tuple[Waveforms, Mapping[str, str]]":
    """Return a run's waveforms, and other names of its pins: those of the adapter's wires."""
    from adapter_sim.pinout import load_pinout
    from bluepill_sim.analysis.waveforms.reading import read_waveforms

    pins = {wire.name.lower(): wire.bluepill for wire in load_pinout().wires}
    if not path.is_dir():
        return read_waveforms(path, is_capture=False), pins
    from robot_bench.recording.run_record import read_run
    from robot_bench.recording.waveforms import waveforms_of

    return waveforms_of(read_run(path), path.name), pins


def _rate(words: str) -> float:
    from bluepill_sim.analysis.waveforms.sample_rate import rate_of

    try:
        return rate_of(words) if words else 0.0
    except ValueError as error:
        raise UsageError(f"--rate {words!r} is no number of samples a second", hint="such as --rate 24MHz") from error


def _declared(words: list[str], aliases: Mapping[str, str]) -> dict[str, str]:
    """Return the pin of each channel as --wire says it."""
    wires: dict[str, str] = {}
    for word in words:
        channel, equals, pin = (part.strip() for part in word.rpartition("="))
        if not (channel and equals and pin):
            raise UsageError(f"--wire {word!r} is no CHANNEL=PIN", hint="such as --wire D0=PB7")
        if channel in wires:
            raise UsageError(f"--wire names channel {channel} twice")
        wires[channel] = aliases.get(pin.lower(), pin)
    return wires


def _lines(found: "PinComparison", model: "Waveforms", seen: "Waveforms") -> Iterator[str]:
    """Yield what a person reads, no line wider than 80 columns but for long names."""
    clock = found.alignment.clock
    begun_ns = clock.in_run(seen.start_ns)
    yield f"run      {model.name}, {(model.end_ns - model.start_ns) / 1e9:.6f} s"
    yield (
        f"capture  {seen.name}, {(seen.end_ns - seen.start_ns) / 1e9:.6f} s, a sample is {_length(seen.sample_ns)}"
        + (f" ({seen.rate_from})" if seen.rate_from else "")
    )
    near = _length(found.limits.near_ns)
    yield f"offset   the capture begins at {begun_ns / 1e9:+.9f} s of the run; edges within {near}"
    if clock.error_within < found.limits.most_error:
        yield (
            f"clock    the board's is {1e6 * clock.error:+.2f} ppm (within {1e6 * clock.error_within:.2f})"
            " against the analyser's"
        )
    else:
        yield "clock    too few edges over too short a time to tell an error"
    if found.alignment.as_good_ns is not None:
        yield (
            f"         as many edges are explained {_length(abs(found.alignment.as_good_ns))} "
            + ("later" if found.alignment.as_good_ns > 0 else "earlier")
            + ": the signals repeat"
        )
    silent = 0
    for one in found.met:
        alone = len(one.added) + len(one.missing)
        silent += not (one.pairs or alone)
        if not (one.pairs or alone):
            continue
        yield f"{one.track.channel:>8} {one.track.pin}: {len(one.pairs)} edges explained" + (
            f", {alone} not{_late(found.late_ns(one))}" if alone else ""
        )
    if silent:
        yield f"{silent:>8} channels without an edge in either"
    if found.unjudged:
        yield f"{found.unjudged:>8} edges are not judged: a pin floats in the run, or pulses shorter than a sample"
    for wire in found.miswired:
        what = "inverted" if wire.shows == wire.pin else f"at {wire.shows}" + (" inverted" if wire.is_inverted else "")
        yield f"WIRE     {wire.channel} is not at {wire.pin} but {what}: {wire.explained} of {wire.of} edges"
    if found.first is None:
        yield f"every edge is explained: {found.explained}"
        return
    yield f"{found.unexplained} edges are not explained; the first:"
    yield from _about(found.first)


def _about(first: "Unexplained") -> Iterator[str]:
    what = "rises" if first.level else "falls"
    side, other = ("capture", "run") if first.is_added else ("run", "capture")
    yield f"  {first.channel} {first.pin} {what} in the {side}, and not in the {other}"
    yield f"  at {first.run_ns / 1e9:.9f} s of the run, {first.capture_ns / 1e9:.9f} s of the capture"
    if first.pulse_ns is not None:
        verb = "an added pulse" if first.is_added else "a lost pulse"
        yield f"  {verb} of {_length(first.pulse_ns)}"
    if first.late_ns is not None:
        when = "later" if first.late_ns > 0 else "earlier"
        yield f"  the capture has it {_length(abs(first.late_ns))} {when} than the run"
    if first.jump is not None:
        when = "later" if first.jump.late_ns > 0 else "earlier"
        yield f"  time jumps: from here on the capture is {_length(abs(first.jump.late_ns))} {when}"
        yield f"  than the run, {first.jump.explained} of {first.jump.of} edges"
    level = "high" if first.other_level else "low"
    yield f"  the {other} is {level} there" + _nearest(first)


def _nearest(first: "Unexplained") -> str:
    if first.nearest is None:
        return " and has no edge"
    apart = first.nearest[0] - first.run_ns
    return (
        f"; its nearest edge {'rises' if first.nearest[1] else 'falls'} {_length(abs(apart))} "
        f"{'later' if apart > 0 else 'earlier'}"
    )


def _late(ns: float | None) -> str:
    return "" if ns is None else f": {_length(abs(ns))} {'later' if ns > 0 else 'earlier'}"


def _title(found: "PinComparison") -> str:
    first = found.first
    if first is None:
        return f"every edge is explained: {found.explained}"
    return (
        f"{first.channel} {first.pin} {'rises' if first.level else 'falls'} only in the "
        f"{'capture' if first.is_added else 'run'}"
    )


def _length(ns: float) -> str:
    for unit, scale in (("s", 1e9), ("ms", 1e6), ("us", 1e3)):
        if ns >= scale:
            return f"{ns / scale:.6g} {unit}"
    return f"{ns:.4g} ns"


def _plain(found: "PinComparison", seen: "Waveforms") -> dict[str, object]:
    clock = found.alignment.clock
    is_known = clock.error_within < found.limits.most_error
    return {
        "capture_begins_ns": clock.in_run(seen.start_ns),
        "clock_ppm": 1e6 * clock.error if is_known else None,
        "clock_within_ppm": 1e6 * clock.error_within if is_known else None,
        "sample_ns": seen.sample_ns,
        "as_good_ns": found.alignment.as_good_ns,
        "channels": {
            one.track.channel: {"pin": one.track.pin, "explained": len(one.pairs), "added": len(one.added),
                                "missing": len(one.missing), "late_ns": found.late_ns(one)}
            for one in found.met
        },
        "not_judged": found.unjudged,
        "miswired": [asdict(wire) for wire in found.miswired],
        "unexplained": found.unexplained,
        "first": None if found.first is None else asdict(found.first),
    }  # fmt: skip
