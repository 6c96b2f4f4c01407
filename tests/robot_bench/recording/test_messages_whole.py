"""The messages of a long run: of each topic how many, the first two whole, and a sum over all."""

import hashlib
import json

from robot_bench.recording.scene_messages import Message, SceneMessages, topics
from tests.robot_bench.recording.kept_lines import is_as_kept
from tests.robot_bench.recording.long_run import META, MORE, long_run


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
