"""Running benches shown to viewers, with a library and a gate that note what they are asked for, as approved."""

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import partial
from random import Random
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import pytest

from robot_bench import live
from robot_bench.bench import Bench
from robot_bench.events.kinds import PinEdge
from robot_bench.live import LiveScene, live_scene, place_before
from robot_bench.scenario.loading import load_scenario
from simbase.errors import MissingDependencyError
from simbase.timing import NS_PER_MS
from tests.tools.suite.approved import judge_of, rounded, said, tried


def library(lines: list[str], refused: Callable[[str], bool]) -> Any:
    """Return foxglove-sdk, as far as a scene needs it."""

    def start(**named: Any) -> object:
        host, listener = named["host"], named.pop("server_listener")
        lines.append(f"server {said(named)} {[each.__name__ for each in type(listener).__mro__]}")
        if refused(host):
            raise OSError("refused")
        made.listener = listener
        return SimpleNamespace(port=7, stop=lambda: lines.append("server stops"))

    def channel(topic: str, **named: object) -> object:
        lines.append(f"channel {topic} {said(named)}")
        return SimpleNamespace(log=lambda data, log_time: lines.append(f"{topic} {log_time} {shown(data)}"))

    made = SimpleNamespace(
        Context=lambda: "context", Schema=lambda **named: named, Channel=channel, start_server=start, listener=None,
        set_log_level=lambda level: lines.append(f"level {level}"), ServerListener=type("ServerListener", (), {}),
    )  # fmt: skip
    return made


def shown(data: bytes) -> str:
    return rounded(said(json.loads(data)))


def gate(lines: list[str], taken: int, *given: object) -> object:
    """Return the gate where viewers are met; one port is taken."""
    lines.append(f"gate {said(given)}")
    if given[1] == taken:
        raise OSError("taken")
    return SimpleNamespace(port=given[1] or 4711, close=lambda: lines.append("gate closes"))


def in_place_of(lines: list[str], found: Any, draw: Random) -> ExitStack:
    """Return a block in which scenes are served by a library and a gate that note what they are asked for."""
    block = ExitStack()
    block.enter_context(patch.dict(sys.modules, foxglove=found))
    block.enter_context(patch.object(live, "OriginGate", partial(gate, lines, 99)))

    def drawn(*bounds: int) -> int:
        lines.append(f"one of {bounds}")
        return draw.randrange(*bounds)

    block.enter_context(patch("random.SystemRandom", lambda: SimpleNamespace(randrange=drawn)))
    return block


def places(draw: Random) -> Iterator[str]:
    """Serve at each place, where the hidden address can be had, where only 127.0.0.1 can, and where none can."""
    scenarios = [load_scenario(name) for name in ("motors", "rover")]
    for number, place in enumerate(
        ("8765", "0", "1.2.3.4:5", ":6", "::1:7", "65535", "65536", "x", "1.2.3.4:", ":", "", "-1", "99", "99")
    ):
        for refused in (lambda _: False, lambda host: host != "127.0.0.1", lambda _: True):
            lines = list[str]()
            with in_place_of(lines, library(lines, refused), draw):
                yield f"{place} {tried(served, scenarios[number % 2], place, lines)} {place_before(place)}"
            yield "\n".join(lines)
    with patch.dict(sys.modules, foxglove=None), pytest.raises(MissingDependencyError) as missing:
        LiveScene({})
    yield str(missing.value)  # its hint says how this installation is made


def served(scenario: Any, place: str, lines: list[str]) -> None:
    with live_scene(scenario, place, lines.append, ("https://viewer.example",)) as drive:
        lines.append(drive.__name__)


def scenes(draw: Random) -> Iterator[str]:
    """Run benches before viewers who come before the run, in its midst, several at once, and never."""
    for name, comes_ms in (("sensors", ()), ("sensors", (0, 40, 40, 61)), ("motors", (5,))):
        lines = list[str]()
        found, due = library(lines, lambda _: False), [at * NS_PER_MS for at in comes_ms]
        scenario = load_scenario(name).with_options(mode="direct", body="kinematic", duration_s=0.12)
        bench = Bench(scenario)

        def come(event: Any, due: list[int] = due, found: Any = found, lines: list[str] = lines) -> None:
            while due and event.t >= due[0]:
                lines.append(f"a viewer comes at {event.t}")
                found.listener.on_subscribe("client", "channel")
                del due[0]

        with in_place_of(lines, found, draw):
            scene = LiveScene({"/scene": "foxglove.SceneUpdate"})
            bench.events.subscribe(come)
            scene.drive(bench)
            before = len(lines)
            bench.events.publish(PinEdge(t=bench.now, wire="DD1", level=True))
            yield f"{bench.now} {len(lines) - before} {scene.url}"
            scene.close()
        yield from lines


TRACES = {"places": places, "scenes": scenes}
test_what_viewers_are_shown_is_what_was_approved = judge_of(__file__, TRACES)
