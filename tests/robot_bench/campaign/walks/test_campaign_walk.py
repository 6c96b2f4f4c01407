"""Campaigns whose runs are made up: what is asked, found, printed, written and shown of them, to the last figure."""

import contextlib
import dataclasses
import io
import itertools
import json
import os
import re
from collections.abc import Iterator
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any
from unittest import mock

import typer
from pyarrow import parquet

from p2os.pioneer.world import load_world
from robot_bench.campaign import things
from robot_bench.campaign import whole as whole_module
from robot_bench.campaign.campaign_file import CampaignTable, RunLimits, Span, campaign_schema, parse_campaign
from robot_bench.campaign.conduct import CampaignProgress, PointFinding
from robot_bench.campaign.last_moment import LastMoment
from robot_bench.campaign.margin import goal_margin, margin
from robot_bench.campaign.pages import comment, page
from robot_bench.campaign.pages.comment import _plain, write_comment
from robot_bench.campaign.results import PointRate, Whole
from robot_bench.campaign.search import Listed
from robot_bench.campaign.space import Space
from robot_bench.campaign.suggestion import suggested
from robot_bench.campaign.trial import GoalResult, HullContact, Outcome, SeenSoFar, Trial, TrialVerdict, trial_of
from robot_bench.campaign.variants import diversity
from robot_bench.campaign.variants.fault_line import FaultLine
from robot_bench.campaign.whole import begin, carry_out, points_of, resume
from robot_bench.campaign.workers import processes
from robot_bench.cli.campaigns import campaign as verb
from robot_bench.events.kinds import Contact, Note, Pose, Text
from robot_bench.scenario.loading import load_scenario
from simbase.errors import P2osError, UsageError
from tests.robot_bench.campaign.test_campaign import Shuffled
from tests.robot_bench.firmware import thumb
from tests.tools.suite.approved import Trace, judge_of, rounded, said, tried
from tests.tools.suite.declared import declared_of

SCENARIO = """
firmware = "dodge.elf"
world = "room"
body = "kinematic"
duration_s = 5
[start]
x_m = 0.5
y_m = 0.0
heading_deg = 0.0
[[obstacle]]
at_s = 0
op = "place"
name = "box"
shape = "box"
length_m = 0.4
width_m = 0.2
height_m = 0.5
x_m = 2.0
y_m = 1.0
heading_deg = 30.0
[[goal]]
kind = "no_collision"
[[goal]]
kind = "min_distance"
distance_m = 1.0
"""
FILE = """
scenario = "mine.toml"
search = "{search}"
batch = {batch}
seed = 5
near_misses = 2
description = "made up"
[budget]
runs = {runs}
confirmations = {confirmations}
{budget}
[cheap]
mode = "adapter"
duration_s = 4
[full]
duration_s = 5
[vary]
start.heading_deg = {{ from = 0, to = 350, step = 10 }}
threshold_m = [0.4, 0.6, 0.75]
start.x_m = {{ from = 0.3, to = 0.7 }}
[[draw]]
kind = "post"
count = {{ from = 0, to = 2 }}
[[draw]]
kind = "wall"
name = "wall behind"
count = {{ from = 0, to = 1 }}
[[disturb]]
fault = "sonar-stuck {{sonar}} {{range_m}}"
sonar = {{ from = 1, to = 8 }}
range_m = {{ from = 0.2, to = 3.0 }}
at_s = {{ from = 1.0, to = 2.0 }}
for_s = 0.5
share = 0.5
[[reach]]
text = "CRUISE"
[[reach]]
text = "never"
"""
#: What can be drawn and disturbed: seen from the robot, in an area, in swarms; and rows in place of `HERE`.
SPACE = """
scenario = "mine.toml"
swarm = {swarm}
keeps = ["no_collision"]
{top}
[vary]
start.heading_deg = {{ from = 0, to = 350, step = 10 }}
start.x_m = [0.4, 0.5]
{vary}
[[draw]]
kind = "post"
name = "near"
count = {{ from = 0, to = 2 }}
ahead_m = {{ from = 0.8, to = 2.0 }}
{draw}
[[draw]]
kind = "wall"
count = [1, 3]
area_m = [-2, -1.5, 2, 1.5]
gap_m = 0.1
length_m = 0.7
{area}
[[disturb]]
fault = "sonar-dead {{sonar}}"
sonar = {{ from = 1, to = 8 }}
at_s = {{ from = 1, to = 3 }}
share = 0.5
[[disturb]]
fault = "sonar-dead 2"
name = "second"
[[goal]]
kind = "no_collision"
excused_by = ["near", "second"]
[[goal]]
kind = "min_distance"
distance_m = 0.1
{goal}
"""
HASH = re.compile(r"\b[0-9a-f]{12,64}\b")


