"""A virtual Pioneer served over TCP in the background, for the verbs that talk to a robot."""

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from p2os.cli import main as cli
from p2os.pioneer.serve import served_pioneer

sys.path.insert(0, str(Path(__file__).parents[1] / "client"))  # `ServedRobot`, whose wheels can be looked at


@dataclass
class Served:
    """A robot that lives in a thread until the test is over."""

    url: str
    events: list[str] = field(default_factory=list)

    @property
    def text(self) -> str:
        return "\n".join(self.events)


@pytest.fixture
def served() -> Iterator[Served]:
    """A 2-DX in a room on a free TCP port."""
    served = Served("")

    def tell(_now: int, what: str, detail: str) -> None:
        served.events.append(f"{what}: {detail}")

    with served_pioneer(body="kinematic", on_event=tell) as served.url:
        yield served


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch) -> Callable[..., int]:
    """The command line, with help that is as wide on every terminal."""
    monkeypatch.setenv("COLUMNS", "100")
    return lambda *words: cli.run([str(word) for word in words])
