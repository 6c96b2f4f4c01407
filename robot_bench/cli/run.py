"""`p2os run`: one firmware, one scenario, one run folder with its report."""

import contextlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, ClassVar

import typer

from p2os.cli.captures.shown_page import NoBrowser, shown
from p2os.cli.groups import BENCH
from p2os.cli.keyboard import any_key_stops
from p2os.cli.names import bodies, body_help, urls, worlds
from p2os.cli.quantities import option
from p2os.cli.trust import Trusted, said
from p2os.errors import RunFailedError
from p2os.pioneer.body.factory import BEST, resolve_body
from p2os.toml_schema import within
from p2os.transport import open_url
from robot_bench.bench.recorded_variables import variables_of
from robot_bench.cli.debugging.gdb import gdb_port
from robot_bench.cli.names import scenario_names, setting_keys, variable_names
from robot_bench.cli.progress import RunDisplay
from robot_bench.cli.shown.live_fleet import LiveFleet
from robot_bench.cli.shown.live_run import LiveRun
from robot_bench.cli.sweep import (
    KEPT,
    SweepRow,
    as_json,
    command,
    print_sweep,
    refuse_junit,
    run_sweep,
    write_junit,
)
from robot_bench.cli.table import print_result
from robot_bench.cli.workers import Jobs, core_count
from robot_bench.networks import network_of, viewer_of
from robot_bench.recording.run_folder import make_next_folder
from robot_bench.remote import CAUTIOUS_ROTATION_DEG_S, CAUTIOUS_VELOCITY_MM_S
from robot_bench.run import RunBench, RunProgress, RunResult, run_at_port, run_scenario, run_together
from robot_bench.scenario import sweep
from robot_bench.scenario.included_files import read_setting
from robot_bench.scenario.loading import load_scenario
from robot_bench.scenario.options import ScenarioOptions
from robot_bench.scenario.scenario import Scenario
from robot_bench.scenario.sweep import MOST_RUNS, read_seeds
from simbase.command_line.gdb_option import GDB_PORT, usual_port
from simbase.command_line.help_pages import Usual, VerbPage
from simbase.command_line.program import EXIT_INTERRUPTED
from simbase.errors import UsageError
from simbase.timing import NS_PER_S, Nanos
from simbase.trust import Trust
from simbase.units import BAUD, FACTOR, PERCENT, PORT, SEED, SPEED, TIME

HELP = """Run a scenario: a BluePill program drives a robot.

The firmware boots on an emulated board, and its pins drive the robot.

SCENARIO is a shipped one (free-drive, motors, sensors, encoders, dodge,
rover, two-dodge)
or a TOML file. Options override its keys. The run folder holds the trace, the
pins as VCD and for PulseView, and report.html.

Exit code: 0 all goals were met, 1 one was missed or the run failed, 2 wrong
usage or file, 130 interrupted (the run folder is complete up to there).
The run folder records how the run ended; --out overwrites one only with --force.

\b
Examples:
  p2os run dodge                                    120 s among obstacles, through adapter and P2OS
  p2os run dodge --mode direct --body kinematic     pins straight to the body, plan view
  p2os run free-drive --firmware build/mine.elf     your program among obstacles, without goals
  p2os run dodge --world arena --seed 7 --json      one JSON object for a script
  p2os run dodge --realtime                         at the speed of the clock
  p2os run dodge --seeds 0-99 -j 2 --junit r.xml    a run a seed, two at a time; a table
  p2os run dodge --set threshold_m=0.4              another value for a scenario's key
  p2os run dodge --coverage --profile               lines, branches, cycles of the whole run
  p2os run dodge --coverage --fail-under 80         exit code 1 below 80 % of the lines
  p2os run dodge --gdb 3333                         under GDB; the robot stands still at a halt
  p2os run dodge --watch-variable dodge.state       recorded, and a plot in p2os view
  p2os run dodge --view                             live on a page in the browser
  p2os run dodge --view --gdb                       the page, and GDB at the same halt
  p2os run dodge --foxglove                         live in Foxglove or Lichtblick
  p2os run dodge --ros                              its pins as topics of ROS 2 (docs/ros.md)
  p2os run dodge --port serial:/dev/ttyUSB0         drive a real Pioneer; asks first
"""


