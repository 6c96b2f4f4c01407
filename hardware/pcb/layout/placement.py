"""Where every part stands, in millimetres from the board's upper left corner.

Left: the BluePill; middle: one row for each wire (series resistor, pull-down), in
the order of the BluePill's pins so that few tracks cross; right: the ESP32 with its
antenna at the upper edge; below: supply, RS-232 and the connectors at the lower edge.

Invariant: `place` gives every component of a board variant exactly one place.
"""

from dataclasses import dataclass

from adapter_sim.pinout import load_pinout
from hardware.pcb.circuit.design import PULL_OFFSET, series_wires
from hardware.pcb.circuit.modules import BLUEPILL_PINS
from hardware.pcb.circuit.netlist import BoardDesign, DesignError
from hardware.pcb.layout.footprints import BLUEPILL_ROWS_MM, PITCH_MM
from hardware.pcb.layout.shapes import Label


@dataclass(frozen=True, slots=True, kw_only=True)
class Placement:
    """Position and angle of a part; `ref_mm` moves its reference (relative to the part, board axes)."""

    x_mm: float
    y_mm: float
    angle_deg: float = 0.0
    ref_mm: tuple[float, float] | None = None


#: Pin 1 of the modules.
BLUEPILL_AT_MM = (11.0, 10.5)
ESP32_AT_MM = (62.5, 11.5)
#: The rows of resistors: first row, distance, columns of series resistor and pull-down.
ROW_TOP_MM, ROW_PITCH_MM, SERIES_X_MM, PULL_X_MM = 8.5, 2.75, 46.0, 52.6


def place(design: BoardDesign) -> dict[str, Placement]:
    """Return the place of every component.

    Raises:
        DesignError: A component has none, or there is one too many.
    """
    places = {**_FIXED, **_VARIANTS[design.variant], **_rows(design)}
    refs = {component.ref for component in design.components}
    if refs != set(places):
        raise DesignError(f"no place for {sorted(refs - set(places))}; no part for {sorted(set(places) - refs)}")
    return places


def row_order() -> list[str]:
    """Return the names of the wires with a resistor, from the top row to the bottom row."""
    heights = {}
    for number, pin in enumerate(BLUEPILL_PINS):
        is_left = number < 20
        heights[pin] = (number if is_left else 39 - number, is_left)
    wires = series_wires(load_pinout())
    return [wire.name for wire in sorted(wires, key=lambda wire: heights[wire.bluepill])]


def silk_labels(design: BoardDesign) -> list[Label]:
    """Return the texts of the board that belong to no part."""
    return [*_TEXTS, *_header_names(design), *_TEXTS_OF[design.variant]]


def short_name(wire: str) -> str:
    """Return the name of a wire that fits beside a pin: DD1, E1S2, M2C3, CON."""
    return wire.replace("encoder", "E").replace("motor", "M").replace("_s", "S").replace("_comm", "C").replace(
        "p2dx_con", "CON").upper()  # fmt: skip


def unturn(offset: tuple[float, float], angle: float) -> tuple[float, float]:
    """Return an offset in board axes as one in the axes of a turned footprint."""
    x, y = offset
    quarter = round(angle / 90) % 4
    return {0: (x, y), 1: (-y, x), 2: (-x, -y), 3: (y, -x)}[quarter]


def _rows(design: BoardDesign) -> dict[str, Placement]:
    refs = {component.ref for component in design.components}
    places = {}
    numbers = {wire.name: number for number, wire in enumerate(series_wires(load_pinout()), start=1)}
    for row, name in enumerate(row_order()):
        y = ROW_TOP_MM + ROW_PITCH_MM * row
        places[f"R{numbers[name]}"] = Placement(x_mm=SERIES_X_MM, y_mm=y, ref_mm=(3.1, 0))
        pull = f"R{numbers[name] + PULL_OFFSET}"
        if pull in refs:
            places[pull] = Placement(x_mm=PULL_X_MM, y_mm=y, ref_mm=(3.1, 0))
    return places


