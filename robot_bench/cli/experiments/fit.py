"""`p2os fit`: a robot's wheels, track, ramps, delays and sonar out of recorded drives; UMBmark; an example data set."""

import json
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from p2os.cli.captures.reading import ProfileForLayouts, RobotForUnits, reading_of
from p2os.cli.groups import BENCH
from p2os.cli.kept_files import FORCE_HELP, refuse_to_overwrite
from p2os.cli.names import worlds
from p2os.cli.quantities import option
from p2os.errors import WorldError
from p2os.robots.parameters import known_robots
from robot_bench.experiments import require
from simbase.errors import FileError, UsageError
from simbase.files import write_text
from simbase.units import SEED

if TYPE_CHECKING:  # NumPy is loaded when the verb runs
    from robot_bench.drives.drive import Drive
    from robot_bench.experiments.drive_files import HowToRead
    from robot_bench.experiments.fitting.least_squares import Fit
    from robot_bench.experiments.fitting.umbmark import Correction, Umbmark

HELP = """Estimate a robot's parameters from recorded drives.

A drive is a run folder, or a recording NAME.jsonl (pcap, ...) with measured
poses: NAME.truth.csv, NAME.truth.tum, or --truth. Poses give wheels and track;
the recording also gives ramps; the world also gives sonar. Parameters that the
drives cannot show are named and not estimated.

\b
Examples:
  p2os fit --example drives                    drives with planted errors
  p2os fit drives/drive-*.jsonl --world room --out mine
                                               mine.toml, mine-errors.toml
  p2os serve --robot mine.toml --errors mine-errors.toml
  p2os fit --umbmark drives/square-*.jsonl     squares both ways round
"""
TRUTH_SUFFIXES = (".truth.csv", ".truth.tum")
#: Estimate → what it is, unit as shown and factor, decimals.
SHOWN: dict[str, tuple[str, str, float, int]] = {
    "left_wheel": ("left wheel, true over assumed", "", 1.0, 5),
    "right_wheel": ("right wheel, true over assumed", "", 1.0, 5),
    "track_mm": ("track", "mm", 1.0, 2),
    "packet_delay_s": ("packets come late by", "ms", 1000.0, 1),
    "command_delay_s": ("command to speed in packets", "ms", 1000.0, 1),
    "accel_mm_s2": ("acceleration", "mm/s²", 1.0, 1),
    "decel_mm_s2": ("deceleration", "mm/s²", 1.0, 1),
    "rot_accel_deg_s2": ("turning up", "deg/s²", 1.0, 1),
    "rot_decel_deg_s2": ("turning down", "deg/s²", 1.0, 1),
    "speed_gain": ("speed told over commanded", "", 1.0, 4),
    "turn_gain": ("turn told over commanded", "", 1.0, 4),
    "reversal_s": ("stands before it reverses", "ms", 1000.0, 1),
    "cone_deg": ("sonar cone", "deg", 1.0, 2),
    "sonar_offset_m": ("sonar offset", "mm", 1000.0, 1),
    "sonar_delay_s": ("sonar readings are old by", "ms", 1000.0, 1),
    "noise_m": ("sonar noise", "mm", 1000.0, 2),
    "noise_part": ("sonar noise, of the range", "%", 100.0, 3),
}


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("fit", help=HELP, rich_help_panel=BENCH)(fit)


