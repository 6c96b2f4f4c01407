"""The routed copper judged without KiCad: is every net one piece, and wide enough?

KiCad's design rule check says more (clearances, pours); this runs everywhere. The ground
net is judged by its tracks alone, so it would work without its pours.
"""

from hardware.pcb import rules
from hardware.pcb.netlist import Design
from hardware.pcb.routing import PlacedPad, Track, Via, placed_pads


def faults(design: Design, tracks: list[Track], vias: list[Via]) -> list[str]:
    """Return nets in several pieces, tracks thinner than their class, and copper of no known net."""
    nets = design.nets()
    found = [f"track of {track.net}, which is no net" for track in tracks if track.net not in nets]
    found += [
        f"{track.net}: {track.width_mm:g} mm wide at {track.start_mm}, its class wants {rules.net_class(track.net).track_mm:g}"
        for track in tracks
        if track.width_mm < rules.net_class(track.net).track_mm
    ]
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


def _pieces(pads: list[PlacedPad], tracks: list[Track], vias: list[Via]) -> int:
    """Return the number of connected groups: ends that meet on a layer, ends within pads, vias through both layers."""
    parent: dict[object, object] = {}

    def root(item: object) -> object:
        parent.setdefault(item, item)
        while parent[item] != item:
            parent[item] = parent[parent[item]]
            item = parent[item]
        return item

    def join(first: object, second: object) -> None:
        parent[root(first)] = root(second)

    points = set()
    for track in tracks:
        ends = [(track.layer, *track.start_mm), (track.layer, *track.end_mm)]
        points |= set(ends)
        join(*ends)
    for via in vias:
        ends = [(0, *via.at_mm), (1, *via.at_mm)]
        points |= set(ends)
        join(*ends)
    for number, pad in enumerate(pads):
        left, top, right, bottom = pad.box_mm
        name = ("pad", pad.ref, pad.pad.number, number)
        root(name)
        for layer, x, y in points:
            if pad.layers >> layer & 1 and left <= x <= right and top <= y <= bottom:
                join(name, (layer, x, y))
    # A path that starts on a track of its own net ends inside that track, not at one of its ends.
    for layer, x, y in points:
        for track in tracks:
            if track.layer == layer and _is_on(track, x, y):
                join((layer, x, y), (layer, *track.start_mm))
    return len({root(item) for item in list(parent)})


def _is_on(track: Track, x: float, y: float) -> bool:
    (x0, y0), (x1, y1) = track.start_mm, track.end_mm
    length = (x1 - x0) ** 2 + (y1 - y0) ** 2
    along = 0.0 if length == 0 else max(0.0, min(1.0, ((x - x0) * (x1 - x0) + (y - y0) * (y1 - y0)) / length))
    dx, dy = x - (x0 + along * (x1 - x0)), y - (y0 + along * (y1 - y0))
    return dx * dx + dy * dy <= (track.width_mm / 2) ** 2