def made_up(trial: Trial) -> Outcome:
    """Return an outcome of any kind, that depends on what varies in a trial alone."""
    key = json.dumps([trial.seed, {name: trial.table.get(name) for name in (
        "start", "threshold_m", "obstacle", "fault")}], sort_keys=True, default=str)  # fmt: skip
    draw, alike = Random(f"{key} {trial.table['duration_s']}"), Random(key)  # both fidelities mostly agree
    if draw.random() < 0.08:
        return Outcome(verdict=TrialVerdict.ERROR, failures=(draw.choice(("too slow", "it ended")),))
    failed = alike.random() < 0.35 or draw.random() < 0.05
    goals = tuple(
        GoalResult(
            kind=kind, wanted=f"{kind} holds", met=None if draw.random() < 0.1 else not (failed and number == 0),
            says=f"{kind} said", robustness=None if draw.random() < 0.3 else draw.uniform(-1.2, 3.0), unit=unit,
            robot="one" * (number % 2), is_excused=number == 2 and draw.random() < 0.3,
        )
        for number, (kind, unit) in enumerate((
            (draw.choice(("no_collision", "reach")), "m"), ("answers", "s"), ("steers", "deg"), ("no_collision", "")))
    )  # fmt: skip
    place = draw.choice(("front left", "rear", ""))
    hits = (HullContact(t=10**9, what="'box'", part=place, x_m=1.0, y_m=draw.uniform(-1, 1)),) * (
        failed and place != ""
    )
    states = draw.sample(("ready", "CRUISE #", "TURN", "BACK"), 3)
    return Outcome(
        verdict=TrialVerdict.FAILED if failed else TrialVerdict.PASSED, goals=goals, hits=hits,
        failures=(f"{goals[0].kind}: {goals[0].says}",) * failed, virtual_ns=4 * 10**9 + draw.randrange(10**9),
        sha256=f"{draw.randrange(40):08x}", distance_m=draw.random(), clearance_m=draw.choice((None, 0.2, 1.4)),
        way_mm=tuple((100 * n, draw.randrange(-900, 900)) for n in range(draw.choice((0, 1, 4)))),
        died="hard fault" * (draw.random() < 0.05), blocks=frozenset(draw.sample(range(30), 5)),
        ways=frozenset(draw.sample(range(40), 4)), lines=frozenset(states),
        transitions=frozenset(map(" → ".join, itertools.pairwise(states))),
        happened=frozenset(words for words in trial.looks_for if "never" not in words and draw.random() < 0.3),
    )  # fmt: skip


def moment(trial: Trial, *_: object) -> LastMoment:
    number = Random(str(trial.table.get("start"))).randrange(4)
    return LastMoment(
        failure="no_collision: it hit", failed_ns=3_210_000_000, avoidable_ns=None if number == 0 else 2 * 10**9,
        place=None if number == 1 else (1.25, -0.5, 90.0), printed="CRUISE 3" * (number != 2),
    )  # fmt: skip


def printed(done: Whole, *, json_output: bool) -> Iterator[str]:
    out, err = io.StringIO(), io.StringIO()
    ended = 0
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            verb.tell(done, None, json_output=json_output)
        except typer.Exit as error:
            ended = error.exit_code
    yield from (HASH.sub("SHA", rounded(line)) for line in [*out.getvalue().splitlines(), *err.getvalue().splitlines()])
    yield f"= {ended}"


