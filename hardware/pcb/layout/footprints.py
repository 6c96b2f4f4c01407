"""Every footprint of the board, drawn by functions of a few measures.

The two plugged-in modules are one footprint each (adjacent sockets would overlap as parts
of their own): sockets, pin names, the antenna's free area. Their origin is pin 1.

Sources: IPC-7351B nominal land patterns for chips and SOIC; JEDEC outlines MS-012,
TO-236, TO-261, DO-214; makers' drawings for connectors (memory). Row distances are the
modules' own; the BluePill's 15.24 mm is that of a DIP-40, the D1 mini's inner rows stand
22.86 mm apart (measured on the thesis's drawing). tests/hardware compares pad centres and
drills with KiCad's own library where that is installed.

Invariant: a footprint's pads have the numbers of its symbol's pins.
"""

from collections.abc import Iterable, Mapping
from types import MappingProxyType

from hardware.pcb.circuit.modules import BLUEPILL_PINS, ESP32_PINS, ESP32_SILKSCREEN
from hardware.pcb.layout.shapes import (
    Circle,
    Label,
    Pad,
    PadKind,
    PadShape,
    PartBox,
    PartFootprint,
    StraightStroke,
    courtyard,
    rectangle,
)

PITCH_MM = 2.54
BLUEPILL_ROWS_MM = 15.24
ESP32_INNER_ROWS_MM = 22.86
#: Free of copper on both sides, relative to pin 1 of the ESP32: left, top, right, bottom.
ANTENNA_AREA_MM = (4.3, -13.0, 23.6, -4.0)

_PCB_BLUE, _PCB_BLACK, _SOCKET, _METAL = (0.1, 0.2, 0.5), (0.1, 0.1, 0.12), (0.08, 0.08, 0.09), (0.7, 0.7, 0.72)
#: A socket of 8.5 mm and a pin header of 2.5 mm hold a module's board at 11 mm.
_MODULE_Z_MM = (11.0, 12.6)


def bluepill() -> PartFootprint:
    """Draw the BluePill: 20 pins down the left, 20 up the right, USB at the top."""
    places = [(0.0, PITCH_MM * index) for index in range(20)]
    places += [(BLUEPILL_ROWS_MM, PITCH_MM * (19 - index)) for index in range(20)]
    names: list[StraightStroke | Circle | Label] = []
    for name, (x, y) in zip(BLUEPILL_PINS, places, strict=True):
        names.append(_name(name, x + (-1.35 if x == 0 else 1.35), y, "right" if x == 0 else "left"))
    left, right, top, bottom = -3.8, 19.04, -2.37, 50.63
    drawings = [
        *_outline(left, top, right, bottom), *names, _first(-1.35, -1.7),
        *rectangle("F.SilkS", 3.6, top, 11.6, top + 4.5), *_socket(0, 20), *_socket(BLUEPILL_ROWS_MM, 20),
        Label(layer="F.SilkS", text="USB", at_mm=(7.62, top + 2.2), size_mm=1.2),
        Label(layer="F.SilkS", text="BluePill", at_mm=(7.62, 22.0), size_mm=1.8),
        Label(layer="F.SilkS", text="SWD", at_mm=(7.62, bottom - 1.6), size_mm=1.2),
    ]  # fmt: skip
    boxes = [_strip(0, 20), _strip(BLUEPILL_ROWS_MM, 20)]
    boxes += [PartBox(center_mm=(7.62, 24.13), size_mm=(22.84, 53.0), z_mm=_MODULE_Z_MM, colour=_PCB_BLUE),
              PartBox(center_mm=(7.62, 0.3), size_mm=(7.5, 5.6), z_mm=(12.6, 15.2), colour=_METAL),
              PartBox(center_mm=(7.62, 26.0), size_mm=(7.0, 7.0), z_mm=(12.6, 14.0), colour=_PCB_BLACK)]  # fmt: skip
    return PartFootprint(
        name="MODULE_BLUEPILL", description="STM32 BluePill on two 1x20 sockets", pads=_pads(places),
        drawings=tuple(drawings), ref_at_mm=(7.62, 19.0), boxes=tuple(boxes),
    )  # fmt: skip


