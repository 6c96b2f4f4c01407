"""What a person says to a robot that runs, line by line, and what it answers.

fault sonar-stuck 3 1.2       break something; `mend sonar-stuck 3` mends it
joystick 512 1023 1           one of the live inputs
status                        where it is, what it does, how full its line is
2: fault reboot               the same to the second robot alone; without a number all hear it

Each line is answered with one line a robot, or with "error: what" and a hint.
"""

import math
from collections.abc import Sequence

from p2os.errors import UsageError
from p2os.pioneer.faults import FAULTS
from p2os.pioneer.host import Host
from p2os.pioneer.live_inputs import INPUTS

#: A longer line is cut.
LONGEST_LINE = 200


def obey(hosts: Sequence[Host], text: str) -> list[str]:
    """Do what a line says, and return the answer's lines."""
    try:
        numbers, words = _addressed(text.strip(), len(hosts))
        if words == "help":
            return help_lines()
        return [_one(number, hosts[number - 1], words) for number in numbers]
    except UsageError as error:
        return [f"error: {error}", *([f"hint: {error.hint}"] if error.hint else [])]


def help_lines() -> list[str]:
    """Return every line that a robot understands, with its meaning."""
    rows = [("status", "where it is, what it does, how full its line is")]
    rows += [(" ".join(["fault", name, *words]), meaning) for name, (words, meaning) in FAULTS.items()]
    rows += [("mend NAME …", "ends a fault; the same first words")]
    rows += [(" ".join([name, *words]), meaning) for name, (words, meaning) in INPUTS.items()]
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
        f"wheels {body.left_speed_mps:.3f} {body.right_speed_mps:.3f} m/s, {state.battery_v:.1f} V{load}, "
        f"{state.packets_dropped} packets dropped, {state.ignored_commands} commands ignored"
    )


def _addressed(text: str, robots: int) -> tuple[range, str]:
    """Return which robots are meant, counted from 1, and the rest of the line."""
    first, colon, rest = text.partition(":")
    if not colon:
        return range(1, robots + 1), text
    if not first.strip().isdecimal() or not 1 <= int(first) <= robots:
        raise UsageError(f"no robot {first.strip()!r}", hint=f"robots: 1 to {robots}")
    return range(int(first), int(first) + 1), rest.strip()


def _one(number: int, host: Host, words: str) -> str:
    if words == "status":
        return status_line(number, host)
    host.do(words)
    return f"robot {number}: {words}"
