"""What the tests of the adapter share: pins in a dictionary, and a robot behind a line."""

from bisect import bisect_left, bisect_right
from collections.abc import Callable
from dataclasses import replace
from operator import itemgetter
from pathlib import Path

import pytest

from adapter_sim import Adapter, AdapterSettings, Pinout, load_pinout
from adapter_sim.codec import motor_code
from adapter_sim.receiver import Receiver
from p2os.protocol.commands import Command
from p2os.protocol.connection import CommandReceived, Connection, ConnectionRole, Opened
from p2os.protocol.frames import Frame
from p2os.protocol.packets import Identity
from p2os.protocol.sip import SonarReading, StandardSip
from p2os.robots.parameters import load_parameters
from simbase.timing import NS_PER_MS, Nanos

PARAMETERS = load_parameters("p2dx")
PINOUT = load_pinout()
PINOUT_TEXT = (Path(__file__).parents[2] / "adapter_sim" / "pinout.toml").read_text(encoding="utf-8")
MS = NS_PER_MS
#: 10 bits a character at 9600 baud.
CHARACTER_NS = 10 * 10**9 // 9600


def four_bits() -> str:
    """Return the pin-out with a fourth wire for each motor."""
    text = PINOUT_TEXT.replace('role = "motor"\nside = "left"\nwidth = 3', 'role = "motor"\nside = "left"\nwidth = 4')
    text = text.replace('role = "motor"\nside = "right"\nwidth = 3', 'role = "motor"\nside = "right"\nwidth = 4')
    for value, pin in (("motor1", "PB8"), ("motor2", "PB9")):
        text += (
            f'\n[[wire]]\nname = "{value}_comm4"\nrole = "motor"\nvalue = "{value}"\nbit = 3\n'
            f'direction = "to_adapter"\nbluepill = "{pin}"\npull = "down"\nidle = 0\nsafe = 0\n'
            'esp32 = { thesis-table3 = "NC", thesis-board = "IO18", rev-b = "NC", rev-c = "NC" }\n'
        )
    return text


class FakePins:
    """A pin bank with a history, so that it reads the level of any instant."""

    def __init__(self) -> None:
        self.history: dict[str, list[tuple[Nanos, bool]]] = {}
        self.outputs: dict[str, bool | None] = {}
        self.writes: list[tuple[Nanos, str, bool | None]] = []
        self.reads = 0

    def set(self, signal: str, high: bool, at: Nanos) -> None:
        self.history.setdefault(signal, []).append((at, high))

    def motors(self, left: int, right: int, at: Nanos, width: int = 3) -> None:
        for name, value in (("motor1", left), ("motor2", right)):
            code = motor_code(value, width)
            for bit in range(width):
                self.set(f"{name}_comm{bit + 1}", bool(code >> bit & 1), at)

    def read(self, signal: str, at: Nanos) -> bool:
        self.reads += 1
        if signal not in self.history:
            return False
        history = self.history[signal]
        since, level = history[-1]
        if since <= at:  # most reads are of the present
            return level
        place = bisect_right(history, at, key=itemgetter(0))
        return history[place - 1][1] if place else False

    def course(self, signal: str, begin: Nanos, end: Nanos) -> list[tuple[Nanos, bool]]:
        history = self.history.get(signal, [])
        first = bisect_right(history, begin, key=itemgetter(0))
        later = history[first : bisect_left(history, end, key=itemgetter(0))]
        return [(begin, history[first - 1][1] if first else False), *later]

    def write(self, signal: str, high: bool | None, now: Nanos) -> None:
        self.outputs[signal] = high
        self.writes.append((now, signal, high))

    def code(self, name: str, width: int = 3) -> int:
        return sum(bool(self.outputs[f"{name}_s{bit + 1}"]) << bit for bit in range(width))

    def distances(self) -> str:
        return "".join("1" if self.outputs[f"DD{number}"] else "0" for number in range(1, 9))


