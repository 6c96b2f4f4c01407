"""`p2os drive`: move a robot a way, an angle, or at a speed for a time, and stop it."""

import contextlib
import json
import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated

import typer

from p2os.cli.groups import ROBOTS
from p2os.cli.held_robot import RobotWatch, held, say_what_is_beyond
from p2os.cli.names import ReportedModel, RobotUrl
from p2os.cli.quantities import option
from p2os.client import MotionResult, Robot, RobotState
from simbase.errors import UsageError
from simbase.timing import NS_PER_S, Nanos
from simbase.units import ANGLE, LENGTH, SPEED, TIME, TURN_RATE

HELP = """Drive a robot a distance, an angle or for a time, then stop it.

The distance comes first, then the angle; each ends when the robot has arrived.
With --for, the speeds are held for a time. Numbers need units. On a signal, an
error or a lost link, the robot stops first.

\b
Examples:
  p2os drive tcp:127.0.0.1:8101 --forward 0.5m              half a metre forward
  p2os drive URL --forward -20cm --vel 100mm/s              back, slowly
  p2os drive URL --forward 1m --turn 90deg                  forward, then left
  p2os drive URL --vel 0.2m/s --turn-rate 15deg/s --for 3s  an arc for three seconds
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveRequest:
    """What is to be done, in SI units.

    Raises:
        UsageError: The options do not go together.
    """

    forward_m: float | None = None
    turn_rad: float | None = None
    speed_mps: float | None = None
    rate_radps: float | None = None
    lasts_ns: Nanos | None = None

    def __post_init__(self) -> None:
        has_way = self.forward_m is not None or self.turn_rad is not None
        has_speed = self.speed_mps is not None or self.rate_radps is not None
        if not has_way and not has_speed:
            raise UsageError("nothing to do", hint="--forward 0.5m, --turn 90deg, or --vel 0.2m/s --for 2s")
        if has_way and self.lasts_ns is not None:
            raise UsageError("--for goes with speeds only", hint="--vel 0.2m/s --for 2s")
        if not has_way and self.lasts_ns is None:
            raise UsageError("a speed without an end", hint="add --for 2s, or a way: --forward 0.5m")
        for name, limit, is_needed in (("--vel", self.speed_mps, self.forward_m), ("--turn-rate", self.rate_radps,
                                                                                   self.turn_rad)):  # fmt: skip
            if has_way and limit is not None and (is_needed is None or limit <= 0):
                what = "has nothing to limit" if is_needed is None else "must be positive: the way gives the direction"
                raise UsageError(f"{name} {what}", hint="p2os drive --help")


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("drive", help=HELP, rich_help_panel=ROBOTS)(drive)


def drive(
    url: RobotUrl,
    forward_m: Annotated[
        float | None,
        option(LENGTH, "--forward", purpose="How far, negative backwards.", least="-1000m", most="1000m"),
    ] = None,
    turn_rad: Annotated[
        float | None,
        option(ANGLE, "--turn", purpose="How far round, positive to the left.", least="-36000deg", most="36000deg"),
    ] = None,
    speed_mps: Annotated[float | None, option(SPEED, "--vel", purpose="Speed: held with --for, else the most.")] = None,
    rate_radps: Annotated[float | None, option(TURN_RATE, "--turn-rate", purpose="Turning speed, likewise.")] = None,
    lasts_ns: Annotated[
        Nanos | None, option(TIME, "--for", purpose="How long the speeds are held.", above_zero=True)
    ] = None,
    robot: ReportedModel = "",
    json_output: Annotated[bool, typer.Option("--json", help="Print a JSON object.")] = False,
) -> None:
    """Move a robot."""
    plan = DriveRequest(
        forward_m=forward_m, turn_rad=turn_rad, speed_mps=speed_mps, rate_radps=rate_radps, lasts_ns=lasts_ns,
    )  # fmt: skip
    with held(Robot(url, model=robot or None, reconnect=False), moves=True) as client:
        say_what_is_beyond(client.limits, speed_mps=plan.speed_mps, rate_radps=plan.rate_radps)
        steps = carry_out(plan, client)
        pose = client.pose
    if json_output:
        end = {"x_m": round(pose.x_m, 6), "y_m": round(pose.y_m, 6), "heading_rad": round(pose.heading_rad, 6)}
        typer.echo(json.dumps({"steps": steps, "pose": end}))
        return
    typer.echo(f"at x {pose.x_m:.3f} m, y {pose.y_m:.3f} m, heading {math.degrees(pose.heading_rad):.1f} deg")


def carry_out(plan: DriveRequest, robot: Robot) -> list[dict[str, object]]:
    """Carry out a plan, each step with a line on stderr; return the steps in SI units.

    Raises:
        MotionError, LinkLostError, MotorsDisabledError: The robot did not arrive; it was stopped.
    """
    steps: list[dict[str, object]] = []
    if plan.lasts_ns is not None:
        forward_mps, turn_radps = plan.speed_mps or 0.0, plan.rate_radps or 0.0
        what = f"hold {forward_mps:.2f} m/s, {math.degrees(turn_radps):.0f} deg/s"
        watch = RobotWatch(robot, what, moves=bool(forward_mps or turn_radps))
        robot.set_velocity(forward_mps, turn_radps)
        with progress(robot, "holding"):
            watch.wait(plan.lasts_ns)
        robot.stop()
        steps.append({"what": "hold", "forward_mps": forward_mps, "turn_radps": turn_radps,
                      "took_s": plan.lasts_ns / NS_PER_S})  # fmt: skip
        _wait_until_it_stands(robot)
    if plan.forward_m is not None:
        with progress(robot, f"driving {plan.forward_m:.3f} m:"):
            result = robot.drive(plan.forward_m, speed_mps=plan.speed_mps)
        steps.append(_step("drive", "m", result))
        sys.stderr.write(f"drove {result.reached:.3f} m of {result.asked:.3f} m in {result.took_ns / NS_PER_S:.1f} s\n")
    if plan.turn_rad is not None:
        with progress(robot, f"turning {math.degrees(plan.turn_rad):.1f} deg:"):
            result = robot.turn(plan.turn_rad, speed_radps=plan.rate_radps)
        steps.append(_step("turn", "rad", result))
        sys.stderr.write(
            f"turned {math.degrees(result.reached):.1f} deg of {math.degrees(result.asked):.1f} deg "
            f"in {result.took_ns / NS_PER_S:.1f} s\n"
        )
    return steps


@contextlib.contextmanager
def progress(robot: Robot, what: str) -> Iterator[None]:
    """Draw where the robot is on a terminal, a line over itself, while it moves; elsewhere nothing."""
    if not sys.stderr.isatty():
        yield
        return
    start = robot.pose

    def show(state: RobotState) -> None:
        pose = state.pose
        way_m, turned = (
            math.hypot(pose.x_m - start.x_m, pose.y_m - start.y_m),
            math.degrees(pose.heading_rad - start.heading_rad),
        )
        speeds = f"{state.forward_mps:+.2f} m/s {math.degrees(state.turn_radps):+.0f} deg/s"
        sys.stderr.write(f"\r\x1b[K{what} {way_m:.3f} m, {turned:+.1f} deg  {speeds}")

    unsubscribe = robot.on_state(show)
    try:
        yield
    finally:
        unsubscribe()
        sys.stderr.write("\r\x1b[K")


def _step(what: str, unit: str, result: MotionResult) -> dict[str, object]:
    return {
        "what": what,
        f"asked_{unit}": round(result.asked, 6),
        f"reached_{unit}": round(result.reached, 6),
        "took_s": round(result.took_ns / NS_PER_S, 3),
    }


def _wait_until_it_stands(robot: Robot) -> None:
    """Return when the wheels stand in two packets in a row, or after a second more than any Pioneer needs."""
    standing = 0
    for _ in range(50):
        state = robot.next_state()
        standing = standing + 1 if abs(state.left_mps) < 0.005 and abs(state.right_mps) < 0.005 else 0
        if standing >= 2:
            return
