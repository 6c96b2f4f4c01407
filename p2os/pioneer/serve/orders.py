"""The orders of an operator to running robots, line by line, and their answers.

fault sonar-stuck 3 1.2       inject a fault; `clear sonar-stuck 3` clears it, `clear all` everything
place box 1 0 0.3 0.3         a thing comes into the world (`world_orders`)
joystick 512 1023 1           one of the live inputs
reset                         back at its start, as just switched on; what was pushed, too
status                        where it is, what it does, how full its line is
2: fault reboot               the same to the second robot alone; without a number it is for all

Each line is answered with one line a robot, or with "error: what" and a hint.
Where the lines come from is `control_line`'s matter.
"""

import math
from collections.abc import Sequence

from p2os.errors import WorldError
from p2os.pioneer.controller.faults import FAULTS
from p2os.pioneer.controller.live_inputs import INPUTS
from p2os.pioneer.controller.order_words import read_words
from p2os.pioneer.serve.host import Host
from p2os.pioneer.serve.multi_robot_world import MultiRobotWorld
from p2os.pioneer.serve.world_orders import WORLD_ORDERS, is_world_order
from simbase.errors import UsageError, nearest

#: A longer line is cut.
LONGEST_LINE = 200
#: Orders of one word.
ALONE = ("status", "reset")
#: What a line can begin with, after the robot's number.
FIRST_WORDS = ("status", "fault", "clear", "reset", "place", "move", "remove", *INPUTS, "help")


def execute(hosts: Sequence[Host], text: str) -> list[str]:
    """Execute a line, and return the answer's lines."""
    try:
        return carry_out(hosts, text)
    except (UsageError, WorldError) as error:
        return [f"error: {error}", *([f"hint: {error.hint}"] if error.hint else [])]


def carry_out(hosts: Sequence[Host], text: str) -> list[str]:
    """Execute a line, and return the answer's lines but for errors.

    Raises:
        UsageError: The words mean nothing, or what they ask for cannot be.
        WorldError: There is no such thing, or it is part of the building.
    """
    numbers, words = _addressed(text.strip(), len(hosts))
    if words.split()[:1] == ["help"]:
        return help_lines()
    _check_words(words)
    if words == "reset":
        return _start_over([(number, hosts[number - 1]) for number in numbers])
    if is_world_order(words):
        return _change_worlds([(number, hosts[number - 1]) for number in numbers], words)
    return [_one(number, hosts[number - 1], words) for number in numbers]


def help_lines() -> list[str]:
    """Return every line that a robot understands, with its meaning."""
    rows = [("status", "where it is, what it does, how full its line is")]
    rows += [("reset", "back at its start, as just switched on; what was pushed, too; the session ends")]
    rows += [(" ".join(["fault", name, *words]), meaning) for name, (words, meaning) in FAULTS.items()]
    rows += [("clear NAME …", "ends a fault; the same first words"), ("clear all", "ends every fault")]
    rows += [(" ".join([name, *words]), meaning) for name, (words, meaning) in INPUTS.items()]
    rows += [(" ".join([name, *words]), meaning) for name, (words, meaning) in WORLD_ORDERS.items()]
    rows += [("N: …", "one of these to robot N alone")]
    return [f"{words:38} {meaning}" for words, meaning in rows]


def status_line(number: int, host: Host) -> str:
    """Return one robot's state in a line."""
    state = host.pioneer.state
    body = host.pioneer.body.state
    load = "" if state.line_load_percent is None else f", line {state.line_load_percent} % of {state.baud} bit/s"
    motors = "on" if state.motors_enabled else "off"
    return (
        f"robot {number} at {host.now / 1e9:.1f} s: {'open' if state.open else 'no session'}"
        f"{', ' + host.client if host.client else ''}, motors {motors}, "
        f"odometry x {state.x_mm / 1000:.3f} m y {state.y_mm / 1000:.3f} m {math.degrees(state.heading_rad):.1f}°, "
        f"wheels {_speed(body.left_speed_mps)} {_speed(body.right_speed_mps)} m/s, {state.battery_v:.1f} V{load}, "
        f"{state.packets_dropped} packets dropped, {state.ignored_commands} commands ignored"
        f"{', injected: ' + ', '.join(state.injected) if state.injected else ''}"
    )


def _speed(speed_mps: float) -> str:
    """Return a speed with no sign before nothing."""
    return f"{round(speed_mps, 3) + 0.0:.3f}"


def _check_words(words: str) -> None:
    first, *rest = words.split() or [""]
    if first not in FIRST_WORDS:
        raise UsageError(f"no order {first!r}", hint=nearest(first, FIRST_WORDS, f"orders: {', '.join(FIRST_WORDS)}"))
    if first in ALONE:
        read_words(words, first, rest, (), {})


def _addressed(text: str, robots: int) -> tuple[range, str]:
    """Return which robots are meant, counted from 1, and the rest of the line."""
    first, colon, rest = text.partition(":")
    if not colon or first.split(maxsplit=1)[:1] in ([word] for word in FIRST_WORDS):  # a thing's name has the colon
        return range(1, robots + 1), text
    if not first.strip().isdecimal() or not 1 <= int(first) <= robots:
        raise UsageError(f"no robot {first.strip()!r}", hint=f"robots: 1 to {robots}")
    return range(int(first), int(first) + 1), rest.strip()


def _change_worlds(named: Sequence[tuple[int, Host]], words: str) -> list[str]:
    """Change every world that a robot of these is in, once; return an answer for each."""
    answers: list[str] = []
    changed: list[MultiRobotWorld] = []
    for number, host in named:
        if host.multi_robot_world is None:
            answers.append(f"world of robot {number}: {host.change_world(words)}")
        elif host.multi_robot_world not in changed:
            changed.append(host.multi_robot_world)
            answers.append(f"world: {host.change_world(words)}")
    return answers


def _start_over(named: Sequence[tuple[int, Host]]) -> list[str]:
    """Put robots back at their starts, those of one world together; return an answer for each."""
    together: dict[MultiRobotWorld, list[Host]] = {}
    for _, host in named:
        if host.multi_robot_world is None:
            host.start_over()
        else:
            together.setdefault(host.multi_robot_world, []).append(host)
    for world, hosts in together.items():
        world.start_over([host.number for host in hosts], hosts[0].now)
        for host in hosts:
            host.go_on()
    return [f"robot {number}: at its start, as just switched on" for number, _ in named]


def _one(number: int, host: Host, words: str) -> str:
    if words == "status":
        return status_line(number, host)
    if words == "clear all":
        injected = host.pioneer.state.injected
        for fault in injected:
            host.do(f"clear {fault}")
        return f"robot {number}: cleared {', '.join(injected) or 'nothing: nothing was injected'}"
    host.do(words)
    return f"robot {number}: {words}"
