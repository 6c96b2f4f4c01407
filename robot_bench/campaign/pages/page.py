"""The report of a campaign: one HTML page in one file.

Where in the searched space it fails (margins over the dimensions that matter most), each failure in its world with the
command that runs it again, how the search went, what of the firmware ran, and what it cost. The page itself is
`p2os.view.page`.

Invariant: the page is made of the rows alone, and says the same however many workers there were, but for the seconds.
"""

import math
import shlex
import statistics
from collections.abc import Iterable, Iterator, Mapping, Sequence

from p2os.pioneer.world import load_world
from p2os.toml_record import tables_of
from p2os.toml_schema import Table
from p2os.view.header import (
    PageBlock,
    PageCurve,
    PageHeader,
    PagePlan,
    PagePlot,
    PageSection,
    PageTable,
    PageText,
    WorldHeader,
    WorldThing,
)
from p2os.view.page import document
from p2os.view.world_plan import world_of
from robot_bench.campaign.conduct import FAILURES, PointFinding, PointRow, Run
from robot_bench.campaign.last_moment import LastMoment
from robot_bench.campaign.results import SHOWN_HASH, Whole
from robot_bench.campaign.trial import unpacked
from robot_bench.campaign.variants.diversity import FailureSet
from robot_bench.report.run_page import named_rows
from simbase.errors import P2osError