def shown(done: Whole) -> Iterator[str]:
    """Go through all that a campaign that is done shows."""
    for row in done.progress.rows:
        yield said([row.number, row.finding, row.proposal.point, row.proposal.values, row.proposal.obstacles,
                    row.proposal.faults, row.new, row.is_drawn])  # fmt: skip
        yield said([(run.stage, run.outcome.sha256, run.outcome.verdict, run.cpu_s, run.margin) for run in row.runs])
    yield from printed(done, json_output=False)
    if done.was_interrupted or done.campaign.batch == 8:
        yield from printed(done, json_output=True)
    for section in page._sections(done):
        for block in (section.title, section.note, *section.blocks):
            yield HASH.sub("SHA", said(block))[:6000]
    yield page._why(done)
    text = (done.folder / "report.html").read_text(encoding="utf-8")
    yield HASH.sub("SHA", " ".join(re.findall(r'"(?:lead|verdict|standing|footer|title)": ?"[^"]*"', text)[:6]))
    for part in sorted((done.folder / "results").iterdir()):
        for entry in parquet.read_table(part).to_pylist():
            left_out = ("p2os", "trial_sha256", "firmware_sha256")
            yield f"{part.name} {said({key: value for key, value in entry.items() if key not in left_out})}"
    for folder in sorted((done.folder / "failures").glob("*")):
        yield f"{folder.name} {said(sorted(path.name for path in folder.iterdir()))}"
        yield HASH.sub("SHA", (folder / "mine.toml").read_text(encoding="utf-8"))


def campaigns(_draw: Random) -> Iterator[str]:
    """Conduct campaigns of several searches and budgets, one of them interrupted and gone on with."""
    before = Path.cwd()
    # What stands in a trial is worked out for the page, the terminal and the summary: once is enough here.
    scenes: dict[str, Any] = {}
    scene = diversity._scene

    def seen(one: Trial) -> Any:
        if one.sha256 not in scenes:
            scenes[one.sha256] = scene(one)
        return scenes[one.sha256]

    answers: list[object] = []  # what a search is given

    with (
        TemporaryDirectory(prefix="p2os-test-") as name,
        mock.patch.object(Listed, "tell", lambda _self, given: answers.extend(given)),
        mock.patch.object(whole_module, "last_moment", moment),
        mock.patch.object(diversity, "_scene", seen),
    ):
        os.chdir(name)
        try:
            for number, (search, batch, runs, confirmations, budget, until) in enumerate((
                ("random", 8, 22, 16, "", 10**6), ("grid", 5, 10, 20, "virtual_hours = 0.008", 10**6),
                ("random", 3, 12, 2, "minutes = 1.5", 10**6), ("random", 4, 8, 3, "", 9),
            )):  # fmt: skip
                place = Path(f"c{number}")
                place.mkdir()
                (place / "mine.toml").write_text(SCENARIO, encoding="utf-8")
                text = FILE.format(search=search, batch=batch, runs=runs, confirmations=confirmations, budget=budget)
                (place / "camp.toml").write_text(text, encoding="utf-8")
                campaign = begin(
                    place / "camp.toml", place / "kept", firmware=None, overrides={"budget": {"runs": runs}}
                )
                ticks = itertools.count(7 * 10**12, 60 * 10**9)
                reported: list[tuple[int, int]] = []

                def note(progress: CampaignProgress, reported: list[tuple[int, int]] = reported) -> None:
                    reported.append((progress.runs, progress.answered))

                for last in (until, 10**6):
                    workers = Shuffled(number, last, made_up)
                    done = carry_out(
                        campaign, place / "kept", workers, clock=lambda ticks=ticks: next(ticks), on_run=note
                    )
                    yield said([search, reported[-1:], workers.count, sum(workers.anew), done.was_interrupted])
                    yield said([
                        (one.margin, one.ended, len(one.reached), sorted(map(str, one.reached))[:3], sorted(one.acting),
                         one.is_excused) for one in answers
                    ])  # fmt: skip
                    answers.clear()
                    if not done.was_interrupted:
                        break
                    campaign = resume(place / "kept")
                yield from shown(done)
                rows = points_of(place / "kept")
                yield HASH.sub("SHA", write_comment(place / "kept", campaign, rows, place / "c.md", url="http://x/"))
                yield said(sorted(path.name for path in place.rglob("*.svg")))
                yield said([row.finding for row in rows] == [row.finding for row in done.progress.rows])
        finally:
            os.chdir(before)


