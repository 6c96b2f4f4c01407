"""What both skins do when a robot is made, not found, or has ended a motion."""

from p2os.client.core import RobotCore
from p2os.client.goals import Goal, MotionResult
from p2os.client.notices import GaveUp
from p2os.client.problems import ConnectError, LinkLostError, MotionError, NoAnswerError
from p2os.client.settings import ClientSettings
from p2os.client.snapshots import Link
from p2os.errors import TransportError
from p2os.parameters import RobotParameters, load_parameters
from p2os.timing import NS_PER_S
from p2os.transport.url import SerialUrl, parse_url


def core_for(
    url: str,
    *,
    model: str | RobotParameters | None,
    auto_enable: bool,
    reconnect: bool,
    deadman_s: float | None,
    settings: ClientSettings | None,
) -> tuple[RobotCore, int | None]:
    """Return a client's core, and the speed at which its line is opened (None: it has none).

    Raises:
        UsageError: The URL or a setting is none.
        ParametersError: There is no such model.
    """
    place = parse_url(url)
    deadman_ns = None if deadman_s is None else round(deadman_s * NS_PER_S)
    chosen = settings or ClientSettings(auto_enable=auto_enable, reconnect=reconnect, deadman_ns=deadman_ns)
    parameters = load_parameters(model) if isinstance(model, str) else model
    return RobotCore(chosen, parameters=parameters), place.baud if isinstance(place, SerialUrl) else None


def not_found(core: RobotCore) -> ConnectError:
    """Return the error that says why no session could be opened."""
    problem = core.problem
    hint = problem.hint if isinstance(problem, GaveUp) else None
    return ConnectError(problem.reason if problem is not None else f"not connected ({core.link.value})", hint=hint)


def not_connected(core: RobotCore) -> LinkLostError:
    """Return the error that says why there is no session any more."""
    reason = f": {core.problem.reason}" if core.problem is not None else ""
    return LinkLostError(f"no packet comes ({core.link.value}){reason}", hint="is the robot on, and the cable in?")


def no_answer(core: RobotCore, kind: type, timeout_s: float) -> TransportError:
    """Return the error of a request that nothing answered."""
    if core.link is not Link.OPEN:
        return not_connected(core)
    return NoAnswerError(f"no {kind.__name__} within {timeout_s:g} s", hint="does this robot have the device?")


def motion_result(goal: Goal, core: RobotCore) -> MotionResult:
    """Return what a goal came to, or raise why it did not arrive.

    Raises:
        LinkLostError: The link was lost on the way.
        MotionError: Anything else.
    """
    ended = goal.ended
    if ended is None:
        raise MotionError(f"{goal.axis.what}: the client was closed")
    if ended.problem is None:
        return MotionResult(ended.asked, ended.reached, ended.took_ns)
    text = f"{ended.what}: {ended.problem}; reached {ended.reached:.3f}"
    if core.link is not Link.OPEN:
        raise LinkLostError(text, hint="the robot was told to stop")
    raise MotionError(text)
