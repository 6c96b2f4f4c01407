"""The circuit between two modules: resistors, what the pads drive, and the voltage of each pad; faults can be planted.

Direct currents only: no capacitance, no edge times. A pad reads by its chip's data sheet: what stands between the
limits of low and high is read as `between`, which a test sets to each.

Source: hardware/pcb/circuit/design.py for the board (a test compares), DS5319 and the ESP32 data sheet for the pads.
Invariant: a voltage depends on what is driven now and on the faults, on nothing before.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, StrEnum

from adapter_sim.pinout import Pinout, Pull, Wire, WireRole

RAIL_V = 3.3
SERIES_OHM = 1200
#: The BluePill's LED pulls PC13 up; a smaller resistor holds a low against it.
SERIES_SPECIAL_OHM = {"encoder2_s1": 680}
PULL_OHM = 20_000
#: From rst to the base of Q1, from there to ground, and EN's pull-up on the module.
BASE_OHM, BASE_PULL_OHM, EN_PULL_OHM = 4700, 47_000, 10_000
#: An output of either chip; chosen: of the order of both data sheets' drive strengths.
OUTPUT_OHM = 50
#: The chips' own pulls.
BLUEPILL_PULL_OHM, ESP32_PULL_OHM = 40_000, 45_000
#: A solder bridge, and Q1 when it conducts.
SHORT_OHM, TRANSISTOR_OHM = 0.1, 10
#: Where Q1 begins to conduct, at its base.
BASE_ON_V = 0.65
#: BluePill's LED on PC13: its diode's voltage, and its resistor (510 Ω on most boards, 1k on some).
LED_V, LED_OHM, LED_PIN = 1.8, 1000, "PC13"


@dataclass(frozen=True, slots=True)
class InputLimits:
    """Up to `low_v` a pad reads 0, from `high_v` on 1."""

    low_v: float
    high_v: float


#: DS5319 table 35, standard pins at 3.3 V: 0.28 (VDD - 2 V) + 0.8 V and 0.41 (VDD - 2 V) + 1.3 V.
BLUEPILL_INPUT = InputLimits(1.164, 1.833)
#: ESP32 data sheet, DC characteristics: 0.25 VDD and 0.75 VDD.
ESP32_INPUT = InputLimits(0.825, 2.475)


class Side(StrEnum):
    """Where on a wire: the BluePill's pad, or the ESP32's (for rst the base of Q1)."""

    BLUEPILL = "bluepill"
    ESP32 = "esp32"


#: A pad: the wire's name and the side; or EN.
Node = tuple[str, Side]
EN: Node = ("EN", Side.ESP32)


class WireFault(Enum):
    """What can be wrong with a wire."""

    OPEN = "open"
    #: The pin of a module is not soldered.
    UNSOLDERED = "unsoldered"
    GND = "gnd"
    RAIL = "3v3"
    SHORT = "short"
    SWAPPED = "swapped"


@dataclass(frozen=True, slots=True)
class BoardFault:
    """A fault of the board.

    `other` is the second wire of a short or a swap; `side` is where a short, a rail or an unsoldered pin is.
    """

    kind: WireFault
    wire: str
    other: str = ""
    side: Side = Side.BLUEPILL


@dataclass(frozen=True, slots=True)
class VoltageSource:
    """A voltage behind a resistor, at a node."""

    volts: float
    ohm: float


class Circuit:
    """The wires of a board.

    Args:
        pinout: The wires.
        faults: What is wrong with them.
    """

    def __init__(self, pinout: Pinout, faults: tuple[BoardFault, ...] = ()) -> None:
        self._wires = pinout.wires
        self._links: list[tuple[Node, Node, float]] = []
        self._fixed: dict[Node, list[VoltageSource]] = {EN: [VoltageSource(RAIL_V, EN_PULL_OHM)]}
        #: Pads that are not soldered: they float, or follow their chip's own pull.
        self._loose: set[Node] = set()
        self._reset = next(wire.name for wire in pinout.wires if wire.role is WireRole.RESET)
        ends = {wire.name: wire.name for wire in pinout.wires}
        is_open = set()
        for fault in faults:
            if fault.kind is WireFault.SWAPPED:
                ends[fault.wire], ends[fault.other] = ends[fault.other], ends[fault.wire]
            elif fault.kind is WireFault.OPEN:
                is_open.add(fault.wire)
            elif fault.kind is WireFault.UNSOLDERED:
                self._loose.add((fault.wire, fault.side))
            elif fault.kind is WireFault.SHORT:
                other = EN if fault.other == "EN" else (fault.other, fault.side)
                self._links.append(((fault.wire, fault.side), other, SHORT_OHM))
            else:
                volts = RAIL_V if fault.kind is WireFault.RAIL else 0.0
                self._fixed.setdefault((fault.wire, fault.side), []).append(VoltageSource(volts, SHORT_OHM))
        for wire in pinout.wires:
            self._place(wire, ends[wire.name], is_open=wire.name in is_open)
        self._groups = self._joined()
        self._group_of = {node: number for number, group in enumerate(self._groups) for node in group}
        #: What a group's nodes have by what drives them.
        self._known: dict[tuple[int, tuple[tuple[Node, VoltageSource], ...]], dict[Node, float]] = {}
        #: What they have while nothing drives any.
        self._alone = {node: volts for group in self._groups for node, volts in self._solve_group(group, {}).items()}

    def _place(self, wire: Wire, end: str, *, is_open: bool) -> None:
        """Put a wire's resistors; it begins at the BluePill's pad of the wire `end`."""
        is_reset = wire.role is WireRole.RESET
        if not is_open:
            ohm = BASE_OHM if is_reset else SERIES_SPECIAL_OHM.get(wire.name, SERIES_OHM)
            self._links.append(((end, Side.BLUEPILL), (wire.name, Side.ESP32), float(ohm)))
        if wire.pull is not Pull.NONE:
            volts = RAIL_V if wire.pull is Pull.UP else 0.0
            ohm = BASE_PULL_OHM if is_reset else PULL_OHM
            self._fixed.setdefault((wire.name, Side.ESP32), []).append(VoltageSource(volts, ohm))

    def _joined(self) -> list[list[Node]]:
        """Return the nodes that resistors join, in groups."""
        group_of: dict[Node, list[Node]] = {EN: [EN]}
        for wire in self._wires:
            for side in Side:
                group_of[wire.name, side] = [(wire.name, side)]
        for one, other, _ in self._links:
            if group_of[one] is not group_of[other]:
                group_of[one] += group_of[other]
                for node in group_of[other]:
                    group_of[node] = group_of[one]
        return list({id(group): group for group in group_of.values()}.values())

    def volts(self, drives: Mapping[Node, VoltageSource]) -> dict[Node, float]:
        """Return each pad's voltage, and that of EN, while the chips put `drives` on their pads."""
        result = self._solve({node: [source] for node, source in drives.items() if node not in self._loose})
        if result[self._reset, Side.ESP32] > BASE_ON_V:
            on = {node: [source] for node, source in drives.items() if node not in self._loose}
            on.setdefault(EN, []).append(VoltageSource(0.0, TRANSISTOR_OHM))
            result |= {node: volts for node, volts in self._solve(on).items() if node != (self._reset, Side.ESP32)}
        for node in self._loose:
            source = drives.get(node)
            result[node] = RAIL_V / 2 if source is None else source.volts
        return result

    def _solve(self, drives: Mapping[Node, list[VoltageSource]]) -> dict[Node, float]:
        result, driven = dict(self._alone), dict[int, list[tuple[Node, VoltageSource]]]()
        for node, sources in drives.items():
            driven.setdefault(self._group_of[node], []).extend((node, source) for source in sources)
        for number, pairs in driven.items():
            key = number, tuple(pairs)
            if key not in self._known:
                self._known[key] = self._solve_group(self._groups[number], drives)
            result |= self._known[key]
        return result

    def _solve_group(self, group: list[Node], drives: Mapping[Node, list[VoltageSource]]) -> dict[Node, float]:
        led = next((node for node in group if node[1] is Side.BLUEPILL and self._is_led(node[0])), None)
        volts = self._nodal(group, drives, None)
        # The LED conducts only where the pad is lower than its rail by the diode's voltage.
        return volts if led is None or volts[led] >= RAIL_V - LED_V else self._nodal(group, drives, led)

    def _is_led(self, name: str) -> bool:
        return any(wire.name == name and wire.bluepill == LED_PIN for wire in self._wires)

    def _nodal(
        self, group: list[Node], drives: Mapping[Node, list[VoltageSource]], led: Node | None
    ) -> dict[Node, float]:
        """Solve the group's currents; a node that nothing holds stands half-way."""
        place = {node: number for number, node in enumerate(group)}
        size = len(group)
        # A resistor that is too large to matter keeps what floats from having no solution.
        rows = [[0.0] * size + [RAIL_V / 2 * 1e-12] for _ in group]
        for number in range(size):
            rows[number][number] = 1e-12
        for node in group:
            sources = [*self._fixed.get(node, ()), *drives.get(node, ())]
            if node == led:
                sources.append(VoltageSource(RAIL_V - LED_V, LED_OHM))
            for source in sources:
                rows[place[node]][place[node]] += 1 / source.ohm
                rows[place[node]][size] += source.volts / source.ohm
        for one, other, ohm in self._links:
            if one in place:
                here, there = place[one], place[other]
                rows[here][here] += 1 / ohm
                rows[there][there] += 1 / ohm
                rows[here][there] -= 1 / ohm
                rows[there][here] -= 1 / ohm
        return dict(zip(group, _solved(rows), strict=True))


def _solved(rows: list[list[float]]) -> list[float]:
    """Return the solution of linear equations, each row with its right side last (Gauss, with pivots)."""
    size = len(rows)
    for column in range(size):
        pivot = max(range(column, size), key=lambda row: abs(rows[row][column]))
        rows[column], rows[pivot] = rows[pivot], rows[column]
        for row in range(size):
            if row != column and rows[row][column]:
                factor = rows[row][column] / rows[column][column]
                rows[row] = [a - factor * b for a, b in zip(rows[row], rows[column], strict=True)]
    return [rows[place][size] / rows[place][place] for place in range(size)]