def esp32_d1_mini() -> PartFootprint:
    """Draw the ESP32 D1 mini: two double rows of 2x10, antenna at the top, USB at the bottom."""
    columns = (0.0, PITCH_MM, PITCH_MM + ESP32_INNER_ROWS_MM, 2 * PITCH_MM + ESP32_INNER_ROWS_MM)
    places = [(x, PITCH_MM * index) for x in columns for index in range(10)]
    names: list[StraightStroke | Circle | Label] = []
    for index, (pin, (x, y)) in enumerate(zip(ESP32_PINS, places, strict=True)):
        is_left_hand = index // 10 in {0, 2}
        text = ESP32_SILKSCREEN.get(pin, pin.removeprefix("IO"))
        names.append(_name(text, x + (-1.35 if is_left_hand else 1.35), y, "right" if is_left_hand else "left"))
    right = columns[3]
    left_edge, right_edge, top, bottom = -1.8, right + 1.8, -9.0, 30.0
    keep_left, keep_top, keep_right, keep_bottom = ANTENNA_AREA_MM
    _ = keep_top
    drawings = [
        *_outline(left_edge, top, right_edge, bottom), *names, _first(-1.35, -1.7),
        *_socket(0, 10, 2), *_socket(columns[2], 10, 2),
        *rectangle("F.SilkS", right / 2 - 4, bottom - 5.0, right / 2 + 4, bottom),
        *rectangle("F.SilkS", keep_left, top, keep_right, keep_bottom),
        Label(layer="F.SilkS", text="ANTENNA", at_mm=(right / 2, (top + keep_bottom) / 2), size_mm=1.2),
        Label(layer="F.SilkS", text="ESP32 D1 mini", at_mm=(right / 2, 12.0), size_mm=1.3),
        Label(layer="F.SilkS", text="USB", at_mm=(right / 2, bottom - 2.5), size_mm=1.2),
    ]  # fmt: skip
    boxes = [_strip(1.27, 10, 2), _strip(right - 1.27, 10, 2)]
    boxes += [PartBox(center_mm=(right / 2, (top + bottom) / 2), size_mm=(right + 3.6, bottom - top), z_mm=_MODULE_Z_MM,
                      colour=_PCB_BLACK),
              PartBox(center_mm=(right / 2, 4.5), size_mm=(16.0, 18.0), z_mm=(12.6, 15.8), colour=_METAL),
              PartBox(center_mm=(right / 2, 27.5), size_mm=(7.5, 5.0), z_mm=(12.6, 15.2), colour=_METAL)]  # fmt: skip
    return PartFootprint(
        name="MODULE_ESP32_D1_MINI", description="ESP32 D1 mini (40 pins) on four 1x10 sockets", pads=_pads(places),
        drawings=tuple(drawings), ref_at_mm=(right / 2, 9.2), boxes=tuple(boxes),
    )  # fmt: skip


def _pads(places: list[tuple[float, float]]) -> tuple[Pad, ...]:
    return tuple(
        Pad(number=str(number), kind=PadKind.THROUGH, shape=PadShape.RECT if number == 1 else PadShape.CIRCLE,
            at_mm=place, size_mm=(1.7, 1.7), drill_mm=1.0)
        for number, place in enumerate(places, start=1)
    )  # fmt: skip


def _name(text: str, x: float, y: float, justify: str) -> Label:
    return Label(layer="F.SilkS", text=text, at_mm=(x, y), size_mm=0.8, justify=justify)


def _first(x: float, y: float) -> Circle:
    return Circle(layer="F.SilkS", center_mm=(x, y), radius_mm=0.2, is_filled=True)