def files(_draw: Random) -> Iterator[str]:
    """Read campaign files that are wrong in one key, and write those that scenarios suggest."""
    yield said(campaign_schema())
    changes = (
        ("batch = 4", "batch = 0"),
        ("seed = 5", "seed = -1"),
        ("near_misses = 2", "near_misses = -1"),
        ("runs = 9", "runs = 0"),
        ("runs = 9", "runs = 1.5"),
        ("confirmations = 3", "confirmations = -1"),
        ('search = "random"', 'search = "luck"'),
        ('"adapter"', '"both"'),
        ('"adapter"', '"direct"'),
        ("to = 350", "to = -1"),
        ("step = 10", "step = 0"),
        ("step = 10", "step = 1e-9"),
        ("[0.4, 0.6, 0.75]", "[]"),
        ("[0.4, 0.6, 0.75]", "[-1]"),
        ("threshold_m", "threshold"),
        ('kind = "post"', 'kind = "tower"'),
        ("to = 2 }", "to = -2 }"),
        ("to = 2 }", "to = 2000 }"),
        ("share = 0.5", "share = 1.5"),
        ("sonar = {", "other = {"),
        ("to = 8 }", "to = 99 }"),
        ("swarm", "x"),
        ("for_s = 0.5", "for_s = 0"),
        ("sonar-stuck", "sonar-lost"),
        ('kind = "wall"', 'kind = "gap"'),
        ('text = "CRUISE"', "text = 3"),
        ('text = "CRUISE"', 'event = "robot"'),
        ('"mine.toml"', '"gone.toml"'),
        ("duration_s = 4\n", "duration_s = 0\n"),
        ("[full]", "[full]\nworlds = 1"),
        ("from = 0.3, to = 0.7", "from = 0.3"),
        ("description", "words"),
        ("", ""),
    )
    with TemporaryDirectory(prefix="p2os-test-") as name:
        file = Path(name, "camp.toml")
        (Path(name) / "mine.toml").write_text(SCENARIO, encoding="utf-8")
        whole = FILE.format(search="random", batch=4, runs=9, confirmations=3, budget="minutes = 5")
        for one, other in changes:
            try:
                found = parse_campaign(whole.replace(one, other, 1), file, firmware=None)
            except P2osError as error:
                yield f"{other}: {error} ({error.hint})".replace(name, "HERE")
                continue
            yield said([other, found.search, found.batch, found.seed, found.budget, found.limits, found.near_misses])
            space = Space(found)
            yield said([space.extent, [(one.name, one.span) for one in space.dimensions]])
            for share in (0.0, 0.13, 0.5, 0.77, 0.999):
                proposal = space.proposal(tuple((share + 0.37 * n) % 1 for n in range(len(space.dimensions))))
                yield said([proposal.point, proposal.values, proposal.obstacles, proposal.faults])
                yield said(space.point(proposal.values) if share else ())
    for name in ("motors", "two-dodge"):
        for keys in ({}, {"runs": 7, "search": "grid", "seed": 3, "firmware": "mine.elf"}):
            text = suggested(load_scenario(name), name, "c.toml", keys)
            yield from (
                line
                for line in text.splitlines()
                if (not line.startswith("body") and not keys) or "mine" in line or "grid" in line or "7" in line
            )
    yield said(CampaignTable)