class FakeRobot:
    """A server that obeys at once, and sends a SIP every 100 ms once open."""

    def __init__(self) -> None:
        self.connection = Connection(ConnectionRole.SERVER, identity=Identity("Fake", "Pioneer", "p2dx"))
        self.commands: list[tuple[Nanos, Command]] = []
        self.sip = StandardSip(sonar=tuple(SonarReading(number, 32_000) for number in range(8)))
        self.forward = self.turn = 0
        self.obeys = True
        self.sends = True
        self.next_sip: Nanos | None = None

    def receive(self, data: bytes, now: Nanos) -> None:
        self.connection.receive(data, now)
        while (event := self.connection.next_event()) is not None:
            if isinstance(event, Opened):
                self.next_sip = now + 100 * MS
            elif isinstance(event, CommandReceived):
                self.commands.append((now, event.command))
                self._obey(event.command)

    def _obey(self, command: Command) -> None:
        if command.name == "STOP":
            self.forward = self.turn = 0
        elif command.name == "VEL":
            self.forward = command.integer or 0
        elif command.name == "RVEL":
            self.turn = command.integer or 0
        elif command.name == "SETO":
            self.sip = replace(self.sip, raw_x=0, raw_y=0, raw_heading=0)

    def take_output(self) -> list[bytes]:
        return self.connection.take_output()

    def next_deadline(self) -> Nanos | None:
        return self.next_sip if self.connection.is_open else None

    def advance_to(self, now: Nanos) -> None:
        self.connection.advance_to(now)
        if self.connection.is_open and self.next_sip is not None and now >= self.next_sip:
            self.next_sip += 100 * MS
            if self.obeys:
                rim = round(self.turn * PARAMETERS.track_mm * 0.0087266)
                self.sip = replace(
                    self.sip, raw_left_velocity=self.forward - rim, raw_right_velocity=self.forward + rim
                )
            if self.sends:
                self.connection.send(self.sip, now)


class Line:
    """One direction of a wire: frames queue, and arrive with their last character."""

    def __init__(self) -> None:
        self.free_at: Nanos = 0
        self.queue: list[tuple[Nanos, bytes]] = []
        self.cut = False
        #: Changes a frame, or swallows it by returning b"".
        self.damage: Callable[[bytes], bytes] = lambda frame: frame
        #: (time out, frame) of everything that was sent, cut or not.
        self.log: list[tuple[Nanos, bytes]] = []

    def send(self, frames: list[bytes], now: Nanos) -> None:
        for frame in frames:
            self.log.append((now, frame))
            self.free_at = max(self.free_at, now) + len(frame) * CHARACTER_NS
            data = b"" if self.cut else self.damage(frame)
            if data:
                self.queue.append((self.free_at, data))

    def take(self, now: Nanos) -> list[bytes]:
        due = [data for at, data in self.queue if at <= now]
        self.queue = [(at, data) for at, data in self.queue if at > now]
        return due

    def next_deadline(self) -> Nanos | None:
        return self.queue[0][0] if self.queue else None


class Rig:
    """The adapter, its pins, a line each way, and the robot, on one clock."""

    def __init__(
        self,
        settings: AdapterSettings | None = None,
        robot: object | None = None,
        now: Nanos = 0,
        pinout: Pinout = PINOUT,
        kind: type = Adapter,
        receiver: Receiver | None = None,
    ) -> None:
        self.now = now
        self.pins = FakePins()
        self.robot = robot or FakeRobot()
        self.events: list[tuple[Nanos, str, str]] = []
        self.adapter = kind(
            pins=self.pins,
            pinout=pinout,
            parameters=PARAMETERS,
            settings=settings or AdapterSettings(threshold_um=600_000),
            on_event=lambda now, what, detail: self.events.append((now, what, detail)),
            now=now,
            receiver=receiver,
        )
        self.to_robot, self.to_adapter = Line(), Line()

    def run(self, until: Nanos) -> None:
        """Advance to `until`, every part at each deadline of any part."""
        parts = (self.adapter, self.robot, self.to_robot, self.to_adapter)
        while True:
            due = min((at for part in parts if (at := part.next_deadline()) is not None), default=until)
            now = min(due, until)
            if now < self.now:
                raise AssertionError(f"a deadline in the past: {now} < {self.now}")
            self.now = now
            for data in self.to_adapter.take(now):
                self.adapter.receive(data, now)
            self.adapter.advance_to(now)
            self.to_robot.send(self.adapter.take_output(), now)
            for data in self.to_robot.take(now):
                self.robot.receive(data, now)
            self.robot.advance_to(now)
            self.to_adapter.send(self.robot.take_output(), now)
            if now >= until and not any((at := part.next_deadline()) is not None and at <= until for part in parts):
                return

    def ms(self, span_ms: float) -> None:
        """Advance by milliseconds."""
        self.run(self.now + round(span_ms * MS))

    def connect(self) -> None:
        """Boot, raise p2dx_con, and wait until the robot is driven."""
        self.ms(310)
        self.pins.set("p2dx_con", True, self.now)
        self.ms(1_000)
        assert self.adapter.state == "driving", self.events

    def sent(self, since: Nanos = 0) -> list[tuple[Nanos, str, object]]:
        """Return what the adapter sent from an instant on, as (time, name, argument)."""
        commands = [(at, Command.from_frame(Frame.from_bytes(data))) for at, data in self.to_robot.log if at >= since]
        return [(at, command.name, command.argument) for at, command in commands]


@pytest.fixture
def rig() -> Rig:
    """Return a rig that has not booted yet."""
    return Rig()


@pytest.fixture
def driving() -> Rig:
    """Return a rig that drives its robot."""
    rig = Rig()
    rig.connect()
    return rig
