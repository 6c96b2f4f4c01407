"""Drive robots of any maker through one script, and lay what they did side by side.

    python -m p2os serve --robot p3dx --body kinematic --world WORLD --port tcp:127.0.0.1:8101
    AMRISim --nomap --no-gui --no-error -R p3dx -p 8123
    python -m tools.bench.peers.peer_figures tcp:127.0.0.1:8101 tcp:127.0.0.1:8123 --record drives

The script sets accelerations, drives, turns, moves, stops, falls silent and drives with its motors off; it needs two
metres of free space on each side: robot_bench/experiments/validation/scenarios/plain.toml is such a world. A figure
has what the manual says beside it; `--record` leaves the conversations for `p2os compare` and `p2os decode`. Every
robot is stopped in the end, whatever happens.

Exit codes: 0 all robots were driven, 1 one could not be, 2 wrong usage.
"""

import argparse
import contextlib
import math
import statistics
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from p2os.capture import Capture, Chunk, Direction, write_recording
from p2os.errors import P2osError, TransportError
from p2os.protocol.commands import command, vel2
from p2os.protocol.connection import Connection, ConnectionRole, ConnectionState, SipReceived
from p2os.protocol.events import Synchronised
from p2os.protocol.odometry import Odometry
from p2os.protocol.sip import StandardSip
from p2os.protocol.times import CYCLE_NS
from p2os.robots.parameters import RobotParameters, load_parameters
from p2os.robots.parameters import nearest_model as model_of
from p2os.transport import Transport, open_url
from p2os.transport.waiting import wait_readable
from p2os.transport.wall_clock import wall_clock
from simbase.timing import NS_PER_MS, NS_PER_S

#: chosen: how long a robot may take to open a session, seconds.
OPENING_S = 15.0
#: chosen: accelerations that the script asks for, mm/s² and deg/s², and its speeds, mm/s and deg/s.
ACCEL, DECEL, TURN_ACCEL = 200, 400, 60
SPEED, TURN = 300, 40
#: From packet to packet, by the manual, seconds.
CYCLE_S = CYCLE_NS / NS_PER_S
#: Slower than this stands, mm/s.
STANDING_MM_S = 5.0


@dataclass(slots=True)
class Sample:
    """What a packet tells: seconds, mm and degrees; `robot_s` counts packets of 100 ms, a simulator's own time."""

    t: float
    robot_s: float
    forward: float
    turn: float
    x: float
    y: float
    heading: float
    sip: StandardSip


@dataclass(slots=True)
class PeerSession:
    """A session with one robot, in real time."""

    url: str
    line: Transport
    connection: Connection = field(default_factory=lambda: Connection(ConnectionRole.CLIENT))
    model: str = ""
    samples: list[Sample] = field(default_factory=list)
    chunks: list[Chunk] = field(default_factory=list)
    #: Sends nothing, as a client that hangs.
    is_mute: bool = False
    odometry: Odometry | None = None
    parameters: RobotParameters | None = None
    began: int = field(default_factory=wall_clock)

    def now_s(self) -> float:
        """Return seconds since the session began."""
        return (wall_clock() - self.began) / NS_PER_S

    def open(self) -> None:
        """Open a session.

        Raises:
            TransportError: Nobody answers as a robot.
        """
        self.step(0.3)
        self.connection.connect(wall_clock())
        self.wait(lambda: self.connection.is_open, OPENING_S)
        if self.connection.state is not ConnectionState.OPEN:
            raise TransportError(f"{self.url} does not open a session", hint=f"p2os info {self.url}")

    def send(self, name: str, *argument: int | bytes) -> float:
        """Send a command; return when."""
        self.connection.send(command(name, *argument), wall_clock())
        self._flush()
        return self.now_s()

    def step(self, seconds: float) -> None:
        """Let time pass."""
        self.wait(lambda: False, seconds)

    def wait(self, until: Callable[[], bool], longest_s: float) -> None:
        """Take packets until something holds, or the time is over."""
        end = wall_clock() + round(longest_s * NS_PER_S)
        while not until() and (now := wall_clock()) < end:
            wait_readable((self.line.fileno(),), min(end - now, 20 * NS_PER_MS) / NS_PER_S)
            self._take(self.line.read())
            self.connection.advance_to(wall_clock())
            self._flush()

    def _flush(self) -> None:
        for data in self.connection.take_output():
            if not self.is_mute:
                self.chunks.append(Chunk(at_ns=wall_clock() - self.began, direction=Direction.TO_ROBOT, data=data))
                self.line.write(data)

    def _take(self, data: bytes) -> None:
        now = wall_clock()
        if data:
            self.chunks.append(Chunk(at_ns=now - self.began, direction=Direction.FROM_ROBOT, data=data))
        self.connection.receive(data, now)
        while (event := self.connection.next_event()) is not None:
            if isinstance(event, Synchronised):
                self.model = event.identity.subclass
                self.parameters = load_parameters(model_of(self.model))
                self.odometry = Odometry(self.parameters)
            if isinstance(event, SipReceived) and self.odometry is not None:
                self._sample(event.sip, now)

    def _sample(self, sip: StandardSip, now: int) -> None:
        parameters, odometry = self.parameters, self.odometry
        if parameters is None or odometry is None:
            return
        odometry.update(sip)
        left, right = (raw * parameters.velocity_conv for raw in (sip.raw_left_velocity, sip.raw_right_velocity))
        self.samples.append(Sample(
            t=(now - self.began) / NS_PER_S, robot_s=len(self.samples) * CYCLE_S, forward=(left + right) / 2,
            turn=math.degrees((right - left) / parameters.track_mm), x=odometry.x_m * 1000, y=odometry.y_m * 1000,
            heading=math.degrees(odometry.heading_rad), sip=sip,
        ))  # fmt: skip

    def since(self, t: float) -> list[Sample]:
        """Return what came after a time."""
        return [one for one in self.samples if one.t > t]

    def stand(self) -> None:
        """Stop, and wait until it stands."""
        at = self.send("VEL", 0)
        self.send("RVEL", 0)
        self.wait(lambda: bool(late := self.since(at + 0.5)) and abs(late[-1].forward) < STANDING_MM_S
                  and abs(late[-1].turn) < 1.0, 6.0)  # fmt: skip
        self.step(0.3)

    def close(self) -> None:
        """Stop the robot and give its line back."""
        self.is_mute = False
        with contextlib.suppress(TransportError):
            self.connection.disconnect(wall_clock())
            self._flush()
        self.line.close()


