"""Why runs failed, drawn at random: what is asked of their programs, each step, and what is found."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from random import Random
from types import SimpleNamespace
from typing import Any
from unittest import mock

from adapter_sim.pinout import WireRole, load_pinout
from bluepill_sim.core import BLOCK
from bluepill_sim.core.recorder import RECORD
from bluepill_sim.program.functions import UNKNOWN
from bluepill_sim.stm32f103 import SRAM_BASE
from robot_bench.events.kinds import Contact, Fault, Note, Verdict, WorldChange
from robot_bench.recording.run_record import RunRecord
from robot_bench.report.explain import explain as explaining
from robot_bench.report.explain import findings
from robot_bench.report.explain.chain import ChainLink, Evidence, Explanation, Standing
from robot_bench.report.explain.contact import ContactAnalysis, exchanged
from robot_bench.report.explain.probing import (
    SAME_NS,
    Codes,
    InputEffect,
    Prober,
    SensorResponse,
    first_row,
    parted,
)
from robot_bench.report.explain.progress import ProgressAnalysis
from robot_bench.report.explain.replay import ChipReplay, ChipReset, Hold, ReplayPart, SourcePlace
from robot_bench.report.explain.scene import Scene
from robot_bench.wires.edges import Edges
from tests.robot_bench.recording.records import S, pose
from tests.robot_bench.report.programs_asked import (
    AHEAD,
    DISTANCES,
    AskedProber,
    AskedReplay,
    answers,
    driven_run,
    poses,
    step_lines,
)
from tests.tools.suite.approved import Trace, judge_of, said
from tests.tools.suite.declared import declared_of

MS = S // 1000
STILL, SPIN, AWAY, BACK = (0, 0), (-2, 2), (2, -2), (-3, -2)
ALL_CODES: Sequence[Codes] = (AHEAD, AHEAD, (2, 2), STILL, SPIN, AWAY, BACK, (3, 1))
PLACES = [SourcePlace(f"{file}.c:{line}", file, calls) for file, line, calls in (
    ("loop", 9, ()), ("drive", 40, ("main",)), ("look", 7, ("step", "main")))]  # fmt: skip
FAULTS = ("wheel-blocked left", "sonar-stuck 4 0.2", "sonar-dead 5", "link-down", "brown-out", "reboot", "low-battery",
          "sonar-noisy 3 0.1", "stop-button")  # fmt: skip


def time_of(draw: Random, until_s: float, least: float = 0.2) -> int:
    """Return a time of a run in ns: mostly one that other things have too, the run's parts and whole half seconds."""
    kind = draw.randrange(4)
    if kind < 2:
        return round(draw.randint(1, 8) / 8 * until_s * S)
    return draw.randint(1, round(2 * until_s)) * S // 2 if kind == 2 else round(draw.uniform(least, 0.99) * until_s * S)


def legs_of(draw: Random, until_s: float, ways: Sequence[Codes] = ALL_CODES) -> list[tuple[float, Codes]]:
    """Return which codes the motors have from when on."""
    found, at = [(0.0, draw.choice(ways))], 0.0
    for _ in range(draw.randrange(4)):
        at += draw.choice((0.5, 1.0, 2.0, until_s / 3))
        found.append((round(at, 3), draw.choice(ways)))
    return [one for one in found if one[0] < until_s]


def rises(draw: Random, until_s: float) -> dict[str, float | tuple[float, ...]]:
    """Return when some sensors' pins toggle."""
    at = round(until_s - draw.choice((0.3, 0.62, 1.0, 1.5, 3.0)), 3)
    low = round(until_s - draw.choice((0.2, 0.25, 0.7)), 3)
    nets = draw.choice(((), ("DD4",), ("DD4",), ("DD5",), ("DD4", "DD5"), ("DD3", "DD4", "DD6"), ("DD1",)))
    return {net: at if low <= at or draw.random() < 0.8 else (at, low) for net in nets}