def spaces(draw: Random) -> Iterator[str]:
    """Go through spaces of drawn things and faults, and refuse tables that cannot be meant."""
    rows: tuple[dict[str, object], ...] = (
        {}, {"swarm": 0.4}, {"draw": "aside_m = { from = -0.5, to = 0.5 }"}, {"draw": "heading_deg = 30"},
        {"draw": "area_m = [0, 0, 1, 1]"}, {"area": "aside_m = 1"}, {"area": 'name = "near"'},
        {"draw": "radius_m = { from = 0.1, to = 0.2 }"}, {"draw": "length_m = 1.0"}, {"draw": "gap_m = 0.2"},
        {"draw": "width_m = { from = 0.3, to = 0.2 }"}, {"draw": "width_m = [[1]]"}, {"draw": "width_m = true"},
        {"draw": "ahead = 1"}, {"area": "width_m = [0.1, 0.2]"}, {"goal": 'excused_by = ["nears"]'},
        {"top": '[cheap]\nmode = "direct"'}, {"top": '[cheap]\nbody = "odd"'}, {"top": "[full]\nworld = 3"},
        {"top": "[full.start]\nz_m = 3"}, {"vary": "start.z_m = [1]"}, {"vary": 'world = ["room", "arena"]'},
        {"vary": 'duration_s = { from = 2, to = 9, tail = "long" }'}, {"vary": "seed = { from = 1, to = 5, step = 2 }"},
        {"vary": 'duration_s = { from = 0, to = 9, tail = "long" }'}, {"vary": "seed = { from = 3, to = 3 }"},
    )  # fmt: skip
    with TemporaryDirectory(prefix="p2os-test-") as name:
        file = Path(name, "camp.toml")
        (Path(name) / "mine.toml").write_text(SCENARIO, encoding="utf-8")
        empty = {"swarm": 0, "top": "", "vary": "", "draw": "", "area": "", "goal": ""}
        texts = [(said(row), SPACE.format(**{**empty, **row})) for row in rows]
        texts += [
            (area, SPACE.format(**empty).replace("[-2, -1.5, 2, 1.5]", area))
            for area in ("[-2, -1.5, 2]", "[2, -1.5, 2, 1.5]", "[-2, 1.5, 2, 1.5]", '["a", 0, 1, 1]', "[0, 0, 1, 1]")
        ]
        head = 'scenario = "mine.toml"\n'
        texts += [
            (rest, head + rest)
            for rest in (
                "", '[[draw]]\nkind = "post"', "[vary]\nseed = [1]", 'keeps = ["reach"]', 'firmware = "gone.elf"',
                '[[disturb]]\nfault = "sonar-dead 1"\nat_s = 2',
            )
        ]  # fmt: skip
        for label, text in texts:
            try:
                found = parse_campaign(text, file, firmware=None)
            except P2osError as error:
                yield f"{label}: {error} ({error.hint})".replace(name, "HERE")
                continue
            yield said([label, found.draws, found.disturbances, found.vary, found.cheap, found.full, found.trial.table])
            space = Space(found)
            yield said([(one.name, one.span, one.span.count) for one in space.dimensions])
            for _ in range(4):
                proposal = space.proposal(tuple(draw.random() for _ in space.dimensions))
                yield said([proposal.values, proposal.settings, proposal.obstacles, proposal.faults])
                yield said([sorted(space.acting(proposal)), sorted(proposal.disturbed_by)])
            trial = proposal.trial(found.trial, found.cheap)
            yield said([[(key, trial.table.get(key)) for key in ("start", "body", "obstacle", "fault", "goal")],
                        sorted(trial.disturbed_by), space.coordinates(proposal.point)])  # fmt: skip
    for span in (
        Span(1, 9, 2, is_whole=True), Span(0, 1), Span(0.5, 2.0, 0.5), Span(60, 900, is_long_tailed=True),
        Span(1, 4, 1, is_whole=True, is_long_tailed=True), Span(choices=("a", "b", "c")), Span(2.0, 2.0),
    ):  # fmt: skip
        yield said([span, span.count, [span.value(at) for at in (0.0, 0.1, 0.33333, 0.5, 0.66667, 0.999999, 1.0)]])


def packed(_draw: Random) -> Iterator[str]:
    """Pack scenarios with the files that they name: worlds that stand alone and that import, programs, own robots."""
    with TemporaryDirectory(prefix="p2os-test-") as name:
        folder = Path(name)
        head = 'name = "hall"\nextent_m = [-2, -2, 2, 2]\n'
        hall = f'{head}[[box]]\nname = "a"\nx_m = 1\ny_m = 1\nlength_m = 1\nwidth_m = 1\n'
        wedge = "v -2 -2 0\nv -1 -2 0\nv -2 -1 0\nv -2 -2 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
        for file, text in (
            ("hall.toml", hall), ("more.toml", f'{hall}[[import]]\nfile = "wedge.obj"\n'), ("wedge.obj", wedge),
            ("own.toml", 'model = "p3dx"\n'),
        ):  # fmt: skip
            (folder / file).write_text(text, encoding="utf-8")
        (folder / "mine.bin").write_bytes(thumb.SLEEP)
        for number, (old, new) in enumerate((
            ("", ""), ('"room"', '"hall.toml"'), ('"room"', '"more.toml"'), ('"room"', '"wedge.obj"'),
            ('"room"', '"gone.toml"'), ('"dodge.elf"', '"mine.bin"'),
            ("duration_s", 'seeds = "1-3"\nseed = 2\nduration_s'),
        )):  # fmt: skip
            file = folder / f"s{number}.toml"
            file.write_text(SCENARIO.replace(old, new), encoding="utf-8")
            yield new
            yield tried(_packed, file, None).replace(name, "HERE")
            yield tried(_packed, file, folder / "mine.bin").replace(name, "HERE")
        yield tried(trial_of, "none")


