"""What reports make of runs, drawn at random: the plan and its labels, what plots draw, and the pages' sections."""

import json
import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import takewhile
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any

from p2os.view.recording import ViewRecording
from robot_bench.drives.latency_budget import STEPS, WHOLE, LatencyBudget
from robot_bench.events.codec import Json, line_of
from robot_bench.events.kinds import Contact, Event, Packet, PinEdge, Wave, WorldChange
from robot_bench.recording.run_record import RunRecord, record_of
from robot_bench.recording.summary import outcome_of, outcome_of_all, verdict
from robot_bench.report import drawn, measures
from robot_bench.report import plan as report_plan
from robot_bench.report.drawn import drawn_of
from robot_bench.report.make import Files, make_artefacts, make_artefacts_of_all
from robot_bench.report.page_of_all import report_of_all
from robot_bench.report.plan import STANDING_SHARE, plan, things_at_the_end
from robot_bench.report.run_page import lead_of, run_report
from tests.robot_bench.recording.long_run import META, MORE, long_run
from tests.robot_bench.recording.records import S
from tests.tools.suite.approved import judge_of, said, tried

MS = S // 1000
#: What the end of a trace may have: sections of each kind, and none.
ENDS: tuple[Json, ...] = (
    {"passed": True, "goals_met": ["a", "c"], "trace_sha256": "ab", "min_clearance_m": 0.25, "real_time_factor": 7.77},
    {"passed": True, "goals_met": ["a"], "goals_not_judged": ["d"], "notes": ["n"], "explained": "since it was so"},
    {"passed": True, "goals_not_judged": ["d", "e"]},
    {"passed": False, "failures": ["interrupted (SIGINT)", "b: missed"], "last_blocks": ["a.c:1", "b.c:2"]},
    {"passed": False, "failures": ["b: missed"], "min_clearance_m": 1, "parts": [
        {"name": "display", "words": "lit", "png": "iVBO"}, {"name": "sensor", "words": "asked 3 times"}]},
    {"passed": False, "coverage": {"files": ["c.html", "l.info"], "table": ["lines 3 of 4", "ways 1 of 2"]},
     "profile": {"files": ["p.txt"], "table": []}},
    {"passed": True},
)  # fmt: skip


def spread(draw: Random, least: float, most: float) -> float:
    return round(draw.uniform(least, most), 3)


def way(draw: Random, seconds: float) -> list[list[float]]:
    """Return poses of a robot that drives, turns on the spot, and stands."""
    x, y, heading, rows = 0.0, 0.0, 0.0, list[list[float]]()
    speed, turn = 0.0, 0.0
    for step in range(int(seconds * 4)):
        if step % 8 == 0:
            speed, turn = draw.choice(((0.0, 0.0), (0.0, 0.5), (0.4, 0.0), (0.7, -0.3), (0.01, 0.0)))
        heading += turn / 4
        x, y = x + speed / 4 * math.cos(heading), y + speed / 4 * math.sin(heading)
        rows.append([step / 4, round(x, 4), round(y, 4), round(heading, 4), speed, speed])
    return rows


def thing_of(draw: Random, name: str) -> Json:
    thing: Json = {"name": name, "x": spread(draw, -2.5, 2.5), "y": spread(draw, -2.5, 2.5)}
    if draw.random() < 0.4:
        return thing | {"shape": "cylinder", "radius": spread(draw, 0.05, 0.6)}
    turn: Json = {"heading": spread(draw, -2.0, 2.0)} if draw.random() < 0.6 else {}
    return thing | turn | {"shape": "box", "length": spread(draw, 0.05, 3.0), "width": spread(draw, 0.05, 1.0)}


def plans(draw: Random) -> Iterator[str]:
    """Write on plans of every size: few things and many, short drives and long."""
    for number in range(24):
        side = draw.choice((0.5, 2.0, 3.0, 12.0))
        extent = (-side, -side * draw.choice((0.5, 1.0)), side, side)
        seconds = draw.choice((0.25, 6.0, 6.25, 24.0, 24.25, 61.0))
        poses = way(draw, seconds) if number % 6 else []
        things = [thing_of(draw, f"{'thing' * draw.randrange(1, 4)} {n}") for n in range(draw.choice((0, 1, 4, 12)))]
        changes: list[Json] = []
        for _ in range(draw.choice((0, 2, 6))):
            op = draw.choice(("place", "move", "remove"))
            name = f"post {draw.randrange(3)}" if op == "place" or not things else str(draw.choice(things)["name"])
            place = thing_of(draw, name)
            changes.append({"op": op, "t": 1.0, **({"name": name} if op == "remove" else place)})
        hits = [(spread(draw, 0, 9), spread(draw, -side, side), 0.0, "'post'") for _ in range(draw.choice((0, 1, 14)))]
        duration_s = draw.choice((seconds, seconds + 0.001, seconds * 2))
        made: Any = plan(extent=extent, poses=poses, obstacles=things, changes=changes, hits=hits,
                         duration_s=duration_s)  # fmt: skip
        yield said([extent, seconds, duration_s, made["bounds"], made["step"], made["times"]])
        yield from map(said, made["labels"])
        yield said(things_at_the_end(things, changes))
    for duration_s in (6.0, 6.01, 12.0, 12.1, 24.0, 60.1, 120.0, 241.0, 1441.0, 43_200.0, 43_201.0, 90_000.0):
        rows = [[duration_s * n / 40, float(n), 0.0, 0.0] for n in range(41)]
        made = plan(extent=(0, 0, 40, 1), poses=rows, obstacles=[], changes=[], hits=[], duration_s=duration_s)
        yield said([duration_s, made["times"]])
    near_m = 4.0 * STANDING_SHARE
    for moved in (0.0, near_m * 0.99, near_m, near_m * 1.01):
        for turned in (0.0, 0.19, 0.2, 0.21):
            rows = [[0.0, 0.0, 0.0, 0.0], [0.5, 0.0, 0.0, 0.0], [1.0, moved, 0.0, turned], [1.5, moved, 0.0, turned]]
            made = plan(extent=(-2, -2, 2, 2), poses=rows, obstacles=[], changes=[], hits=[], duration_s=1.5)
            yield said([moved, turned, made["times"]])


