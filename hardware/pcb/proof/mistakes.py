"""Mistakes of an order or a drawing, drawn by seed: bill of materials, print, lands, nets; the checks must name them.

Each is one slip that a person makes: a code of an order number read wrongly, a plus at the other pad, two pads counted
the other way round, a wire on the neighbour. Circuits' own faults are drawn in mutants.py and taken from there.

Invariant: a mistake changes one thing, and `touches` is what a check must name of it.
"""

import dataclasses
import random
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from hardware.pcb.circuit.electrical import bom_faults
from hardware.pcb.circuit.netlist import BoardDesign, Component
from hardware.pcb.proof import lands, mutants, printed
from hardware.pcb.proof.board_file import PlacedLand, PrintedBoard, PrintedMark, SilkPart
from hardware.pcb.proof.expected import differences


@dataclass(frozen=True, slots=True, kw_only=True)
class Mistake:
    """One slip: what kind, what it is, and order and board as they then are."""

    kind: str
    name: str
    touches: frozenset[str]
    design: BoardDesign
    board: PrintedBoard

    def lines(self) -> list[str]:
        """Return what the checks say."""
        return [*bom_faults(self.design), *differences(self.design), *printed.faults(self.board, self.design),
                *lands.faults(self.board, self.design)]  # fmt: skip

    def is_named(self) -> bool:
        """Tell whether a line names the part, pin, net or text of the slip."""
        lines = self.lines()
        words = {word for line in lines for word in re.findall(r"[\w+.-]+", line)}
        words |= {word.split(".")[0] for word in words}
        return bool(words & self.touches) or any(text in line for text in self.touches for line in lines if "'" in line)