def _outline(left: float, top: float, right: float, bottom: float) -> list[StraightStroke]:
    # On the silkscreen only the short sides: the pins' names stand where the long ones would run.
    silk = [StraightStroke(layer="F.SilkS", start_mm=(left, y), end_mm=(right, y)) for y in (top, bottom)]
    return [*rectangle("F.Fab", left, top, right, bottom, 0.1), *silk,
            *courtyard(left - 0.25, top - 0.25, right + 0.25, bottom + 0.25)]  # fmt: skip


def _socket(x: float, count: int, columns: int = 1) -> list[StraightStroke]:
    right = x + PITCH_MM * (columns - 1)
    return rectangle("F.Fab", x - 1.27, -1.27, right + 1.27, PITCH_MM * (count - 1) + 1.27, 0.1)


def _strip(x: float, count: int, columns: int = 1) -> PartBox:
    length = PITCH_MM * count
    return PartBox(
        center_mm=(x, (length - PITCH_MM) / 2), size_mm=(2.5 * columns, length), z_mm=(0, 8.5), colour=_SOCKET
    )


BLACK, GREY, BROWN, GREEN = (0.08, 0.08, 0.09), (0.55, 0.56, 0.58), (0.55, 0.42, 0.27), (0.12, 0.45, 0.2)
BLUE, WHITE = (0.1, 0.2, 0.45), (0.9, 0.9, 0.86)


def _smd(number: str, x: float, y: float, width: float, height: float) -> Pad:
    return Pad(number=number, kind=PadKind.SMD, shape=PadShape.ROUND_RECT, at_mm=(x, y), size_mm=(width, height))


def _hole(number: str, x: float, y: float, size: float, drill: float, shape: PadShape = PadShape.CIRCLE) -> Pad:
    return Pad(number=number, kind=PadKind.THROUGH, shape=shape, at_mm=(x, y), size_mm=(size, size), drill_mm=drill)


def _chip(
    name: str,
    pad: tuple[float, float, float],
    body: tuple[float, float, float],
    numbers: tuple[str, str] = ("1", "2"),
    colour: tuple[float, float, float] = BLACK,
) -> PartFootprint:
    """Draw a part with two end pads; pad = (centre, width, height), body = (length, width, height)."""
    centre, width, height = pad
    long, wide, tall = body
    half = max(height, wide) / 2 + 0.25
    edge = centre + width / 2 + 0.25
    lines: list[StraightStroke | Circle | Label] = [*rectangle("F.Fab", -long / 2, -wide / 2, long / 2, wide / 2, 0.1)]
    inner = centre - width / 2 - 0.2
    if numbers == ("K", "A"):
        # The cathode's end is closed: the bar that a person looks for.
        top = half + 0.0
        lines += [StraightStroke(layer="F.SilkS", start_mm=(-edge, -top), end_mm=(-edge, top), width_mm=0.2)]
        lines += [StraightStroke(layer="F.SilkS", start_mm=(-edge, y), end_mm=(centre, y)) for y in (-top, top)]
        lines += [
            StraightStroke(layer="F.Fab", start_mm=(-long / 4, -wide / 2), end_mm=(-long / 4, wide / 2), width_mm=0.1)
        ]
    elif inner > 0.1:
        lines += [
            StraightStroke(layer="F.SilkS", start_mm=(-inner, y), end_mm=(inner, y))
            for y in (-wide / 2 - 0.1, wide / 2 + 0.1)
        ]
    lines += courtyard(-edge, -half, edge, half)
    return PartFootprint(
        name=name,
        description=f"{long:g} x {wide:g} mm, two end pads",
        pads=(_smd(numbers[0], -centre, 0, width, height), _smd(numbers[1], centre, 0, width, height)),
        drawings=tuple(lines),
        ref_at_mm=(0, -half - 0.6),
        boxes=(PartBox(center_mm=(0, 0), size_mm=(long, wide), z_mm=(0.05, tall), colour=colour),),
    )


