"""The case: a tray that carries the board on spacers, a lid on the same spacers, and what cables and straps need.

    lid      2.4 mm, a lip that keeps it in place, an M3 screw into each spacer
    spacers  bought: M3 x 20 mm, female above, male below, through the board into an insert
    base     bosses with heat-set inserts below the board's holes, openings for the plugs,
             a tongue with slots for cable ties, and ears for two straps of 25 mm, which hold the
             case on the robot's deck, or a power bank below it

Openings are made around the bodies of the board's own parts, so that a part that moves
takes its opening with it. Chosen: 2.4 mm walls (six lines of a 0.4 mm nozzle), 0.6 mm of play
around the board, heights of the plugs that people have (makers' drawings of USB micro-B
cables: 11 x 8.5 mm at most; D-sub: 30.8 x 12.5 mm).

Not here: the holes of the Pioneer's deck, of which no drawing was found.
"""

import hashlib
from functools import cache

from hardware.case.board import PlacedBox, body_of, mounting_holes, part_place
from hardware.case.solids import Block, PrintedPart, Solid, UprightCylinder
from hardware.pcb.layout.rules import BOARD_HEIGHT_MM, BOARD_THICKNESS_MM, BOARD_WIDTH_MM, CORNER_MM

WALL_MM, PLAY_MM = 2.4, 0.6
#: Below the board: solder and cut leads take 3 mm.
STANDOFF_MM = 5.0
#: Of the spacers: from the board's upper side to the lid.
SPACER_MM = 20.0
LIP_MM, LIP_PLAY_MM = 3.0, 0.25
#: Heat-set insert M3, 4.6 mm outside, 5.7 mm long; the hole as its makers want it.
INSERT_HOLE_MM, BOSS_MM, SCREW_HOLE_MM = 4.0, 8.0, 3.4
#: Around the plug of a cable.
PLUG_PLAY_MM = 0.8
USB_PLUG_MM = (11.0, 8.5)
#: From the socket's mouth to where the cable has bent away upwards.
USB_PLUG_LENGTH_MM = 34.0
#: A pen or a match reaches the button, 15 mm below the lid.
BUTTON_MM = 7.0
STRAP_MM, STRAP_SLOT_MM, EAR_MM = 25.0, 4.0, 11.0
TIE_SLOT_MM = (4.0, 2.2)
LIGHT_MM = 3.2
#: Rev C has one light more, and the others where every board has them.
LIGHTS, LIGHTS_VARIANT = ("D6", "D7", "D8", "D9"), "rev-c"

_INNER = (-PLAY_MM, BOARD_WIDTH_MM + PLAY_MM, -PLAY_MM, BOARD_HEIGHT_MM + PLAY_MM)
_OUTER = (_INNER[0] - WALL_MM, _INNER[1] + WALL_MM, _INNER[2] - WALL_MM, _INNER[3] + WALL_MM)
_FLOOR_TOP = -BOARD_THICKNESS_MM - STANDOFF_MM
_BOTTOM = _FLOOR_TOP - WALL_MM


@cache
def base() -> PrintedPart:
    """Return the tray."""
    walls: list[Solid] = [
        Block(x=_OUTER[:2], y=_OUTER[2:], z=(_BOTTOM, SPACER_MM), corner_mm=CORNER_MM + PLAY_MM + WALL_MM,
              name="walls"),
        Block(x=_INNER[:2], y=_INNER[2:], z=(_FLOOR_TOP, SPACER_MM), corner_mm=CORNER_MM + PLAY_MM, is_cut=True,
              name="inside"),
    ]  # fmt: skip
    for at in mounting_holes():
        walls.append(UprightCylinder(at=at, radius_mm=BOSS_MM / 2, z=(_FLOOR_TOP, -BOARD_THICKNESS_MM), name="boss"))
        walls.append(UprightCylinder(at=at, radius_mm=INSERT_HOLE_MM / 2, z=(_BOTTOM + 0.8, -BOARD_THICKNESS_MM),
                                     is_cut=True,
                                     name="insert"))  # fmt: skip
    return PrintedPart(name="base", solids=(*walls, *_front(), *_back(), *_ears(), *_tongue()))


