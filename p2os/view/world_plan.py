"""The plan of a world (`World.to_plain`, and the first entry of a trace) as the header of a page has it."""

from collections.abc import Mapping, Sequence
from typing import Any, cast

from p2os.view.header import WorldHeader, WorldThing


def world_of(world: Mapping[str, object]) -> WorldHeader:
    """Return a world as the first entry of a trace has it."""
    low_x, low_y, high_x, high_y = cast("Sequence[float]", world.get("extent") or (-3.0, -3.0, 3.0, 3.0))
    return WorldHeader(
        name=str(world.get("name", "?")), extent_m=(low_x, low_y, high_x, high_y),
        things=[thing_of(item) for item in cast("Sequence[Mapping[str, Any]]", world.get("obstacles") or ())],
    )  # fmt: skip


def thing_of(item: Mapping[str, Any]) -> WorldThing:
    """Return a thing as a world's plan has it."""
    is_round = item.get("shape", "box") == "cylinder"
    return WorldThing(
        name=str(item["name"]), kind=str(item.get("kind", "")), shape="cylinder" if is_round else "box",
        x_m=float(item["x"]), y_m=float(item["y"]), heading_rad=float(item.get("heading") or 0.0),
        height_m=float(item.get("height") or 0.5), length_m=float(item.get("length") or 0.0),
        width_m=float(item.get("width") or 0.0), radius_m=float(item.get("radius") or 0.0),
    )  # fmt: skip