def _package(
    name: str,
    description: str,
    pads: Iterable[Pad],
    half: tuple[float, float],
    silk: tuple[float, float],
    dot: tuple[float, float, float],
    yard: tuple[float, float],
    ref_y_mm: float,
    z_mm: tuple[float, float],
) -> PartFootprint:
    """Draw a small package: half its body, half of its two strokes, its dot with its radius, half its courtyard."""
    x, y = half
    strokes = [
        StraightStroke(layer="F.SilkS", start_mm=(silk[0], at), end_mm=(-silk[0], at)) for at in (-silk[1], silk[1])
    ]
    return PartFootprint(
        name=name, description=description, pads=tuple(pads),
        drawings=(*rectangle("F.Fab", -x, -y, x, y, 0.1), *strokes,
                  Circle(layer="F.SilkS", center_mm=dot[:2], radius_mm=dot[2], is_filled=True),
                  *courtyard(-yard[0], -yard[1], *yard)),
        ref_at_mm=(0, ref_y_mm),
        boxes=(PartBox(center_mm=(0, 0), size_mm=(2 * x, 2 * y), z_mm=z_mm, colour=BLACK),),
    )  # fmt: skip


def _packages() -> list[PartFootprint]:
    sot23 = (("1", -0.9375, -0.95), ("2", -0.9375, 0.95), ("3", 0.9375, 0))
    sot223 = [_smd(str(n), -3.15, y, 2.0, 1.5) for n, y in ((1, -2.3), (2, 0.0), (3, 2.3))]
    soic = [(number, 1.27 * index - 4.445, x) for index in range(8)
            for number, x in ((index + 1, -2.475), (16 - index, 2.475))]  # fmt: skip
    return [
        _package("SOT23", "SOT-23 (TO-236)", [_smd(n, x, y, 1.475, 0.6) for n, x, y in sot23], (0.65, 1.45),
                 (0.65, 1.65), (-1.3, -1.6, 0.12), (1.95, 1.8), -2.4, (0.1, 1.0)),
        _package("SOT223", "SOT-223 (TO-261), tab on pin 2", [*sot223, _smd("2", 3.15, 0, 2.0, 3.8)], (1.75, 3.25),
                 (-1.9, 3.45), (-3.15, -3.5, 0.15), (4.4, 3.7), -4.3, (0.1, 1.7)),
        _package("SOIC16", "SOIC-16, 3.9 x 9.9 mm, pitch 1.27 mm (MS-012)",
                 [_smd(str(number), x, y, 1.95, 0.6) for number, y, x in soic], (1.95, 4.95), (-1.95, 5.1),
                 (-3.9, -4.445, 0.2), (3.7, 5.35), -5.9, (0.15, 1.65)),
    ]  # fmt: skip


def _header(name: str, columns: int, rows: int) -> PartFootprint:
    pads, boxes = [], []
    for row in range(rows):
        for column in range(columns):
            first = row == 0 and column == 0
            number = str(row * columns + column + 1)
            shape = PadShape.RECT if first else PadShape.OVAL
            pads.append(_hole(number, 2.54 * column, 2.54 * row, 1.7, 1.0, shape))
            boxes.append(
                PartBox(center_mm=(2.54 * column, 2.54 * row), size_mm=(0.64, 0.64), z_mm=(-3, 8.5), colour=GREY)
            )  # fmt: skip
    right, bottom = 2.54 * (columns - 1) + 1.33, 2.54 * (rows - 1) + 1.33
    boxes.append(PartBox(center_mm=((right - 1.33) / 2, (bottom - 1.33) / 2),
                         size_mm=(right + 1.2, bottom + 1.2), z_mm=(0, 2.5), colour=BLACK))  # fmt: skip
    return PartFootprint(
        name=name, description=f"Pin header {columns} x {rows}, 2.54 mm", pads=tuple(pads),
        drawings=(*rectangle("F.SilkS", -1.33, -1.33, right, bottom),
                  *rectangle("F.Fab", -1.27, -1.27, right - 0.06, bottom - 0.06, 0.1),
                  StraightStroke(layer="F.SilkS", start_mm=(-1.6, -1.6), end_mm=(-1.6, 0), width_mm=0.2),
                  *courtyard(-1.8, -1.8, right + 0.47, bottom + 0.47)),
        ref_at_mm=((right - 1.33) / 2, -2.4),
        boxes=tuple(boxes),
    )  # fmt: skip


