"""`p2os run`: one firmware, one scenario, one run folder with its report."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer
from typer.core import TyperCommand

from p2os.cli.held_robot import hold_robot
from p2os.cli.main import EXIT_INTERRUPTED
from p2os.errors import RunFailedError, UsageError
from p2os.transport import open_url
from robot_bench.cli.gdb import debug_bench, debug_port
from robot_bench.cli.progress import RunDisplay
from robot_bench.cli.table import print_result
from robot_bench.recording.run_folder import make_next_folder
from robot_bench.remote import CAUTIOUS_ROTATION_DEG_S, CAUTIOUS_VELOCITY_MM_S
from robot_bench.run import RunResult, run_at_port, run_scenario
from robot_bench.scenario.scenario import Scenario, load_scenario

HELP = """Run a scenario: the firmware boots on an emulated BluePill and its pins drive a robot.

SCENARIO is one of those that ship (motors, sensors, encoders, dodge) or a TOML
file. What the options leave open is the scenario's. The run folder holds
the trace, the pins as VCD and for PulseView, and report.html.

Exit code: 0 all goals were met, 1 one was missed or the run failed, 2 wrong
usage or file, 130 interrupted (the run folder is complete up to there).
However a run ends, its folder says so; --out never overwrites a run without --force.

\b
Examples:
  p2os run dodge                                    120 s among obstacles, through adapter and P2OS
  p2os run dodge --mode direct --body kinematic     pins straight to the body, plan view
  p2os run motors --firmware build/mine.elf         your program, judged by that scenario
  p2os run dodge --world arena --seed 7 --json      one JSON object for a script
  p2os run dodge --realtime                         at the speed of the clock
  p2os run dodge --gdb 3333                         under GDB; the robot stands still at a halt
  p2os run dodge --port serial:/dev/ttyUSB0         drive a real Pioneer; asks first
"""


class RealtimeCommand(TyperCommand):
    """Lets `--realtime` stand without its number, which then is 1."""

    def parse_args(self, ctx: typer.Context, args: list[str]) -> list[str]:  # type: ignore[override] # typer's own class
        """Insert the number where it is missing."""
        filled = []
        for place, word in enumerate(args):
            filled.append(word)
            following = args[place + 1] if place + 1 < len(args) else ""
            if word == "--realtime" and not _is_number(following):
                filled.append("1")
        return super().parse_args(ctx, filled)


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("run", help=HELP, cls=RealtimeCommand)(run)


def run(
    scenario: Annotated[str, typer.Argument(help="Name or TOML file.", metavar="SCENARIO")],
    firmware: Annotated[Path | None, typer.Option(help="ELF, HEX or BIN in place of the scenario's.")] = None,
    mode: Annotated[str | None, typer.Option(help="direct or adapter.")] = None,
    adapter: Annotated[str | None, typer.Option(help="model or firmware: what stands in the adapter's place.")] = None,
    port: Annotated[str | None, typer.Option(help="Drive the robot at this URL, in real time.", metavar="URL")] = None,
    body: Annotated[str | None, typer.Option(help="kinematic, bullet, mujoco, or best installed.")] = None,
    world: Annotated[str | None, typer.Option(help="World, or a TOML file.")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of everything random.", min=0)] = None,
    duration: Annotated[float | None, typer.Option(help="Seconds of virtual time.", metavar="S")] = None,
    usart_baud: Annotated[
        int | None, typer.Option(help="Speed of USART1's far end; unset follows the firmware.", metavar="BAUD", min=1)
    ] = None,
    realtime: Annotated[
        float | None, typer.Option(help="Keep pace with the clock, SPEED times as fast.", metavar="[SPEED]")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Run folder; default runs/SCENARIO-NNN.", metavar="DIR")] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite the run that the --out folder holds.")] = False,
    json_output: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
    gdb: Annotated[
        int | None, typer.Option(help="Wait for GDB on this TCP port; 0 takes a free one.", metavar="PORT", min=0)
    ] = None,
    yes: Annotated[bool, typer.Option("--yes", help="With --port: do not ask before the first motion.")] = False,
    max_speed: Annotated[
        int | None, typer.Option(help="With --port: cap of the forward speed, mm/s.", metavar="MM_S", min=1)
    ] = None,
) -> None:
    """Run a scenario."""
    if realtime is not None and realtime <= 0:
        raise UsageError(f"--realtime {realtime:g} cannot be", hint="a speed is above 0; 1 is real time")
    wanted = load_scenario(scenario)
    if port is not None:
        refuse_beside_port(mode=mode, body=body, world=world, seed=seed, realtime=realtime)
    elif yes or max_speed is not None:
        raise UsageError(f"{'--yes' if yes else '--max-speed'} goes with --port only")
    wanted = wanted.with_options(
        firmware=firmware,
        mode=mode,
        adapter_core=adapter,
        body=body,
        world=world,
        seed=seed,
        duration_s=duration,
        usart_baud=usart_baud,
    )
    if port is not None:
        result = drive_port(wanted, out, port, yes=yes, max_speed=max_speed, gdb=gdb, force=force)
        end_with(result, json_output=json_output)
        return
    folder = out or make_next_folder(wanted.name)
    with RunDisplay() as display:
        if gdb is None:
            result = run_scenario(wanted, folder, speed=realtime, on_progress=display.update, force=force)
        else:
            driver = debug_bench(gdb, is_paced=realtime is not None, on_wait=display.raise_if_interrupted)
            result = run_scenario(wanted, folder, on_progress=display.update, drive=driver, force=force)
    end_with(result, json_output=json_output)


def drive_port(
    scenario: Scenario,
    out: Path | None,
    url: str,
    *,
    yes: bool,
    max_speed: int | None,
    gdb: int | None = None,
    force: bool = False,
) -> RunResult:
    """Drive the robot at a URL after asking a person.

    Raises:
        TransportError: The port cannot be opened.
        RunFailedError: The person declined.
    """
    scenario = capped(scenario, max_speed)
    transport = open_url(url)
    try:
        if not yes:
            ask(scenario, url)
        hold_robot()
        with RunDisplay() as display:
            driver = None if gdb is None else debug_port(gdb, on_wait=display.raise_if_interrupted)
            folder = out or make_next_folder(scenario.name)
            return run_at_port(scenario, folder, transport, on_progress=display.update, drive=driver, force=force)
    finally:
        transport.close()


def capped(scenario: Scenario, max_speed: int | None) -> Scenario:
    """Return the scenario with the caps of an untried program, where neither it nor the command line sets any."""
    adapter = scenario.adapter
    velocity = max_speed or adapter.max_velocity_mm_s or CAUTIOUS_VELOCITY_MM_S
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


def refuse_beside_port(**options: object) -> None:
    """Refuse what has no meaning when the robot is real.

    Raises:
        UsageError: One of the options is given (`mode` only where it is not adapter).
    """
    if options.get("mode") == "adapter":
        options.pop("mode")
    for name, value in options.items():
        if value is not None:
            raise UsageError(
                f"--{name} cannot stand beside --port: the robot at the port has its own",
                hint="leave one of the two out",
            )


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
