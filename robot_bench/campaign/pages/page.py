"""The report of a campaign: one HTML page in one file, drawn as SVG, without a script.

Where in the searched space it fails (margins over the dimensions that matter most), each failure in its world with the
command that runs it again, how the search went, what of the firmware ran, and what it cost. Its style is that of the
report of a run.

Invariant: the page is made of the rows alone, and says the same however many workers there were, but for the seconds.
"""

import html
import math
import shlex
import statistics
from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib.resources import files
from string import Template

from p2os.pioneer.world import load_world
from p2os.pioneer.world.model import World
from p2os.toml_record import tables_of
from p2os.toml_schema import Table
from robot_bench.campaign.conduct import FAILURES, PointFinding, PointRow, Run
from robot_bench.campaign.last_moment import LastMoment
from robot_bench.campaign.results import SHOWN_HASH, Whole
from robot_bench.campaign.trial import unpacked
from robot_bench.campaign.variants.diversity import FailureSet
from simbase.errors import P2osError

#: chosen: what fits a page that one scrolls through.
MOST_SHOWN, MOST_DIMENSIONS = 24, 8
#: Of a chart and of a plan, in units of their drawings.
_WIDTH, _HEIGHT, _SIDE = 360, 200, 300
_PAGE = Template("""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>$title</title><style>$style</style></head><body>
<header><h1>$heading <span class="verdict $verdict_class">$verdict</span></h1><p class="lead">$lead</p></header>
<main>
<section class="halves even"><div><h2>What came of it</h2><table class="figures"><tbody>$figures</tbody></table></div>
<div><h2>What it cost</h2><table class="figures"><tbody>$cost</tbody></table></div></section>
<section><h2>Failures <small>each run again in another process with the same hash</small></h2>
<div class="multiples">$failures</div>$more</section>
<section><h2>Margins over what varied <small>a point a run; below the line it failed</small></h2>
<div class="charts">$space</div></section>
<section><h2>Course of the search</h2><div class="charts">$course</div></section>
<section><h2>Reached <small>by the cheap runs, and what no point has</small></h2>
<table class="figures"><tbody>$reached</tbody></table></section>
<section><h2>Where the cheap runs ended <small>darker: less margin</small></h2>
<div class="multiples">$map</div></section>
</main><footer>$footer</footer></body></html>
""")
#: Of what is drawn.
STYLE = """
.halves.even { grid-template-columns: minmax(0, 1fr) minmax(0, 1fr); }
.multiples { display: grid; grid-template-columns: repeat(auto-fill, minmax(250px, 1fr)); gap: 18px; }
.charts { display: grid; grid-template-columns: repeat(auto-fill, minmax(300px, 1fr)); gap: 18px; }
svg { width: 100%; height: auto; display: block; background: var(--panel); border: 1px solid var(--line);
  border-radius: 8px; }
svg text { fill: var(--faint); font: 11px system-ui, sans-serif; }
figcaption { min-height: 0; overflow-wrap: anywhere; font-size: 13px; }
figcaption b { color: var(--ink); } figcaption code { display: block; font-size: 11.5px; color: var(--ink); }
.wall { fill: var(--wall); } .drawn { fill: var(--box); } .way { fill: none; stroke: var(--path); stroke-width: 1.6; }
.walk { fill: none; stroke: var(--box); stroke-dasharray: 4 3; }
.hit { fill: var(--bad); } .last { fill: none; stroke: var(--warn); stroke-width: 2.5; }
.start { fill: none; stroke: var(--path); stroke-width: 1.6; }
.axis { stroke: var(--line); } .passed { fill: var(--good); } .failed { fill: var(--bad); } .seen { fill: var(--warn); }
.line { fill: none; stroke: var(--left); stroke-width: 1.8; } .line.bad { stroke: var(--bad); }
@media (max-width: 820px) { .halves.even { grid-template-columns: 1fr; } }
"""
_CLASS: Mapping[PointFinding, str] = {
    PointFinding.PASSED: "passed", PointFinding.EXCUSED: "seen",
    PointFinding.CONFIRMED: "failed", PointFinding.FULL_ONLY: "failed",
    PointFinding.CHEAP_ONLY: "seen",
    PointFinding.UNCONFIRMED: "seen", PointFinding.NOT_REPEATED: "seen", PointFinding.ERROR: "seen",
}  # fmt: skip
_MEANING: Mapping[PointFinding, str] = {
    PointFinding.PASSED: "passed",
    PointFinding.EXCUSED: "missed a goal that does not judge it, for what disturbed it",
    PointFinding.CONFIRMED: "failed, cheap and in full",
    PointFinding.FULL_ONLY: "failed in full alone",
    PointFinding.CHEAP_ONLY: "failed in the cheap run alone, no failure",
    PointFinding.UNCONFIRMED: "failed in the cheap run, not confirmed: no budget",
    PointFinding.NOT_REPEATED: "failed once and not again: a bug of the bench",
    PointFinding.ERROR: "without a verdict",
}


