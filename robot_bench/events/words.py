"""Events in words: a line each, for a person who reads why something failed."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from robot_bench.events.kinds import (
    Clearance,
    Contact,
    Event,
    Fault,
    Note,
    Packet,
    PinEdge,
    Pose,
    Ranges,
    Text,
    Verdict,
    Wave,
    WorldChange,
)
from simbase.timing import NS_PER_S

_WORDS: Mapping[type, Callable[[Any], str]] = {
    PinEdge: lambda edge: f"{edge.wire} {'high' if edge.level else 'low'}",
    Wave: lambda wave: f"{wave.wire} at {wave.frequency_hz:g} Hz, {wave.duty:.1%}",
    Text: lambda text: f"{text.port} sends {text.data.decode('utf-8', 'replace').rstrip()!r}",
    Packet: lambda packet: f"{packet.direction} {packet.data.hex()}",
    Pose: lambda pose: f"robot at x {pose.x_m:.2f} m, y {pose.y_m:.2f} m, {pose.speed_mps:+.2f} m/s",
    Clearance: lambda clearance: f"{clearance.um / 1e6:.3f} m of clearance",
    Ranges: lambda ranges: f"sonar {' '.join(f'{mm / 1000:.2f}' for mm in ranges.mm)} m",
    Contact: lambda hit: f"contact with {hit.place}",
    Note: lambda note: f"{note.who}: {note.what}{', ' if note.detail else ''}{note.detail}",
    WorldChange: lambda change: f"{change.name!r}: {change.op}",
    Fault: lambda fault: f"fault {fault.op}: {fault.words}",
    Verdict: lambda verdict: f"goal {'met' if verdict.met else 'missed'}: {verdict.goal}",
}
#: What there is so much of that it would hide the rest.
_FREQUENT = (PinEdge, Packet, Pose, Clearance, Ranges)


def words_of(event: Event) -> str:
    """Return an event with its time in one line."""
    return f"{event.t / NS_PER_S:10.6f} s  {what_of(event)}"


def what_of(event: Event) -> str:
    """Return an event in words, without its time."""
    return _WORDS[type(event)](event)


def last_words(events: Iterable[Event], count: int = 8) -> list[str]:
    """Return the last events in words, those aside that come again and again."""
    return [words_of(event) for event in events if not isinstance(event, _FREQUENT)][-count:]