def fit(
    captures: Annotated[
        list[Path] | None, typer.Argument(help="Run folders or recordings.", metavar="DRIVE")
    ] = None,
    truth: Annotated[
        list[Path] | None,
        typer.Option("--truth", help="Measured poses of the first drive, the second.", metavar="FILE")
    ] = None,
    world: Annotated[
        str, typer.Option(help="Where it was driven, for the sonar; a run knows.", metavar="NAME|FILE",
                          autocompletion=worlds)
    ] = "",
    umbmark: Annotated[bool, typer.Option("--umbmark", help="The drives are squares, some each way round.")] = False,
    out: Annotated[str, typer.Option("--out", help="Write NAME.toml and NAME-errors.toml.", metavar="NAME")] = "",
    example: Annotated[
        Path | None, typer.Option("--example", help="Write drives with planted errors instead.", metavar="FOLDER")
    ] = None,
    seed: Annotated[int, option(SEED, "--seed", purpose="Of the example.", least="0", shown="0")] = 0,
    json_output: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
    robot: RobotForUnits = "",
    profile: ProfileForLayouts = None,
    force: Annotated[bool, typer.Option("--force", help=FORCE_HELP)] = False,
) -> None:  # fmt: skip
    """Fit a robot."""
    require()
    if example is not None:
        _write_example(example, world, seed, force=force)
        return
    if not captures:
        raise UsageError("which drives?", hint="p2os fit DRIVE..., or --example FOLDER writes some")
    targets = [Path(f"{out}.toml"), Path(f"{out}-errors.toml")] if out else []
    for path in targets:
        refuse_to_overwrite(path, force=force)
    drives = _drives(captures, truth or [], robot, partial(reading_of, robot=robot, profile=profile))
    if umbmark:
        _umbmark(drives, as_json=json_output)
        return
    found = _fits(drives, world)
    if out:
        _write(drives, found, targets)
    if json_output:
        typer.echo(json.dumps({name: _plain(one) for name, one in found.items()}, indent=2))
    else:
        sys.stdout.writelines(f"{line}\n" for line in _lines(found))
        if out:
            typer.echo(f"written: {targets[0]} (--robot), {targets[1]} (--errors)")


def _write_example(folder: Path, world: str, seed: int, *, force: bool) -> None:
    from p2os.pioneer.world import load_world
    from robot_bench.experiments.fitting.examples import WORLD_NAME, write_examples

    if folder.is_dir() and any(folder.iterdir()) and not force:
        raise UsageError(f"{folder} holds something already", hint="another folder, or --force")
    written = write_examples(folder, load_world(world or WORLD_NAME, seed), seed)
    typer.echo(f"{len(written)} drives in {folder}; planted: {folder}/planted.toml, {folder}/planted-errors.toml")


def _drives(captures: Sequence[Path], truths: Sequence[Path], robot: str, how: "HowToRead") -> "list[Drive]":
    from robot_bench.experiments.drive_files import is_recording, read_drive

    if len(truths) > len(captures):
        raise UsageError(f"{len(truths)} --truth for {len(captures)} drives")
    found = []
    for number, path in enumerate(captures):
        drive = read_drive(path, robot=robot, how=how)
        beside = [path.with_suffix(suffix) for suffix in TRUTH_SUFFIXES if is_recording(path)]
        measured = truths[number] if number < len(truths) else next((one for one in beside if one.is_file()), None)
        if measured is not None:
            drive.truth = read_drive(measured).truth
        found.append(drive)
    return found


def _fits(drives: "Sequence[Drive]", world: str) -> "dict[str, Fit | FileError]":
    """Return what each group of parameters came to; an error says why a group could not be looked at."""
    from p2os.pioneer.world import load_world
    from robot_bench.experiments.fitting.clocks import on_one_clock, without_delays
    from robot_bench.experiments.fitting.ramps import fit_ramps
    from robot_bench.experiments.fitting.sonar import fit_sonar, walls_of
    from robot_bench.experiments.fitting.wheels import fit_wheels

    asked = load_world(world) if world else None
    drives, clocks = on_one_clock(drives)

    def sonar() -> "Fit":
        place = asked or next((load_world(name) for drive in drives if (name := _world_of(drive))), None)
        if place is None:
            raise FileError("nobody says in which world it was driven", hint="--world NAME")
        return fit_sonar(drives, walls_of(place, drives[0].parameters))

    found: dict[str, Fit | FileError] = {}
    makes: dict[str, Callable[[], Fit]] = {
        "wheels": lambda: fit_wheels(drives), "ramps": lambda: fit_ramps(drives), "sonar": sonar,
    }  # fmt: skip
    for name, make in makes.items():
        try:
            found[name] = without_delays(make(), clocks)
        except (FileError, UsageError, WorldError) as error:
            found[name] = FileError(str(error), hint=error.hint)
    errors = [one for one in found.values() if isinstance(one, FileError)]
    if len(errors) == len(found):
        raise errors[0]
    return found


