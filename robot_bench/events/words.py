"""Events in words: a line each, for a person who reads why something failed."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields
from decimal import Decimal
from typing import Any

from robot_bench.events.kinds import (
    CanTransfer,
    Clearance,
    Contact,
    Event,
    Fault,
    I2cTransfer,
    Note,
    Packet,
    PinEdge,
    Pose,
    Ranges,
    SpiTransfer,
    Text,
    Verdict,
    Wave,
    WorldChange,
)
from simbase.timing import NS_PER_S

#: chosen: of a long transfer a line shows so many bytes.
_SHOWN_BYTES = 16


def _bytes(data: bytes) -> str:
    return data[:_SHOWN_BYTES].hex(" ") + (f" … ({len(data)} bytes)" if len(data) > _SHOWN_BYTES else "")


def _i2c(i2c: I2cTransfer) -> str:
    verb = "reads" if i2c.is_read else "writes"
    what = f"{i2c.bus} {verb} {i2c.address:#04x}: {_bytes(i2c.data) or 'nothing'}"
    if not i2c.answered:
        return f"{what}, nobody answers"
    is_refused = not i2c.is_read and i2c.acknowledged < len(i2c.data)
    end = {"stop": "", "restart": ", and begins again", "lost": ", loses the bus", "cut": ", cut off"}.get(
        i2c.end, " …"
    )
    return what + (", the last refused" if is_refused else "") + end


def _can(can: CanTransfer) -> str:
    width = 8 if can.is_extended else 3
    verb = "sends" if can.is_own else "hears"
    what = f"asks for {can.dlc} bytes" if can.is_remote else _bytes(can.data) or "nothing"
    error = {"": "", "acknowledge": ", nobody acknowledges"}.get(can.error, f", {can.error}")
    return f"{can.bus} {verb} {can.identifier:0{width}x}: {what}{error}"


_WORDS: Mapping[type, Callable[[Any], str]] = {
    PinEdge: lambda edge: f"{edge.wire} {'high' if edge.level else 'low'}",
    Wave: lambda wave: f"{wave.wire} at {wave.frequency_hz:g} Hz, {wave.duty:.1%}",
    Text: lambda text: f"{text.port} sends {text.data.decode('utf-8', 'replace').rstrip()!r}",
    SpiTransfer: lambda spi: f"{spi.bus} sends {_bytes(spi.from_master)}, gets {_bytes(spi.from_slave)}",
    I2cTransfer: _i2c,
    CanTransfer: _can,
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
#: Fields in millionths, and of what.
_MICRO: Mapping[str, str] = {
    "x": "m", "y": "m", "z": "m", "um": "m", "heading": "rad", "pitch": "rad", "left_angle": "rad",
    "right_angle": "rad", "left": "m/s", "right": "m/s", "work": "J",
}  # fmt: skip
#: What there is so much of that it would hide the rest.
_FREQUENT = (PinEdge, Packet, Pose, Clearance, Ranges, SpiTransfer, I2cTransfer, CanTransfer)


def is_frequent(event: Event) -> bool:
    """Tell whether there is so much of an event's kind that it would hide the rest."""
    return isinstance(event, _FREQUENT)


def words_of(event: Event) -> str:
    """Return an event with its time in one line."""
    return f"{event.t / NS_PER_S:10.6f} s  {what_of(event)}"


def what_of(event: Event) -> str:
    """Return an event in words, without its time."""
    return _WORDS[type(event)](event)


def distinguishing_words(one: Event, other: Event) -> tuple[str, str]:
    """Return two events in words, with all that they differ in, to the last digit, where the words are the same."""
    words, others = what_of(one), what_of(other)
    if words != others or type(one) is not type(other):
        return words, others
    names = [part.name for part in fields(one) if part.name != "t"]
    pairs = [(name, getattr(one, name), getattr(other, name)) for name in names]
    parted = [_exact(name, ours, theirs) for name, ours, theirs in pairs if ours != theirs]
    if not parted:
        return words, others
    return (
        f"{words} ({', '.join(ours for ours, _ in parted)})",
        f"{others} ({', '.join(theirs for _, theirs in parted)})",
    )


def _exact(name: str, one: object, other: object) -> tuple[str, str]:
    """Return a field of two events, of its elements those that differ, as exactly as it is recorded."""
    if isinstance(one, bytes) and isinstance(other, bytes):
        at = next((n for n, (a, b) in enumerate(zip(one, other, strict=False)) if a != b), min(len(one), len(other)))
        ours, theirs = (f"{name} from byte {at} on: {_bytes(data[at:]) or 'nothing'}" for data in (one, other))
        return ours, theirs
    if isinstance(one, tuple) and isinstance(other, tuple):
        one, other = (dict(enumerate(items, 1)) for items in (one, other))
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        keys = [key for key in {**one, **other} if (key in one, one.get(key)) != (key in other, other.get(key))]
        ours, theirs = (
            " ".join(f"{key} {items[key]!r}" if key in items else f"no {key}" for key in keys) for items in (one, other)
        )
        return f"{name}: {ours}", f"{name}: {theirs}"
    unit = _MICRO.get(name, "")
    if unit and isinstance(one, int) and isinstance(other, int):
        word = name.replace("_", " ") + " " if name != "um" else ""
        return f"{word}{_millionths(one)} {unit}", f"{word}{_millionths(other)} {unit}"
    return f"{name} {one!r}", f"{name} {other!r}"


def _millionths(value: int) -> str:
    return f"{Decimal(value).scaleb(-6):f}"


def last_words(events: Iterable[Event], count: int = 8) -> list[str]:
    """Return the last events in words, those aside that come again and again."""
    return [words_of(event) for event in events if not is_frequent(event)][-count:]