def _box_header() -> PartFootprint:
    pads = tuple(
        _hole(str(2 * row + column + 1), 2.54 * column, 2.54 * row, 1.7, 1.0,
              PadShape.RECT if row == column == 0 else PadShape.CIRCLE)
        for row in range(5) for column in range(2)
    )  # fmt: skip
    # The key is the gap in the wall at pin 1's side.
    walls = [((-3.29, 3.03), (-3.29, -5.21)), ((-3.29, -5.21), (5.83, -5.21)), ((5.83, -5.21), (5.83, 15.37)),
             ((5.83, 15.37), (-3.29, 15.37)), ((-3.29, 15.37), (-3.29, 7.13))]  # fmt: skip
    return PartFootprint(
        name="IDC_2X5", description="Box header 2 x 5, 2.54 mm, upright, keyed", pads=pads,
        drawings=(*(StraightStroke(layer="F.SilkS", start_mm=start, end_mm=end) for start, end in walls),
                  Circle(layer="F.SilkS", center_mm=(-3.9, 0), radius_mm=0.2, is_filled=True),
                  *rectangle("F.Fab", -3.18, -5.1, 5.72, 15.26, 0.1), *courtyard(-3.68, -5.6, 6.22, 15.76)),
        ref_at_mm=(1.27, -6.3),
        boxes=(PartBox(center_mm=(1.27, 5.08), size_mm=(8.9, 20.36), z_mm=(0, 9.0), colour=BLACK),),
    )  # fmt: skip


def _terminal() -> PartFootprint:
    pads = (_hole("1", 0, 0, 2.6, 1.3, PadShape.RECT), _hole("2", 5.08, 0, 2.6, 1.3))
    return PartFootprint(
        name="TERMINAL_5.08", description="Screw terminal 2 x 5.08 mm, wires enter from below", pads=pads,
        drawings=(*rectangle("F.SilkS", -2.6, -5.3, 7.68, 4.6), *rectangle("F.Fab", -2.54, -5.2, 7.62, 4.5, 0.1),
                  StraightStroke(layer="F.SilkS", start_mm=(-2.6, 2.6), end_mm=(7.68, 2.6)),
                  *courtyard(-3.04, -5.7, 8.12, 5.1)),
        ref_at_mm=(2.54, -6.2),
        boxes=(PartBox(center_mm=(2.54, -0.35), size_mm=(10.16, 9.7), z_mm=(0, 10), colour=GREEN),),
    )  # fmt: skip


def _buck() -> PartFootprint:
    pads = tuple(
        Pad(number=str(index + 1), kind=PadKind.THROUGH, shape=PadShape.RECT if index == 0 else PadShape.OVAL,
            at_mm=(2.54 * index, 0), size_mm=(1.5, 2.5), drill_mm=1.0)
        for index in range(3)
    )  # fmt: skip
    names = [Label(layer="F.SilkS", text=text, at_mm=(2.54 * index, 2.8), size_mm=0.8)
             for index, text in enumerate(("IN", "G", "OUT"))]  # fmt: skip
    return PartFootprint(
        name="SIP3_BUCK", description="SIP-3 step-down module 11.7 x 7.6 mm", pads=pads,
        drawings=(*rectangle("F.SilkS", -3.4, -5.7, 8.48, 2.0), *rectangle("F.Fab", -3.3, -5.6, 8.38, 2.0, 0.1), *names,
                  *courtyard(-3.55, -5.85, 8.65, 3.4)),
        ref_at_mm=(2.54, -3.6),
        boxes=(PartBox(center_mm=(2.54, -1.8), size_mm=(11.7, 7.6), z_mm=(0.5, 10.7), colour=BLACK),),
    )  # fmt: skip


