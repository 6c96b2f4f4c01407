"""How the verbs that show captures choose units and layout: `--robot`, `--profile`, `--dir`.

Left open, both are found in the capture itself: the robot gives its model in
answer to SYNC2, and the model implies which firmware family it runs.
"""

from typing import Annotated

import typer

from p2os.capture import Capture, Direction, Reading, frame_chunks
from p2os.cli.names import robots
from p2os.protocol.frames import Frame
from p2os.protocol.packets import IDENTITY_KIND, Identity
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import HEAD_BYTES, READING_BYTES, SIP_KINDS
from p2os.robots.parameters import ParametersError, RobotParameters, load_parameters
from simbase.errors import UsageError

RobotForUnits = Annotated[
    str,
    typer.Option(
        "--robot", help="Robot model, or a TOML file, for units; default: by the capture, else p2dx.",
        metavar="MODEL|FILE", autocompletion=robots, show_default=False,
    ),
]  # fmt: skip
FAMILIES = "|".join(profile.value for profile in Profile)
ProfileForLayouts = Annotated[
    Profile | None,
    typer.Option("--profile", help="Firmware family, for layouts; default: as the packets look.", metavar=FAMILIES),
]
DEFAULT_ROBOT = "p2dx"


def direction_of(text: str) -> Direction | None:
    """Return the direction that `--dir` names, None for auto.

    Raises:
        UsageError: It names something else.
    """
    if text == "auto":
        return None
    try:
        return Direction(text)
    except ValueError as error:
        raise UsageError(f"--dir {text!r} is none of auto, c2r, r2c", hint="c2r: sent by the client") from error


def reading_of(capture: Capture, *, robot: str = "", profile: Profile | None = None) -> Reading:
    """Return how to read a capture.

    Args:
        capture: What is to be read.
        robot: Model or file; empty to look into the capture.
        profile: Firmware family; None to look into the capture.

    Raises:
        ParametersError: There is no such model or file.
    """
    subclass, guessed = _look(capture) if not robot or profile is None else ("", Profile.P2OS)
    parameters = load_parameters(robot) if robot else _parameters(subclass)
    return Reading(profile=profile or guessed, parameters=parameters)


def _parameters(subclass: str) -> RobotParameters:
    try:
        return load_parameters(subclass or DEFAULT_ROBOT)
    except ParametersError:
        return load_parameters(DEFAULT_ROBOT)


def _look(capture: Capture) -> tuple[str, Profile]:
    """Return the model and the firmware family that a capture shows.

    A SIP longer than its sonar readings need has the tail that only ARCOS sends;
    AROS and P2OS have the same shape.
    """
    subclass, profile = "", Profile.P2OS
    for chunk in frame_chunks(capture.chunks):
        if chunk.direction is Direction.TO_ROBOT or len(chunk.data) < 6 or chunk.data[:2] != b"\xfa\xfb":
            continue
        kind, data = chunk.data[3], chunk.data[4:-2]
        if kind == IDENTITY_KIND and data:
            subclass = Identity.from_frame(Frame(chunk.data[3:-2])).subclass.lower()
        elif kind in SIP_KINDS and len(data) >= HEAD_BYTES - 1:
            if len(data) > HEAD_BYTES - 1 + READING_BYTES * data[18]:
                profile = Profile.ARCOS
            if subclass:
                break
    return subclass, profile