#: Options of a scenario whose flag is not their name.
_FLAGS = {"adapter_core": "--adapter", "duration_s": "--duration", "usart_baud": "--usart-baud"}


class RunPage(VerbPage):
    """Lets some options stand without what follows them: factor 1, the usual port, or DDS."""

    usual: ClassVar[Mapping[str, Usual]] = {
        "--realtime": lambda following: () if _is_number(following) else ("1",),
        "--foxglove": lambda following: viewer_of("foxglove").place_before(following),
        "--gdb": usual_port,
        "--ros": lambda following: network_of("ros").place_before(following),
    }


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("run", help=HELP, rich_help_panel=BENCH, cls=RunPage)(run)


def run(
    scenario: Annotated[
        str, typer.Argument(help="Name or TOML file.", metavar="SCENARIO", autocompletion=scenario_names)
    ],
    firmware: Annotated[
        Path | None, typer.Option(help="ELF, HEX or BIN in place of the scenario's.", metavar="FILE")
    ] = None,
    mode: Annotated[str | None, typer.Option(help="How the pins reach the robot.", metavar="direct|adapter")] = None,
    adapter: Annotated[
        str | None, typer.Option(help="What stands in the adapter's place.", metavar="model|firmware")
    ] = None,
    port: Annotated[
        str | None, typer.Option(help="Drive the robot at this URL, in real time.", metavar="URL", autocompletion=urls)
    ] = None,
    body: Annotated[
        str | None,
        typer.Option(help=body_help(), metavar="BODY", autocompletion=bodies),
    ] = None,
    world: Annotated[
        str | None, typer.Option(help="World, or a TOML file.", metavar="WORLD|FILE", autocompletion=worlds)
    ] = None,
    seed: Annotated[int | None, option(SEED, "--seed", purpose="Of everything random.", least="0")] = None,
    seeds: Annotated[str | None, typer.Option(help="A run for each: 0-99, or 1,5,10-19.", metavar="SEEDS")] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option(
            "--set", help="A key of the scenario; repeatable.", metavar="KEY=VALUE", autocompletion=setting_keys
        ),
    ] = None,
    jobs: Jobs = None,
    junit: Annotated[Path | None, typer.Option(help="Write what CI reads.", metavar="FILE")] = None,
    keep: Annotated[
        str, typer.Option(help="Of many runs, which folders stay.", metavar="failures|all|none")
    ] = "failures",
    duration_ns: Annotated[
        Nanos | None, option(TIME, "--duration", purpose="How much virtual time.", above_zero=True)
    ] = None,
    usart_baud: Annotated[
        int | None,
        option(BAUD, "--usart-baud", purpose="Speed of USART1's far end; unset follows the firmware.", above_zero=True),
    ] = None,
    record: Annotated[
        str | None, typer.Option(help="Buses to record too: spi1 spi2 i2c1 i2c2 can usb.", metavar="BUS,BUS")
    ] = None,
    realtime: Annotated[
        float | None,
        option(
            FACTOR,
            "--realtime",
            purpose="Keep pace with the clock, FACTOR times as fast.",
            above_zero=True,
            metavar="[FACTOR]",
        ),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Run folder; default runs/SCENARIO-NNN.", metavar="FOLDER")] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite the run that the --out folder holds.")] = False,
    trust: Trusted = False,
    json_output: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
    coverage: Annotated[bool, typer.Option("--coverage", help="Write which lines and branches ran.")] = False,
    fail_under: Annotated[
        float,
        option(
            PERCENT,
            "--fail-under",
            purpose="With --coverage: least share of lines.",
            shown="0%",
            least="0%",
            most="100%",
        ),
    ] = 0.0,
    profile: Annotated[bool, typer.Option("--profile", help="Write where the cycles went.")] = False,
    watch_variable: Annotated[
        list[str] | None,
        typer.Option(
            help="Record a variable of the program; repeatable.", metavar="NAME", autocompletion=variable_names
        ),
    ] = None,
    gdb: Annotated[
        int | None,
        option(
            PORT,
            "--gdb",
            purpose=f"Wait for GDB on this TCP port, {GDB_PORT} if none is named; 0 takes a free one.",
            metavar="[PORT]",
            least="0",
            most="65535",
        ),
    ] = None,
    ros: Annotated[
        str | None,
        typer.Option(help="Be a ROS 2 node, at real time: dds, dds:42, zenoh@HOST.", metavar="[WHERE]"),
    ] = None,
    inputs: Annotated[
        Path | None, typer.Option(help="Do again what came in from ROS in that run.", metavar="RUN")
    ] = None,
    view: Annotated[bool, typer.Option("--view", help="Show it live on a page in the browser, at real time.")] = False,
    no_browser: NoBrowser = False,
    foxglove: Annotated[
        str | None,
        typer.Option(help="Show it live to Foxglove or Lichtblick, at real time.", metavar="[PORT|HOST:PORT]"),
    ] = None,
    foxglove_origin: Annotated[
        list[str] | None,
        typer.Option(help="With --foxglove: a page that may look (https://HOST); repeatable.", metavar="ORIGIN"),
    ] = None,
    yes: Annotated[bool, typer.Option("--yes", help="With --port: do not ask before the first motion.")] = False,
    max_speed: Annotated[
        float | None, option(SPEED, "--max-speed", purpose="With --port: cap of the forward speed.", least="1mm/s")
    ] = None,
) -> None:
    """Run a scenario."""
    settings = [read_setting(text) for text in set_ or ()]
    wanted = load_scenario(scenario, firmware=firmware, settings=settings, trust=said(trust))
    if coverage or profile:
        refuse(
            {"coverage and --profile": port},
            "cannot stand beside --port: they cost more time than a real robot gives",
            hint="run the same firmware without --port",
        )
        refuse(
            {"coverage and --profile": gdb},
            "cannot stand beside --gdb: what a debugger steps back over would count twice",
            hint="leave one of the two out",
        )
    if fail_under and not coverage:
        raise UsageError("--fail-under goes with --coverage only", hint="add --coverage")
    if port is not None:
        theirs = {"mode": None if mode == "adapter" else mode, "body": body, "world": world, "seed": seed}
        refuse(
            {**theirs, "realtime": realtime},
            "cannot stand beside --port: the robot at the port has its own",
            hint="leave one of the two out",
        )
    elif yes or max_speed is not None:
        raise UsageError(f"{'--yes' if yes else '--max-speed'} goes with --port only")
    refuse_beside("watch-variable", watch_variable or None, port=port, robots=wanted.robots or None)
    options: ScenarioOptions = {
        "firmware": firmware,
        "mode": mode,
        "adapter_core": adapter,
        "body": body,
        "world": world,
        "seed": seed,
        "duration_s": None if duration_ns is None else duration_ns / NS_PER_S,
        "usart_baud": usart_baud,
        "record": record,
    }
    wanted = wanted.with_options(**options)
    measured = coverage or profile or None
    refuse_beside("ros", ros, port=port, gdb=gdb, coverage=measured, inputs=inputs)
    refuse_beside("inputs", inputs, port=port, gdb=gdb, coverage=measured)
    if foxglove_origin and foxglove is None:
        raise UsageError("--foxglove-origin goes with --foxglove only", hint="add --foxglove")
    refuse_beside("foxglove", foxglove, port=port, gdb=gdb, ros=ros, inputs=inputs, robots=wanted.robots or None)
    page = view or None
    refuse_beside("view", page, port=port, ros=ros, inputs=inputs, foxglove=foxglove)
    if is_sweep(wanted, seeds=seeds, seed=seed, port=port):
        alone = {
            "port": port,
            "ros": ros,
            "inputs": inputs,
            "foxglove": foxglove,
            "view": page,
            "gdb": gdb,
            "realtime": realtime,
            "watch-variable": watch_variable or None,
        }
        refuse(
            {**alone, "coverage": coverage or None, "profile": profile or None},
            "cannot stand beside a sweep: it is for one run",
            hint="--seed and --set take one run of it",
        )
        rows = sweep_rows(scenario, wanted, options, seeds, said(trust))
        run_many(rows, out, jobs=jobs or core_count(), kept=keep, junit=junit, json_output=json_output, force=force)
        return
    many = "--seeds 0-9, or a scenario with [sweep]"
    refuse({"jobs": jobs, "junit": junit}, "goes with many runs only", hint=many)
    if port is not None:
        result = drive_port(wanted, out, port, yes=yes, max_speed_mps=max_speed, gdb=gdb, force=force)
        end_with(result, json_output=json_output)
        return
    names = watch_variable or ()
    variables_of(wanted.firmware, names)  # what is none is said before there is a folder
    folder = out or make_next_folder(wanted.name)
    # Who looks on from outside lives in real time.
    pace = None if page else realtime or (None if ros is None and foxglove is None else 1.0)
    with RunDisplay() as display:
        if wanted.robots and view and measured is None and gdb is None:
            result = run_viewed_fleet(wanted, folder, realtime or 1.0, display, force=force, is_opened=not no_browser)
        elif gdb is None or view:
            with (
                viewed(wanted, realtime or 1.0, display, names, is_opened=not no_browser, gdb=gdb) if view
                else driven(wanted, ros=ros, inputs=inputs, foxglove=foxglove, origins=foxglove_origin or ())
            ) as driver:  # fmt: skip
                result = run_scenario(
                    wanted, folder, speed=pace, on_progress=display.update, force=force, drive=driver,
                    coverage=coverage, profile=profile, fail_under=fail_under, explained=True,
                    variables=names,
                )  # fmt: skip
        else:
            from robot_bench.cli.debugging.gdb import debug_bench

            driver = debug_bench(gdb, is_paced=realtime is not None, on_wait=display.raise_if_interrupted)
            result = run_scenario(wanted, folder, on_progress=display.update, drive=driver, force=force,
                                  variables=names)  # fmt: skip
    end_with(result, json_output=json_output)


