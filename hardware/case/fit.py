"""Whether the case fits the board: what may not touch, what must be open, and what a printer can make.

Bodies are compared point by point (`RASTER_MM`) with the lists of solids, so that the checks need no modeller.
Each returns what is wrong, one line each.
"""

from collections.abc import Callable, Iterator

from hardware.case import design
from hardware.case.board import PlacedBox, bodies, body_of, mounting_holes, part_place, through_pads
from hardware.case.solids import Block, PrintedPart
from hardware.pcb.circuit.design import VARIANTS, build
from hardware.pcb.layout.rules import BOARD_HEIGHT_MM, BOARD_THICKNESS_MM, BOARD_WIDTH_MM, CORNER_MM

RASTER_MM = 1.0
#: The name of the board among its parts.
BOARD = "the board"
#: A hex spacer M3 across its corners.
SPACER_RADIUS_MM = 3.2
#: What solder and cut leads take below the board.
SOLDER_MM = 3.0
#: Of the room around a plug, what must be left.
PLAY_LEFT_MM = 0.5
#: The bed of small printers.
BED_MM = 180.0


def parts_touch_nothing() -> list[str]:
    """Return the parts of any variant, and boards, that stand in the case's material."""
    return [
        f"{variant}: {box.part} stands in the {body.name} at {_text(at)}"
        for variant in VARIANTS
        for box in (*bodies(variant), _board())
        for body in _printed()
        if (at := _first_touch(body, box)) is not None
    ]


def solder_keeps_off_the_base() -> list[str]:
    """Return the pads whose solder and leads, `SOLDER_MM` below the board, stand in the base."""
    base, wrong = design.base(), []
    for x, y, radius in sorted({pad for variant in VARIANTS for pad in through_pads(variant)}):
        space = PlacedBox(part="", x=(x - radius, x + radius), y=(y - radius, y + radius),
                          z=(-BOARD_THICKNESS_MM - SOLDER_MM, -BOARD_THICKNESS_MM - 0.01))  # fmt: skip
        if (at := _first_touch(base, space)) is not None:
            wrong.append(f"a pad at {_text((x, y, 0.0))} stands in the base at {_text(at)}")
    return wrong


def parts_keep_off_the_spacers() -> list[str]:
    """Return the parts that stand where a spacer is."""
    return [
        f"{variant}: {box.part} stands in the spacer at {_text((*hole, 0.0))}"
        for variant in VARIANTS
        for box in bodies(variant)
        for hole in mounting_holes(variant)
        if box.z[1] > 0 and _distance(hole[0], box.x) ** 2 + _distance(hole[1], box.y) ** 2 < SPACER_RADIUS_MM**2
    ]


def bosses_carry_the_board() -> list[str]:
    """Return the holes of the board below which no boss with an insert stands, or whose lid has no hole."""
    base, lid, wrong = design.base(), design.lid(), []
    for x, y in mounting_holes():
        ring = (design.INSERT_HOLE_MM + design.BOSS_MM) / 4
        below = -BOARD_THICKNESS_MM - 0.01
        if base.holds(x, y, below) or not base.holds(x + ring, y, below):
            wrong.append(f"no boss with an insert below the hole at {_text((x, y, 0.0))}")
        if lid.holds(x, y, design.SPACER_MM + 0.1) or not lid.holds(
            x + design.SCREW_HOLE_MM, y, design.SPACER_MM + 0.1
        ):
            wrong.append(f"no hole of the lid above {_text((x, y, 0.0))}")
    return wrong


def plugs_reach_their_sockets() -> list[str]:
    """Return the sockets before which there is a wall, from the socket to the outside."""
    width, height = design.USB_PLUG_MM
    usb = body_of("U1", index=3)
    middle, level = (usb.x[0] + usb.x[1]) / 2, (usb.z[0] + usb.z[1]) / 2
    rs232, terminal, bank = body_of("J3"), body_of("J1"), body_of("J2")
    far = 20.0
    inner = design.usb_way()
    ways = {
        "USB of the ESP32": PlacedBox(part="", x=(inner.x[0] + PLAY_LEFT_MM, inner.x[1] - PLAY_LEFT_MM),
                                      y=(inner.y[0] + 0.1, inner.y[1] - PLAY_LEFT_MM),
                                      z=(inner.z[0], inner.z[1] + far)),
        "USB of the BluePill": PlacedBox(part="", x=(middle - width / 2, middle + width / 2), y=(-far, usb.y[0]),
                                         z=(level - height / 2, level + height / 2)),
        "RS-232": PlacedBox(part="", x=rs232.x, y=(rs232.y[1], BOARD_HEIGHT_MM + far), z=rs232.z),
        "12 V": PlacedBox(part="", x=(terminal.x[0] + 1, terminal.x[1] - 1), y=(terminal.y[1], BOARD_HEIGHT_MM + 4),
                          z=(1.0, 7.0)),
        "5 V": PlacedBox(part="", x=(bank.x[0] + 1, bank.x[1] - 1), y=(bank.y[1], BOARD_HEIGHT_MM + 4),
                         z=(bank.z[1] + 1, design.SPACER_MM - 1)),
    }  # fmt: skip
    return [
        f"{name}: the {body.name} is in the way at {_text(at)}"
        for name, way in ways.items()
        for body in _printed()
        if (at := _first_touch(body, way)) is not None
    ]