def meta_of(draw: Random, number: int) -> Json:
    meta: Json = {
        "k": "meta", "scenario": "mine", "firmware": "dodge.elf", "mode": draw.choice(("direct", "adapter")),
        "body": "kinematic", "seed": number, "firmware_sha256": "cd" * 4, "note": "a note", **META,
    }  # fmt: skip
    for key in ("scenario", "firmware", "mode", "body", "seed", "firmware_sha256", "note", "threshold_m", "step_mps",
                "pins", "robot", "world"):  # fmt: skip
        if number and draw.random() < 0.2:
            del meta[key]
    world: Any = meta.get("world")
    if world and draw.random() < 0.5:
        meta["world"] = {"name": "hall", "obstacles": [
            *world["obstacles"],
            *({**thing_of(draw, f"b{n}"), "kind": kind} for n, kind in enumerate(("wall", "rail", "floor", "ramp"))),
        ]}  # fmt: skip
    return meta


def record(draw: Random, number: int) -> RunRecord:
    """Return a run of some seconds, with some of all kinds of events, and with an end or cut."""
    until = draw.choice((1, 3, 6)) * S
    events: list[Event] = [*takewhile(lambda one: one.t < until, long_run(number))]
    events = sorted([*(one for one in MORE if draw.random() < 0.7), *events], key=lambda one: one.t)
    kinds = sorted({type(one) for one in events} - {PinEdge, Wave}, key=lambda kind: kind.__name__)
    left_out = {kind for kind in kinds if draw.random() < 0.15}
    events = [one for one in events if type(one) not in left_out]
    events += [
        Contact(t=until + n, what="'post'", x_m=1.1, y_m=0.9, part="left") for n in range(draw.choice((0, 1, 7)))
    ]
    nets = {one.wire for one in events if isinstance(one, PinEdge)}
    meta = meta_of(draw, number)
    labels: Any = meta.get("pins") or {}
    first = [PinEdge(t=0, wire=net, level=False) for net in ("led", "left_pwm", "right_dir", "p2dx_con", "odd")]
    events[:0] = [one for one in first if one.wire not in nets and (one.wire in labels or draw.random() < 0.7)]
    known = nets | {one.wire for one in events if isinstance(one, PinEdge)}
    events = [one for one in events if not isinstance(one, Wave) or one.wire in known]
    end = [json.dumps({"k": "end", **draw.choice(ENDS)})] if number % 5 else []
    return record_of(f"{line}\n" for line in (json.dumps(meta), *map(line_of, events), *end))


def rows_of(shown: ViewRecording) -> Iterator[str]:
    """Go through the channels of a page."""
    for track in shown.tracks:
        rows = [[round(one, 6) if isinstance(one, float) else one for one in column] for column in track.columns]
        yield said([track.header, len(track), [[*column[:3], *column[-2:]] for column in rows]])


def pages(draw: Random) -> Iterator[str]:
    """Report runs of every kind."""
    for number in range(14):
        found = record(draw, number)
        yield said([number, repr(found), verdict(found), lead_of(found.meta)])
        made: Any = drawn_of(found)
        yield from (f"{key} {said(value)}" for key, value in made.items() if key not in {"poses", "pins", "motors"})
        for key in ("poses", "motors", "pins"):
            yield said([key, len(made[key]), made[key][:3], made[key][-3:]])
        shown = run_report(found, is_measured=number % 3 == 0)
        yield said(replace(shown.header, sections=()))
        yield from map(said, shown.header.sections)
        yield from rows_of(shown)
        yield said(outcome_of(found))