def _header_names(design: BoardDesign) -> list[Label]:
    """Return the name of each net beside its pin of the logic header."""
    header, at = design.component("J4"), _FIXED["J4"]
    labels = []
    for pin, net in header.pins:
        row, column = divmod(int(pin) - 1, 2)
        text = (
            "GND"
            if net == "GND"
            else "RST"
            if net == "RST_REQ"
            else short_name((net or "").removesuffix("_BP").lower())
        )
        x = at.x_mm + (-1.75 if column == 0 else PITCH_MM + 1.75)
        labels.append(Label(layer="F.SilkS", text=text, at_mm=(x, at.y_mm + PITCH_MM * row), size_mm=0.8,
                            justify="right" if column == 0 else "left"))  # fmt: skip
    return labels


_BP_X, _BP_Y = BLUEPILL_AT_MM
_FIXED = {
    "U1": Placement(x_mm=_BP_X, y_mm=_BP_Y),
    "U2": Placement(x_mm=ESP32_AT_MM[0], y_mm=ESP32_AT_MM[1]),
    "J4": Placement(x_mm=_BP_X + BLUEPILL_ROWS_MM + 9.2, y_mm=17.5, ref_mm=(1.27, -2.6)),
    # 12 V input, from the lower left corner to the right
    "J1": Placement(x_mm=11.0, y_mm=94.4, ref_mm=(2.54, 3.6)),
    "F1": Placement(x_mm=10.5, y_mm=83.5),
    "D1": Placement(x_mm=18.6, y_mm=83.5, angle_deg=180),
    "D2": Placement(x_mm=25.6, y_mm=83.0, angle_deg=90, ref_mm=(-2.9, -2.2)),
    "C1": Placement(x_mm=32.0, y_mm=80.5, angle_deg=270),
    "C2": Placement(x_mm=26.0, y_mm=76.6),
    # 5 V from a power bank
    "J2": Placement(x_mm=26.0, y_mm=93.7, ref_mm=(7.6, 0)),
    "D3": Placement(x_mm=40.5, y_mm=92.5, angle_deg=180),
    "JP1": Placement(x_mm=55.0, y_mm=82.0, ref_mm=(0, 7.4)),
    "C4": Placement(x_mm=51.0, y_mm=77.0, angle_deg=90, ref_mm=(2.3, 0)),
    "D4": Placement(x_mm=13.0, y_mm=69.0, angle_deg=0),
    "D5": Placement(x_mm=66.5, y_mm=52.0),
    "R61": Placement(x_mm=43.5, y_mm=96.5),
    "D6": Placement(x_mm=50.0, y_mm=96.5, angle_deg=180),
    "C3": Placement(x_mm=51.0, y_mm=88.0, angle_deg=270, ref_mm=(-2.3, 0)),
    # RS-232
    "U5": Placement(x_mm=76.0, y_mm=71.0),
    "C5": Placement(x_mm=69.0, y_mm=67.0, angle_deg=270, ref_mm=(2.1, 0)),
    "C6": Placement(x_mm=69.0, y_mm=73.5, angle_deg=270, ref_mm=(2.1, 0)),
    "C7": Placement(x_mm=64.8, y_mm=67.0, angle_deg=270, ref_mm=(2.1, 0)),
    "C8": Placement(x_mm=64.8, y_mm=73.5, angle_deg=270, ref_mm=(2.1, 0)),
    "C9": Placement(x_mm=82.5, y_mm=66.0, angle_deg=270, ref_mm=(2.1, 0)),
    # 0.3 mm nearer to the edge than KiCad's footprint has it: a board that is cut large must not hold the plug back.
    "J3": Placement(x_mm=70.5, y_mm=89.75),
    "R62": Placement(x_mm=84.5, y_mm=60.5),
    "R63": Placement(x_mm=84.5, y_mm=57.0),
    "R73": Placement(x_mm=91.0, y_mm=60.5),
    "JP2": Placement(x_mm=87.0, y_mm=80.5, ref_mm=(2.6, 2.54)),
    "R64": Placement(x_mm=91.0, y_mm=66.0),
    "D7": Placement(x_mm=96.0, y_mm=66.0, angle_deg=180, ref_mm=(0, 1.7)),
    "R65": Placement(x_mm=91.0, y_mm=71.0),
    "D8": Placement(x_mm=96.0, y_mm=71.0, angle_deg=180, ref_mm=(0, 1.7)),
    # reset and mode
    "Q1": Placement(x_mm=58.0, y_mm=70.0),
    "R66": Placement(x_mm=46.0, y_mm=69.0),
    "R67": Placement(x_mm=52.6, y_mm=70.5),
    "J5": Placement(x_mm=60.5, y_mm=60.0, ref_mm=(-2.9, 1.27)),
    "R60": Placement(x_mm=66.5, y_mm=62.5),
    "SW1": Placement(x_mm=89.5, y_mm=50.0), "R75": Placement(x_mm=82.0, y_mm=46.0),
    "R76": Placement(x_mm=82.0, y_mm=50.5),
    # emergency stop: the loop at the right edge, its transistors where they act
    "J7": Placement(x_mm=96.0, y_mm=11.5, ref_mm=(2.4, 1.27)),
    "R77": Placement(x_mm=95.5, y_mm=19.0), "R78": Placement(x_mm=95.5, y_mm=22.6),
    "C14": Placement(x_mm=95.5, y_mm=26.2),
    "R79": Placement(x_mm=95.5, y_mm=29.8), "Q3": Placement(x_mm=95.5, y_mm=38.2),
    "Q2": Placement(x_mm=60.5, y_mm=75.6), "R80": Placement(x_mm=67.5, y_mm=84.8),
    "R81": Placement(x_mm=62.5, y_mm=84.8),
    "Q4": Placement(x_mm=84.0, y_mm=70.8), "R82": Placement(x_mm=84.0, y_mm=74.6),
    # holes and test points
    "H1": Placement(x_mm=4.0, y_mm=4.0), "H2": Placement(x_mm=96.0, y_mm=4.0),
    "H3": Placement(x_mm=4.0, y_mm=96.0), "H4": Placement(x_mm=96.0, y_mm=96.0),
    "TP1": Placement(x_mm=34.0, y_mm=75.9), "TP2": Placement(x_mm=37.0, y_mm=71.5),
    "TP3": Placement(x_mm=43.5, y_mm=88.6), "TP4": Placement(x_mm=56.0, y_mm=77.0),
    "TP5": Placement(x_mm=87.5, y_mm=76.5), "TP6": Placement(x_mm=20.5, y_mm=69.0),
    "TP7": Placement(x_mm=74.0, y_mm=52.0), "TP8": Placement(x_mm=63.0, y_mm=80.5),
    "TP9": Placement(x_mm=61.5, y_mm=66.3), "TP10": Placement(x_mm=69.0, y_mm=80.5),
    "TP11": Placement(x_mm=75.0, y_mm=80.5), "TP12": Placement(x_mm=81.0, y_mm=80.5),
}  # fmt: skip