def refuse(options: Mapping[str, object], why: str, *, hint: str) -> None:
    """Refuse the first of some options, by their names, that is given.

    Raises:
        UsageError: It is not None.
    """
    for name, value in options.items():
        if value is not None:
            raise UsageError(f"--{name} {why}", hint=hint)


def refuse_beside(name: str, given: object, **others: object) -> None:
    """Refuse what cannot stand beside an option that is given: whatever of `others` is not None either.

    Raises:
        UsageError: Both are there.
    """
    for other, value in others.items():
        what = "several robots" if other == "robots" else f"--{other}"
        if value is not None:
            refuse({name: given}, f"cannot stand beside {what}", hint="leave one of the two out")


@contextlib.contextmanager
def driven(
    scenario: Scenario, *, ros: str | None, inputs: Path | None, foxglove: str | None, origins: Sequence[str] = ()
) -> Iterator[RunBench | None]:
    """Yield what runs a bench as a node of ROS, with what came in from it before, or before a viewer; None: the run.

    Raises:
        UsageError: The scenario has no pins of the pin-out, or a place is none.
        MissingDependencyError, TransportError, FileError: As of `Network` and `Viewer`.
    """
    if foxglove is not None:
        say = "open {} in Foxglove or Lichtblick".format
        viewer = viewer_of("foxglove")
        with viewer.live_scene(scenario, foxglove, lambda url: typer.echo(say(url), err=True), origins) as driver:
            yield driver
        return
    if ros is None and inputs is None:
        yield None
        return
    network = network_of("ros")
    network.refuse_without_pins(scenario)
    if inputs is not None:
        yield network.with_inputs(inputs)
        return
    with network.met(ros or "") as driver:
        yield driver