@cache
def lid() -> PrintedPart:
    """Return the cover."""
    top = (SPACER_MM, SPACER_MM + WALL_MM)
    left, right, top_side, bottom_side = _INNER
    inner = (left + LIP_PLAY_MM, right - LIP_PLAY_MM, top_side + LIP_PLAY_MM, bottom_side - LIP_PLAY_MM)
    lip = (SPACER_MM - LIP_MM, SPACER_MM)
    solids: list[Solid] = [
        Block(x=_OUTER[:2], y=_OUTER[2:], z=top, corner_mm=CORNER_MM + PLAY_MM + WALL_MM, name="plate"),
        Block(x=(inner[0], inner[1]), y=(inner[2], inner[3]), z=lip, corner_mm=CORNER_MM, name="lip"),
        Block(x=(inner[0] + 1.6, inner[1] - 1.6), y=(inner[2] + 1.6, inner[3] - 1.6), z=lip, corner_mm=CORNER_MM - 1,
              is_cut=True, name="inside of the lip"),
        # The lip stands nowhere in the way of a cable.
        *(Block(x=(x[0] - 1, x[1] + 1), y=y, z=lip, is_cut=True, name="gap of the lip") for x, y in _cable_gaps()),
    ]  # fmt: skip
    for at in mounting_holes():
        solids.append(UprightCylinder(at=at, radius_mm=BOSS_MM / 2, z=lip, is_cut=True, name="room for a spacer"))
        solids.append(UprightCylinder(at=at, radius_mm=SCREW_HOLE_MM / 2, z=top, is_cut=True, name="screw"))
    solids += [
        UprightCylinder(at=part_place(part, LIGHTS_VARIANT), radius_mm=LIGHT_MM / 2, z=top, is_cut=True,
                        name=f"light of {part}")
        for part in LIGHTS
    ]  # fmt: skip
    logic, regulator = body_of("J4", index=-1), body_of("U3")
    solids += [
        _around(logic, 2.0, top, "LOGIC"),
        Block(x=usb_way().x, y=usb_way().y, z=top, is_cut=True, name="USB of the ESP32"),
        _around(body_of("J7", index=-1), 2.0, top, "STOP"),
        UprightCylinder(at=button_place(), radius_mm=BUTTON_MM / 2, z=top, is_cut=True, name="button"),
    ]
    solids += [
        Block(x=(x, x + 2.0), y=(regulator.y[0] - 6, regulator.y[1] + 6), z=top, is_cut=True, name="vent")
        for x in (regulator.x[0], regulator.x[0] + 4.5, regulator.x[0] + 9.0)
    ]
    return PrintedPart(name="lid", solids=tuple(solids))


def usb_way() -> PlacedBox:
    """Return the way of a cable to the ESP32's USB socket, which lies within: in from above, then to the socket."""
    socket = body_of("U2", index=-1)
    middle, half = (socket.x[0] + socket.x[1]) / 2, USB_PLUG_MM[0] / 2 + PLUG_PLAY_MM
    level = (socket.z[0] + socket.z[1]) / 2
    return PlacedBox(part="U2", x=(middle - half, middle + half), y=(socket.y[1], socket.y[1] + USB_PLUG_LENGTH_MM),
                     z=(level - USB_PLUG_MM[1] / 2, SPACER_MM + WALL_MM))  # fmt: skip


def button_place() -> tuple[float, float]:
    """Return the middle of the mode button."""
    button = body_of("SW1", index=-1)
    return (button.x[0] + button.x[1]) / 2, (button.y[0] + button.y[1]) / 2


def stamp() -> str:
    """Return the hash of all solids, in micrometres: what the written files are of."""
    text = [
        f"{body.name} {type(solid).__name__} {solid.is_cut} {[round(1000 * side) for side in solid.extent]}"
        f" {round(1000 * getattr(solid, 'corner_mm', 0))}"
        for body in (base(), lid())
        for solid in body.solids
    ]
    return hashlib.sha256("\n".join(text).encode()).hexdigest()