#: chosen: what fits a page that one scrolls through.
MOST_SHOWN, MOST_DIMENSIONS = 24, 8
#: Curves of a chart of points, and what they are called.
_CURVES: Mapping[str, tuple[PointFinding, ...]] = {
    "passed": (PointFinding.PASSED,),
    "excused": (PointFinding.EXCUSED,),
    "failed": (PointFinding.CONFIRMED, PointFinding.FULL_ONLY),
    "undecided": (
        PointFinding.CHEAP_ONLY, PointFinding.UNCONFIRMED, PointFinding.NOT_REPEATED, PointFinding.ERROR,
    ),
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
    firmware = ", ".join(f"{name} ({sha256[:SHOWN_HASH]})" for name, sha256 in campaign.trial.programs.items())
    lead = (
        f"{campaign.description + ': ' if campaign.description else ''}{firmware} in {campaign.trial.table['world']}, "
        f"{campaign.search}"
    )
    return document(
        PageHeader(
            title=campaign.name, verdict=verdict, standing="failed" if failures else "passed", lead=lead,
            why=_why(whole), sections=list(_sections(whole)),
            footer=f"p2os campaign --resume {shlex.quote(str(whole.folder))} goes on where it was interrupted",
        )
    )  # fmt: skip


def _sections(whole: Whole) -> Iterator[PageSection]:
    rows, failures = whole.progress.rows, whole.failures
    yield PageSection(title="What came of it", blocks=[PageTable(rows=named_rows(list(_figures(whole))))])
    blocks: list[PageBlock] = [block for row in failures[:MOST_SHOWN] for block in _failure(row, whole)]
    if len(failures) > MOST_SHOWN:
        blocks.append(PageText(text=f"and {len(failures) - MOST_SHOWN} more in failures/"))
    note = "each run again in another process with the same hash"
    yield PageSection(title="Failures", note=note, blocks=blocks or [PageText(text="none")])
    yield PageSection(title="What it cost", blocks=[PageTable(rows=named_rows(list(_cost(whole))))])
    space: list[PageBlock] = [_over(name, rows) for name in _dimensions(rows)]
    note = "a point a run; below 0 it failed"
    yield PageSection(title="Margins over what varied", note=note, blocks=space or [PageText(text="nothing varied")])
    yield PageSection(title="Course of the search", blocks=list(_course(rows)))
    note = "by the cheap runs, and what no point has"
    yield PageSection(title="Reached", note=note, blocks=[PageTable(rows=named_rows(list(_reached(whole))))])
    yield PageSection(title="Where the cheap runs ended", note="a point a run, by its margin", blocks=[_map(whole)])


def _why(whole: Whole) -> str:
    """Return what the first failure is, and how it is looked at; empty where there is none."""
    row = next(iter(whole.failures), None)
    if row is None or row.failing is None:
        return ""
    why = next(iter(row.failing.outcome.failures), row.finding.value)
    way = f"p2os view {shlex.quote(str(whole.folder))}, and open it there"
    return f"point {row.number}: {why}; to look at it: {way}, or run the command below its plan"


def _figures(whole: Whole) -> Iterator[tuple[str, str]]:
    for finding, meaning in _MEANING.items():
        if whole.counts.get(finding) or finding in FAILURES:
            yield meaning, str(whole.counts.get(finding, 0))
    if whole.failures:
        yield from FailureSet.of(whole.progress.rows).words().items()
    yield "different runs, by their traces", str(whole.different_runs)
    for name, rate in whole.rates.items():
        yield f"{name}, of the different runs at points drawn from the whole space", str(rate)


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


def _failure(row: PointRow, whole: Whole) -> Iterator[PagePlan]:
    """Yield a failure in its world: the way of the robot, what it touched, and the last moment to avoid it."""
    run = row.failing
    if run is None:
        return
    moment = whole.moments.get(row.number)
    why = next(iter(run.outcome.failures), "")
    words = [f"{row.finding.value}: {why}", *([moment.words] if moment is not None else [])]
    way = [(x / 1000, y / 1000) for x, y in run.outcome.way_mm]
    hits = [(hit.x_m, hit.y_m) for hit in run.outcome.hits[:1]]
    yield PagePlan(
        title=f"point {row.number}", text="; ".join(words), listing=whole.results.replay(row), opens=row.number,
        world=_world(run), ways=[_curve("way", way)], hits=hits, places=_last(moment),
    )  # fmt: skip


def _last(moment: LastMoment | None) -> list[tuple[float, float, str]]:
    if moment is None or moment.place is None:
        return []
    x, y = moment.place[:2]
    return [(x, y, "last moment")]


def _world(run: Run) -> WorldHeader | None:
    """Return the world of a run with what its scenario places; None where it is not to be had."""
    try:
        with unpacked(run.trial.files) as folder:
            scenario = run.trial.scenario(folder)
            world = load_world(scenario.world, seed=scenario.seed)
    except P2osError:
        return None
    placed = [thing for table in tables_of(run.trial.table, "obstacle") for thing in _placed(table)]
    found = world_of(world.to_plain())
    return WorldHeader(name=found.name, extent_m=found.extent_m, things=[*found.things, *placed])


def _placed(table: Table) -> Iterator[WorldThing]:
    values = {key: float(value) for key, value in table.items() if isinstance(value, (int, float))}
    if "x_m" in values:
        yield WorldThing(
            name=str(table.get("name", "")), kind="obstacle", shape="cylinder" if "radius_m" in values else "box",
            x_m=values["x_m"], y_m=values["y_m"], heading_rad=math.radians(values.get("heading_deg", 0.0)),
            length_m=values.get("length_m", 0.0), width_m=values.get("width_m", 0.0),
            radius_m=values.get("radius_m", 0.0),
        )  # fmt: skip


def _curve(name: str, points: Sequence[tuple[float, float]]) -> PageCurve:
    return PageCurve(name=name, x=[x for x, _ in points], y=[y for _, y in points])


def _map(whole: Whole) -> PagePlot:
    """Return the floor with the place where each cheap run ended, each with its margin."""
    curves = _by_finding(
        (row, (at[0] / 1000, at[1] / 1000), f"point {row.number}: {row.cheap.margin:.3f}")
        for row in whole.progress.rows
        if row.cheap.outcome.way_mm and row.cheap.margin is not None
        for at in (row.cheap.outcome.way_mm[-1],)
    )
    return PagePlot(x_name="x", x_unit="m", y_name="y", y_unit="m", curves=curves, is_equal=True)


def _by_finding(points: Iterable[tuple[PointRow, tuple[float, float], str]]) -> list[PageCurve]:
    """Return points as curves, one for each way to come out."""
    points = list(points)
    curves = []
    for name, findings in _CURVES.items():
        found = [(at, said) for row, at, said in points if row.finding in findings]
        if found:
            x, y = zip(*(at for at, _ in found), strict=True)
            curves.append(PageCurve(name=name, x=x, y=y, style="points", labels=[said for _, said in found]))
    return curves


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


def _over(name: str, rows: Sequence[PointRow]) -> PagePlot:
    points = (
        (row, (float(value), row.cheap.margin), f"point {row.number}: {row.cheap.margin:.3f}")
        for row in rows
        if isinstance(value := row.proposal.values.get(name), (int, float)) and row.cheap.margin is not None
    )
    return PagePlot(title=name, x_name=name, y_name="margin", curves=_by_finding(points))


def _course(rows: Sequence[PointRow]) -> Iterator[PagePlot]:
    points = (
        (row, (float(row.number), row.cheap.margin), f"point {row.number}: {row.cheap.margin:.3f}")
        for row in rows if row.cheap.margin is not None
    )  # fmt: skip
    yield PagePlot(title="margin, point by point", x_name="point", y_name="margin", curves=_by_finding(points))
    counts: list[tuple[float, float]] = [(0.0, 0.0)]
    new: list[tuple[float, float]] = [(0.0, 0.0)]
    for row in rows:
        counts.append((float(row.number), counts[-1][1] + (row.finding in FAILURES)))
        new.append((float(row.number), new[-1][1] + row.new))
    yield PagePlot(title="failures so far", x_name="point", y_name="failures", curves=[_curve("failures", counts)])
    words = "blocks and states so far"
    yield PagePlot(title=words, x_name="point", y_name="blocks and states", curves=[_curve(words, new)])