@contextlib.contextmanager
def viewed(
    scenario: Scenario,
    speed: float,
    display: RunDisplay,
    variables: Sequence[str] = (),
    *,
    is_opened: bool,
    gdb: int | None = None,
) -> Iterator[RunBench]:
    """Yield what runs a bench while a page shows and controls it, at first at a speed and with some variables.

    Raises:
        UsageError, MissingDependencyError: As of `shown`.
        BluePillError: The port for GDB beside it is taken.
    """
    with gdb_port(gdb, scenario) as port:
        live = LiveRun(scenario, speed=speed, variables=variables, on_wait=display.raise_if_interrupted, gdb=port)
        with shown(live.source, is_opened=is_opened):
            yield live.drive


def run_viewed_fleet(
    scenario: Scenario, folder: Path, speed: float, display: RunDisplay, *, force: bool, is_opened: bool
) -> RunResult:
    """Run robots that share a world while a page shows them.

    Raises:
        UsageError, MissingDependencyError: As of `shown`.
    """
    live = LiveFleet(scenario, speed=speed, on_wait=display.raise_if_interrupted)
    with shown(live.source, is_opened=is_opened):
        return run_together(scenario, folder, on_progress=display.update, force=force, drive=live.drive)


def is_sweep(scenario: Scenario, *, seeds: str | None, seed: int | None, port: str | None) -> bool:
    """Tell whether more than one run is asked for; at a port only where the command line says so."""
    return seeds is not None or (port is None and (bool(scenario.axes) or (bool(scenario.seeds) and seed is None)))


