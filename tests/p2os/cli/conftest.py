"""A virtual Pioneer served over TCP in the background, for the verbs that talk to a robot."""

import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import pytest

from p2os.cli import main as cli
from p2os.cli.serve import make_pioneer
from p2os.pioneer.host import Host
from p2os.transport import listen_url

#: Generous: the machine may be busy.
PATIENCE_S = 60.0


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
    pioneer = make_pioneer(robot="p2dx", world="room", body="kinematic")
    listener = listen_url("tcp:127.0.0.1:0")
    served = Served(listener.description)

    def tell(_now: int, what: str, detail: str) -> None:
        served.events.append(f"{what}: {detail}")

    pioneer.on_event = tell
    over = threading.Event()
    host = Host(pioneer, listener, on_event=tell)
    thread = threading.Thread(target=lambda: host.run(until=over.is_set))
    thread.start()
    yield served
    over.set()
    thread.join(PATIENCE_S)
    assert not thread.is_alive()


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch) -> Callable[..., int]:
    """The command line, with help that is as wide on every terminal."""
    monkeypatch.setenv("COLUMNS", "100")
    return lambda *words: cli.run([str(word) for word in words])
