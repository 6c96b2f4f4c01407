"""Programs that do anything with a robot over lines of any sort: what is sent and told, and when, as approved."""

import math
import random
from collections.abc import Callable, Iterator

from p2os.client.goals import DriveAxis, MotionGoal, TurnAxis
from p2os.client.robot_state import RobotPose
from p2os.client.settings import ClientSettings
from p2os.pioneer.controller import Pioneer
from p2os.protocol.commands import Command
from p2os.protocol.commands import CommandNumber as C
from p2os.protocol.profiles import Profile
from simbase.errors import P2osError
from tests.p2os.client.client_rig import MS, Rig, free_pioneer, new_pioneer
from tests.tools.suite.approved import Trace, judge_of, refusal, said

USUAL = ClientSettings()
COMMANDS = (
    C.SETV, C.SETA, C.SONAR, C.BUMPSTALL, C.VEL2, C.ROTATE, C.SETO, C.CONFIG, C.ENABLE, C.MOVE, C.HEAD, C.DHEAD, C.VEL,
    C.RVEL, C.STOP, C.E_STOP, C.PTUPOS,
)  # fmt: skip
WORDS = ("stop-button", "wheel-blocked left", "bumper front 2", "line-noise 0.002", "low-battery 10.9")


def one_act(draw: random.Random, rig: Rig, goals: list[MotionGoal]) -> None:  # noqa: C901, PLR0912 - a table of acts
    """Do one thing that a program, its user or the world may do."""
    core, now = rig.core, rig.now
    match draw.randrange(24):
        case 0 | 1 | 2 | 3:
            core.set_velocity(draw.choice((0.0, 0.1, 0.3, -0.2, 9.0)), draw.choice((0.0, 0.0, 0.5, -1.0, 9.0)), now)
        case 4 | 5:
            axis = DriveAxis(draw.choice((0.4, -0.2, 0.0, 0.01)))
            goals.append(core.begin_goal(axis, draw.choice((None, 500 * MS)), draw.choice((None, 0.1)), now))
        case 6 | 7:
            turn = TurnAxis(math.radians(draw.choice((30, -90, 0, 200))))
            goals.append(core.begin_goal(turn, None, draw.choice((None, 0.4)), now))
        case 8:
            core.stop(now, at_once=draw.random() < 0.5)
        case 9:
            core.enable(draw.random() < 0.7, now)
        case 10 if goals:
            core.cancel_goal(goals[-1], now)
        case 11:
            core.set_pose(RobotPose(x_m=1.0, y_m=-2.0, heading_rad=draw.uniform(-3, 3)))
        case 12 | 20 | 21:
            number = draw.choice(COMMANDS)
            core.send(Command(number, draw.choice((0, 1, 100, 300, -80))), now)
        case 13:
            core.take_gap(draw.choice((100, 900, 2500)) * MS, now)
        case 14:
            rig.pull()
        case 15:
            rig.reboot()
        case 16:
            rig.is_cut = not rig.is_cut
        case 17 | 18:
            rig.pioneer.do(f"{draw.choice(('fault', 'clear'))} {draw.choice(WORDS)}", now)
        case 19:
            core.close(now)


def life(draw: random.Random, rig: Rig, acts: int) -> Iterator[str]:
    """Yield what a program and its robot say to each other, and what the program is told."""
    goals: list[MotionGoal] = []
    rig.connect()
    since, heard = 0, 0
    for number in range(acts):
        if number % 6 == 5:
            rig.plug()
            rig.is_cut = False
            rig.core.connect(rig.now)
        try:
            one_act(draw, rig, goals)
        except P2osError as error:
            yield refusal(error)
        (rig.living if draw.random() < 0.7 else rig.run)(draw.choice((0.02, 0.15, 0.4, 1.1)))
        yield said([(at // MS, command.number, command.argument) for at, command in rig.sent[since:]])
        yield said([item for item in rig.news[heard:] if item in rig.notices() or item is rig.states[-1]])
        yield said((rig.core.link, rig.core.baud, rig.core.stats, rig.core.commanded, rig.core.is_quiet, rig.wheels))
        yield said((rig.core.limits, rig.core.next_deadline(), [(goal.reached, goal.ended) for goal in goals[-2:]]))
        since, heard = len(rig.sent), len(rig.news)


def walk_of(
    make: Callable[[], Pioneer],
    acts: int,
    chosen: ClientSettings = USUAL,
    wire: str = "perfect",
    baud: int | None = None,
) -> Trace:
    return lambda draw: life(draw, Rig(settings=chosen, wire=wire, seed=3, baud=baud, pioneer=make()), acts)


TRACES: dict[str, Trace] = {
    "over TCP": walk_of(free_pioneer, 160),
    "among walls": walk_of(lambda: new_pioneer(crowded=True), 90, ClientSettings(deadman_ns=None)),
    "at a port": walk_of(lambda: free_pioneer("p3dx-sh", profile=Profile.ARCOS), 100, baud=9600),
    "on a bad line": walk_of(free_pioneer, 60, ClientSettings(auto_enable=False, plausibility_ns=400 * MS), "garbling"),
    "late": walk_of(lambda: free_pioneer("p2at8", profile=Profile.AROS), 60, ClientSettings(reconnect=False), "late"),
    "in pieces": walk_of(lambda: free_pioneer("p3at-sh", profile=Profile.ARCOS), 60, wire="byte by byte"),
    "with losses": walk_of(free_pioneer, 60, ClientSettings(deadman_ns=None, plausibility_ns=200 * MS), "lossy", 9600),
}
test_what_was_approved_is_shown = judge_of(__file__, TRACES)
