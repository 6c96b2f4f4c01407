"""`p2os compare`: two drives laid over one another, how far they are apart, and where they part."""

import json
import math
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from p2os.cli.captures.reading import ProfileForLayouts, RobotForUnits, reading_of
from p2os.cli.groups import BENCH
from p2os.cli.kept_files import FORCE_HELP, refuse_to_overwrite
from p2os.cli.quantities import option
from robot_bench.experiments import require
from simbase.errors import UsageError
from simbase.files import write_text
from simbase.timing import NS_PER_S, Nanos
from simbase.units import TIME

if TYPE_CHECKING:  # NumPy is loaded when the verb runs
    from robot_bench.experiments.comparison import Comparison

HELP = """Compare how two robots drove, from runs or captures.

A and B are run folders, recordings, pcap, CSV (t_s, x_m, y_m, heading_rad) or
TUM files; A is the reference. B is aligned in time by the speeds (two virtual
runs share their start), and in space by A's first pose. For an exact comparison
of two runs of one scenario, use `p2os diff`.

\b
Examples:
  p2os compare runs/dodge-001 runs/dodge-002
  p2os compare real.pcap runs/square-001 --html square.html
  p2os compare runs/dodge-001 runs/dodge-001 --poses truth,odometry
  p2os compare a.csv b.csv --align least-squares --tum out   out-a.tum, out-b.tum
"""
#: chosen: so many signals are listed, the first that part.
MOST_SIGNALS = 8
POSES = ("auto", "truth", "odometry")
ALIGNMENTS = ("first", "least-squares", "none")


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("compare", help=HELP, rich_help_panel=BENCH)(compare)


def compare(
    one: Annotated[Path, typer.Argument(help="The reference.", metavar="A")],
    other: Annotated[Path, typer.Argument(help="What is compared with it.", metavar="B")],
    poses: Annotated[
        str, typer.Option(help="Whose poses, of both or A,B: truth, odometry, or truth where known.",
                          metavar="auto|truth|odometry[,...]")
    ] = "auto",
    align: Annotated[str, typer.Option(help="How B is laid on A.", metavar="|".join(ALIGNMENTS))] = "first",
    at: Annotated[
        str, typer.Option(help="An event that is at one time in both, in the words of goals, or: moves.",
                          metavar="EVENT")
    ] = "",
    shift: Annotated[
        Nanos | None, option(TIME, "--shift", purpose="How much later B is made, instead of finding it.")
    ] = None,
    delta: Annotated[
        Nanos, option(TIME, "--delta", purpose="Length of a step of the relative error.", above_zero=True, shown="1s")
    ] = NS_PER_S,
    json_output: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
    page: Annotated[Path | None, typer.Option("--html", help="Write a page of both.", metavar="FILE")] = None,
    picture: Annotated[Path | None, typer.Option("--picture", help="Write the picture, PNG.", metavar="FILE")] = None,
    tum: Annotated[
        str, typer.Option("--tum", help="Write both ways as compared, NAME-a.tum, NAME-b.tum.", metavar="NAME")
    ] = "",
    robot: RobotForUnits = "",
    profile: ProfileForLayouts = None,
    force: Annotated[bool, typer.Option("--force", help=FORCE_HELP)] = False,
) -> None:  # fmt: skip
    """Compare two drives."""
    require(*(["matplotlib"] if picture else []))
    from robot_bench.experiments.comparison import How
    from robot_bench.experiments.comparison import compare as compared
    from robot_bench.experiments.drive_files import read_drive, write_tum

    if align not in ALIGNMENTS:
        raise UsageError(f"--align {align!r} is none of {', '.join(ALIGNMENTS)}")
    for side in ("a", "b") if tum else ():
        refuse_to_overwrite(Path(f"{tum}-{side}.tum"), force=force)
    shift_s = None if shift is None else shift / NS_PER_S
    how = How(poses=_which(poses), align=align, at=at, shift_s=shift_s, step_s=delta / NS_PER_S)
    reader = partial(reading_of, robot=robot, profile=profile)
    found = compared(read_drive(one, robot=robot, how=reader), read_drive(other, robot=robot, how=reader), how)
    if tum:
        write_tum(found.ours, Path(f"{tum}-a.tum"))
        write_tum(found.theirs, Path(f"{tum}-b.tum"))
    if picture:
        from robot_bench.experiments.pictures import comparison_figure, write_png

        write_png(comparison_figure(found), picture)
    if page:
        from robot_bench.experiments.comparison_page import comparison_page

        write_text(page, comparison_page(found, lines_of(found)))
    if json_output:
        typer.echo(json.dumps(found.as_plain(), indent=2))
    else:
        sys.stdout.writelines(f"{line}\n" for line in lines_of(found))