def answered(draw: Random) -> Mapping[str, SensorResponse]:
    """Return what a program does of each sensor: turns away, exchanged, one-sided, or hardly at all."""
    away = {2: (3, 2), 3: (3, 1), 4: (2, -2), 5: (-2, 2), 6: (1, 3), 7: (2, 3)}
    kind = draw.randrange(8)
    codes: dict[int, Codes] = dict(away)
    if kind == 1:
        codes = {place: (two, one) for place, (one, two) in away.items()}
    elif kind == 2:
        one, other = draw.sample(sorted(away), 2)
        codes[one], codes[other] = codes[other], codes[one]
    elif kind == 3:
        codes = {}
    elif kind == 4:
        codes = {place: (max(one, 1), two) for place, (one, two) in away.items()}
    elif kind == 5:
        codes = {place: draw.choice(ALL_CODES) for place in draw.sample(sorted(away), draw.randint(1, 6))}
    elif kind == 6:
        one, other = draw.choice(((2, 7), (3, 6), (4, 5), (2, 3), (6, 7)))
        codes[one] = codes[other] = draw.choice((codes[one], codes[other], AHEAD))
    return answers(
        codes, base=draw.choice((AHEAD, AHEAD, SPIN)), other=draw.choice(((2, 2), (2, 2), AHEAD, SPIN)),
        answered=draw.choice((2, 2, 200 * MS, S, None)), otherwise_ns=draw.choice((S, S, 4 * MS, 0)),
        unnoticed=draw.choice(((), (), (4,), (3, 4, 5))),
    )  # fmt: skip


def nearly_exchanged(draw: Random) -> Mapping[str, SensorResponse]:
    """Return what a program does of two sensors, or sides, exchanged; it may fail to do it of one of them."""
    away = {2: (3, 2), 3: (3, 1), 4: (2, -2), 5: (-2, 2), 6: (1, 3), 7: (2, 3)}
    one, other = draw.choice(((3, 6), (4, 5), (3, 5), (2, 3)))
    codes = {place: pair[::-1] for place, pair in away.items()} if draw.random() < 0.5 else dict(away)
    codes[one], codes[other] = codes[other], codes[one]
    found = dict(answers(codes))
    if draw.random() < 0.5:
        net = draw.choice(DISTANCES)
        found[net] = replace(found[net], **draw.choice(({"answered": None}, {"codes": AHEAD}, {"codes": (3, 2)})))
    return found


def rows_of(draw: Random, until_s: float) -> dict[str, object]:
    """Return what else the trace has: faults, notes, changes, waves."""
    at = lambda: time_of(draw, until_s)  # noqa: E731 - some time
    faults = [Fault(t=at(), op=draw.choice(("inject", "inject", "clear", "died")), words=draw.choice(FAULTS))
              for _ in range(draw.choice((0, 1, 3)))]  # fmt: skip
    whats = ("driving", "command", "lost", "motors", "reset")
    notes = [Note(t=at(), who=draw.choice(("adapter", "adapter", "body")), detail=draw.choice(("", "VEL 100")),
                  what=draw.choice(whats)) for _ in range(draw.choice((0, 1, 3)))]  # fmt: skip
    moved = [WorldChange(t=at(), op="move", name=draw.choice(("crate", "other")), fields={})
             for _ in range(draw.choice((0, 0, 1)))]  # fmt: skip
    return {"faults": sorted(faults, key=lambda one: one.t), "events": sorted(notes, key=lambda one: one.t),
            "changes": sorted(moved, key=lambda one: one.t)}  # fmt: skip


def control_pins(draw: Random, record: RunRecord, until_s: float) -> None:
    for net, level in (("rst", 0), ("p2dx_con", 1)):
        if draw.random() < 0.3:
            at = time_of(draw, until_s)
            edges = [(0, level), (at, 1 - level), (at + round(draw.choice((0.5, 9.0)) * S), level)]
            record.pins[net] = Edges(edges)