def _front() -> list[Solid]:
    """Openings of the wall at the board's lower edge: RS-232 plug, terminal, power bank."""
    wall = (_INNER[3] - 1, _OUTER[3] + 1)
    plug, terminal, bank = body_of("J3"), body_of("J1"), body_of("J2")
    return [
        Block(x=(plug.x[0] - PLUG_PLAY_MM, plug.x[1] + PLUG_PLAY_MM), y=wall,
              z=(-PLUG_PLAY_MM, plug.z[1] + PLUG_PLAY_MM), is_cut=True, name="RS-232"),
        Block(x=terminal.x, y=wall, z=(0.0, terminal.z[1] - 2), is_cut=True, name="12 V"),
        # Open above: the plug stands upright, and its cable bends over the wall's foot.
        Block(x=bank.x, y=wall, z=(bank.z[1], SPACER_MM), is_cut=True, name="5 V"),
    ]  # fmt: skip


def _back() -> list[Solid]:
    """The opening for a cable to the BluePill's USB socket."""
    socket = _usb_socket()
    x, z = (socket.x[0] + socket.x[1]) / 2, (socket.z[0] + socket.z[1]) / 2
    width, height = (side + 2 * PLUG_PLAY_MM for side in USB_PLUG_MM)
    return [
        Block(x=(x - width / 2, x + width / 2), y=(_OUTER[2] - 1, _INNER[2] + 1), z=(z - height / 2, z + height / 2),
              is_cut=True, name="USB"),
    ]  # fmt: skip


def _ears() -> list[Solid]:
    """Two ears with slots on each side."""
    solids: list[Solid] = []
    for y in (22.0, 78.0):
        inside, half = (_BOTTOM, _FLOOR_TOP), STRAP_MM / 2
        solids += [
            Block(x=x, y=(y - half - 4, y + half + 4), z=inside, name="ear")
            for x in ((_OUTER[0] - EAR_MM, _OUTER[0] + WALL_MM), (_OUTER[1] - WALL_MM, _OUTER[1] + EAR_MM))
        ]
        solids += [
            Block(x=(x - STRAP_SLOT_MM / 2, x + STRAP_SLOT_MM / 2), y=(y - half - 0.5, y + half + 0.5), z=inside,
                  is_cut=True, name="strap")
            for x in (_OUTER[0] - EAR_MM / 2, _OUTER[1] + EAR_MM / 2)
        ]  # fmt: skip
    return solids


def _tongue() -> list[Solid]:
    """A tongue below the two supply cables, with a pair of slots for a cable tie each."""
    width, depth = TIE_SLOT_MM
    middles = [(body_of(part).x[0] + body_of(part).x[1]) / 2 for part in ("J1", "J2")]
    solids: list[Solid] = [
        Block(x=(middles[0] - 9, middles[1] + 9), y=(_OUTER[3] - WALL_MM, _OUTER[3] + 14), z=(_BOTTOM, _FLOOR_TOP),
              name="tongue")
    ]  # fmt: skip
    for middle in middles:
        solids += [
            Block(x=(x - depth / 2, x + depth / 2), y=(_OUTER[3] + 5, _OUTER[3] + 5 + width), z=(_BOTTOM, _FLOOR_TOP),
                  is_cut=True, name="cable tie")
            for x in (middle - 4.0, middle + 4.0)
        ]  # fmt: skip
    return solids


def _cable_gaps() -> list[tuple[tuple[float, float], tuple[float, float]]]:
    """Return where a cable passes the lip: x and y."""
    bank, socket = body_of("J2"), _usb_socket()
    middle, half = (socket.x[0] + socket.x[1]) / 2, USB_PLUG_MM[0] / 2 + PLUG_PLAY_MM
    return [
        (bank.x, (_INNER[3] - 3, _INNER[3])),
        ((middle - half, middle + half), (_INNER[2], _INNER[2] + 3)),
    ]


def _usb_socket() -> PlacedBox:
    """Return the BluePill's USB socket: of its bodies the one at the board's upper edge."""
    return body_of("U1", index=3)


def _around(box: PlacedBox, play: float, z: tuple[float, float], name: str) -> Block:
    return Block(
        x=(box.x[0] - play, box.x[1] + play), y=(box.y[0] - play, box.y[1] + play), z=z, is_cut=True, name=name
    )
