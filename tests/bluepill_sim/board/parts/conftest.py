"""A socket that writes down what a part does, for parts by themselves."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

import pytest

from bluepill_sim.fabric.pins import PinDrive
from bluepill_sim.fabric.surroundings import BoardMotion


@dataclass
class FakePin:
    """A pin that keeps what it was driven to."""

    is_five_volt_tolerant: bool = True
    level: bool = False
    output: PinDrive = PinDrive.NONE
    driven: list[Any] = field(default_factory=list)
    later: list[tuple[int, int]] = field(default_factory=list)
    volts: Any = None

    def drive(self, level: int | None, *, is_weak: bool = False) -> None:
        self.driven.append((level, is_weak))

    def drive_later(self, levels: Iterable[tuple[int, int]], *, is_weak: bool = False) -> None:
        del is_weak
        self.later += levels

    def set_volts(self, volts: Any) -> None:
        self.volts = volts


class FakePort:
    """A serial port that keeps what it is sent."""

    far_baud: int | None = None

    def __init__(self) -> None:
        self.received = bytearray()

    def receive(self, data: bytes) -> None:
        self.received += data


@dataclass
class FakeSpi:
    """An SPI of which only the speed counts."""

    bit_hz: int = 2_250_000


@dataclass
class FakeWorld:
    """A world that answers what it is told to."""

    now: BoardMotion = field(default_factory=BoardMotion)
    metres: float = 9.0
    asked: tuple[float, ...] = ()

    def motion(self) -> BoardMotion:
        return self.now

    def range_m(self, *asked: float) -> float:
        self.asked = asked
        return self.metres


class FakeSocket:
    """What a part gets, without a board."""

    def __init__(self, *pins: str) -> None:
        self.name, self.now_ns = "part", 0
        self.pins = {name: FakePin() for name in pins}
        self.port: Any = None
        self.spi: Any = None
        self.surroundings = FakeWorld()
        self.notes: list[tuple[int, str, str]] = []
        self.warnings: list[str] = []
        self.replans = 0

    def has(self, pin: str) -> bool:
        return pin in self.pins

    def pin(self, name: str) -> Any:
        return self.pins[name]

    def note(self, at_ns: int, what: str, detail: str = "") -> None:
        self.notes.append((at_ns, what, detail))

    def warn(self, message: str) -> None:
        self.warnings.append(message)

    def deadline_changed(self) -> None:
        self.replans += 1


@pytest.fixture(scope="session")
def plugged() -> Callable[..., Any]:
    """Return a function that plugs a part into a fake socket with these pins, and returns the socket."""

    def plug(part: Any, *pins: str, **others: Any) -> Any:
        socket = FakeSocket(*pins)
        for name, value in others.items():
            setattr(socket, name, value)
        part.plug(socket)
        return socket

    return plug


@pytest.fixture(scope="session")
def port() -> Callable[[], FakePort]:
    return FakePort


@pytest.fixture(scope="session")
def spi() -> Callable[..., FakeSpi]:
    return FakeSpi
