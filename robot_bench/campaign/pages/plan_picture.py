"""The picture of one point of a campaign: its world and the robot's way in it, an SVG that stands alone.

A page of this project draws by itself (`p2os.view`); this is for where no script runs, as in a comment.
"""

import html
import math
from collections.abc import Callable, Sequence

from p2os.pioneer.world import load_world
from p2os.pioneer.world.model import World
from p2os.toml_record import tables_of
from p2os.toml_schema import Table
from robot_bench.campaign.conduct import Run
from robot_bench.campaign.trial import unpacked
from simbase.errors import P2osError

#: Width of a drawing, in its own units.
_SIDE = 300
_STYLE = """
.wall { fill: #4a5560; } .drawn { fill: #b9a66b; } .way { fill: none; stroke: #1b6ca8; stroke-width: 1.6; }
.walk { fill: none; stroke: #b9a66b; stroke-dasharray: 4 3; } .hit { fill: #b3261e; }
.start { fill: none; stroke: #1b6ca8; stroke-width: 1.6; } svg { background: #ffffff; }
"""


def picture(run: Run) -> str:
    """Return the world of a run with the way of its robot, where that began and ended, and what it touched.

    Empty where the world is not to be had.
    """
    try:
        with unpacked(run.trial.files) as folder:
            scenario = run.trial.scenario(folder)
            world = load_world(scenario.world, seed=scenario.seed)
    except P2osError:
        return ""
    to = _place_in(world.extent)
    parts = _things(world, to)
    parts += [_drawn(table, to) for table in tables_of(run.trial.table, "obstacle")]
    way = [to(x / 1000, y / 1000) for x, y in run.outcome.way_mm]
    if way:
        parts.append(_polyline(way, "way"))
        parts.append(f'<circle class="start" cx="{way[0][0]}" cy="{way[0][1]}" r="5"/>')
    if way and not run.outcome.hits:
        parts.append(f'<circle class="hit" cx="{way[-1][0]}" cy="{way[-1][1]}" r="4"><title>its end</title></circle>')
    for hit in run.outcome.hits[:1]:
        x, y = to(hit.x_m, hit.y_m)
        parts.append(f'<circle class="hit" cx="{x}" cy="{y}" r="5"><title>{html.escape(hit.what)}</title></circle>')
    return _svg(_SIDE, _high(world.extent), parts)


#: Returns the place in a drawing of a place in the plan.
_To = Callable[[float, float], tuple[float, float]]


def _place_in(extent: tuple[float, float, float, float]) -> _To:
    x0, _, x1, y1 = extent
    scale = _SIDE / (x1 - x0)
    return lambda x, y: (round((x - x0) * scale, 1), round((y1 - y) * scale, 1))


def _high(extent: tuple[float, float, float, float]) -> int:
    x0, y0, x1, y1 = extent
    return round(_SIDE * (y1 - y0) / (x1 - x0))


def _things(world: World, to: _To) -> list[str]:
    return [
        _shape("wall", to, item.x_m, item.y_m, item.heading_rad, item.length_m, item.width_m, item.radius_m)
        for item in world.obstacles
        if not item.kind.is_driven_on
    ]


def _drawn(table: Table, to: _To) -> str:
    values = {key: float(value) for key, value in table.items() if isinstance(value, (int, float))}
    if "x_m" not in values:
        return ""
    found = _shape(
        "drawn", to, values["x_m"], values["y_m"], math.radians(values.get("heading_deg", 0.0)),
        values.get("length_m", 0.0), values.get("width_m", 0.0), values.get("radius_m", 0.0),
    )  # fmt: skip
    path = table.get("path_m")
    return found + (_polyline([to(x, y) for x, y in path], "walk") if isinstance(path, list) and path else "")


def _shape(
    name: str, to: _To, x_m: float, y_m: float, heading_rad: float, length_m: float, width_m: float, radius_m: float
) -> str:
    scale = to(1.0, 0.0)[0] - to(0.0, 0.0)[0]
    x, y = to(x_m, y_m)
    if radius_m:
        return f'<circle class="{name}" cx="{x}" cy="{y}" r="{max(radius_m * scale, 1.5):.1f}"/>'
    length, width = length_m * scale, width_m * scale
    return (
        f'<rect class="{name}" x="{x - length / 2:.1f}" y="{y - width / 2:.1f}" width="{length:.1f}" '
        f'height="{width:.1f}" transform="rotate({-math.degrees(heading_rad):.1f} {x} {y})"/>'
    )


def _polyline(points: Sequence[tuple[float, float]], name: str) -> str:
    return f'<polyline class="{name}" points="{" ".join(f"{x},{y}" for x, y in points)}"/>'


def _svg(width: int, height: int, parts: Sequence[str]) -> str:
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" role="img">'
    return f"{head}<style>{_STYLE}</style>{''.join(parts)}</svg>"