_VARIANTS: dict[str, dict[str, Placement]] = {
    "rev-b": {"U3": Placement(x_mm=40.0, y_mm=82.5)},
    "rev-c": {
        "U3": Placement(x_mm=40.0, y_mm=82.5),
        "U6": Placement(x_mm=66.5, y_mm=46.2, angle_deg=270, ref_mm=(-7.0, 0)),
        "D5": Placement(x_mm=66.5, y_mm=52.0, ref_mm=(-5.2, 0)),
        "C10": Placement(x_mm=74.5, y_mm=48.0),
        "R74": Placement(x_mm=74.5, y_mm=44.5),
        "R72": Placement(x_mm=91.0, y_mm=46.5), "D9": Placement(x_mm=96.0, y_mm=46.5, angle_deg=180, ref_mm=(0, 1.7)),
        "J6": Placement(x_mm=35.5, y_mm=56.5, ref_mm=(7.6, -4.0)),
        "F2": Placement(x_mm=26.5, y_mm=64.5), "JP3": Placement(x_mm=9.0, y_mm=64.0, angle_deg=90, ref_mm=(-3.4, 0)),
        "D10": Placement(x_mm=26.5, y_mm=70.5, ref_mm=(0, -2.3)), "TP2": Placement(x_mm=43.0, y_mm=73.8),
    },
    "lm317": {
        "U3": Placement(x_mm=43.0, y_mm=80.5),
        "R68": Placement(x_mm=38.0, y_mm=87.5, angle_deg=90, ref_mm=(0, -2.35)),
        "R69": Placement(x_mm=40.4, y_mm=87.5, angle_deg=90, ref_mm=(0, -2.35)),
        "C11": Placement(x_mm=47.0, y_mm=87.0),
        "C3": Placement(x_mm=51.0, y_mm=88.0, angle_deg=270),
        "U4": Placement(x_mm=27.5, y_mm=70.0, ref_mm=(0, 4.4)),
        "C12": Placement(x_mm=34.3, y_mm=69.0, angle_deg=90, ref_mm=(0, -3.1)),
        "R70": Placement(x_mm=40.5, y_mm=69.5, angle_deg=90, ref_mm=(2.5, 0)),
        "R71": Placement(x_mm=40.5, y_mm=73.4, angle_deg=90, ref_mm=(2.5, 0)),
        "C13": Placement(x_mm=27.5, y_mm=64.5),
        "TP3": Placement(x_mm=47.0, y_mm=91.8),
    },
}  # fmt: skip

