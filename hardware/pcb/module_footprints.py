"""Footprints of the two plugged-in modules: sockets, pin names, the antenna's free area.

Both are one footprint each (adjacent sockets would overlap as parts of their own).
Origin: pin 1. Row distances are the modules' own; the BluePill's 15.24 mm is that of
a DIP-40, the D1 mini's inner rows stand 22.86 mm apart (measured on the thesis's drawing).
"""

from hardware.pcb.modules import BLUEPILL_PINS, ESP32_PINS, ESP32_SILKSCREEN
from hardware.pcb.shapes import Box, Circle, Footprint, Label, Line, Pad, PadKind, PadShape, courtyard, rectangle

PITCH_MM = 2.54
BLUEPILL_ROWS_MM = 15.24
ESP32_INNER_ROWS_MM = 22.86
#: Free of copper on both sides, relative to pin 1 of the ESP32: left, top, right, bottom.
ANTENNA_AREA_MM = (4.3, -13.0, 23.6, -4.0)

_PCB_BLUE, _PCB_BLACK, _SOCKET, _METAL = (0.1, 0.2, 0.5), (0.1, 0.1, 0.12), (0.08, 0.08, 0.09), (0.7, 0.7, 0.72)
#: A socket of 8.5 mm and a pin header of 2.5 mm hold a module's board at 11 mm.
_MODULE_Z_MM = (11.0, 12.6)


def bluepill() -> Footprint:
    """Draw the BluePill: 20 pins down the left, 20 up the right, USB at the top."""
    places = [(0.0, PITCH_MM * index) for index in range(20)]
    places += [(BLUEPILL_ROWS_MM, PITCH_MM * (19 - index)) for index in range(20)]
    names: list[Line | Circle | Label] = []
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
    boxes += [Box(center_mm=(7.62, 24.13), size_mm=(22.84, 53.0), z_mm=_MODULE_Z_MM, colour=_PCB_BLUE),
              Box(center_mm=(7.62, 0.3), size_mm=(7.5, 5.6), z_mm=(12.6, 15.2), colour=_METAL),
              Box(center_mm=(7.62, 26.0), size_mm=(7.0, 7.0), z_mm=(12.6, 14.0), colour=_PCB_BLACK)]  # fmt: skip
    return Footprint(
        name="MODULE_BLUEPILL", description="STM32 BluePill on two 1x20 sockets", pads=_pads(places),
        drawings=tuple(drawings), ref_at_mm=(7.62, 19.0), boxes=tuple(boxes),
    )  # fmt: skip


def esp32_d1_mini() -> Footprint:
    """Draw the ESP32 D1 mini: two double rows of 2x10, antenna at the top, USB at the bottom."""
    columns = (0.0, PITCH_MM, PITCH_MM + ESP32_INNER_ROWS_MM, 2 * PITCH_MM + ESP32_INNER_ROWS_MM)
    places = [(x, PITCH_MM * index) for x in columns for index in range(10)]
    names: list[Line | Circle | Label] = []
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
    boxes += [Box(center_mm=(right / 2, (top + bottom) / 2), size_mm=(right + 3.6, bottom - top), z_mm=_MODULE_Z_MM,
                  colour=_PCB_BLACK),
              Box(center_mm=(right / 2, 4.5), size_mm=(16.0, 18.0), z_mm=(12.6, 15.8), colour=_METAL),
              Box(center_mm=(right / 2, 27.5), size_mm=(7.5, 5.0), z_mm=(12.6, 15.2), colour=_METAL)]  # fmt: skip
    return Footprint(
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


def _outline(left: float, top: float, right: float, bottom: float) -> list[Line]:
    # On the silkscreen only the short sides: the pins' names stand where the long ones would run.
    silk = [Line(layer="F.SilkS", start_mm=(left, y), end_mm=(right, y)) for y in (top, bottom)]
    return [*rectangle("F.Fab", left, top, right, bottom, 0.1), *silk,
            *courtyard(left - 0.25, top - 0.25, right + 0.25, bottom + 0.25)]  # fmt: skip


def _socket(x: float, count: int, columns: int = 1) -> list[Line]:
    right = x + PITCH_MM * (columns - 1)
    return rectangle("F.Fab", x - 1.27, -1.27, right + 1.27, PITCH_MM * (count - 1) + 1.27, 0.1)


def _strip(x: float, count: int, columns: int = 1) -> Box:
    length = PITCH_MM * count
    return Box(center_mm=(x, (length - PITCH_MM) / 2), size_mm=(2.5 * columns, length), z_mm=(0, 8.5), colour=_SOCKET)
