"""How long a change takes on its way around the loop, part by part, out of a run's events.

    ping → packet → sensor pin → motor pins → command → wheels

A step ends where the next begins, so that the steps of one chain add up to its whole. Times are those at which bytes
have arrived and levels have changed. When a sonar pinged is not recorded: it follows from its place among the readings
of its packet, which fire in turn, and from the packet's time on the line. Wheels are seen each 50 ms, and their
answer is followed back along the ramp (`onsets`).

What answers what: a change of the motor pins answers the last change of a sensor pin in `LONGEST_S` before it, a
command that sets another speed the last change of the motor pins. A program that acts by itself has motor changes
without a sensor's, and those are in no chain.

Invariant: no step is negative.
"""

from bisect import bisect_left, bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from p2os.errors import LocalProtocolError, RemoteProtocolError
from p2os.protocol.bauds import DEFAULT_BAUD
from p2os.protocol.frames import Frame
from p2os.protocol.line_time import LineTime
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import SIP_KINDS, StandardSip
from robot_bench.drives.drive import Drive, Floats
from robot_bench.drives.of_packets import spread_s
from robot_bench.drives.onsets import SPEED_COMMANDS, answers, changes
from robot_bench.events.codec import Json
from robot_bench.events.kinds import Packet
from simbase.timing import NS_PER_S

#: chosen: later than this a change answers something else, seconds.
LONGEST_S = 0.5
#: chosen: edges of one value of the pins come within this, seconds.
TOGETHER_S = 0.002
#: Steps of the loop, in order.
STEPS = ("ping to packet", "packet to pin", "pin to motor", "motor to command", "command to wheel")
WHOLE = "ping to wheel"


@dataclass(slots=True)
class LatencyBudget:
    """Seconds of each step, as often as it was seen; of the whole, where a chain has all of them."""

    steps: dict[str, list[float]] = field(default_factory=lambda: {name: [] for name in (*STEPS, WHOLE)})

    def of(self, name: str) -> Floats:
        """Return the times of a step, seconds."""
        return np.array(self.steps[name], dtype=np.float64)


def quantiles(values: Floats) -> Json:
    """Return how values are distributed, for JSON; all None where there are none."""
    names = ("median", "p90", "p99", "max")
    if not len(values):
        return {"count": 0, **dict.fromkeys(names)}
    found = np.quantile(values, (0.5, 0.9, 0.99, 1.0))
    return {"count": len(values), **{name: float(value) for name, value in zip(names, found, strict=True)}}


@dataclass(frozen=True, slots=True)
class _Reading:
    """A packet that brought a sonar's reading: when the ping was, when it had arrived."""

    ping_s: float
    packet_s: float


def latency_budget(drive: Drive) -> LatencyBudget:
    """Return the budget of a run; a step that a recording does not show has no times."""
    found = LatencyBudget()
    pins = _pin_changes(drive)
    pin_times = pins[0].tolist()
    motors = _motor_changes(drive)
    commands = sorted(at for name in SPEED_COMMANDS if name in drive.commands for at in changes(drive.commands[name]))
    onsets = {answer.command_s: answer.onset_s for answer in answers(drive)}
    at_s, ping_s, packet_s = pins[:, ~np.isnan(pins[1])]
    found.steps[STEPS[0]] += (packet_s - ping_s).tolist()
    found.steps[STEPS[1]] += (at_s - packet_s).tolist()
    chains: dict[float, float] = dict(zip(at_s.tolist(), ping_s.tolist(), strict=True))
    for place, at in enumerate(motors):
        cause = _before(pin_times, at)
        # What the pins said before the last change of the motors was answered by that.
        if cause is None or (place and motors[place - 1] >= cause):
            cause = None
        else:
            found.steps[STEPS[2]].append(at - cause)
        until = motors[place + 1] if place + 1 < len(motors) else np.inf
        number = bisect_left(commands, at)
        if number >= len(commands) or commands[number] >= min(until, at + LONGEST_S):
            continue
        found.steps[STEPS[3]].append(commands[number] - at)
        if commands[number] in onsets and cause is not None and cause in chains:
            found.steps[WHOLE].append(onsets[commands[number]] - chains[cause])
    found.steps[STEPS[4]] += [onset - at for at, onset in onsets.items()]
    return found


def _readings(drive: Drive) -> Mapping[int, Sequence[_Reading]]:
    """Return of each sonar, from 0, the packets that brought a reading, in order."""
    found: dict[int, list[_Reading]] = {}
    line, before = LineTime(DEFAULT_BAUD), 0.0
    for event in drive.events or ():
        if not isinstance(event, Packet) or event.direction != "r2c":
            continue
        try:
            frame = Frame.from_bytes(event.data)
            if frame.kind not in SIP_KINDS:
                continue
            sip = StandardSip.from_frame(frame, Profile.P2OS)
        except (LocalProtocolError, RemoteProtocolError):  # a noisy line: no sound frame
            continue
        at = event.t / NS_PER_S
        made = at - line.time_of(len(event.data)) / NS_PER_S
        each = spread_s(len(sip.sonar), drive.parameters.sonar_fitted, at - before)
        before = at
        for place, reading in enumerate(sip.sonar, 1 - len(sip.sonar)):
            found.setdefault(reading.number, []).append(_Reading(made + place * each, at))
    return found


def _pin_changes(drive: Drive) -> Floats:
    """Return when sensor pins changed, and when the ping and the packet were of the reading that each change answers.

    Shape (3, n), seconds, in order of time, then of sensors; NaN where none had come in `LONGEST_S` before.
    """
    readings, found = _readings(drive), [np.empty((3, 0))]
    for number in sorted(drive.sensors):
        at_s = drive.sensors[number].t_s[1:]
        rows = [(np.nan, -np.inf), *((one.ping_s, one.packet_s) for one in readings.get(number - 1, ()))]
        ping_s, packet_s = np.array(rows, dtype=np.float64).T
        place = np.searchsorted(packet_s, at_s, side="right") - 1
        ping_s = np.where(at_s - packet_s[place] <= LONGEST_S, ping_s[place], np.nan)
        found.append(np.array([at_s, ping_s, packet_s[place]]))
    whole = np.concatenate(found, axis=1)
    return np.asarray(whole[:, np.argsort(whole[0], kind="stable")], dtype=np.float64)


def _before(times: Sequence[float], at_s: float) -> float | None:
    place = bisect_right(times, at_s)
    return times[place - 1] if place and at_s - times[place - 1] <= LONGEST_S else None


def _motor_changes(drive: Drive) -> list[float]:
    """Return when the motor pins took another value; edges of one write are one change, at the first of them."""
    times = sorted(at for steps in drive.motors.values() for at in steps.t_s[1:].tolist())
    return [at for place, at in enumerate(times) if not place or at - times[place - 1] > TOGETHER_S]