def _packed(file: Path, firmware: Path | None) -> object:
    found = trial_of(str(file), firmware=firmware, settings=[("threshold_m", 0.45)])
    files = {key: rounded(data.decode()) if key.endswith(".toml") else "" for key, data in found.files.items()}
    return [found.name, found.seed, found.trusted, [(key, found.table[key]) for key in sorted(found.table)], files]


def limited(_draw: Random) -> Iterator[str]:
    """Do pieces of work within limits that are only noted: some need too much, some have a bug."""
    calls: list[str] = []

    def work(look: Any) -> Any:
        look()
        return Outcome(verdict=TrialVerdict.PASSED)

    def greedy(_look: Any) -> Any:
        raise MemoryError

    def wrong(_look: Any) -> Any:
        raise KeyError("no such thing")

    with (
        mock.patch.object(processes, "_limit", lambda *given: calls.append(said(given[1]))),
        mock.patch.object(processes, "_cpu_s", return_value=7.2),
        mock.patch.object(processes, "_mapped_bytes", return_value=1000),
    ):
        for limits in (RunLimits(), RunLimits(cpu_s=1.0, memory_mb=64), RunLimits(cpu_s=1.6), RunLimits(cpu_s=2.4)):
            for one in (work, greedy, wrong):
                found, is_sound = processes._limited(one, limits, lambda: calls.append("look"))
                yield said([limits, is_sound, getattr(found, "failures", ()), calls])
                calls.clear()


def figures(draw: Random) -> Iterator[str]:
    """Work out margins, rates, and words of the journal and of Markdown."""
    for unit in ("m", "s", "deg", "°", "m/s", "m/s²", "J", "", "x"):
        for by in (None, -2.0, -1e-4, 0.0, 0.4, 2.0):
            for met in (True, False, None):
                goal = GoalResult(kind=draw.choice(("no_collision", "reach")), wanted="", met=met, says="", unit=unit,
                                  robustness=by, is_excused=draw.random() < 0.2)  # fmt: skip
                outcome = Outcome(verdict=draw.choice(list(TrialVerdict)), goals=(goal,) * draw.randint(0, 1),
                                  clearance_m=draw.choice((None, 0.3)), died="x" * draw.randint(0, 1))  # fmt: skip
                yield said([unit, by, met, goal.kind, goal_margin(goal, outcome), margin(outcome)])
    for count, of in ((0, 1), (1, 1), (3, 10), (50, 100)):
        yield f"{PointRate(count, of)} {said(PointRate(count, of).bounds)}"
    left_out = {1: "a", 2: "a", 3: "b", 7: "a", 9: "a", 10: "a"}
    yield said(CampaignProgress(left_out=left_out).left_out_words())
    yield said([_plain(text) for text in ("a_b*c", "`x_y` a_b", "`x", "a\nb", "``", "[l](u)")])
    for number in range(4):
        start = next(n for n in range(99) if Random(str({"n": n})).randrange(4) == number)
        yield moment(Trial(name="", table={"start": {"n": start}}, files={}, seed=0)).words
    yield said(tried(page._correlation, [(1.0, 2.0), (2.0, 4.0), (3.0, 5.0)]))
    yield said([page._correlation([(1.0, 1.0), (1.0, 2.0)]), page._last(None)])