def sweep_rows(
    name: str, wanted: Scenario, options: ScenarioOptions, seeds: str | None, trust: Trust
) -> list[SweepRow]:
    """Return every run of a sweep, each checked.

    Args:
        name: As it was asked for.
        wanted: The scenario as its file says it.
        options: What the command line sets.
        seeds: As typed; None: those of the scenario.
        trust: Which code that the scenario names may be executed.

    Raises:
        UntrustedError: A value of a parameter is code, and nobody has said that it may be executed.
        ScenarioError: A value of a parameter cannot be.
        UsageError: An option takes the place of a parameter, or there are too many runs.
    """
    seed = options.get("seed")
    if seeds is not None and seed is not None:
        raise UsageError("--seeds cannot stand beside --seed", hint="leave one of the two out")
    chosen = read_seeds(seeds) if seeds is not None else wanted.seeds if seed is None else (seed,)
    given = {key: value for key, value in options.items() if value is not None and key != "seed"}
    swept = {axis.key for axis in wanted.axes}
    for key in (*given, *(["seed"] if chosen else [])):
        if key in swept:
            raise UsageError(f"the scenario sweeps {key}, and an option sets it", hint=f"--set {key}=VALUE ends that")
    rows: list[SweepRow] = []
    for settings in sweep.rows(wanted.axes):
        if len(rows) >= MOST_RUNS:
            raise UsageError(f"more than {MOST_RUNS} runs", hint="fewer seeds, or a wider step")
        firmware = options.get("firmware")
        row = load_scenario(
            name, firmware=None if firmware is None else Path(firmware), settings=(*wanted.settings, *settings),
            set_by=str(within(wanted.where, "sweep")), trust=trust,
        ).with_options(**options)  # fmt: skip
        for one in chosen or (row.seed,):
            again = command(name, _words(given, row, trust), (*wanted.settings, *settings), one)
            rows.append(SweepRow(row.with_options(seed=one), settings, again))
    return rows


def _words(given: Mapping[str, object], row: Scenario, trust: Trust) -> list[str]:
    """Return the options that make a row again, on whatever machine: the best body by its name."""
    named = {**given, "body": resolve_body(row.body)} if row.body == BEST else given
    words = [word for key, value in named.items() for word in (_FLAGS.get(key, f"--{key}"), _typed(key, value))]
    return [*words, *(["--trust"] if trust.everything else [])]