def draw(design: BoardDesign, board: PrintedBoard, seed: int, count: int = 60) -> list[Mistake]:
    """Return mistakes, a quarter of each kind, in the order of their kinds.

    Args:
        design: A sound circuit.
        board: The same board's file.
        seed: Decides all.
        count: How many, a multiple of 4.
    """
    chance = random.Random(seed)
    found = []
    for kind, one in (("bom", _order), ("print", _print), ("land", _land)):
        for _ in range(count // 4):
            name, touches, changed = one(design, board, chance)
            other = changed if isinstance(changed, BoardDesign) else design
            found.append(Mistake(kind=kind, name=name, touches=frozenset(touches), design=other,
                                 board=changed if isinstance(changed, PrintedBoard) else board))  # fmt: skip
    found += [
        Mistake(kind="net", name=one.name, touches=one.touches(), design=mutants.apply(design, one), board=board)
        for one in chance.sample(mutants.draw(design, seed), count // 4)
    ]
    return found


#: What is drawn: a name, what must be named, and the changed order or board.
Drawn = tuple[str, Sequence[str], "BoardDesign | PrintedBoard"]

#: Codes that are read wrongly: in a number, for another.
_SLIPS: tuple[tuple[str, str], ...] = (
    (r"^RC0805", "RC0603"), (r"^(RC0805)F", r"\1J"), (r"^(RC\w+-07\d+)K(\d*)L", r"\1R\2L"),
    (r"^(RC\w+-07\d+)RL", r"\1KL"),
    (r"^(RC\w+-07)(\d)K(\d)L", r"\g<1>\2\g<3>0RL"), (r"^(RC\w+-07)(\d+)KL", r"\g<1>\g<2>0KL"),
    (r"^CC0805", "CC0603"), (r"X7R9", "X7R7"), (r"BB104", "BB103"), (r"^GRM31", "GRM21"), (r"61C226", "61A226"),
    (r"61C226", "61C106"), (r"FR1V", "FR1E"), (r"1V101", "1V100"), (r"^SMBJ15A", "SMBJ5.0A"), (r"^SMBJ", "SMAJ"),
    (r"^(SMBJ15)A", r"\1CA"), (r"1812L050", "1812L110"), (r"/30PR", "/15PR"), (r"MSMF110", "MSMF050"),
    (r"/24X", "/16X"),
    (r"^B340A", "B320A"), (r"^B340A", "B340B"), (r"210L", "210E"), (r"^MAX3232", "MAX232"), (r"EIDR", "EIPWR"),
    (r"EIDR", "EIDWR"), (r"2450", "2433"), (r"2450", "24120"), (r"BC817", "BC807"), (r"BC807", "BC817"),
    (r"-40,", "-16,"),
    (r"^74HC595", "74HCT595"), (r"D,118", "PW,118"), (r"SGC", "SRC"), (r"SYC", "SGC"), (r"SRC-PRV", "SYC"),
    (r"^KP-2012", "KP-1608"), (r"^6130(0?\d)", r"6131\1"), (r"^(613\d{3})(\d)1121", r"\g<1>31121"), (r"^B2P", "B3P"),
    (r"^VHR-2N", "VHR-3N"), (r"DCYR", "KCS"), (r"^61201021", "61200821"), (r"1821$", "1121"),
    (r"5747840-3", "5747844-3"),
    (r"1729128", "1729131"), (r"B3F-1000", "B3F-4000"),
)  # fmt: skip


def _order(design: BoardDesign, board: PrintedBoard, chance: random.Random) -> Drawn:
    """A part's order number with another code in it, another part's number, or another value beside it."""
    _ = board
    keys = sorted({part.part.key for part in design.components if part.part.bought})
    key = chance.choice(keys)
    of_key = [part for part in design.components if part.part.key == key]
    part = of_key[0].part
    slips = [re.sub(old, new, part.mpn) for old, new in _SLIPS if re.search(old, part.mpn)]
    others = [one.part for one in design.components if one.part.symbol == part.symbol and one.part.key != key]
    choices = [("mpn", number) for number in slips]
    choices += [("mpn", one.mpn) for one in others[:3]]
    choices += [("value", one.value) for one in others[:2]] + [("footprint", one.footprint) for one in others
                                                                if one.footprint != part.footprint][:2]  # fmt: skip
    field, value = chance.choice(choices or [("mpn", part.mpn[:-1])])
    mpn, text, footprint = (value if field == name else getattr(part, name) for name in ("mpn", "value", "footprint"))
    wrong = dataclasses.replace(part, mpn=mpn, value=text, footprint=footprint)
    changed = [dataclasses.replace(one, part=wrong) if one.part.key == key else one for one in design.components]
    return f"{key}: {field} {value}", [one.ref for one in of_key], _with(design, changed)


def _with(design: BoardDesign, components: Sequence[Component]) -> BoardDesign:
    return dataclasses.replace(design, components=tuple(components))


def _print(design: BoardDesign, board: PrintedBoard, chance: random.Random) -> Drawn:
    """A bar, plus, dot, name, reference or label that stands where it should not."""
    _ = design
    return chance.choice((_bar, _text_pair, _text_pair, _dot, _label_pair, _label_away, _references, _gone))(
        board, chance
    )


def _replaced(board: PrintedBoard, *parts: SilkPart) -> PrintedBoard:
    return dataclasses.replace(board, parts={**board.parts, **{part.ref: part for part in parts}})


def _mirrored(point: tuple[float, float], one: PlacedLand, other: PlacedLand) -> tuple[float, float]:
    """Return a point turned by half about the middle of two lands."""
    return (one.at[0] + other.at[0] - point[0], one.at[1] + other.at[1] - point[1])


def _bar(board: PrintedBoard, chance: random.Random) -> Drawn:
    """The whole print of a part with two ends the wrong way round."""
    part = board.parts[chance.choice(sorted(ref for ref in board.parts if re.fullmatch(r"D\d+|C1", ref)))]
    one, other = part.lands[0], part.lands[1]

    def turned(mark: PrintedMark) -> PrintedMark:
        return dataclasses.replace(mark, points=tuple(_mirrored(at, one, other) for at in mark.points))

    marks = tuple(mark if mark.is_reference else turned(mark) for mark in part.marks)
    return (
        f"the print of {part.ref} turned",
        [part.ref],
        _replaced(board, dataclasses.replace(part, marks=marks)),
    )


def _text_pair(board: PrintedBoard, chance: random.Random) -> Drawn:
    """Two names of one part's pins exchanged."""
    named = [
        (part, [mark for mark in part.marks if mark.text and not mark.is_reference]) for part in board.parts.values()
    ]
    part, marks = chance.choice([(part, marks) for part, marks in named if len({mark.text for mark in marks}) > 2])
    names = [mark for mark in marks if mark.justify != "center"] or [mark for mark in marks if len(mark.text) < 4]
    one, other = chance.choice([(a, b) for a in names for b in names if a.text < b.text])
    swap = {one: dataclasses.replace(one, text=other.text), other: dataclasses.replace(other, text=one.text)}
    changed = dataclasses.replace(part, marks=tuple(swap.get(mark, mark) for mark in part.marks))
    return f"{part.ref}: {one.text} and {other.text} exchanged", [part.ref], _replaced(board, changed)


def _dot(board: PrintedBoard, chance: random.Random) -> Drawn:
    """The mark of pin 1 at another pad."""

    def is_dot(mark: PrintedMark) -> bool:
        return mark.is_filled or (len(mark.points) == 2 and mark.width_mm == 0.2)

    many = [part for ref, part in sorted(board.parts.items()) if len(part.lands) > 2 and not ref.startswith("D")]
    part = chance.choice([part for part in many if any(map(is_dot, part.marks))])
    land = chance.choice([land for land in part.lands if land.number != "1"])
    first = next(land for land in part.lands if land.number == "1")
    dx, dy = land.at[0] - first.at[0], land.at[1] - first.at[1]
    moved = [dataclasses.replace(mark, points=tuple((x + dx, y + dy) for x, y in mark.points)) if is_dot(mark) else mark
             for mark in part.marks]  # fmt: skip
    name = f"the mark of pin 1 of {part.ref} at pad {land.number}"
    return name, [part.ref], _replaced(board, dataclasses.replace(part, marks=tuple(moved)))


def _label_pair(board: PrintedBoard, chance: random.Random) -> Drawn:
    """Two labels of the board exchanged."""
    known = [mark for mark in board.labels if not printed.OF_BOARD.fullmatch(mark.text)]
    one, other = chance.choice([(a, b) for a in known for b in known if a.text < b.text])
    swap = {one: dataclasses.replace(one, text=other.text), other: dataclasses.replace(other, text=one.text)}
    changed = dataclasses.replace(board, labels=tuple(swap.get(mark, mark) for mark in board.labels))
    return f"{one.text} and {other.text} exchanged", [one.text, other.text], changed


def _label_away(board: PrintedBoard, chance: random.Random) -> Drawn:
    """A label turned, so that its plus and minus change sides, or moved 15 mm away."""
    known = [mark for mark in board.labels if not printed.OF_BOARD.fullmatch(mark.text)]
    mark = chance.choice(known)
    if mark.text in printed.POLES:
        wrong = dataclasses.replace(mark, text=mark.text[::-1])
    else:
        ((x, y),) = mark.points
        wrong = dataclasses.replace(mark, points=((x + (15 if x < 50 else -15), y),))
    changed = dataclasses.replace(board, labels=tuple(wrong if one is mark else one for one in board.labels))
    return f"{mark.text} elsewhere", [mark.text, "J4"] if printed.header_net(mark.text) else [mark.text], changed


def _references(board: PrintedBoard, chance: random.Random) -> Drawn:
    """The printed references of two parts exchanged."""
    refs = sorted(ref for ref, part in board.parts.items() if any(mark.is_reference for mark in part.marks))
    one, other = chance.sample(refs, 2)
    changed = []
    for ref, text in ((one, other), (other, one)):
        part = board.parts[ref]
        marks = tuple(dataclasses.replace(mark, text=text) if mark.is_reference else mark for mark in part.marks)
        changed.append(dataclasses.replace(part, marks=marks))
    return f"{one} and {other} printed for each other", [one, other], _replaced(board, *changed)


def _gone(board: PrintedBoard, chance: random.Random) -> Drawn:
    """A label that was forgotten."""
    known = [mark for mark in board.labels if mark.text in {*printed.LABELS, *printed.POLES}]
    mark = chance.choice(known)
    changed = dataclasses.replace(board, labels=tuple(one for one in board.labels if one is not mark))
    return f"{mark.text} forgotten", [mark.text], changed


def _land(design: BoardDesign, board: PrintedBoard, chance: random.Random) -> Drawn:
    """A pad that stands, is counted, sized or drilled otherwise."""
    _ = design
    part = chance.choice([part for _, part in sorted(board.parts.items()) if part.lands])
    land = chance.choice(part.lands)
    name, new = chance.choice(_LAND_SLIPS)(part, land, chance)
    return f"{part.ref}: {name}", [part.ref], _replaced(board, dataclasses.replace(part, lands=new))


def _swapped(part: SilkPart, land: PlacedLand, chance: random.Random) -> tuple[str, tuple[PlacedLand, ...]]:
    others = [one for one in part.lands if one.net != land.net] or [land]
    other = chance.choice(others)
    if other is land:
        return _moved(part, land, chance)
    swap = {land: dataclasses.replace(land, number=other.number, net=other.net),
            other: dataclasses.replace(other, number=land.number, net=land.net)}  # fmt: skip
    return f"pads {land.number} and {other.number} counted the other way", tuple(
        swap.get(one, one) for one in part.lands
    )


def _moved(part: SilkPart, land: PlacedLand, chance: random.Random) -> tuple[str, tuple[PlacedLand, ...]]:
    by = chance.choice((0.05, 0.127, 0.3, 1.27, -0.05, -0.3))
    wrong = dataclasses.replace(land, own_mm=(land.own_mm[0] + by, land.own_mm[1]))
    return f"pad {land.number} {by:g} mm further", tuple(wrong if one is land else one for one in part.lands)


def _sized(part: SilkPart, land: PlacedLand, chance: random.Random) -> tuple[str, tuple[PlacedLand, ...]]:
    by = chance.choice((0.6, 0.8, 1.25))
    wrong = dataclasses.replace(land, size_mm=(round(land.size_mm[0] * by, 3), land.size_mm[1]))
    return f"pad {land.number} {by:g} times as wide", tuple(wrong if one is land else one for one in part.lands)


def _drilled(part: SilkPart, land: PlacedLand, chance: random.Random) -> tuple[str, tuple[PlacedLand, ...]]:
    if not land.drill_mm:
        return _sized(part, land, chance)
    wrong = dataclasses.replace(land, drill_mm=round(land.drill_mm - chance.choice((0.1, 0.2, 0.3)), 3))
    return f"the hole of pad {land.number} too small", tuple(wrong if one is land else one for one in part.lands)


def _stretched(part: SilkPart, land: PlacedLand, chance: random.Random) -> tuple[str, tuple[PlacedLand, ...]]:
    """All pads of a part by another pitch: an inch's twelfth for a tenth, a wide body for a narrow one."""
    _ = land
    by = chance.choice((0.98, 1.02, 1.1))
    return f"every pad at {by:g} times its place", tuple(
        dataclasses.replace(one, own_mm=(round(one.own_mm[0] * by + (0.1 if len(part.lands) == 1 else 0.0), 4),
                                         round(one.own_mm[1] * by, 4))) for one in part.lands)  # fmt: skip


_LAND_SLIPS: tuple[Callable[[SilkPart, PlacedLand, random.Random], tuple[str, tuple[PlacedLand, ...]]], ...] = (
    _swapped, _swapped, _moved, _sized, _drilled, _stretched,
)  # fmt: skip