def slope(samples: Sequence[Sample], of: Callable[[Sample], float], low: float, high: float) -> float | None:
    """Return the slope of a ramp by least squares over what lies between two values; None of fewer than three."""
    run = [(one.robot_s, of(one)) for one in samples if min(low, high) <= of(one) <= max(low, high)]
    if len(run) < 3:
        return None
    t, v = (statistics.fmean(values) for values in zip(*run, strict=True))
    return sum((a - t) * (b - v) for a, b in run) / sum((a - t) ** 2 for a, _ in run)


def rate(samples: Sequence[Sample]) -> float:
    """Return how fast the heading turns on the whole, degrees a second of the robot's own time."""
    return (samples[-1].heading - samples[0].heading) / (samples[-1].robot_s - samples[0].robot_s)


Found = dict[str, float | None]
#: Figure → its unit and what the manual says (Pioneer 2 H8 manual, client commands; PROTOCOL.md has its pages).
FIGURES: dict[str, tuple[str, str]] = {
    "packet period": ("ms", "100"),
    "VEL to motion": ("s", "-"),
    "acceleration, SETA": ("mm/s2", f"{ACCEL}"),
    "deceleration, SETA < 0": ("mm/s2", f"{DECEL}"),
    "speed of VEL": ("mm/s", f"{SPEED}"),
    "way over speed x time": ("", "1"),
    "turn acceleration, SETRA": ("deg/s2", f"{TURN_ACCEL}"),
    "rate of RVEL": ("deg/s", f"{TURN}"),
    "turned by DHEAD 90": ("deg", "90"),
    "turned by HEAD 0": ("deg", "to 0"),
    "way of MOVE 500": ("mm", "500"),
    "way of MOVE -500": ("mm", "-500"),
    "VEL2 10 20, turn rate": ("deg/s", "10 Vel2Divisor / track"),
    "deceleration of E_STOP": ("mm/s2", "above SETA's"),
    "watchdog stops after": ("s", "2"),
    "speed after the watchdog, PULSE": ("mm/s", "the last again"),
    "speed with motors off": ("mm/s", "0"),
    "x after SETO": ("mm", "0"),
}


def drive(peer: PeerSession) -> Found:
    """Take one robot through the script."""
    found: Found = {}
    for name, value in (("ENABLE", 1), ("SETV", 400), ("SETRV", 60), ("SETA", ACCEL), ("SETA", -DECEL),
                        ("SETRA", TURN_ACCEL), ("SETRA", -TURN_ACCEL)):  # fmt: skip
        peer.send(name, value)
    peer.step(1.5)
    gaps = [1000 * (after.t - before.t) for before, after in zip(peer.samples, peer.samples[1:], strict=False)]
    found["packet period"] = statistics.median(gaps) if gaps else None
    _straight(peer, found)
    _turns(peer, found)
    _moves(peer, found)
    _stops(peer, found)
    return found


def _straight(peer: PeerSession, found: Found) -> None:
    at = peer.send("VEL", SPEED)
    peer.step(SPEED / ACCEL + 2.5)
    samples = peer.since(at)
    found["VEL to motion"] = next((one.t - at for one in samples if one.forward > STANDING_MM_S), None)
    found["acceleration, SETA"] = slope(samples, lambda one: one.forward, 0.1 * SPEED, 0.9 * SPEED)
    steady = [one for one in samples if one.t > at + SPEED / ACCEL + 1.0]
    found["speed of VEL"] = statistics.fmean(one.forward for one in steady) if steady else None
    if len(steady) > 5:
        way, seconds = steady[-1].x - steady[0].x, steady[-1].robot_s - steady[0].robot_s
        found["way over speed x time"] = way / seconds / (found["speed of VEL"] or 1.0)
    at = peer.send("VEL", 0)
    peer.step(SPEED / DECEL + 1.5)
    fall = slope(peer.since(at), lambda one: one.forward, 0.1 * SPEED, 0.9 * SPEED)
    found["deceleration, SETA < 0"] = None if fall is None else abs(fall)
    at = peer.send("VEL", -SPEED)
    peer.step(SPEED / ACCEL + 2.0)
    peer.stand()