def render(whole: Whole) -> str:
    """Return the report as one HTML document."""
    campaign, rows, failures = whole.campaign, whole.progress.rows, whole.failures
    verdict = f"{len(failures)} of {len(rows)} points fail" if failures else f"none of {len(rows)} points fails"
    if whole.was_interrupted:
        verdict = f"interrupted, {verdict}"
    style = files("robot_bench.report").joinpath("page.css").read_text(encoding="utf-8")
    firmware = ", ".join(f"{name} ({sha256[:SHOWN_HASH]})" for name, sha256 in campaign.trial.programs.items())
    shown = failures[:MOST_SHOWN]
    left = len(failures) - len(shown)
    return _PAGE.substitute(
        title=html.escape(f"{campaign.name} · {verdict}"), heading=html.escape(campaign.name),
        verdict=html.escape(verdict), verdict_class="failed" if failures else "passed", style=style + STYLE,
        lead=html.escape(
            f"{campaign.description + ': ' if campaign.description else ''}{firmware} in "
            f"{campaign.trial.table['world']}, {campaign.search}"
        ),
        figures=_table(_figures(whole)), cost=_table(_cost(whole)),
        failures="".join(_failure(row, whole) for row in shown) or "<p>none</p>",
        more=f"<p>and {left} more in failures/</p>" if left else "",
        space="".join(_over(name, rows) for name in _dimensions(rows)) or "<p>nothing varied</p>",
        course="".join(_course(rows)), map=_map(whole), reached=_table(_reached(whole)),
        footer=html.escape(f"p2os campaign --resume {shlex.quote(str(whole.folder))} goes on where it was interrupted"),
    )  # fmt: skip


def _figures(whole: Whole) -> Iterator[tuple[str, str]]:
    for finding, meaning in _MEANING.items():
        if whole.counts.get(finding) or finding in FAILURES:
            yield meaning, str(whole.counts.get(finding, 0))
    if whole.failures:
        yield from FailureSet.of(whole.progress.rows).words().items()
    yield "different runs, by their traces", str(whole.different_runs)


def _reached(whole: Whole) -> Iterator[tuple[str, str]]:
    """Return what points have reached of the program, each with what there is, and what none has, by source line."""
    progress = whole.progress
    for said, numbers in progress.reached.items():
        many = f"point {numbers[0]} first, {len(numbers)} of {len(progress.rows)} points" if numbers else "no point"
        yield f"has to be reached: {said}", many
    yield "states that it printed, and which followed another", f"{len(progress.states)}, {len(progress.transitions)}"
    yield "blocks of the firmware that ran", str(len(progress.blocks))
    source = whole.source
    if source is None:
        return
    if source.lines_of:
        yield "lines of source with code", f"{source.lines} of {source.lines_of}"
    yield "ways of conditional branches", f"{source.ways} of {source.ways_of}"
    for name, lines in source.unreached():
        yield f"no point has reached {name}", lines
    for name, lines in source.one_way():
        yield f"branches that always went one way in {name}", lines


def _cost(whole: Whole) -> Iterator[tuple[str, str]]:
    progress = whole.progress
    by_stage: dict[str, list[Run]] = {}
    for row in progress.rows:
        for run in row.runs:
            by_stage.setdefault(run.stage.value, []).append(run)
    for stage, runs in by_stage.items():
        seconds, virtual_s = sum(run.cpu_s for run in runs), sum(run.outcome.virtual_ns for run in runs) / 1e9
        factor = f", {virtual_s / seconds:.0f} × real time" if seconds else ""
        yield f"{stage} runs", f"{len(runs)}: {virtual_s:.0f} s in {seconds:.0f} s of a processor{factor}"
    yield "of them in the journal already", str(progress.resumed)
    if progress.left_out:
        yield "lines of the journal that do not count", "; ".join(progress.left_out_words())


def _table(pairs: Iterator[tuple[str, str]]) -> str:
    return "".join(f"<tr><td>{html.escape(name)}</td><td>{html.escape(value)}</td></tr>" for name, value in pairs)


def _failure(row: PointRow, whole: Whole) -> str:
    run = row.failing
    if run is None:
        return ""
    moment = whole.moments.get(row.number)
    why = next(iter(run.outcome.failures), "")
    avoidable = f"<br>{html.escape(moment.words)}" if moment is not None else ""
    return (
        f"<figure>{plan(run, moment)}<figcaption><b>point {row.number}</b>, {html.escape(row.finding.value)}: "
        f"{html.escape(why)}{avoidable}<code>{html.escape(whole.results.replay(row))}</code></figcaption></figure>"
    )


def plan(run: Run, moment: LastMoment | None) -> str:
    """Return the world of a run with the way of its robot, what it touched, and the last moment."""
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
    if moment is not None and moment.place is not None:
        x, y = to(*moment.place[:2])
        parts.append(
            f'<circle class="last" cx="{x}" cy="{y}" r="7"><title>{html.escape(moment.words)}</title></circle>'
        )
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


