"""How each kind of packet is read into a table: by its own declaration, whole columns at a time."""

from collections.abc import Callable, Mapping

import numpy as np
from construct import Construct, Struct

from p2os.capture.columns.gathering import gather
from p2os.capture.columns.walker import PacketWalk, Spans
from p2os.protocol.config_packet import FIELDS, ConfigPacket
from p2os.protocol.packets import PACKET_KINDS, BatteryPacket, CompassPacket, PlaylistPacket, SiminfoPacket
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import HEAD, TAIL

#: Reads into a walk; the walk's `sound` says which packets it could read.
Reader = Callable[[PacketWalk, Profile], None]
#: Fields of a layout that only count others; a battery packet keeps its own, as its rows may be empty.
COUNTS = frozenset({"count", "input_count", "output_count", "analog_count"})

_TAIL_TYPES = {(1, False): "u1", (1, True): "i1", (2, False): "<u2", (2, True): "<i2", (4, False): "<u4"}
#: The tail as one record, and how many of its fields fit in so many bytes.
TAIL_NAMES = tuple(name for name, _, _ in TAIL)
TAIL_RECORD = np.dtype([(name, _TAIL_TYPES[width, signed]) for name, width, signed in TAIL])
_TAIL_ENDS = np.cumsum([width for _, width, _ in TAIL])
_TAIL_FIELDS = np.searchsorted(_TAIL_ENDS, np.arange(256), side="right").astype(np.uint8)
_TAIL_BYTES = np.concatenate(([0], _TAIL_ENDS))


def by_layout(layout: Construct, *, keep: str = "") -> Reader:
    """Return the reader of a packet that is one declared layout and what follows it."""

    def read(walk: PacketWalk, profile: Profile) -> None:
        del profile
        walk.read(layout)
        for name in COUNTS & walk.columns.keys() - {keep}:
            del walk.columns[name]
        take_rest(walk)

    return read


def take_rest(walk: PacketWalk, name: str = "rest") -> None:
    """Keep what follows the last known field."""
    walk.texts[name] = Spans(walk.places, walk.ends)


def read_sip(walk: PacketWalk, profile: Profile) -> None:
    """Read standard SIPs in all their lengths."""
    walk.columns["kind"] = walk.data[walk.places - 1]
    walk.read(HEAD)
    columns = walk.columns
    del columns["count"]
    left, right = columns.pop("left"), columns.pop("right")
    first, second = columns.pop("first"), columns.pop("second")
    if profile.has_gripper_first:
        first, second = second, first
    columns["analog_port"], columns["gripper_state"] = first, second
    for side, bumpers, raw in (("left", "rear", left), ("right", "front", right)):
        columns[f"stall_{side}"] = (raw & 1).astype(np.bool_)
        columns[f"{bumpers}_bumpers"] = raw >> 1
    _read_tail(walk)
    take_rest(walk)


def _read_tail(walk: PacketWalk) -> None:
    """Read as many fields of the tail as each packet has room for; those that it has not are 0."""
    counts = _TAIL_FIELDS[np.clip(walk.ends - walk.places, 0, 255)]
    counts[~walk.sound] = 0
    walk.columns["tail_count"] = counts
    tail = np.zeros(len(counts), TAIL_RECORD)
    for count in np.flatnonzero(np.bincount(counts, minlength=1)).tolist():
        if count:
            rows = np.flatnonzero(counts == count)
            record = np.dtype([(name, TAIL_RECORD[name]) for name in TAIL_NAMES[:count]])
            found = gather(walk.data, walk.places[rows], record, None)
            for name in TAIL_NAMES[:count]:
                tail[name][rows] = found[name]
    for name in TAIL_NAMES:
        walk.columns[name] = tail[name]
    walk.places = walk.places + _TAIL_BYTES[counts]


def read_config(walk: PacketWalk, profile: Profile) -> None:
    """Read CONFIGpacs; a field that was not sent is 0 or empty, as in the packet's class."""
    del profile
    sent = np.zeros(len(walk.places), np.uint8)
    for name, kind in FIELDS:
        if hasattr(kind, "fmtstr"):
            walk.take_number(name, kind)
        else:
            walk.texts[name] = walk.take_text()
        sent += walk.sound
        if name == "hightemp":
            walk.columns[name][~walk.sound] = ConfigPacket().hightemp
    walk.columns["fields_sent"] = sent
    walk.sound[:] = True
    take_rest(walk)


def read_identity(walk: PacketWalk, profile: Profile) -> None:
    """Read identities: three texts and nothing more."""
    del profile
    for name in ("name", "robot_class", "subclass"):
        walk.texts[name] = walk.take_text()
    walk.sound &= walk.places == walk.ends


def read_bytes(walk: PacketWalk, profile: Profile) -> None:
    """Read packets that have a type and bytes: SERAUXpacs, reset notices, and what is not read."""
    del profile
    walk.columns["kind"] = walk.data[walk.places - 1]
    take_rest(walk, "data")


def read_playlist(walk: PacketWalk, profile: Profile) -> None:
    """Read PLAYLISTpacs; a robot without sounds sends zeros, one less than a sound takes."""
    del profile
    starts, size = walk.places, len(PlaylistPacket.NO_SOUNDS)
    could_be_none = walk.ends - starts == size
    record = np.dtype([("bytes", "u1", (size,))])
    none = could_be_none & ~gather(walk.data, starts, record, could_be_none)["bytes"].any(axis=1)
    walk.read(PlaylistPacket.LAYOUT)
    walk.columns["has_sound"] = ~none
    walk.sound |= none
    walk.places = np.where(none, walk.ends, walk.places)
    name = walk.texts["raw_name"]
    name.ends = np.where(none, name.starts, name.ends)
    take_rest(walk)


def read_siminfo(walk: PacketWalk, profile: Profile) -> None:
    """Read SIMINFOs: their devices have texts of any length, so one device of each packet is read at a time."""
    del profile
    *head, devices = SiminfoPacket.LAYOUT.subcons
    walk.read(Struct(*head))
    counts = walk.columns.pop("count")
    walk.ragged[devices.name] = walk.take_items(devices.subcon.subcon, counts)
    take_rest(walk)


#: Name of a table → how its packets are read: by their layout, where it is not said otherwise.
READERS: Mapping[str, Reader] = {
    **{row.table: by_layout(row.layout) for row in PACKET_KINDS if row.layout is not None},
    "sip": read_sip,
    "identity": read_identity,
    "config": read_config,
    "compass_unsized": by_layout(CompassPacket.READING),
    "seraux": read_bytes,
    "playlist": read_playlist,
    "battery": by_layout(BatteryPacket.LAYOUT, keep="count"),
    "reset": read_bytes,
    "siminfo": read_siminfo,
    "raw": read_bytes,
}