def _turns(peer: PeerSession, found: Found) -> None:
    at = peer.send("RVEL", TURN)
    peer.step(TURN / TURN_ACCEL + 2.5)
    samples = peer.since(at)
    found["turn acceleration, SETRA"] = slope(samples, lambda one: one.turn, 0.1 * TURN, 0.9 * TURN)
    steady = [one for one in samples if one.t > at + TURN / TURN_ACCEL + 1.0]
    if len(steady) > 5:
        found["rate of RVEL"] = rate(steady)
    peer.stand()
    before = peer.samples[-1].heading
    peer.send("DHEAD", 90)
    peer.step(6.0)
    found["turned by DHEAD 90"] = peer.samples[-1].heading - before
    peer.send("HEAD", 0)
    peer.step(8.0)
    found["turned by HEAD 0"] = (peer.samples[-1].heading + 180) % 360 - 180
    peer.stand()


def _moves(peer: PeerSession, found: Found) -> None:
    for way in (500, -500):
        before = peer.samples[-1].x
        peer.send("MOVE", way)
        peer.step(10.0)
        found[f"way of MOVE {way}"] = peer.samples[-1].x - before
    peer.connection.send(vel2(10, 20), wall_clock())
    at = peer.now_s()
    peer.step(5.0)
    steady = peer.since(at + 3.0)
    if len(steady) > 5:
        found["VEL2 10 20, turn rate"] = rate(steady)
    peer.stand()


def _stops(peer: PeerSession, found: Found) -> None:
    for name in ("E_STOP", "watchdog"):
        peer.send("VEL", SPEED)
        peer.step(SPEED / ACCEL + 1.0)
        if name == "E_STOP":
            at = peer.send("E_STOP")
            peer.step(1.5)
            moving = [one.t for one in peer.since(at) if abs(one.forward) > STANDING_MM_S]
            found["deceleration of E_STOP"] = SPEED / max(max(moving, default=at) - at, 0.1)
            peer.send("ENABLE", 1)
            peer.stand()
    peer.is_mute, at = True, peer.now_s()
    peer.step(5.0)
    begins = next((one.t for one in peer.since(at) if one.forward < 0.97 * SPEED), None)
    found["watchdog stops after"] = None if begins is None else begins - at
    peer.is_mute = False
    peer.send("PULSE")
    peer.step(2.0)
    found["speed after the watchdog, PULSE"] = peer.samples[-1].forward
    peer.stand()
    peer.send("ENABLE", 0)
    peer.send("VEL", SPEED)
    peer.step(2.0)
    found["speed with motors off"] = peer.samples[-1].forward
    peer.send("VEL", 0)
    peer.send("SETO")
    peer.step(0.8)
    if peer.parameters is not None:
        found["x after SETO"] = peer.samples[-1].sip.raw_x * peer.parameters.distance_nm_per_count / 1e6


def table(urls: Sequence[str], found: Sequence[Found]) -> str:
    """Return the figures side by side, as a table of Markdown."""
    lines = ["| figure | manual | " + " | ".join(urls) + " |", "|---|---|" + "---|" * len(urls)]
    for name, (unit, manual) in FIGURES.items():
        cells = ["-" if (value := one.get(name)) is None else f"{value:.4g}" for one in found]
        lines.append(f"| {name}{f', {unit}' if unit else ''} | {manual} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Drive each robot, print the table; return the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m tools.bench.peers.peer_figures", description=(__doc__ or "").split("\n", 1)[0]
    )
    parser.add_argument("url", nargs="+", metavar="[NAME=]URL", help="a robot, such as AMRISim=tcp:127.0.0.1:8101")
    parser.add_argument("--record", type=Path, metavar="FOLDER", help="write each conversation there, NAME.jsonl")
    chosen = parser.parse_args(arguments)
    names, results = [], []
    for number, text in enumerate(chosen.url):
        name, equals, url = text.rpartition("=")
        names.append(name if equals else f"robot {number + 1}")
        try:
            peer = PeerSession(url, open_url(url))
            try:
                peer.open()
                print(f"{names[-1]}: {peer.model} at {url}", file=sys.stderr, flush=True)
                results.append(drive(peer))
            finally:
                peer.close()
        except P2osError as error:
            print(f"peer_figures: {error}", file=sys.stderr)
            return 1
        if chosen.record:
            chosen.record.mkdir(parents=True, exist_ok=True)
            capture = Capture(
                chunks=tuple(peer.chunks), has_time=True, note=f"tools.bench.peers.peer_figures: {names[-1]}"
            )
            (chosen.record / f"{names[-1]}.jsonl").write_text(write_recording(capture), encoding="utf-8")
    print(table(names, results))
    return 0


if __name__ == "__main__":
    sys.exit(main())