def _map(whole: Whole) -> str:
    """Return the floor with the place where each cheap run ended, by its margin."""
    extent = whole.space.extent
    to, parts = _place_in(extent), list[str]()
    for row in whole.progress.rows:
        if row.cheap.outcome.way_mm and row.cheap.margin is not None:
            x, y = to(*(at / 1000 for at in row.cheap.outcome.way_mm[-1]))
            shade = 0.25 + 0.75 * min(max(1 - row.cheap.margin, 0.0), 1.0)
            parts.append(
                f'<circle class="{_CLASS[row.finding]}" cx="{x}" cy="{y}" r="4" opacity="{shade:.2f}">'
                f"<title>point {row.number}: {row.cheap.margin:.3f}</title></circle>"
            )
    return f"<figure>{_svg(_SIDE, _high(extent), parts)}</figure>"


def _dimensions(rows: Sequence[PointRow]) -> list[str]:
    """Return the dimensions along which the margin changes most, by the correlation of numbers, the first first."""
    found: dict[str, list[tuple[float, float]]] = {}
    for row in rows:
        if row.cheap.margin is not None:
            for name, value in row.proposal.values.items():
                if isinstance(value, (int, float)):
                    found.setdefault(name, []).append((float(value), row.cheap.margin))
    least = max(len(rows) // 4, 3)
    known = {name: pairs for name, pairs in found.items() if len(pairs) >= least}
    return sorted(known, key=lambda name: (-abs(_correlation(known[name])), name))[:MOST_DIMENSIONS]


def _correlation(pairs: Sequence[tuple[float, float]]) -> float:
    try:
        return statistics.correlation(*zip(*pairs, strict=True))
    except statistics.StatisticsError:  # one of them does not change
        return 0.0


def _over(name: str, rows: Sequence[PointRow]) -> str:
    points = [
        (float(value), row.cheap.margin, _CLASS[row.finding], f"point {row.number}")
        for row in rows
        if isinstance(value := row.proposal.values.get(name), (int, float)) and row.cheap.margin is not None
    ]
    return _chart(name, points, [])


def _course(rows: Sequence[PointRow]) -> Iterator[str]:
    points = [
        (float(row.number), row.cheap.margin, _CLASS[row.finding], f"point {row.number}")
        for row in rows if row.cheap.margin is not None
    ]  # fmt: skip
    yield _chart("margin, point by point", points, [])
    counts: list[tuple[float, float]] = [(0.0, 0.0)]
    new: list[tuple[float, float]] = [(0.0, 0.0)]
    for row in rows:
        counts.append((float(row.number), counts[-1][1] + (row.finding in FAILURES)))
        new.append((float(row.number), new[-1][1] + row.new))
    yield _chart("failures so far", [], counts, "line bad")
    yield _chart("blocks and states so far", [], new)


def _chart(
    title: str, points: Sequence[tuple[float, float, str, str]], line: Sequence[tuple[float, float]], name: str = "line"
) -> str:
    """Return a chart of points (x, y, class, title) or a line, with the ends of its axes and y = 0."""
    both = [*((x, y) for x, y, _, _ in points), *line]
    xs, ys = [x for x, _ in both], [y for _, y in both]
    if not xs:
        return ""
    x0, x1, y0, y1 = min(xs), max(xs), min(0.0, *ys), max(0.0, *ys)
    x1, y1 = x1 + float(x0 == x1), y1 + float(y0 == y1)
    left, top, wide, high = 40, 12, _WIDTH - 52, _HEIGHT - 34

    def to(x: float, y: float) -> tuple[float, float]:
        return round(left + (x - x0) / (x1 - x0) * wide, 1), round(top + (y1 - y) / (y1 - y0) * high, 1)

    parts = [f'<line class="axis" x1="{left}" x2="{left + wide}" y1="{to(x0, 0)[1]}" y2="{to(x0, 0)[1]}"/>']
    parts += [
        f'<circle class="{kind}" cx="{to(x, y)[0]}" cy="{to(x, y)[1]}" r="3" opacity="0.75"><title>'
        f"{html.escape(said)}: {y:.3f}</title></circle>"
        for x, y, kind, said in points
    ]
    if line:
        parts.append(_polyline([to(x, y) for x, y in line], name))
    for text, x, y, anchor in (
        (_short(y1), left - 4, top + 4, "end"), (_short(y0), left - 4, top + high + 4, "end"),
        (f"{x0:g}", left, _HEIGHT - 6, "start"), (f"{x1:g}", left + wide, _HEIGHT - 6, "end"),
        (title, left + wide / 2, _HEIGHT - 6, "middle"),
    ):  # fmt: skip
        parts.append(f'<text x="{x}" y="{y}" text-anchor="{anchor}">{html.escape(text)}</text>')
    return f"<figure>{_svg(_WIDTH, _HEIGHT, parts)}</figure>"


def _short(value: float) -> str:
    """Return a number that fits beside an axis: two digits, or all those before the point."""
    return f"{value:.2g}" if abs(value) < 10 else f"{value:.0f}"


def _polyline(points: Sequence[tuple[float, float]], name: str) -> str:
    return f'<polyline class="{name}" points="{" ".join(f"{x},{y}" for x, y in points)}"/>'


def _svg(width: int, height: int, parts: Sequence[str]) -> str:
    return f'<svg viewBox="0 0 {width} {height}" role="img">{"".join(parts)}</svg>'
