"""Components and the nets between them, as plain values.

Invariant: a `BoardDesign` that exists has no reference twice, and no pin in two nets.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from hardware.pcb.circuit.parts import PARTS, Part
from simbase.errors import P2osError

#: Nets that carry supply current: at least 0.8 mm of copper (rules.py).
POWER_NETS = frozenset({
    "GND", "VIN", "VIN_FUSED", "+12V", "5V_REG", "5V_EXT", "5V_BANK", "+5V", "BP_5V", "ESP_5V", "+3V3",
    "JP8_12V", "JP8_FUSED", "JP8_FEED",
})  # fmt: skip


class DesignError(P2osError):
    """The design contradicts itself."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Component:
    """One part on the board."""

    ref: str
    part: Part
    #: (pin, net) for each pin; None where nothing is connected, on purpose.
    pins: tuple[tuple[str, str | None], ...]
    #: Words for silkscreen and drawings beside the reference.
    label: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class BoardDesign:
    """A whole board of one variant."""

    variant: str
    #: Revision of the pin map (adapter_sim/pinout.toml).
    revision: str
    title: str
    components: tuple[Component, ...]

    def __post_init__(self) -> None:
        """Refuse a reference that stands twice, or a component that has a pin twice.

        Raises:
            DesignError: Names the reference.
        """
        seen: set[str] = set()
        for component in self.components:
            if component.ref in seen:
                raise DesignError(f"{component.ref} stands twice")
            seen.add(component.ref)
            numbers = [pin for pin, _ in component.pins]
            if len(set(numbers)) != len(numbers):
                raise DesignError(f"{component.ref} has a pin twice: {numbers}")

    def component(self, ref: str) -> Component:
        """Return a component by its reference; KeyError where there is none."""
        return {component.ref: component for component in self.components}[ref]

    def nets(self) -> dict[str, list[tuple[str, str]]]:
        """Return (reference, pin) of every net, nets and members sorted."""
        found: dict[str, list[tuple[str, str]]] = {}
        for component in self.components:
            for pin, net in component.pins:
                if net is not None:
                    found.setdefault(net, []).append((component.ref, pin))
        return {
            name: sorted(found[name], key=lambda member: (member[0], _pin_order(member[1]))) for name in sorted(found)
        }


def make(ref: str, key: str, pins: Mapping[str, str | None] | Iterable[str | None], label: str = "") -> Component:
    """Build a component from a part's key; a plain list counts the pins from 1.

    Raises:
        DesignError: The catalogue has no such part.
    """
    if key not in PARTS:
        raise DesignError(f"{ref}: no part {key!r} in the catalogue")
    if isinstance(pins, Mapping):
        rows = tuple(pins.items())
    else:
        rows = tuple((str(number), net) for number, net in enumerate(pins, start=1))
    return Component(ref=ref, part=PARTS[key], pins=rows, label=label)


def _pin_order(pin: str) -> tuple[int, str]:
    return (int(pin), "") if pin.isdigit() else (0, pin)
