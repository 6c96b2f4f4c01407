"""The messages of a long run: of each topic how many, the first two whole, and a sum over all."""

import hashlib
import json

from robot_bench.events.kinds import Contact, Pose, Wave
from robot_bench.recording.run_record import RunRecord
from robot_bench.recording.scene_messages import Message, SceneMessages, topics
from robot_bench.recording.summary import figures, outcome_of
from tests.robot_bench.recording.kept_lines import is_as_kept
from tests.robot_bench.recording.long_run import META, MORE, long_run
from tests.robot_bench.recording.records import S


def plain(message: Message) -> str:
    """Return what a message says, its numbers to nine digits."""
    text = json.dumps(message.data)
    return json.dumps(json.loads(text, parse_float=lambda number: f"{float(number):.9g}"), sort_keys=True)


def test_the_messages_of_a_long_run() -> None:
    scene, bare = SceneMessages(META), SceneMessages({})
    found: dict[str, list[Message]] = {}
    events = sorted([*MORE, *long_run(3)], key=lambda event: event.t)
    for event in events[: len(events) // 2]:
        for message in (*scene.of(event), *bare.of(event)):
            found.setdefault(message.topic, []).append(message)
    for message in (*scene.anew(7), *bare.anew(8)):
        found.setdefault(f"{message.topic} anew", []).append(message)
    lines = [str(topics(2, ["led"]))]
    for topic, messages in found.items():
        said = [f"{one.schema} {one.t} {plain(one)}" for one in messages]
        whole = hashlib.sha256("\n".join(said).encode()).hexdigest()[:16]
        lines += [f"{topic}: {len(said)} {whole}", *(f"  {one[:1500]}" for one in said[:2])]
    assert is_as_kept(lines, "messages_of_a_long_run")


def run_of(**changes: object) -> RunRecord:
    poses = [event for event in long_run(3) if isinstance(event, Pose)]
    waves = [event for event in long_run(3) if isinstance(event, Wave)]
    given: dict[str, object] = {
        "meta": {**META, "scenario": "mine"}, "is_cut": False, "poses": poses, "last_ns": 40 * S,
        "contacts": [event for event in long_run(3) if isinstance(event, Contact)] * 9,
        "waves": {"pwm": [*enumerate(waves)], "led": [(5, None)]},
        "end": {"passed": True, "goals_met": ["a"], "min_clearance_m": 0.25, "real_time_factor": 3.21,
                "virtual_s": 40.0, "coverage": {"a.c": 1}, "explained": "because"},
    }  # fmt: skip
    return RunRecord(**given | changes)  # type: ignore[arg-type]


def test_the_figures_of_a_long_run() -> None:
    lines = []
    same = Wave(t=0, wire="pwm", at=0, period=10, high=3, ticks_hz=1000)
    for record in (
        run_of(),
        run_of(is_cut=True, end={}),
        run_of(poses=[], contacts=[], waves={"pwm": [(0, same)]}, end={}),
    ):
        lines += [*map(str, figures(record)), json.dumps(outcome_of(record), default=str)]
    assert is_as_kept(lines, "figures_of_a_long_run")
