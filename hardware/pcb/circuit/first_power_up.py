"""The voltages that the person who builds a board should find at its test points.

docs/board-build.md prints this table; a test compares them. Figures are the design's
with the tolerances of its parts, not measurements: no board has been built.
"""

from dataclasses import dataclass

from hardware.pcb.circuit.design import TEST_POINTS


@dataclass(frozen=True, slots=True, kw_only=True)
class Expected:
    """Lowest and highest voltage against GND at a test point, 12.0 V at J1, jumper JP1 at 12V."""

    net: str
    #: Without modules, before they are plugged in.
    bare_v: tuple[float, float]
    #: With both modules, no cable at J3.
    full_v: tuple[float, float]
    #: What it shows, and where to look if it is wrong.
    note: str


#: Variant rev-b, in the order of the test points.
EXPECTED: tuple[Expected, ...] = (
    Expected(net="GND", bare_v=(0.0, 0.0), full_v=(0.0, 0.0), note="the meter's black lead"),
    Expected(net="+12V", bare_v=(11.5, 11.9), full_v=(11.3, 11.8), note="behind fuse and D1; 0 V: polarity, F1, D1"),
    Expected(net="5V_REG", bare_v=(4.9, 5.1), full_v=(4.9, 5.1), note="output of U3"),
    Expected(net="+5V", bare_v=(4.9, 5.1), full_v=(4.9, 5.1), note="behind JP1; 0 V: the jumper"),
    Expected(net="+3V3", bare_v=(0.0, 0.3), full_v=(3.2, 3.4), note="made by the ESP32 module, so only with it"),
    Expected(net="BP_5V", bare_v=(4.6, 5.1), full_v=(4.5, 5.0), note="behind D4, at the BluePill's 5V pin"),
    Expected(net="ESP_5V", bare_v=(4.6, 5.1), full_v=(4.5, 5.0), note="behind D5, at the ESP32's 5V pin"),
    Expected(net="ESP_EN", bare_v=(0.0, 0.3), full_v=(3.0, 3.4), note="below 0.3 V while PB13 is high: held in reset"),
    Expected(net="RS_VP", bare_v=(0.0, 0.5), full_v=(4.8, 5.8), note="U5's positive pump; low: C5, C7, +3V3"),
    Expected(net="RS_VM", bare_v=(-0.5, 0.0), full_v=(-5.8, -4.8), note="U5's negative pump; near 0: C6, C8"),
    Expected(net="RS_DTR", bare_v=(0.0, 0.5), full_v=(4.8, 5.8), note="DTR asserted all the time; 0 V without JP2"),
    Expected(net="DSR_N", bare_v=(0.0, 0.5), full_v=(3.0, 3.4), note="falls below 0.4 V when the robot asserts DSR"),
)


def rows() -> list[str]:
    """Return the table's lines for the manual.

    Raises:
        ValueError: A test point of the design has no row, or a row no test point.
    """
    if tuple(row.net for row in EXPECTED) != TEST_POINTS:
        raise ValueError("the table of expected voltages and the test points differ")
    return [
        f"| TP{number} | {row.net} | {_volts(row.bare_v)} | {_volts(row.full_v)} | {row.note} |"
        for number, row in enumerate(EXPECTED, start=1)
    ]


def _volts(limits: tuple[float, float]) -> str:
    low, high = limits
    return f"{low:g} V" if low == high else f"{low:g} to {high:g} V"
