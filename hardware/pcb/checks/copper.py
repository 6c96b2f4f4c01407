"""The routed copper judged without KiCad: is every net one piece, and wide enough?

KiCad's design rule check says more (clearances, pours); this runs everywhere. The ground
net is judged by its tracks alone, so it would work without its pours.
"""

from hardware.pcb.circuit.netlist import BoardDesign
from hardware.pcb.layout import rules
from hardware.pcb.layout.routing import PlacedPad, Track, Via, placed_pads


def faults(design: BoardDesign, tracks: list[Track], vias: list[Via]) -> list[str]:
    """Return nets in several pieces, tracks thinner than their class, and copper of no known net."""
    nets = design.nets()
    found = [f"track of {track.net}, which is no net" for track in tracks if track.net not in nets]
    for track in tracks:
        wanted_mm = rules.net_class(track.net).track_mm
        if track.width_mm < wanted_mm:
            found.append(f"{track.net}: {track.width_mm:g} mm wide at {track.start_mm}, its class wants {wanted_mm:g}")
    pads = [pad for pad in placed_pads(design) if pad.net is not None]
    for net in nets:
        pieces = _pieces(
            [pad for pad in pads if pad.net == net],
            [track for track in tracks if track.net == net],
            [via for via in vias if via.net == net and not via.is_stitch],
        )
        if pieces != 1:
            found.append(f"{net} is in {pieces} pieces")
    return found


class _Groups:
    """Things that were joined, directly or through others."""

    def __init__(self) -> None:
        self._parent: dict[object, object] = {}

    def root(self, item: object) -> object:
        """Return the one that stands for an item's group; an unknown item is a group of its own."""
        self._parent.setdefault(item, item)
        while self._parent[item] != item:
            self._parent[item] = self._parent[self._parent[item]]
            item = self._parent[item]
        return item

    def join(self, first: object, second: object) -> None:
        """Make one group of two."""
        self._parent[self.root(first)] = self.root(second)

    def count(self) -> int:
        """Return the number of groups."""
        return len({self.root(item) for item in list(self._parent)})


def _pieces(pads: list[PlacedPad], tracks: list[Track], vias: list[Via]) -> int:
    """Return the number of connected groups: ends that meet on a layer, ends within pads, vias through both layers."""
    groups = _Groups()
    pairs = [((track.layer, *track.start_mm), (track.layer, *track.end_mm)) for track in tracks]
    pairs += [((0, *via.at_mm), (1, *via.at_mm)) for via in vias]
    for first, second in pairs:
        groups.join(first, second)
    points = {point for pair in pairs for point in pair}
    for number, pad in enumerate(pads):
        name = ("pad", pad.ref, pad.pad.number, number)
        groups.root(name)
        for point in points:
            if _is_in(pad, point):
                groups.join(name, point)
    # A path that starts on a track of its own net ends inside that track, not at one of its ends.
    for layer, x, y in points:
        for track in tracks:
            if track.layer == layer and _is_on(track, x, y):
                groups.join((layer, x, y), (layer, *track.start_mm))
    return groups.count()


def _is_in(pad: PlacedPad, point: tuple[int, float, float]) -> bool:
    layer, x, y = point
    left, top, right, bottom = pad.box_mm
    return bool(pad.layers >> layer & 1) and left <= x <= right and top <= y <= bottom


def _is_on(track: Track, x: float, y: float) -> bool:
    (x0, y0), (x1, y1) = track.start_mm, track.end_mm
    length = (x1 - x0) ** 2 + (y1 - y0) ** 2
    along = 0.0 if length == 0 else max(0.0, min(1.0, ((x - x0) * (x1 - x0) + (y - y0) * (y1 - y0)) / length))
    dx, dy = x - (x0 + along * (x1 - x0)), y - (y0 + along * (y1 - y0))
    return dx * dx + dy * dy <= (track.width_mm / 2) ** 2