def _radial() -> PartFootprint:
    pads = (_hole("1", 0, 0, 1.6, 0.8, PadShape.RECT), _hole("2", 2.5, 0, 1.6, 0.8))
    return PartFootprint(
        name="CP_RADIAL_D6", description="Electrolytic capacitor, 6.3 mm, pitch 2.5 mm", pads=pads,
        drawings=(Circle(layer="F.SilkS", center_mm=(1.25, 0), radius_mm=3.3),
                  Circle(layer="F.Fab", center_mm=(1.25, 0), radius_mm=3.15, width_mm=0.1),
                  Label(layer="F.SilkS", text="+", at_mm=(-2.2, -2.0), size_mm=1.0),
                  *courtyard(-2.3, -3.5, 4.8, 3.5)),
        ref_at_mm=(1.25, 2.1),
        boxes=(PartBox(center_mm=(1.25, 0), size_mm=(5.8, 5.8), z_mm=(0, 11.2), colour=BLUE),),
    )  # fmt: skip


def _jst_vh() -> PartFootprint:
    pads = (_hole("1", 0, 0, 2.7, 1.7, PadShape.RECT), _hole("2", 3.96, 0, 2.7, 1.7))
    return PartFootprint(
        name="JST_VH_2", description="Header JST VH, 2 x 3.96 mm, upright, keyed by its wall", pads=pads,
        drawings=(*rectangle("F.SilkS", -2.06, -2.11, 6.02, 4.91), *rectangle("F.SilkS", -0.86, -3.81, 4.82, -2.11),
                  *rectangle("F.Fab", -1.95, -3.7, 5.91, 4.8, 0.1), *courtyard(-2.45, -4.2, 6.41, 5.3)),
        ref_at_mm=(1.98, -4.9),
        boxes=(PartBox(center_mm=(1.98, 1.4), size_mm=(7.86, 6.8), z_mm=(0, 3.8), colour=WHITE),
               PartBox(center_mm=(1.98, -2.85), size_mm=(5.4, 1.7), z_mm=(0, 9.4), colour=WHITE)),
    )  # fmt: skip


def _de9() -> PartFootprint:
    pads = [_hole("0", x, 1.42, 4.0, 3.2) for x in (-6.96, 18.04)]
    # 1.1 mm takes pins at 2.77 mm (KiCad: 1.0 mm) and at 2.74 mm (TE: 1.04 mm).
    pads += [_hole(str(n + 1), 2.77 * n, 0, 1.6, 1.1, PadShape.RECT if n == 0 else PadShape.CIRCLE) for n in range(5)]
    pads += [_hole(str(n + 6), 1.385 + 2.77 * n, 2.84, 1.6, 1.1) for n in range(4)]
    names = [Label(layer="F.SilkS", text=str(n + 1), at_mm=(2.77 * n, -1.45), size_mm=0.8) for n in range(5)]
    return PartFootprint(
        name="DE9_MALE", description="DE-9 plug, right angle, edge 10.54 mm below pin 1 at most", pads=tuple(pads),
        drawings=(*rectangle("F.Fab", -9.9, -1.8, 20.96, 10.54, 0.1), *names,
                  *(StraightStroke(layer="F.SilkS", start_mm=(x, -2.3), end_mm=(x, 9.9)) for x in (-10.0, 21.06)),
                  StraightStroke(layer="F.SilkS", start_mm=(-10.0, -2.3), end_mm=(21.06, -2.3)),
                  *courtyard(-10.4, -2.4, 21.48, 17.4)),
        ref_at_mm=(5.54, -3.1),
        boxes=(PartBox(center_mm=(5.54, 4.4), size_mm=(30.8, 12.3), z_mm=(0, 12.5), colour=GREY),
               PartBox(center_mm=(5.54, 13.5), size_mm=(16.9, 6.0), z_mm=(1.8, 10.5), colour=(0.7, 0.7, 0.72))),
    )  # fmt: skip