def _which(words: str) -> tuple[str, str]:
    found = words.split(",")
    if len(found) > 2 or any(word not in POSES for word in found):
        raise UsageError(f"--poses {words!r}: {', '.join(POSES)}, or two of them with a comma")
    return found[0], found[-1]


def lines_of(found: "Comparison") -> Iterator[str]:
    """Yield what a person reads, no line wider than 80 columns."""
    x, y, turn = found.pose
    first, last = found.ours.t_s[0], found.ours.t_s[-1]
    yield f"reference  {found.one.name}, {found.ours.path_m:.2f} m"
    yield f"compared   {found.other.name}, {found.theirs.path_m:.2f} m"
    yield (
        f"aligned    {found.shift_s:+.3f} s, x {x:+.3f} m, y {y:+.3f} m, {math.degrees(turn):+.2f} deg"
        f" ({found.how.align})"
    )
    yield f"over       {len(found.ours)} poses from {first:.2f} s to {last:.2f} s"
    yield ""
    yield f"{'':30}{'rmse':>9}{'mean':>9}{'median':>9}{'std':>9}{'max':>9}"
    step = f"over {found.step_s:.2g} s"
    degrees = math.degrees
    for name, statistics, scale in (
        ("APE, m", found.ape_m, 1.0),
        ("APE, deg", found.ape_rad, degrees(1.0)),
        (f"RPE {step}, m", found.rpe_m, 1.0),
        (f"RPE {step}, deg", found.rpe_rad, degrees(1.0)),
        ("speed differs, m/s", found.speed_mps, 1.0),
        ("turn rate differs, deg/s", found.turn_radps, degrees(1.0)),
    ):
        values = (statistics.rmse, statistics.mean, statistics.median, statistics.std, statistics.max)
        yield f"{name:30}" + "".join(f"{value * scale:9.4f}" for value in values)
    yield ""
    yield from _latency_lines(found)
    sonar = [part for part in found.parts if part.kind == "sonar"]
    if sonar:
        worst = max(sonar, key=lambda part: part.largest)
        rms = math.sqrt(sum(part.rms**2 for part in sonar) / len(sonar))
        yield (
            f"sonar differs by {rms:.3f} m (rms of {len(sonar)}), most {worst.largest:.3f} m: {worst.signal} at "
            f"{worst.largest_s:.2f} s"
        )
    yield from _parting_lines(found)


def _latency_lines(found: "Comparison") -> Iterator[str]:
    from robot_bench.drives.latency_budget import quantiles

    for drive, values in zip((found.one, found.other), found.latency_s, strict=True):
        row = quantiles(values)
        if row["count"]:
            yield (
                f"command to motion  {drive.name}: median {1000 * float(str(row['median'])):.0f} ms, "
                f"90 % {1000 * float(str(row['p90'])):.0f} ms, max {1000 * float(str(row['max'])):.0f} ms, "
                f"{row['count']} times"
            )


def _parting_lines(found: "Comparison") -> Iterator[str]:
    from robot_bench.experiments.parting import motion_parts_s

    came = found.origin
    if came is None:
        yield f"they do not part: {len(found.parts)} signals stay within their bounds"
        return
    for part in [part for part in found.parts if part.parts_s is not None][:MOST_SIGNALS]:
        yield (
            f"parts at {part.parts_s:8.3f} s  {part.bound.stage:9}{part.signal:14}"
            f"{part.ours:g} and {part.theirs:g} {part.bound.unit}".rstrip()
        )
    within = [part.signal for part in found.parts if part.parts_s is None]
    if within:
        yield f"within bounds: {len(within)} of {len(found.parts)} signals"
    part, begin = came
    where = f"{part.signal} ({part.bound.stage}) at {begin:.3f} s"
    moved_s = motion_parts_s(found.parts)
    if moved_s is None:
        yield f"the motion does not part; what differs: {where}"
    else:
        yield f"the motion parts at {moved_s:.3f} s; it came from: {where}"