def drawn_effect(draw: Random, record: RunRecord, hit: int) -> InputEffect:
    """Return what the pins that went high have changed before a contact."""
    rose = [t for net in DISTANCES for t, level in record.pins[net] if level and t < hit]
    since = min(rose, default=hit - S)
    left = hit - since
    noticed = (
        None if draw.random() < 0.2 else since + draw.choice((MS, MS, 149 * MS, 150 * MS, left * 2 // 5, left // 2))
    )
    answered = None if noticed is None or draw.random() < 0.3 else noticed + draw.choice((0, MS, 200 * MS, left // 3))
    return InputEffect(
        noticed=noticed, by="main.c:12 (look)", before=draw.choice((SPIN, AHEAD, AHEAD)),
        after=draw.choice((AHEAD, STILL)), answered=answered, way=[(hit - 2 * S, AHEAD), (hit - S, SPIN)],
        otherwise_ns=draw.choice((S, 4_999_999, 5_000_000)), otherwise=draw.choice((None, ((1, 2), AHEAD))),
    )  # fmt: skip


def program(draw: Random, record: RunRecord, hit: int | None) -> AskedProber:
    """Return a program that does what is drawn."""
    end = record.last_ns
    until_s = end / S
    replay = AskedReplay(
        record, end + draw.choice((0, 4 * S)), draw.choice((end, end, time_of(draw, until_s))),
        resets=[ChipReset(time_of(draw, until_s), draw.choice(("IWDG", "IWDG", "PIN", "SOFTWARE", "ODD")),
                          draw.choice(PLACES)) for _ in range(draw.choice((0, 0, 0, 1, 5)))],
        writes=draw.choice((*PLACES, None)), fed=[(round(0.1 * n * end), draw.choice(PLACES)) for n in range(9)],
        edges=draw.choice(([], [], [(end // 2, "motor1_comm1", True)])),
        reads_at={"in.c:3": [round(n * draw.choice((0.002, 0.15)) * S) for n in range(400)]},
        variables=[("count", 0, 1), ("wide", 1, 2), ("odd", 0, 3)],
        memory=[(n * 100 * MS, (n * 23 % 65_536).to_bytes(3, "little")) for n in range(0, 400, 3)],
    )  # fmt: skip
    replay.resets = sorted(replay.resets, key=lambda one: one.at)
    lines = [(0.0, 0.6 * end / S, {"a.c:1": 3, "a.c:2": 9, "a.c:9": 1}),
             (0.6 * end / S, 1e3, draw.choice(({}, {"a.c:2": 5}, {f"a.c:{n}": n for n in range(2, 8)})))]  # fmt: skip
    asked = answered(draw) if draw.random() < 0.6 else nearly_exchanged(draw)
    kinds = draw.choice(((asked,) * 3, (asked, answered(draw), asked), (asked,)))
    ends = () if hit is None else (hit, min(hit + 3 * S, replay.end))
    effects = {until: drawn_effect(draw, record, hit or 0) for until in ends}
    rows = {n * S: {net: replace(one, at=n * S) for net, one in row.items()} for n, row in enumerate(kinds, 1)}
    return AskedProber(
        replay, effects=effects, answered=rows, later=answered(draw), lines=lines,
        notices=draw.choice(((0.0, 1e3), (0.0, 1e3), (0.0, 0.5 * end / S), (0.0, -1.0))),
        codes=draw.choice(((AHEAD, STILL), (SPIN, AHEAD), (STILL, STILL))), new=draw.choice(((), ("a.c:1", "b.c:2"))),
        unnoticed=draw.choice(((), ("DD4",), ("DD3", "DD4"))),
    )  # fmt: skip


def asked_of(prober: AskedProber | None) -> str:
    return "" if prober is None else said(prober.asked)


def contacts(draw: Random) -> Iterator[str]:
    """Look for why things were touched: ahead, beside, behind, seen or not, by programs of many kinds."""
    for number in range(220):
        legs = legs_of(draw, 6.0, (AHEAD, AHEAD, AHEAD, (2, 2), SPIN, BACK))
        on = rises(draw, 6.0) if draw.random() < 0.5 else dict.fromkeys(draw.sample(DISTANCES[2:6], 2), 4.5)
        record = driven_run(*legs, until_s=6.0, on=on, **rows_of(draw, 6.0))
        if draw.random() < 0.1:
            record = replace(record, poses=poses(*legs, until_s=6.0, driven=False))
        control_pins(draw, record, 6.0)
        at = record.poses[-1]
        ahead, beside = draw.choice(((0.28, 0.06), (0.28, -0.02), (0.5, 0.0), (-0.3, 0.1), (0.1, 0.24), (0.7, 0.4)))
        hit = Contact(
            t=6 * S, what="'crate'", x_m=round(at.x_m + ahead, 3), y_m=beside, part=draw.choice(("", "front"))
        )
        record.contacts.append(hit)
        prober = program(draw, record, hit.t) if draw.random() < 0.9 else None
        scene = Scene(record)
        analysis = ContactAnalysis(scene, prober, hit)  # type: ignore[arg-type]  # as much of it as is asked
        yield f"{number} {legs} {said([analysis.bearing, analysis.since, analysis.expected, analysis.on])}"
        finding = analysis.find()
        yield f"{finding} {asked_of(prober)}"
        yield " | ".join(step_lines(analysis.steps))


def stays(draw: Random) -> Iterator[str]:
    """Look for why robots came no further: reset, let go, stuck, spinning, blind, or as they were meant to."""
    for number in range(130):
        until_s = draw.choice((16.0, 24.0))
        ways = draw.choice((ALL_CODES, (AHEAD, STILL), (STILL, SPIN), (SPIN,)))
        legs = [(0.0, STILL), *((max(at, 0.5), codes) for at, codes in legs_of(draw, until_s, ways))]
        if draw.random() < 0.3:
            legs = [(0.0, STILL), (0.5, AHEAD), (6.0, draw.choice((STILL, SPIN)))]
        record = driven_run(*legs, until_s=until_s, on=rises(draw, until_s / 2), **rows_of(draw, until_s))
        if draw.random() < 0.3:
            turn = draw.choice((0.0, 0.5, 0.0785))
            record = replace(record, poses=poses(*legs, until_s=until_s, driven=draw.random() < 0.5, turn_radps=turn))
        if draw.random() < 0.1:
            record.waves["motor1_comm1"] = []
        control_pins(draw, record, until_s)
        record.meta["gives_up_s"] = draw.choice((3.0, 3.0, 5.0))
        prober = program(draw, record, None) if draw.random() < 0.92 else None
        analysis = ProgressAnalysis(Scene(record), prober, record.last_ns)  # type: ignore[arg-type]
        finding = analysis.find()
        yield f"{number} {legs} {finding} {asked_of(prober)}"
        yield " | ".join(step_lines(analysis.steps))


def others(draw: Random) -> Iterator[str]:
    """Look into any failure: by its kind, by when it was decided, and by what is odd besides."""
    failures = ("no_collision: it hit", "clearance: 0.1 m", "contact with it", "min_distance: 3 m not driven",
                "reach: x", "energy: 1 J", "text: nothing in 30 s", "answers: after 12 ms", "")  # fmt: skip
    for number in range(45):
        failure, met = draw.choice(failures), draw.random() < 0.3
        says = failure.partition(": ")[2].replace("3", "7")
        contacts_ = [Contact(t=12 * S, what="'crate'", x_m=2.0, y_m=0.1, part="")] * draw.choice((0, 1))
        changes: dict[str, Any] = rows_of(draw, 24.0) | {
            "contacts": contacts_, "verdicts": [Verdict(t=18 * S, goal="it", says=says, met=met)],
            "end": draw.choice(({"failures": [failure]}, {"failures": ["odd: 1", failure]}, {}, {"goals_met": ["a"]})),
        }  # fmt: skip
        if draw.random() < 0.2:
            changes["faults"] = [Fault(t=draw.choice((11, 19)) * S, op="died", words="HardFault at main+4")]
        record = driven_run(*legs_of(draw, 24.0), until_s=24.0, on=rises(draw, 18.0), **changes)
        prober = program(draw, record, 12 * S) if draw.random() < 0.9 else None
        if prober is not None:
            prober.replay.board.fault = draw.choice((None, SimpleNamespace(pc=8, at_ns=11 * S)))
            prober.replay.line = lambda address: SourcePlace(f"a.c:{address}", "f")  # type: ignore[attr-defined]
            prober.replay.role = lambda _role: ("encoder1_s1", "encoder2_s1")  # type: ignore[attr-defined]
        finding, steps = explaining._find(record, Scene(record), prober, failure or "x")  # type: ignore[arg-type]
        yield f"{number} {failure} {finding} {explaining._decided(record, failure)} {asked_of(prober)}"
        yield f"{' | '.join(step_lines(steps))} {explaining._odd(prober)}"  # type: ignore[arg-type]
        for wanted in ("", "odd", "never"):
            whole = explaining.explain(record, None, failure=wanted)
            yield f"{whole.line} {whole.text()} {said(whole.to_plain())}"
    links = [ChainLink(t=n * S, part=part, says="it says " * n, evidence=Evidence.REPLAYED)
             for n, part in ((9, "firmware"), (2, "motion"), (30, "contact"))]  # fmt: skip
    for standing in Standing:
        shown = Explanation(failure="a: b " * 20, standing=standing, summary="because " * 14, steps=tuple(links),
                            also=("odd " * 25, "more"), limits=("that " * 20,))  # fmt: skip
        yield shown.text()
        yield Explanation(failure="", standing=standing, summary="s").text()


def parts_of_findings(draw: Random) -> Iterator[str]:
    """Ask for what findings are made of: codes, faults in force, wires let go, counters that run over."""
    for _ in range(60):
        until_s = 12.0
        record = driven_run(*legs_of(draw, until_s), until_s=until_s, **rows_of(draw, until_s))
        control_pins(draw, record, until_s)
        if draw.random() < 0.2:
            record = replace(record, poses=poses((0.0, STILL), until_s=until_s))
        at = time_of(draw, until_s, 0.3)
        steps: list[ChainLink] = []
        found = findings.obeyed(record, draw.choice((0.0625, 0.2)), at, steps)
        way = findings.codes_between(record, at // 2, at)
        yield f"{at} {found} {' '.join(step_lines(steps))} {findings.steady_since(record, at)} {way}"
        faults = [findings.injected(record, at, on, sonar) for on, sonar in (("wheels", 0), ("sonar", 4))]
        yield said([findings.held_codes(way, at), findings.let_go(record, at), faults])
        reads = sorted(time_of(draw, 12.0, 0.0) for _ in range(draw.choice((0, 9, 200))))
        replay = AskedReplay(
            record, 12 * S, 12 * S, variables=[("a", 0, 1), ("b", 0, 2), ("c", 1, 4), ("d", 2, 8)],
            reads_at={"a.c:1": reads},
        )  # fmt: skip
        counts = draw.choice((lambda n: n * 4 % 256, lambda n: 250 - n, lambda n: 100 + n, lambda n: 32_700 + 20 * n,
                              lambda n: (65_500 + 9 * n) % 65_536, lambda n: 2**31 - 100 + 9 * n,
                              lambda n: (2**32 - 90 + 9 * n) % 2**32))  # fmt: skip
        ends_s = draw.choice((-1.0, 3.0, 6.0))
        replay.memory = [
            (round(max(ends_s, 0) * S) + n * 5 * MS, counts(n).to_bytes(4, "little") * 3) for n in range(60)
        ]
        prober = AskedProber(replay, notices=(0.0, ends_s))
        after = draw.choice(({}, {"a.c:1": 2}, {f"b.c:{n}": n for n in range(5)}))
        prober.lines = [(0.0, ends_s, {"a.c:1": 3, "a.c:4": 4}), (ends_s, 99.0, after)]
        steps = []
        ended = findings.ended(prober, at, at + draw.choice((S, 8 * S)), steps)  # type: ignore[arg-type]
        yield f"{ended} {' '.join(step_lines(steps))} {said(findings.ran_over(prober, at))} {asked_of(prober)}"  # type: ignore[arg-type]
        yield said(findings.read_gap(prober, at))  # type: ignore[arg-type]
    yield said([findings.numbers(names) for names in ([], ["a"], ["a", "b"], ["a", "b", "c"])])


def bounds(_draw: Random) -> Iterator[str]:
    """Look one nanosecond before, at and behind each time that findings wait for, and at wheels that are off."""
    settled = findings.SETTLED_NS
    still = poses((0.0, STILL), until_s=12.0)
    record = replace(driven_run((0.0, STILL), (2.0, AHEAD), until_s=12.0), poses=still)
    for at in (2 * S, 2 * S + settled - 1, 2 * S + settled, 2 * S + settled + 1):
        steps: list[ChainLink] = []
        yield f"{at} {findings.obeyed(record, 0.0625, at, steps)} {' '.join(step_lines(steps))}"
    at = 6 * S
    for ns in (40 * MS, 250 * MS):
        for by in (-1, 0, 1):
            alone = replace(record, poses=[replace(still[0], t=at - ns + by)])
            yield f"{ns} {by} {findings.obeyed(alone, 0.0625, at, [])}"
    for off in (0.0399, 0.04, 0.0401, 0.1, 0.10001):
        for step in (0.05, 0.2):
            slow = replace(record, poses=[replace(still[0], t=at - 50 * MS, left=round((3 * step - off) * 1e6))])
            slow.poses[0] = replace(slow.poses[0], right=round(3 * step * 1e6))
            yield f"{off} {step} {findings.obeyed(slow, step, at, [])}"
    yield from seen_alone()
    yield from near_bearings()
    yield from ways_of_parts()
    hits = [Contact(t=t, what=f"'{t}'", x_m=1.0, y_m=0.0) for t in (3 * S, 5 * S)]
    for end in ({}, {"goals_met": ["a"]}, {"failures": ["reach: x"]}):
        found = driven_run((0.0, AHEAD), until_s=12.0, contacts=hits, end=end)
        yield explaining.explain(found, None).text()
    for way, until in (([(0, AHEAD), (10, STILL)], 15), ([(0, AHEAD), (7 * MS, STILL)], 10 * MS), ([(5, SPIN)], 9)):
        for by in (-1, 0, 1):
            yield findings.held_codes(way, until + SAME_NS + by)


def ways_of_parts() -> Iterator[str]:
    """Tell the codes over a time whose first and last nanosecond have edges."""
    seen: Any = SimpleNamespace(
        levels_at=lambda since: {"one": since % 2 == 0},
        edges=[(at, "one", at % 3 == 0) for at in (90, 99, 100, 101, 150, 199, 200, 201)],
    )
    asked: Any = SimpleNamespace(_codes=lambda levels: (int(levels["one"]), 0))
    for since, until in ((100, 200), (99, 201), (101, 199), (150, 150)):
        yield said(Prober.way(asked, seen, since, until))


def near_bearings() -> Iterator[str]:
    """Touch things at bearings about those at which sensors count as near, with pins that have gone low lately."""
    hit = Contact(t=6 * S, what="'it'", x_m=1.0, y_m=0.0)
    for low_ns in (600 * MS - 1, 600 * MS, 600 * MS + 1, None):
        on: dict[str, float | tuple[float, ...]] = dict.fromkeys(
            DISTANCES, 3.0 if low_ns is None else (3.0, (hit.t - low_ns) / S)
        )
        run = driven_run((0.0, AHEAD), until_s=12.0, on=on)
        for degrees in (*((sign * whole + 0.5 * half) for whole in (0, 25, 60, 90) for sign in (-1, 1)
                          for half in (-1, 0, 1)), 180):  # fmt: skip
            scene = Scene(run)
            for sensor in scene.sensors if low_ns is None else scene.sensors[3:4]:
                bearing = math.remainder(sensor.heading_rad + math.radians(degrees), math.tau)
                with (
                    mock.patch.object(Scene, "bearing_rad", return_value=bearing),
                    mock.patch.object(Scene, "should_see", return_value={}),
                    mock.patch.object(Scene, "may_see", return_value=False),
                ):
                    found = ContactAnalysis(scene, None, hit)
                    yield said([low_ns, degrees, found.on, found._is_in_sight()])


def seen_alone() -> Iterator[str]:
    """Hold one sensor's pin high by a fault, of programs that drive on by one step, or not, with and without it."""
    for codes in ((1, 1), (1, 2), (0, 1), (2, 0)):
        for alone_high in (STILL, (1, 1), (-1, 2), (1, 0)):
            run = driven_run((0.0, AHEAD), until_s=12.0, on={"DD4": 3.0},
                             faults=[Fault(t=2 * S, op="inject", words="sonar-stuck 4 0.2")])  # fmt: skip
            response = SensorResponse(at=0, base=codes, codes=alone_high, noticed=None, answered=None)
            prober = AskedProber(AskedReplay(run, 12 * S, 12 * S), answered={0: dict.fromkeys(DISTANCES, response)})
            prober.later = dict.fromkeys(DISTANCES, response)
            analysis = ProgressAnalysis(Scene(run), prober, run.last_ns)  # type: ignore[arg-type]
            yield f"{codes} {alone_high} {analysis._sees_what_is_not(6 * S)} {' | '.join(step_lines(analysis.steps))}"


def exchanges(draw: Random) -> Iterator[str]:
    """Say of answers which two sensors, or sides, are exchanged, where that is sure."""

    def side(net: str) -> str:
        return "left" if int(net[2:]) < 5 else "right"

    for _ in range(500):
        rows = [answered(draw)] * draw.choice((1, 3, 4))
        if draw.random() < 0.3:
            rows[-1] = answered(draw)
        elif draw.random() < 0.6:
            rows = [*[nearly_exchanged(draw)] * draw.choice((1, 3)), nearly_exchanged(draw)]
        yield f"{[one.codes for one in rows[0].values()]} {exchanged(DISTANCES, rows, side)}"


def scenes(draw: Random) -> Iterator[str]:
    """Look from robots on their way at points: within cones, near their edges, and out of sight."""
    for _ in range(60):
        places = [[round(draw.uniform(-0.2, 0.2), 3), round(draw.uniform(-0.2, 0.2), 3), heading]
                  for heading in (1.57, 0.4, -0.2, -1.57)]  # fmt: skip
        robot = {"sonar": places, "sonar_cone_rad": draw.choice((0.3, 0.52, 1.0))}
        meta: dict[str, object] = {"robot": robot, "step_mps": 0.05}
        meta |= draw.choice(({}, {"threshold_m": 0.8}, {"gives_up_s": 4.5}))
        if draw.random() < 0.2:
            meta["robot"] = {}
        record = driven_run((0.0, AHEAD), until_s=3.0, meta=meta)
        record.poses[:] = [replace(pose(n * S // 10, n * 20_000, n * 3000), heading=n * 40_000) for n in range(30)]
        scene = Scene(record)
        at = draw.choice((0, S, 2 * S + 1, 9 * S))
        hit = Contact(t=at, what="'a'", x_m=draw.uniform(0, 1), y_m=draw.uniform(-0.5, 0.6))
        since = draw.choice((0, S // 2, S))
        record.changes += [WorldChange(t=t, op="move", name=name, fields={}) for t, name in (
            (since, "a"), (at, draw.choice(("a", "b"))), (at + 1, "a"))]  # fmt: skip
        sides = [one.side for one in scene.sensors]
        yield said([scene.sensors, sides, scene.cone_rad, scene.threshold_m, scene.step_mps, scene.gives_up_ns])
        yield said([scene.pose(hit.t).t, [one.t for one in scene.poses(since, hit.t)][:3], scene.bearing_rad(hit)])
        yield said([scene.should_see(hit, since), scene.may_see(hit, since), scene.still_since(hit, since)])
        yield said([[scene.inside_m(one, scene.pose(hit.t), hit.x_m, hit.y_m)] for one in scene.sensors])


def replays(draw: Random) -> Iterator[str]:
    """Ask a replay what its trace and its program say: levels, since when, lines and variables."""
    for _ in range(12):
        net, at = "DD4", 0
        edges = Edges([(0, draw.randrange(2))])
        for _ in range(draw.choice((0, 1, 4))):
            at += draw.choice((5, 900))
            edges.append(at, 1 - edges[-1][1])
        replay: Any = object.__new__(ChipReplay)
        replay.record = SimpleNamespace(pins={net: edges})
        replay.wires = {wire.name: wire for wire in load_pinout().wires}
        symbols = [
            SimpleNamespace(name=name, is_function=is_function, address=SRAM_BASE + offset, size=size)
            for name, is_function, offset, size in (
                ("f", True, 0, 8), ("a", False, 4, 4), ("b", False, 8, 0), ("c", False, 10, 2), ("d", False, 1 << 20, 4)
            )
        ]  # fmt: skip
        replay.board = SimpleNamespace(image=SimpleNamespace(symbols=SimpleNamespace(symbols=symbols)))
        replay._functions = SimpleNamespace(name=lambda address: "main" if address < 8 else UNKNOWN)
        replay._lines = SimpleNamespace(place=lambda address: f"a.c:{address}" * (address % 3 > 0))
        replay._code = SimpleNamespace(block=lambda block: SimpleNamespace(addresses=[block, block + 2] * (block > 4)))
        times = [0, 1, 5, at - 1, at, at + 1]
        yield said([list(edges), [(replay.level(net, one), replay.high_since(net, one)) for one in times]])
        yield said([[replay.variable_at(place) for place in range(13)], replay.variables, replay.pin("DD4")])
        yield said([[str(replay.line(one)) for one in range(5, 10)], [str(replay.end_line(one)) for one in (2, 5, 8)]])
        yield said([replay.role(role) for role in WireRole])
        part = ReplayPart(levels={"a": True, "b": False}, edges=[(3, "a", False), (5, "b", True)])
        yield said([part.levels_at(one) for one in (2, 3, 4, 5)])
    yield said([str(one) for one in PLACES] + [str(SourcePlace("", "f", ("g",)))])


class MadeReplay:
    """A replay whose parts are drawn, and that notes what it is asked."""

    def __init__(self, draw: Random) -> None:
        self._draw, self.calls = draw, list[str]()
        self.end = 30 * S
        self.outputs = [f"motor{motor}_comm{bit}" for motor in (1, 2) for bit in (1, 2, 3)]
        self.board = SimpleNamespace(pc=0x0800_0010, chip=SimpleNamespace(ns_of=lambda cycle: cycle * 14))
        self.record = SimpleNamespace(poses=[pose(n * S, left=25_000 * (n > 2)) for n in range(30)])

    def role(self, _role: object) -> list[str]:
        return ["DD1", "DD2", "DD3"]

    def line(self, address: int) -> SourcePlace:
        return SourcePlace(f"a.c:{address & 0xFF}", "f")

    end_line = line

    def variable_at(self, place: int) -> str:
        return f"variable {place}"

    def branch(self, since: int, until: int, holds: Sequence[Hold]) -> str:
        self.calls.append(f"branch {since} {until} {said(holds)}")
        return "branch"

    def run(self, since: int, until: int, holds: Sequence[Hold] = (), **words: Any) -> ReplayPart:
        beside = words.pop("beside", None)
        self.calls.append(f"run {since} {until} {said(holds)} {said(words)} {beside is not None}")
        draw = self._draw
        part = ReplayPart(levels=dict.fromkeys(self.outputs, False))
        if beside is not None:
            part.edges, part.text, part.memory = [*beside.edges], [*beside.text], [*beside.memory]
            part.packed_rows = beside.packed_rows
        if beside is None or draw.random() < 0.6:
            for _ in range(draw.randrange(4)):
                at = since + draw.randrange(max(until - since, 1))
                part.edges.append((at, draw.choice(self.outputs), draw.random() < 0.6))
            part.edges.sort()
        rows = [*RECORD.iter_unpack(part.packed_rows)]
        if beside is not None and rows and draw.random() < 0.5:
            place = draw.randrange(len(rows))
            rows[place] = (rows[place][0], rows[place][1] ^ 4, rows[place][2])
        if beside is None or draw.random() < 0.3:
            cycles = (since // 14 + 60_000 * n for n in range(len(rows), len(rows) + draw.randrange(5)))
            rows += [(cycle, 0x0800_0000 + 2 * draw.randrange(9), draw.choice((BLOCK, BLOCK, 3))) for cycle in cycles]
        part.packed_rows = b"".join(RECORD.pack(*row) for row in rows)
        part.has_more_rows = draw.random() < 0.2
        if beside is None or draw.random() < 0.3:
            part.memory = [(since + n * 10 * MS, bytes([n, draw.choice((0, 0, 1))])) for n in range(4)]
            part.text = [(since + n * MS, draw.choice((65, 65, 66))) for n in range(2)]
        return part


def probes(draw: Random) -> Iterator[str]:
    """Compare replays that part in their way, their variables, their text or their pins, or nowhere."""
    for _ in range(50):
        replay = MadeReplay(draw)
        prober = Prober(replay)  # type: ignore[arg-type]  # as much of it as is asked
        at = draw.choice((0, S, 5 * S, 29 * S))
        until = min(at + draw.choice((10 * MS, 60 * MS, 2 * S)), replay.end)
        holds = [Hold(wire="DD1", level=draw.choice((True, False, None)), since=at + MS, until=until)]
        yield said(prober.effect(holds, until, draw.choice((None, at))))
        found = prober.answers(at, nets=draw.choice(((), ("DD2",))))
        yield f"{said(found)} {[one.turn for one in found.values()]} {said(prober.answers(at)['DD2'])}"
        yield said([prober.noticed(holds, until, at), prober.flip_noticed(["DD1", "DD3"], at)])
        yield said([prober.takes_notice(at, 9 * MS), prober.moments(20 * S), prober.moments(at, 3)])
        yield said([prober.codes_all(at, level=True), prober.last_place(at), prober.held(at, until, level=True)])
        yield said([sorted(prober.lines_run(at, until).items()), sorted(prober.new_lines(at))])
        yield said(replay.calls)
        one_way, other_way = (
            sorted((draw.randrange(9), draw.choice(ALL_CODES)) for _ in range(draw.choice((1, 3)))) for _ in range(2)
        )
        yield f"{one_way} {other_way} {parted(one_way, other_way, 10)}"
        one, other = replay.run(at, until), replay.run(at, until)
        other = replay.run(at, until, beside=draw.choice((one, one, other)))
        rows = [len(one.packed_rows), len(other.packed_rows), one.has_more_rows, other.has_more_rows]
        yield f"{rows} {first_row(one, other)}"


TRACES: dict[str, Trace] = {
    "contacts": contacts, "stays": stays, "others": others, "parts": parts_of_findings, "exchanges": exchanges,
    "scenes": scenes, "probes": probes, "replays": replays, "bounds": bounds,
}  # fmt: skip
for _package in ("report", "report.explain", "view"):
    TRACES[f"declared in {_package}"] = declared_of(f"robot_bench.{_package}")
test_what_runs_are_explained_by_is_what_was_approved = judge_of(__file__, TRACES)