def _button() -> PartFootprint:
    pads = [_hole(number, x, y, 2.0, 1.1) for number, y in (("1", 0.0), ("2", 4.5)) for x in (0.0, 6.5)]
    return PartFootprint(
        name="SW_PUSH_6MM", description="Push button 6 x 6 mm, upright", pads=tuple(pads),
        drawings=(*(StraightStroke(layer="F.SilkS", start_mm=(1.25, y), end_mm=(5.25, y)) for y in (-0.9, 5.4)),
                  Circle(layer="F.SilkS", center_mm=(3.25, 2.25), radius_mm=1.8),
                  *rectangle("F.Fab", 0.25, -0.75, 6.25, 5.25, 0.1), *courtyard(-1.5, -1.5, 8.0, 6.0)),
        ref_at_mm=(3.25, -2.0),
        boxes=(PartBox(center_mm=(3.25, 2.25), size_mm=(6.0, 6.0), z_mm=(0, 3.4), colour=BLACK),
               PartBox(center_mm=(3.25, 2.25), size_mm=(3.4, 3.4), z_mm=(3.4, 4.3), colour=GREY)),
    )  # fmt: skip


def _test_point() -> PartFootprint:
    pad = Pad(number="1", kind=PadKind.SMD, shape=PadShape.CIRCLE, at_mm=(0, 0), size_mm=(1.5, 1.5))
    return PartFootprint(name="TESTPOINT", description="Test point 1.5 mm", pads=(pad,),
                         drawings=(Circle(layer="F.SilkS", center_mm=(0, 0), radius_mm=1.0),
                                   *courtyard(-1.2, -1.2, 1.2, 1.2)),
                         ref_at_mm=(0, -1.7))  # fmt: skip


def _mounting_hole() -> PartFootprint:
    pad = Pad(number="", kind=PadKind.HOLE, shape=PadShape.CIRCLE, at_mm=(0, 0), size_mm=(3.2, 3.2), drill_mm=3.2)
    return PartFootprint(name="HOLE_M3", description="Mounting hole M3", pads=(pad,),
                         drawings=(Circle(layer="F.SilkS", center_mm=(0, 0), radius_mm=3.0),
                                   Circle(layer="F.CrtYd", center_mm=(0, 0), radius_mm=3.2, width_mm=0.05)),
                         ref_at_mm=(0, -3.6))  # fmt: skip


def _all() -> list[PartFootprint]:
    return [
        _chip("R_0805", (0.9125, 1.025, 1.4), (2.0, 1.25, 0.55)),
        _chip("C_0805", (0.95, 1.0, 1.45), (2.0, 1.25, 1.25), colour=BROWN),
        _chip("C_1206", (1.475, 1.15, 1.8), (3.2, 1.6, 1.6), colour=BROWN),
        _chip("LED_0805", (0.9375, 0.975, 1.4), (2.0, 1.25, 0.8), ("K", "A"), WHITE),
        _chip("D_SMA", (2.0, 2.5, 1.8), (4.3, 2.6, 2.3), ("K", "A")),
        _chip("D_SMB", (2.15, 2.5, 2.3), (4.4, 3.6, 2.3), ("K", "A")),
        _chip("F_1812", (2.1375, 1.125, 3.4), (4.5, 3.2, 1.6), colour=GREEN),
        *_packages(), _terminal(), _jst_vh(), _buck(), _radial(), _de9(), _button(),
        _test_point(), _mounting_hole(),
        _header("HEADER_1X2", 1, 2), _header("HEADER_1X3", 1, 3), _header("HEADER_2X12", 2, 12),
        _box_header(),
        bluepill(), esp32_d1_mini(),
    ]  # fmt: skip


#: Every footprint by its name.
FOOTPRINTS: Mapping[str, PartFootprint] = MappingProxyType({footprint.name: footprint for footprint in _all()})