def run_many(
    rows: Sequence[SweepRow],
    out: Path | None,
    *,
    jobs: int | None,
    kept: str,
    junit: Path | None,
    json_output: bool,
    force: bool,
) -> None:
    """Run all rows, print what came of them, and end the command with its exit code.

    Raises:
        UsageError: `kept` is no word for what is kept.
        FileError: The JUnit file cannot be written.
    """
    if kept not in KEPT:
        raise UsageError(f"there is no --keep {kept!r}", hint=" or ".join(f"--keep {word}" for word in KEPT))
    if junit is not None:
        refuse_junit(junit)
    with RunDisplay(is_shown=False) as display:
        done = run_sweep(
            rows,
            out,
            jobs=jobs or core_count(),
            kept=kept,
            force=force,
            raise_if_interrupted=display.raise_if_interrupted,
        )
    if junit is not None:
        write_junit(done, junit)
    if json_output:
        typer.echo(json.dumps(as_json(done), sort_keys=True))
    else:
        print_sweep(done)
    if done.was_interrupted:
        raise typer.Exit(EXIT_INTERRUPTED)
    if done.failed:
        raise typer.Exit(1)


def _typed(key: str, value: object) -> str:
    """Return the value of an option as one types it."""
    return f"{value:.9f}".rstrip("0").rstrip(".") + "s" if key == "duration_s" else str(value)


def drive_port(
    scenario: Scenario,
    out: Path | None,
    url: str,
    *,
    yes: bool,
    max_speed_mps: float | None,
    gdb: int | None = None,
    force: bool = False,
) -> RunResult:
    """Drive the robot at a URL after asking a person, who stops it by any key.

    Raises:
        TransportError: The port cannot be opened.
        RunFailedError: The person declined.
    """
    from p2os.cli.held_robot import hold_robot
    from robot_bench.cli.debugging.gdb import debug_port

    scenario = capped(scenario, max_speed_mps)
    transport = open_url(url)
    try:
        if not yes:
            ask(scenario, url)
        hold_robot()
        with RunDisplay() as display, any_key_stops() as raise_if_pressed:
            driver = None if gdb is None else debug_port(gdb, on_wait=display.raise_if_interrupted)
            folder = out or make_next_folder(scenario.name)

            def look(progress: RunProgress) -> None:
                raise_if_pressed()
                display.update(progress)

            return run_at_port(scenario, folder, transport, on_progress=look, drive=driver, force=force)
    finally:
        transport.close()


def capped(scenario: Scenario, max_speed_mps: float | None) -> Scenario:
    """Return the scenario with the caps of an untried program, where neither it nor the command line sets any."""
    adapter = scenario.adapter
    asked_mm_s = None if max_speed_mps is None else round(max_speed_mps * 1000)
    velocity = asked_mm_s or adapter.max_velocity_mm_s or CAUTIOUS_VELOCITY_MM_S
    rotation = adapter.max_rotation_deg_s or CAUTIOUS_ROTATION_DEG_S
    return replace(scenario, adapter=replace(adapter, max_velocity_mm_s=velocity, max_rotation_deg_s=rotation))


def ask(scenario: Scenario, url: str) -> None:
    """Ask whether the robot may move.

    Raises:
        RunFailedError: The answer is no, or nobody is there to answer.
    """
    adapter = scenario.adapter
    question = (
        f"{scenario.firmware.name} will move the robot at {url}, at most {adapter.max_velocity_mm_s} mm/s and "
        f"{adapter.max_rotation_deg_s} deg/s. Is it free to move?"
    )
    try:
        agreed = typer.confirm(question, err=True)
    except typer.Abort:
        agreed = False
    if not agreed:
        raise RunFailedError("nothing was sent to the robot: nobody said yes", hint="--yes says it beforehand")


def end_with(result: RunResult, *, json_output: bool) -> None:
    """Print a result and end the command with its exit code."""
    if json_output:
        typer.echo(json.dumps(result.outcome, sort_keys=True))
    else:
        print_result(result)
    if result.was_interrupted:
        raise typer.Exit(EXIT_INTERRUPTED)
    if not result.passed:
        raise typer.Exit(1)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