def _world_of(drive: "Drive") -> str:
    """Return the name of the world of a run; empty for other drives."""
    place = drive.meta.get("world")
    return str(place.get("name", "")) if isinstance(place, dict) else ""


def _plain(one: "Fit | FileError") -> object:
    return {"not_fitted": str(one)} if isinstance(one, FileError) else one.as_plain()


def _lines(found: "dict[str, Fit | FileError]") -> Iterator[str]:
    """Yield what a person reads, no line wider than 80 columns but for a reason."""
    for group, one in found.items():
        if isinstance(one, FileError):
            yield f"{group}: not fitted, {one}" + (f" ({one.hint})" if one.hint else "")
            continue
        yield f"{group}: {one.count} pieces, residual {1000 * one.residual:.2f} mm{'/s' if group == 'ramps' else ''}"
        for name, estimate in one.estimates.items():
            words, unit, factor, decimals = SHOWN[name]
            value, low, high = (f"{factor * x:.{decimals}f}" for x in (estimate.value, estimate.low, estimate.high))
            yield f"  {words:31}{value:>10} {unit:8} {low} to {high}"
        for name, why in one.unseen.items():
            yield f"  {SHOWN[name][0]}: these drives cannot show it"
            yield f"      {why}"
    yield "intervals hold with 95 %"


def _write(drives: "Sequence[Drive]", found: "dict[str, Fit | FileError]", targets: Sequence[Path]) -> None:
    from robot_bench.experiments.fitting.robot_files import errors_text, robot_text

    parameters = drives[0].parameters
    if parameters.subclass not in known_robots():
        raise UsageError(f"{parameters.subclass} is no shipped model, on which a robot file could be based")
    estimates = {
        name: estimate
        for one in found.values() if not isinstance(one, FileError)
        for name, estimate in one.estimates.items()
    }  # fmt: skip
    texts = robot_text(parameters.subclass, parameters, estimates), errors_text(parameters, estimates)
    for path, text in zip(targets, texts, strict=True):
        write_text(path, text)


def _umbmark(drives: "Sequence[Drive]", *, as_json: bool) -> None:
    from robot_bench.experiments.fitting.umbmark import umbmark

    found = umbmark(drives)
    if as_json:
        typer.echo(json.dumps(found.as_plain(), indent=2))
        return
    sys.stdout.writelines(f"{line}\n" for line in _umbmark_lines(found))


def _umbmark_lines(found: "Umbmark") -> Iterator[str]:
    yield "return error of each run, mm (ahead, to the left)"
    for one, (x, y) in zip(found.squares, found.errors(found.before), strict=True):
        yield f"  {one.name:30}{'cw ' if one.is_clockwise else 'ccw'} {1000 * x:+9.1f} {1000 * y:+9.1f}"
    yield f"{'':22}{'E_d':>9}{'E_b':>9}{'left':>9}{'right':>9}{'E_max':>9}{'largest':>9}"
    for name, correction in (
        ("as it is", found.before), ("Borenstein and Feng", found.formulas), ("least squares", found.least_squares),
    ):  # fmt: skip
        yield _correction_line(name, correction)
    for name, why in found.fit.unseen.items():
        yield f"{name}: these runs cannot show it: {why}"
    for name, estimate in found.fit.estimates.items():
        yield f"{name} is {estimate.low:.5f} to {estimate.high:.5f} with 95 %"
    before, after = 1000 * found.before.largest_m, 1000 * found.least_squares.largest_m
    yield f"largest return error {before:.1f} mm, corrected {after:.1f} mm: {before / after:.1f} times less"


def _correction_line(name: str, one: "Correction") -> str:
    left, right = one.wheels
    return (
        f"{name:22}{one.e_d:9.5f}{one.e_b:9.5f}{left:9.5f}{right:9.5f}"
        f"{1000 * one.e_max_m:6.1f} mm{1000 * one.largest_m:6.1f} mm"
    )
