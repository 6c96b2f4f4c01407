"""The page of a run with several robots: what came of each, their ways on one plan, and what happened as one list.

It opens from a file, without script; each robot's own report has the rest.

Invariant: it is made from the traces and the outcome alone.
"""

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import cast

from robot_bench.events.codec import Json
from robot_bench.events.kinds import Event, WorldChange
from robot_bench.events.words import is_frequent, what_of
from robot_bench.recording.run_record import RunRecord
from robot_bench.recording.summary import SUMMARY_NAME, verdict_of
from robot_bench.recording.together import named_events
from robot_bench.report.thinning import ends, extremes
from simbase.files import writing
from simbase.timing import NS_PER_S

REPORT_NAME = "report.html"
#: Told apart also where colours are not seen: after these it goes on with the first ones, dashed.
_COLOURS = ("#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#ff7f0e", "#17becf", "#8c564b", "#e377c2")
#: chosen: width of the drawn plan, pixels; what a list may take, in characters.
_WIDTH_PX, _LIST_BYTES, _ROW_BYTES = 900.0, 200_000, 60
_PAGE = """\
<!doctype html>
<html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>{title}</title>
<style>body {{ font: 16px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 60rem; padding: 0 1rem }}
td, th {{ padding: .2rem 1rem .2rem 0; text-align: left; vertical-align: top }} svg {{ width: 100%; height: auto }}
td:not(:last-child) {{ white-space: nowrap }} .log {{ font-size: 14px }}
.log td:first-child {{ text-align: right; font-variant-numeric: tabular-nums }}</style>
<h1>{title}</h1>
<p>{verdict}</p>
<table><tr><th>robot<th>way<th>clear of<th>collisions<th>what came of it</tr>
{rows}
</table>
<h2>Ways</h2>
{plan}
<h2>What happened</h2>
<table class="log">
{log}
</table>
</html>
"""


def write_report_of_all(outcome: Json, records: Mapping[str, RunRecord], folder: Path) -> None:
    """Write what came of a run with several robots, and the page of all.

    Args:
        outcome: What came of it.
        records: Each robot's trace by its name, as read.
        folder: The run's.

    Raises:
        FileError: The disk is full, or the folder cannot be written.
        TraceError: A robot's folder holds no readable trace.
    """
    robots = cast("Mapping[str, Mapping[str, object]]", outcome["robots"])
    colours = {name: _COLOURS[place % len(_COLOURS)] for place, name in enumerate(robots)}
    page = _PAGE.format(
        title=escape(f"{outcome['scenario']} in {outcome['world']}"),
        verdict=escape(
            f"{verdict_of(outcome)}; {outcome['virtual_s']} s, body {outcome['body']}, seed {outcome['seed']}"
        ),
        rows="\n".join(_row(name, one, colours[name]) for name, one in robots.items()),
        plan=_plan(records, colours),
        log="\n".join(_log(named_events(folder), colours)),
    )
    with writing(folder):
        (folder / REPORT_NAME).write_text(page, encoding="utf-8")
        (folder / SUMMARY_NAME).write_text(json.dumps(outcome, indent=2, sort_keys=True) + "\n", encoding="utf-8")


def _row(name: str, one: Mapping[str, object], colour: str) -> str:
    failures = [*cast("Sequence[str]", one["failures"]), *cast("Sequence[str]", one["goals_not_judged"] or ())]
    lines = "<br>".join(escape(line) for line in failures) or "passed"
    return (
        f'<tr><td><a href="{name}/{REPORT_NAME}" style="color:{colour}">{name}</a><td>{_metres(one["distance_m"])}'
        f"<td>{_metres(one['min_clearance_m'])}<td>{one['collisions']}<td>{lines}</tr>"
    )


def _metres(value: object) -> str:
    return f"{value:.3f} m" if isinstance(value, (int, float)) else ""


