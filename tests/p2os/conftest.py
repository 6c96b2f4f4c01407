"""A robot on a body without physics, for the tests of the controller and its host."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from p2os.pioneer.controller import ControllerSettings, Pioneer
from p2os.protocol.commands import Command, CommandNumber
from p2os.protocol.frames import Decoder, Frame
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import SIP_KINDS, StandardSip
from p2os.robots.parameters import RobotParameters, load_parameters
from simbase.timing import NS_PER_MS
from tests.p2os.perfect_body import PerfectBody


def context_of(pioneer: Pioneer) -> Any:
    """Return what a snapshot holds of the parts that commands act on."""
    return pioneer.snapshot()["_context"]


class Robot:
    """A virtual robot and a client that speaks in frames."""

    def __init__(self, parameters: RobotParameters, settings: ControllerSettings, dt_ns: int = NS_PER_MS) -> None:
        self.body = PerfectBody(dt_ns=dt_ns)
        self.events: list[tuple[int, str, str]] = []
        self.pioneer = Pioneer(
            parameters=parameters, body=self.body, settings=settings,
            on_event=lambda now, what, detail: self.events.append((now, what, detail)),
        )  # fmt: skip
        self.now = 0
        self._decoder = Decoder()

    def say(self, number: int, argument: int | bytes | None = None) -> None:
        self.send(Command(number, argument).to_frame().to_bytes())

    def send(self, data: bytes) -> None:
        self.pioneer.receive(data, self.now)

    def run(self, milliseconds: float) -> None:
        self.now += round(milliseconds * NS_PER_MS)
        self.pioneer.advance_to(self.now)

    def frames(self) -> list[Frame]:
        """Return what the robot has said since the last call; every byte must be a frame."""
        frames = []
        for data in self.pioneer.take_output():
            self._decoder.receive(data, self.now)
            while (item := self._decoder.next_item()) is not None:
                assert isinstance(item, Frame)
                frames.append(item)
        return frames

    def sips(self) -> list[StandardSip]:
        profile = self.pioneer.profile
        return [StandardSip.from_frame(frame, profile) for frame in self.frames() if frame.kind in SIP_KINDS]

    def sip(self) -> StandardSip:
        """Run to the next packet and return it."""
        self.frames()
        due = self.pioneer.next_deadline()
        assert due is not None
        self.now = due
        self.pioneer.advance_to(due)
        (packet,) = self.sips()
        return packet

    def open(self, *, motors: bool = True) -> "Robot":
        for number in (0, 1, 2):
            self.say(number)
        self.say(CommandNumber.OPEN)
        if motors:
            self.say(CommandNumber.ENABLE, 1)
        self.frames()
        return self

    def reported(self) -> list[str]:
        return [what for _, what, _ in self.events]


@pytest.fixture(scope="session")
def make_robot() -> Callable[..., Robot]:
    def make(
        *, model: str = "p2dx", parameters: RobotParameters | None = None, dt_ns: int = NS_PER_MS, **settings: object
    ) -> Robot:
        chosen = ControllerSettings(**settings)  # type: ignore[arg-type]  # a test says what it means
        return Robot(parameters or load_parameters(model), chosen, dt_ns)

    return make


@pytest.fixture
def robot(make_robot: Callable[..., Robot]) -> Robot:
    return make_robot()


@pytest.fixture(params=list(Profile), ids=lambda profile: profile.value)
def profile(request: pytest.FixtureRequest) -> Profile:
    return request.param


def client_side(name: str) -> list[tuple[float, bytes]]:
    """Return what the client of a captured conversation sent: (seconds, bytes)."""
    path = Path(__file__).resolve().parent.parent / "golden" / "captures" / f"{name}.jsonl"
    rows = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    return [(row["t"], bytes.fromhex(row["hex"])) for row in rows if row["dir"] == "c2s"]


@pytest.fixture
def captured() -> Callable[[str], list[tuple[float, bytes]]]:
    """Return a function from a capture's name to what its client said."""
    return client_side


@pytest.fixture
def aria() -> list[tuple[float, bytes]]:
    """AriaCoda's demo: 34 s of driving and turning."""
    return client_side("aria_p2de")


@pytest.fixture
def player() -> list[tuple[float, bytes]]:
    """player's p2os driver: 9 s, commands without arguments, a lone type byte, VEL2."""
    return client_side("player_p2de")