_TEXTS: list[Label] = [
    Label(layer="F.SilkS", text="BluePill to Pioneer adapter", at_mm=(25.0, 3.2), size_mm=1.4),
    Label(layer="F.SilkS", text="+12V-", at_mm=(13.54, 87.9), size_mm=1.5),
    Label(layer="F.SilkS", text="+5V-", at_mm=(27.98, 88.6), size_mm=1.5),
    Label(layer="F.SilkS", text="11-14.8V", at_mm=(20.6, 87.9), size_mm=0.8),
    Label(layer="F.SilkS", text="12V", at_mm=(57.0, 82.0), size_mm=0.9, justify="left"),
    Label(layer="F.SilkS", text="BANK", at_mm=(57.0, 87.08), size_mm=0.8, justify="left"),
    Label(layer="F.SilkS", text="MODE", at_mm=(60.5, 57.4), size_mm=0.9),
    Label(layer="F.SilkS", text="DTR", at_mm=(90.0, 80.5), size_mm=0.9),
    Label(layer="F.SilkS", text="PWR", at_mm=(53.6, 96.5), size_mm=0.9),
    Label(layer="F.SilkS", text="TX", at_mm=(96.0, 63.9), size_mm=0.9),
    Label(layer="F.SilkS", text="RX", at_mm=(96.0, 68.9), size_mm=0.9),
    Label(layer="F.SilkS", text="HOST (RS-232 plug, DTE)", at_mm=(76.0, 98.2), size_mm=1.0),
    Label(layer="F.SilkS", text="STOP", at_mm=(96.0, 8.6), size_mm=0.9),
    Label(layer="F.SilkS", text="LOOP OPEN: EN LOW, TX IDLE, ROBOT STOPS IN 2s", at_mm=(99.0, 32.0), size_mm=0.8,
          angle_deg=90.0),
    Label(layer="F.SilkS", text="BOOT/MODE", at_mm=(92.75, 57.3), size_mm=0.9),
    Label(layer="F.SilkS", text="LOGIC", at_mm=(36.7, 12.4), size_mm=1.0),
    Label(layer="F.SilkS", text="3.3V only", at_mm=(36.7, 48.4), size_mm=0.8),
]  # fmt: skip
_TEXTS_OF: dict[str, list[Label]] = {
    "rev-b": [Label(layer="F.SilkS", text="REV B", at_mm=(50.0, 3.2), size_mm=1.6)],
    "rev-c": [
        Label(layer="F.SilkS", text="REV C", at_mm=(50.0, 3.2), size_mm=1.6),
        Label(layer="F.SilkS", text="STATUS", at_mm=(96.0, 44.4), size_mm=0.9),
        Label(layer="F.SilkS", text="JP8 ribbon", at_mm=(37.0, 73.0), size_mm=0.8),
        Label(layer="F.SilkS", text="JP8 12V", at_mm=(14.2, 64.0), size_mm=0.8, justify="left"),
    ],
    "lm317": [
        Label(layer="F.SilkS", text="REV B LM317", at_mm=(50.0, 3.2), size_mm=1.2),
        Label(layer="F.SilkS", text="5V: 150mA, peaks 250mA", at_mm=(50.0, 5.4), size_mm=0.8),
    ],
}