def crowds(_draw: Random) -> Iterator[str]:
    """Draw more moves, hits and edges than a plot shows."""
    found = record(Random(3), 1)
    changes = [one for one in MORE if isinstance(one, WorldChange)]
    found.changes = [replace(changes[n % len(changes)], t=n * 10 * MS) for n in range(drawn.MOST_MOVES * 3)]
    found.contacts = [Contact(t=n, what="'x'", x_m=n / 1000, y_m=0.0) for n in range(drawn.MOST_HITS + 2)]
    found.last_ns = found.changes[-1].t
    for few in (False, True):
        found.changes = [one for one in found.changes if not few or one.op == "move"][: drawn.MOST_MOVES + (not few)]
        made: Any = drawn_of(found)
        yield said(
            [len(made["hits"]), made["hits"][-1], len(made["changes"]), made["changes"][:9], made["changes"][-9:]]
        )


def latencies(draw: Random) -> Iterator[str]:
    """Show how parts of the loop are distributed: nothing, one scale's end, and beyond it."""
    for most_ms in (1.0, 49.999, 50.0, 50.001, 120.0):
        for seen in (0, 1, 3):
            budget = LatencyBudget()
            for name in (*STEPS, WHOLE)[2 : 2 + seen]:
                budget.steps[name] = [most_ms / 1000 * draw.random() for _ in range(20)] + [most_ms / 1000]
            found: Any = SimpleNamespace(latency=budget)
            yield from map(said, measures._latency(found))


def folders(draw: Random) -> Iterator[str]:
    """Make all files of runs, alone and of several robots."""
    with TemporaryDirectory(prefix="p2os-test-") as name:
        folder = Path(name)
        traces = {}
        for number, robot in enumerate(("west", "east"), start=1):
            (folder / robot).mkdir()
            meta = json.dumps({"k": "meta", **META, "scenario": "mine", "body": "kinematic", "seed": 4})
            events = [*takewhile(lambda one: one.t < S, long_run(number))]
            wire = [Packet(t=S + n, direction="r2c", data=bytes([n])) for n in range(2)]
            end: Json = {
                "k": "end", "virtual_s": 1.0, "wall_s": 0.5, "real_time_factor": 2.0, "distance_m": 0.5 * number,
                "collisions": number, "min_clearance_m": None if number == 1 else 0.25, "passed": number == 1,
                "failures": [] if number == 1 else ["b: missed", "c: missed"], "goals_met": ["a"],
                "goals_not_judged": ["d"] * (number - 1), "trace_sha256": f"{number}", "notes": [f"n{number}"],
                "last_blocks": [],
            }  # fmt: skip
            named = {one.wire for one in events if isinstance(one, PinEdge)}
            events = [one for one in events if not isinstance(one, Wave) or one.wire in named]
            lines = [f"{line}\n" for line in (meta, *map(line_of, [*events, *wire]), json.dumps(end))]
            traces[robot] = record_of(lines)
            (folder / robot / "trace.jsonl").write_text("".join(lines), encoding="utf-8")
        for files in (Files.SUMMARY, Files.REPORT):
            made = make_artefacts(folder / "west", files)
            yield said([made.outcome, made.report.name, sorted(path.name for path in (folder / "west").iterdir())])
        both = make_artefacts_of_all(folder, ["west", "east"], "mine", Files.SUMMARY)
        yield said([both.outcome, both.report.name, sorted(path.name for path in folder.rglob("*"))])
        for file in ("summary.json", "west/summary.json", "west/wire.jsonl", "west/usart.txt"):
            yield (folder / file).read_text(encoding="utf-8")
        yield said(len((folder / "west" / "pins.vcd").read_text(encoding="utf-8").splitlines()))
        for interrupted in (False, True):
            outcomes = {robot: outcome_of(found) for robot, found in traces.items()}
            if interrupted:
                outcomes["west"]["failures"] = ["interrupted (SIGINT)"]
            whole = outcome_of_all("mine", outcomes)
            shown = report_of_all(whole, traces)
            yield said(whole)
            yield said(shown.header)
            yield from rows_of(shown)
        yield tried(make_artefacts, folder / "none").replace(name, "HERE")
    yield said(draw.random())


def labels(_draw: Random) -> Iterator[str]:
    """Write names on things as wide and as high as they are, or by a pixel less or more, with a path under them."""
    for text in ("a", "abcd"):
        width, height = report_plan.LETTER_PX * len(text), report_plan.LINE_PX
        for across in (width / 3, width / 2 - 0.5, width / 2, width / 2 + 0.5, width):
            for along in (height / 3, height / 2 - 0.5, height / 2, height / 2 + 0.5, height):
                for place in ((0.0, 0.0), (-1.9, 0.0), (1.9, 1.9)):
                    for path in ((), ((9, 9), (10, 10)), [(x, y) for x in range(30) for y in range(30)]):
                        sheet = report_plan._Sheet((-2.0, -2.0, 2.0, 2.0), 200.0, path={*path})
                        found: list[Json] = []
                        for _ in range(2):  # the second has to make room for the first
                            report_plan._add(found, sheet, text, place, (across, along), {})
                        report_plan._add(found, sheet, text, place, across, {"kind": "mark"})
                        yield said([text, across, along, place, len(path), found, sheet.boxes])


TRACES = {
    "labels": labels,
    "plans": plans, "latencies": latencies, "crowds": crowds, "folders": folders, "pages": pages,
}  # fmt: skip
test_what_reports_show_is_what_was_approved = judge_of(__file__, TRACES)
