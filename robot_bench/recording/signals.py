"""The nets of a recording in the order and groups in which a person reads them.

Names are those of the pin-out (`adapter_sim/pinout.toml`); a recording with
other nets shows them last, in their own group.
"""

from collections.abc import Mapping, Sequence

from adapter_sim.pinout import load_pinout
from robot_bench.wires.edges import Edges

#: Group title → nets, least significant bit first.
GROUPS: Mapping[str, tuple[str, ...]] = {
    "distance": tuple(f"DD{n}" for n in range(1, 9)),
    "motor 1 (left)": tuple(f"motor1_comm{n}" for n in range(1, 5)),
    "motor 2 (right)": tuple(f"motor2_comm{n}" for n in range(1, 5)),
    "encoder 1 (left)": tuple(f"encoder1_s{n}" for n in range(1, 5)),
    "encoder 2 (right)": tuple(f"encoder2_s{n}" for n in range(1, 5)),
    "link": ("p2dx_con", "rst"),
}


def grouped(names: Sequence[str]) -> list[tuple[str, list[str]]]:
    """Return the groups that have a net among `names`, with those nets."""
    known = {net for nets in GROUPS.values() for net in nets}
    groups = [(title, [net for net in nets if net in names]) for title, nets in GROUPS.items()]
    groups.append(("other", [net for net in names if net not in known]))
    return [(title, nets) for title, nets in groups if nets]


def pin_labels() -> dict[str, str]:
    """Return what a person reads beside each net's waveform: the BluePill's pin, and the signal ("PB7 comm1")."""
    wires = load_pinout().wires
    signals = {wire.name: wire.name.rpartition("_")[2] if wire.value else wire.name for wire in wires}
    return {wire.name: f"{wire.bluepill} {signals[wire.name]}" for wire in wires}


def motor_steps(pins: Mapping[str, Edges], motor: int) -> list[tuple[int, int]]:
    """Return the value of a motor's pins over time, as (ns, steps).

    Two's complement with comm1 as the least significant bit. Edges at one
    instant are one change.
    """
    nets = [net for net in GROUPS[f"motor {motor} ({'left' if motor == 1 else 'right'})"] if net in pins]
    if not nets:
        return []
    changes = sorted((t, bit, level) for bit, net in enumerate(nets) for t, level in pins[net])
    width, code = len(nets), 0
    result: list[tuple[int, int]] = []
    for t, bit, level in changes:
        code = code | 1 << bit if level else code & ~(1 << bit)
        value = code - (1 << width) if code >> (width - 1) else code
        if result and result[-1][0] == t:
            result.pop()
        if not result or result[-1][1] != value:
            result.append((t, value))
    return result