def lights_are_seen() -> list[str]:
    """Return the LEDs above which the lid is closed."""
    lid = design.lid()
    return [
        f"{variant}: {component.ref}"
        for variant in VARIANTS
        for component in build(variant).components
        if component.part.symbol == "LED" and lid.holds(*part_place(component.ref, variant), design.SPACER_MM + 1)
    ]


def parts_leave_the_cable_its_way() -> list[str]:
    """Return the parts of any variant that stand in the way of the cable to the ESP32's USB socket."""
    way = design.usb_way()
    return [
        f"{variant}: {box.part}"
        for variant in VARIANTS
        for box in bodies(variant)
        if box.part != "U2" and _overlap(box.x, way.x) and _overlap(box.y, way.y) and _overlap(box.z, way.z)
    ]


def hands_reach_what_they_use() -> list[str]:
    """Return what is used with the lid on and lies below closed material: the mode button, the stop's loop."""
    lid, wrong = design.lid(), []
    for name, (x, y) in {"button": design.button_place(), "stop": _middle(body_of("J7", index=-1))}.items():
        if lid.holds(x, y, design.SPACER_MM + 1):
            wrong.append(f"{name}: the lid is closed at {_text((x, y, design.SPACER_MM))}")
    return wrong


def a_small_printer_takes_it() -> list[str]:
    """Return the bodies that are larger than a small printer's bed."""
    return [
        f"{body.name}: {body.extent[1] - body.extent[0]:.0f} x {body.extent[3] - body.extent[2]:.0f} mm"
        for body in _printed()
        if max(body.extent[1] - body.extent[0], body.extent[3] - body.extent[2]) > BED_MM
    ]


def base_and_lid_do_not_meet() -> list[str]:
    """Return where lid and base take the same space."""
    base, lid = design.base(), design.lid()
    level = design.SPACER_MM - design.LIP_MM / 2
    left, right, top, bottom, _, _ = lid.extent
    slice_of = PlacedBox(part="the lid's lip", x=(left, right), y=(top, bottom), z=(level, level))
    return [f"at {_text(at)}" for at in _points(slice_of) if lid.holds(*at) and base.holds(*at)]


#: What is checked, in words.
CHECKS: dict[str, Callable[[], list[str]]] = {
    "parts of every variant touch nothing": parts_touch_nothing,
    "solder keeps off the base": solder_keeps_off_the_base,
    "parts keep off the spacers": parts_keep_off_the_spacers,
    "bosses and screws meet the board's holes": bosses_carry_the_board,
    "plugs reach their sockets": plugs_reach_their_sockets,
    "the LEDs are seen": lights_are_seen,
    "nothing stands in the way of the ESP32's cable": parts_leave_the_cable_its_way,
    "button and stop are reached with the lid on": hands_reach_what_they_use,
    "lid and base do not meet": base_and_lid_do_not_meet,
    "a printer of 180 mm takes it": a_small_printer_takes_it,
}


def _printed() -> tuple[PrintedPart, PrintedPart]:
    return design.base(), design.lid()


def _board() -> PlacedBox:
    """Return the board itself."""
    return PlacedBox(part=BOARD, x=(0.0, BOARD_WIDTH_MM), y=(0.0, BOARD_HEIGHT_MM),
                     z=(-BOARD_THICKNESS_MM + 0.01, 0.0))  # fmt: skip


def _first_touch(body: PrintedPart, box: PlacedBox) -> tuple[float, float, float] | None:
    near = body.near((*box.x, *box.y, *box.z))
    if all(solid.is_cut for solid in near.solids):
        return None
    corner = CORNER_MM if box.part == BOARD else 0.0
    own = Block(x=box.x, y=box.y, z=box.z, corner_mm=corner)
    return next((at for at in _points(box) if near.holds(*at) and own.holds(*at)), None)


def _points(box: PlacedBox) -> Iterator[tuple[float, float, float]]:
    """Yield the points of a raster over a body, its faces included."""
    for x in _steps(*box.x):
        for y in _steps(*box.y):
            for z in _steps(*box.z):
                yield x, y, z


def _steps(least: float, most: float) -> list[float]:
    count = max(1, -int(-(most - least) // RASTER_MM))
    return [least + (most - least) * step / count for step in range(count + 1)] if most > least else [least]


def _overlap(one: tuple[float, float], other: tuple[float, float]) -> bool:
    return one[0] < other[1] and other[0] < one[1]


def _middle(box: PlacedBox) -> tuple[float, float]:
    return (box.x[0] + box.x[1]) / 2, (box.y[0] + box.y[1]) / 2


def _distance(value: float, span: tuple[float, float]) -> float:
    return max(span[0] - value, value - span[1], 0.0)


def _text(at: tuple[float, float, float]) -> str:
    return "x {:.1f}, y {:.1f}, z {:.1f} mm".format(*at)