def _plan(records: Mapping[str, RunRecord], colours: Mapping[str, str]) -> str:
    """Return the world and all ways as SVG, whose unit is the metre; y goes up."""
    world = cast("Json", next(iter(records.values())).meta.get("world") or {})
    low_x, low_y, high_x, high_y = cast("Sequence[float]", world.get("extent") or (-3, -3, 3, 3))
    dot = (high_x - low_x) * 5 / _WIDTH_PX
    shapes = [_shape(item) for item in cast("Sequence[Json]", world.get("obstacles") or ())]
    ways, names = [], []
    for place, (name, record) in enumerate(records.items()):
        columns = [[getattr(pose, axis) for pose in record.poses] for axis in ("x", "y")]
        poses = [record.poses[n] for n in extremes([pose.t for pose in record.poses], columns)]
        if not poses:
            continue
        dashed = f' stroke-dasharray="{2 * dot:g}"' if place >= len(_COLOURS) else ""
        points = " ".join(f"{p.x_m:.3f},{p.y_m:.3f}" for p in poses)
        first, last, colour = poses[0], poses[-1], colours[name]
        ways.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="{dot / 2:g}"{dashed}/>')
        ways.append(f'<circle cx="{first.x_m:.3f}" cy="{first.y_m:.3f}" r="{dot:g}" fill="{colour}"/>')
        ways += [
            f'<circle cx="{hit.x_m:.3f}" cy="{hit.y_m:.3f}" r="{dot:g}" fill="none" stroke="#000" '
            f'stroke-width="{dot / 2:g}"><title>{escape(f"{name}: {hit}")}</title></circle>'
            for hit in record.contacts
        ]
        tip = f"translate({last.x_m:.3f} {last.y_m:.3f}) rotate({math.degrees(last.heading_rad):.1f})"
        arrow = f"{2 * dot:g},0 {-dot:g},{dot:g} {-dot:g},{-dot:g}"
        ways.append(f'<polygon points="{arrow}" transform="{tip}" fill="{colour}"/>')
        names.append(
            f'<text x="{last.x_m + 2 * dot:.3f}" y="{-last.y_m - 2 * dot:.3f}" font-size="{3 * dot:g}" '
            f'fill="{colour}">{escape(name)}</text>'
        )
    box = f"{low_x:g} {-high_y:g} {high_x - low_x:g} {high_y - low_y:g}"
    return (
        f'<svg viewBox="{box}" role="img" aria-label="the ways of all robots">'
        f'<g transform="scale(1 -1)">{"".join([*shapes, *ways])}</g>{"".join(names)}</svg>'
        "<p>A dot is where a way begins, an arrow where it ends, a ring a contact.</p>"
    )


def _shape(item: Json) -> str:
    """Return a thing of the world in its first place; floors are not drawn."""
    if item.get("kind") in {"floor", "ramp"}:
        return ""
    x, y = (float(cast("float", item[key])) for key in "xy")
    if item.get("shape", "box") == "box":
        length, width = (float(cast("float", item.get(key, 0.1))) for key in ("length", "width"))
        turned = math.degrees(float(cast("float", item.get("heading", 0.0))))
        what = f'<rect x="{-length / 2:g}" y="{-width / 2:g}" width="{length:g}" height="{width:g}" '
        what += f'transform="translate({x:g} {y:g}) rotate({turned:.2f})"'
    else:
        what = f'<circle cx="{x:g}" cy="{y:g}" r="{float(cast("float", item.get("radius", 0.05))):g}"'
    return f'{what} fill="#bbb"><title>{escape(str(item.get("name", "")))}</title></{what[1 : what.index(" ")]}>'


def _log(events: Iterable[tuple[str, Event]], colours: Mapping[str, str]) -> list[str]:
    """Return what all robots tell, in order of time, but for what there is so much of, and where the others are."""
    reported = [
        (event.t, name, what_of(event))
        for name, event in events
        if not is_frequent(event) and not (isinstance(event, WorldChange) and event.name in colours)
    ]
    head, tail = ends([len(what) + _ROW_BYTES for _, _, what in reported], _LIST_BYTES)
    shown = [*reported[:head], *reported[len(reported) - tail :]]
    rows = [
        f'<tr><td>{t / NS_PER_S:.3f} s<td style="color:{colours[name]}">{name}<td>{escape(what)}</tr>'
        for t, name, what in shown
    ]
    if len(shown) < len(reported):
        rows.insert(head, f"<tr><td><td><td>… {len(reported) - len(shown)} more: p2os report FOLDER --events FILE</tr>")
    return rows