def comments(_draw: Random) -> Iterator[str]:
    """Say where a failing point parts from a good version, of points whose failing run is the cheap one or another."""
    runs = {name: SimpleNamespace(trial=name) for name in ("cheap", "failing")}
    for finding in PointFinding:
        for failing in (None, runs["failing"]):
            row: Any = SimpleNamespace(finding=finding, cheap=runs["cheap"], failing=failing)
            for apart in (None, "apart"):
                for cause in (FaultLine(line="a.c:3", says="so"), FaultLine(line="", says="why"), UsageError("no")):
                    with (
                        mock.patch.object(comment, "first_apart", return_value=apart) as asked,
                        mock.patch.object(comment, "by_version", side_effect=[cause]) as by,
                        mock.patch.object(comment, "reported", "reported {}".format),
                    ):
                        yield said([finding, failing is None, comment._against(row, "other")])  # type: ignore[arg-type]
                        yield said([asked.call_args.args, by.call_args.args])


def seen_so_far(draw: Random) -> Iterator[str]:
    """Take what runs show: places, contacts, lines with figures in them, and more of these than are kept."""
    for most in (3, 200, 230):
        seen, words = SeenSoFar(), [f"line {chr(33 + n // 90)}{chr(33 + n % 90)}" for n in range(most)]
        for number in range(700):
            t = 100 * 10**6 * number + draw.choice((0, 0, 1))
            seen._take(Pose(t=t, x=number * 999, y=-number * 1001, z=0, heading=0, pitch=0, left=0, right=0,
                            left_angle=0, right_angle=0, collisions=0))  # fmt: skip
            line = draw.choice(words) if number > most else words[number % most]
            line = line if draw.random() < 0.9 else draw.choice((f"x={number} y={-number / 8}", "", words[0]))
            seen._take(Text(t=t, data=f"{line}\r\n".encode() + b"\xff" * (number == 9)))
            if number % 300 == 0:
                seen._take(Contact(t=t, what="'box'", x_m=0.1 * number, y_m=0.0, part="front"))
            if number % 233 == 0:
                seen._take(Note(t=t, who="body", what="x"))  # what it did not ask for
        yield said([most, len(seen.printed), len(seen.transitions), seen.last, seen.hits, seen.way_mm[:4],
                    len(seen.way_mm)])  # fmt: skip
        yield f"{[*seen.printed][:9]} {[*seen.printed][-2:]} {[*seen.transitions][:9]} {[*seen.transitions][-2:]}"


def drawn_things(draw: Random) -> Iterator[str]:
    """Place things of each kind in rooms: where they are wanted, nearby, or nowhere."""
    world = load_world("room")
    for name, kind in things.KINDS.items():
        yield said([name, kind.doc, kind.measures, kind.walks])
        for _ in range(6):
            measures = {key: round(draw.uniform(*ends), 3) for key, ends in kind.measures.items()}
            place = (
                round(draw.uniform(-2.6, 2.6), 3),
                round(draw.uniform(-2, 2), 3),
                draw.choice((0.0, 30.0, 359.9, -90.0)),
            )
            yield said([measures, kind.boxes(measures)])
            parts = [things._placed(part, *place) for part in kind.boxes(measures)]
            thing = things.DrawnThing(
                name="t", kind=name, place=place, measures=measures, gap_m=draw.choice((None, 0.0, 0.9))
            )
            yield said([place, parts, [things._table("t", part, thing, place[2]) for part in parts]])
            one, other = (things.Footprint(things._obstacle(draw.choice(parts))) for _ in range(2))
            far = things.Footprint(things._obstacle({"x_m": 0.4, "y_m": 0.1, "radius_m": 0.2}))
            yield said([things._apart_m(one, other), things._apart_m(one, far), things._apart_m(far, one)])
            room = things.Room(world=world, starts=[world.start], gap_m=draw.choice((0.0, 0.3)), free_m=0.6)
            yield said(room.tables([thing, dataclasses.replace(thing, name="u"), dataclasses.replace(thing, name="v")]))
    yield said([things._places((1.0, 2.0, 3.0))[:4], len(things._places((0.0, 0.0, 0.0)))])


TRACES: dict[str, Trace] = {
    "files": files, "spaces": spaces, "packed": packed, "limited": limited, "figures": figures, "things": drawn_things,
    "seen": seen_so_far, "comments": comments,
}  # fmt: skip
for _package in ("campaign", "campaign.reaching", "campaign.workers", "campaign.pages"):
    TRACES[f"declared in {_package}"] = declared_of(f"robot_bench.{_package}")
TRACES["campaigns"] = campaigns  # last, for it takes longest
test_what_campaigns_come_to_is_what_was_approved = judge_of(__file__, TRACES)
