"""The nets of a recording in the order and groups in which a person reads them.

Names are those of the pin-out (`adapter_sim/pinout.toml`); a recording with
other nets shows them last, in their own group.
"""

from array import array
from collections.abc import Iterator, Mapping, Sequence
from typing import overload

from adapter_sim.pinout import load_pinout
from robot_bench.recording.run_record import RunRecord
from robot_bench.wires.edges import Edges, codes

#: Group title → nets, least significant bit first.
GROUPS: Mapping[str, tuple[str, ...]] = {
    "distance": tuple(f"DD{n}" for n in range(1, 9)),
    "motor 1 (left)": tuple(f"motor1_comm{n}" for n in range(1, 5)),
    "motor 2 (right)": tuple(f"motor2_comm{n}" for n in range(1, 5)),
    "encoder 1 (left)": tuple(f"encoder1_s{n}" for n in range(1, 5)),
    "encoder 2 (right)": tuple(f"encoder2_s{n}" for n in range(1, 5)),
    "link": ("p2dx_con", "rst"),
}

#: Beginnings of the nets of a robot on own pins.
SIDES = ("left", "right")


def grouped(names: Sequence[str]) -> list[tuple[str, list[str]]]:
    """Return the groups that have a net among `names`, with those nets.

    Of the nets of a robot on own pins, those of a side are one.
    """
    known = {net for nets in GROUPS.values() for net in nets}
    groups = [(title, [net for net in nets if net in names]) for title, nets in GROUPS.items()]
    others = [net for net in names if net not in known]
    groups += [(side, [net for net in others if net.startswith(f"{side}_")]) for side in SIDES]
    groups.append(("other", [net for net in others if not net.startswith(tuple(f"{side}_" for side in SIDES))]))
    return [(title, nets) for title, nets in groups if nets]


def pin_labels() -> dict[str, str]:
    """Return what a person reads beside each net's waveform: the BluePill's pin, and the signal ("PB7 comm1")."""
    wires = load_pinout().wires
    signals = {wire.name: wire.name.rpartition("_")[2] if wire.value else wire.name for wire in wires}
    return {wire.name: f"{wire.bluepill} {signals[wire.name]}" for wire in wires}


def levels_and_duties(record: RunRecord, net: str) -> list[tuple[int, float]]:
    """Return what a net was from when on: 0 or 1, or the duty of the wave that it shows."""
    edges = record.pins[net]
    duties = {at: wave.duty for at, wave in record.waves.get(net, []) if wave is not None}
    return sorted((dict(edges) | duties).items())


class SignalSteps(Sequence[tuple[int, int]]):
    """Signed values over time, as (ns, steps), oldest first."""

    def __init__(self, times: "array[int]", values: "array[int]") -> None:
        self.times, self.values = times, values

    def __len__(self) -> int:
        return len(self.times)

    @overload
    def __getitem__(self, place: int) -> tuple[int, int]: ...
    @overload
    def __getitem__(self, place: slice) -> "SignalSteps": ...
    def __getitem__(self, place: int | slice) -> "tuple[int, int] | SignalSteps":
        if isinstance(place, int):
            return self.times[place], self.values[place]
        return SignalSteps(self.times[place], self.values[place])

    def __iter__(self) -> Iterator[tuple[int, int]]:
        return zip(self.times, self.values, strict=True)

    def __eq__(self, other: object) -> bool:
        return list(self) == list(other) if isinstance(other, Sequence) else NotImplemented

    __hash__ = None  # type: ignore[assignment]  # it holds arrays


def motor_steps(pins: Mapping[str, Edges], motor: int) -> SignalSteps:
    """Return the value of a motor's pins over time, as (ns, steps).

    Two's complement with comm1 as the least significant bit. Edges at one
    instant are one change.
    """
    nets = [net for net in GROUPS[f"motor {motor} ({'left' if motor == 1 else 'right'})"] if net in pins]
    found, sign = codes([pins[net] for net in nets]), 1 << max(0, len(nets) - 1)
    signed = bytes((code ^ sign) - sign & 0xFF for code in range(256))
    return SignalSteps(found.times, array("b", bytes(found.levels).translate(signed)))
