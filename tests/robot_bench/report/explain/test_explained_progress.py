"""Why a robot came no further, or anything else failed: each finding whole, with its steps and what was asked."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import SimpleNamespace

import pytest

from robot_bench.events.kinds import Contact, Fault, Note, Verdict, WorldChange
from robot_bench.recording.run_record import RunRecord
from robot_bench.report.explain import explain as explaining
from robot_bench.report.explain.findings import codes_between, read_gap
from robot_bench.report.explain.probing import Codes, SensorResponse
from robot_bench.report.explain.progress import ProgressAnalysis
from robot_bench.report.explain.replay import ChipReset, SourcePlace
from robot_bench.report.explain.scene import Scene
from robot_bench.wires.edges import Edges
from tests.robot_bench.recording.kept_lines import is_as_kept
from tests.robot_bench.recording.records import S
from tests.robot_bench.report.programs_asked import (
    AHEAD,
    AskedProber,
    AskedReplay,
    answers,
    driven_run,
    poses,
    step_lines,
)

STILL: Codes = (0, 0)
SPIN: Codes = (-2, 2)
SPINS = ((0.0, STILL), (0.5, SPIN))
#: 40 s, of which it stands from 10 s on.
STANDS = ((0.0, STILL), (1.0, AHEAD), (10.0, STILL))
AT = SourcePlace("loop.c:9", "loop")


def spinning(codes: Mapping[int, Codes], other: Codes = (-1, 1), **fields: object) -> Mapping[str, SensorResponse]:
    return answers(codes, base=SPIN, other=other, **fields)  # type: ignore[arg-type]


@dataclass(frozen=True, kw_only=True)
class Case:
    """A robot that stayed where it was, and its program."""

    name: str
    legs: Sequence[tuple[float, Codes]] = STANDS
    until_s: float = 40.0
    on: Mapping[str, float | tuple[float, ...]] = field(default_factory=dict)
    run: Mapping[str, object] = field(default_factory=dict)
    asked: Sequence[Mapping[str, SensorResponse]] = ()
    program: Mapping[str, object] = field(default_factory=dict)
    replay: Mapping[str, object] = field(default_factory=dict)
    pins: Mapping[str, Sequence[tuple[float, int]]] = field(default_factory=dict)

    def record(self) -> RunRecord:
        found = driven_run(*self.legs, until_s=self.until_s, on=self.on, **self.run)
        found.pins |= {net: Edges([(round(t * S), level) for t, level in edges]) for net, edges in self.pins.items()}
        return found

    def prober(self, record: RunRecord) -> AskedProber:
        replay = AskedReplay(record, record.last_ns, record.last_ns, **self.replay)  # type: ignore[arg-type]
        return AskedProber(replay, answered={n * S: row for n, row in enumerate(self.asked, 2)}, **self.program)  # type: ignore[arg-type]


STUCK = {
    "notices": (0.0, 12.0),
    "lines": [(0.0, 12.0, {"a.c:1": 3, "a.c:2": 9}), (12.0, 99.0, {"a.c:2": 5, "b.c:3": 8})],
}
BUSY = {"notices": (0.0, 12.0), "lines": [(0.0, 12.0, {"a.c:1": 3, "a.c:2": 9}),
                                          (12.0, 99.0, {f"a.c:{n}": n for n in range(2, 7)})]}  # fmt: skip
COUNTS = ((11.7, 200), (11.9, 225), (12.2, 31), (12.3, 40))
COUNTER = [(round(t * S), bytes([value, 0, 0, 0, 0])) for t, value in COUNTS]
CASES = [
    Case(name="it drives all the time", legs=((0.0, AHEAD),)),
    Case(name="it stands for less than a part", legs=((0.0, STILL), (0.5, AHEAD), (30.9, STILL))),
    Case(name="it stands for a part", legs=((0.0, STILL), (0.5, AHEAD), (30.0, STILL))),
    Case(name="wheels that do not turn", legs=((0.0, AHEAD),),
         run={"poses": poses((0.0, AHEAD), until_s=40.0, driven=False),
              "events": [Note(t=S, who="adapter", what="command", detail="x"),
                         Note(t=2 * S, who="adapter", what="driving"), Note(t=3 * S, who="adapter", what="lost",
                                                                            detail="the link")]}),
    Case(name="wheels that do not turn, of a note of little use", legs=((0.0, AHEAD),),
         run={"poses": poses((0.0, AHEAD), until_s=40.0, driven=False),
              "events": [Note(t=2 * S, who="adapter", what="driving"), Note(t=3 * S, who="body", what="hit")]}),
    Case(name="wheels that a fault holds", legs=((0.0, AHEAD),),
         run={"poses": poses((0.0, AHEAD), until_s=40.0, driven=False),
              "faults": [Fault(t=4 * S, op="inject", words="wheel-blocked left")]}),
    Case(name="a robot that was let go", legs=((0.0, AHEAD),), pins={"p2dx_con": ((0.0, 1), (5.0, 0))},
         run={"poses": poses((0.0, AHEAD), until_s=40.0, driven=False)}),
    Case(name="an adapter in reset", legs=((0.0, AHEAD),), pins={"rst": ((0.0, 0), (5.0, 1))},
         run={"poses": poses((0.0, AHEAD), until_s=40.0, driven=False)}),
    Case(name="motors by waves", legs=((0.0, AHEAD),), run={"poses": poses((0.0, AHEAD), until_s=40.0, driven=False),
         "waves": {"motor1_comm1": []}}),
    Case(name="a watchdog", replay={"resets": [ChipReset(20 * S, "IWDG", AT), ChipReset(30 * S, "IWDG", AT)],
         "fed": [(12 * S, AT), (18 * S, SourcePlace("wd.c:4", "feed"))]},
         program={"lines": [(17.0, 18.0, {"a.c:1": 1}), (18.0, 19.0, {"a.c:1": 1, "a.c:5": 2, "a.c:6": 3})]}),
    Case(name="a watchdog that is not fed", replay={"resets": [ChipReset(20 * S, "IWDG", AT)] * 2}),
    Case(name="one reset by itself, for too short a time", replay={"resets": [ChipReset(35 * S, "SOFTWARE", AT)]}),
    Case(name="resets by a pin", replay={"resets": [ChipReset((20 + 4 * n) * S, "PIN", AT) for n in range(4)]}),
    Case(name="a reset of another kind", legs=((0.0, STILL), (8.0, AHEAD)), until_s=20.0,
         replay={"resets": [ChipReset(2 * S, "POWER", AT)]}),
    Case(name="it never begins", legs=((0.0, STILL),)),
    Case(name="it begins late", legs=((0.0, STILL), (35.0, AHEAD))),
    Case(name="it is stuck", program=STUCK),
    Case(name="it is stuck, and its motors change after", legs=(*STANDS, (35.0, (1, -1))), program=STUCK),
    Case(name="it stands still", program={"notices": (0.0, 12.0)}),
    Case(name="it looks no more", program=BUSY),
    Case(name="it looks no more, as a counter runs over", program=BUSY,
         replay={"variables": [("count", 0, 1), ("odd", 1, 3)], "memory": COUNTER}),
    Case(name="it looks no more, as a counter passes a limit", program=BUSY,
         replay={"variables": [("wide", 0, 2)],
                 "memory": [(12 * S, (255).to_bytes(2, "little")), (12 * S + 5, (256).to_bytes(2, "little"))]}),
    Case(name="it looks at no time", program={"notices": (0.0, -1.0)}),
    Case(name="it looks seldom",
         program={"notices": (0.0, 12.0)}, replay={"reads_at": {"in.c:3": [0, 11 * S + 1, 12 * S]}},
         legs=((0.0, STILL), (1.0, AHEAD), (10.0, STILL), (24.0, AHEAD))),
    Case(name="it spins", legs=SPINS, asked=(spinning({}),) * 3),
    Case(name="it spins at two times", legs=SPINS, asked=(spinning({}),) * 2),
    Case(name="it spins at some times", legs=SPINS, asked=(spinning({}), spinning({}), answers({}))),
    Case(name="it spins, and drives on when one sensor sees", legs=SPINS, asked=(spinning({4: (2, 2)}),) * 3),
    Case(name="it spins, and drives alike when two sensors see", legs=SPINS,
         asked=(spinning({4: (2, 2), 5: (-3, -3)}),) * 3),
    Case(name="it spins, and drives on at two sensors", legs=SPINS,
         asked=(spinning({4: (2, 2), 5: (3, 3)}),) * 3),
    Case(name="it spins, and drives on when all see", legs=SPINS, asked=(spinning({}),) * 3,
         program={"codes": (SPIN, AHEAD)}),
    Case(name="it spins, and does not look at one", legs=SPINS, asked=(spinning({}, unnoticed=(6,)),) * 3),
    Case(name="it spins, and does not look at two", legs=SPINS, asked=(spinning({}, unnoticed=(6, 7)),) * 3),
    Case(name="it turns while it stays", legs=SPINS, run={"poses": poses((0.0, SPIN), until_s=40.0, turn_radps=0.5)}),
    Case(name="it turns half round while it stays", legs=SPINS,
         run={"poses": poses((0.0, SPIN), until_s=40.0, turn_radps=0.0785)}),
    Case(name="it stays so",
         until_s=60.0, program={"lines": [(5.0, 10.0, {"a.c:1": 1, "a.c:2": 2}), (30.0, 40.0, {"a.c:2": 1})]}),
    Case(name="it stays so, for less than a program gives up in", until_s=39.0),
    Case(name="it stays so, and left it with nothing in sight", until_s=60.0,
         replay={"edges": [(40 * S, "motor1_comm1", True)]}),
    Case(name="it stays so, and another wire changed", until_s=60.0, replay={"edges": [(40 * S, "led", True)]}),
    Case(name="it stays so, and never drove on", until_s=60.0, program={"codes": (STILL, STILL)}),
    Case(name="it stays so, and drove for less than two seconds", until_s=60.0,
         legs=((0.0, STILL), (8.5, AHEAD), (10.0, STILL))),
    Case(name="a sonar that errs", on={"DD3": 9.0}, asked=(answers({3: STILL}),),
         program={"later": answers({3: STILL})}, run={"faults": [Fault(t=S, op="inject", words="sonar-stuck 3 0.2")]}),
    Case(name="a sonar that errs, and it would stand as well", on={"DD3": 9.0}, asked=(answers({3: STILL}),),
         program={"later": answers({3: (1, 1)})}, run={"faults": [Fault(t=S, op="inject", words="sonar-stuck 3 0.2")]}),
    Case(name="a sonar that errs, its pin low", asked=(answers({3: STILL}),),
         run={"faults": [Fault(t=S, op="inject", words="sonar-stuck 3 0.2")]}),
    Case(name="the program itself", on={"DD2": 9.0, "DD3": 9.5}),
    Case(name="the program itself, by whom is not found", replay={"writes": None}),
]  # fmt: skip


def said(case: Case, prober: AskedProber | None, record: RunRecord) -> list[str]:
    analysis = ProgressAnalysis(Scene(record), prober, record.last_ns)  # type: ignore[arg-type]
    finding = analysis.find()
    asked = [] if prober is None else [f"    asked {one}" for one in prober.asked]
    return [
        f"{case.name}: {'cause' if finding.is_cause else 'known'}: {finding.says}",
        *step_lines(analysis.steps),
        *asked,
    ]


def test_each_link_that_keeps_a_robot_where_it_is() -> None:
    lines = []
    for case in CASES:
        record = case.record()
        lines += said(case, case.prober(record), record)
    lines += [line for name in ("it never begins", "the program itself", "it spins") for case in CASES
              if case.name == name for line in said(case, None, case.record())]  # fmt: skip
    assert is_as_kept(lines, "explained_progress")


def failing(failure: str, **changes: object) -> tuple[RunRecord, str]:
    """A run of 40 s that failed at 30 s."""
    says = failure.partition(": ")[2]
    verdict = Verdict(t=30 * S, goal="it", says=says, met=False) if says else None
    fields = {"end": {"failures": [failure]}, "verdicts": [verdict] if verdict else [], **changes}
    return driven_run(*STANDS, until_s=40.0, **fields), failure


HIT = Contact(t=12 * S, what="'crate'", x_m=2.0, y_m=0.0)
OTHERS: Mapping[str, tuple[Callable[[], tuple[RunRecord, str]], Mapping[str, object], Mapping[str, object]]] = {
    "a contact": (lambda: failing("no_collision: hit", contacts=[HIT]), {}, {"effects": {}}),
    "a contact soon after a reset": (lambda: failing("no_collision: hit", contacts=[HIT]),
                                     {"resets": [ChipReset(9 * S + 1, "PIN", AT), ChipReset(13 * S, "PIN", AT)]}, {}),
    "a contact long after a reset": (lambda: failing("clearance: hit", contacts=[HIT]),
                                     {"resets": [ChipReset(9 * S, "PIN", AT)]}, {}),
    "a way": (lambda: failing("min_distance: 3 m not driven"), {}, {}),
    "work": (lambda: failing("energy: more than 1 J"), {}, {}),
    "a death": (lambda: failing("text: nothing", faults=[Fault(t=20 * S, op="died", words="HardFault")]), {}, {}),
    "a death after it":
        (lambda: failing("text: nothing", faults=[Fault(t=31 * S, op="died", words="HardFault")]), {}, {}),
    "anything": (lambda: failing("text: nothing in 30 s"), {}, {}),
    "anything, soon after a reset": (lambda: failing("text: nothing in 30 s"),
                                     {"resets": [ChipReset(28 * S, "WWDG", AT)]}, {}),
    "anything, of a program that looks no more": (lambda: failing("text: nothing in 30 s"), {}, STUCK),
    "anything, with pins that are not noticed": (lambda: failing("text: nothing"), {}, {"unnoticed": ("DD2",)}),
}  # fmt: skip


def test_what_else_fails_is_looked_into_by_its_kind() -> None:
    lines = []
    for name, (make, replay, program) in OTHERS.items():
        record, failure = make()
        record.pins |= {net: Edges([(0, 0), (25 * S, 1)]) for net in ("DD2", "DD3")}
        prober = Case(name=name, replay=replay, program=program).prober(record)
        finding, steps = explaining._find(record, Scene(record), prober, failure)  # type: ignore[arg-type]
        lines += [f"{name}: {'cause' if finding.is_cause else 'known'}: {finding.says}", *step_lines(steps)]
        lines += [f"    asked {one}" for one in prober.asked]
    assert is_as_kept(lines, "explained_others")


@pytest.mark.parametrize("unnoticed", [(), ("DD1", "DD8")])
def test_what_is_odd_is_told_whether_or_not_it_has_to_do_with_it(unnoticed: Sequence[str]) -> None:
    record = driven_run(*STANDS, until_s=40.0)
    reads = {"a.c:1": [2 * S, 2_060_000_000, 2_100_000_000], "b.c:2": [2 * S, 2_060_000_001], "c.c:3": [2 * S]}
    odd = {"resets": [ChipReset(20 * S, "PIN", AT)] * 2, "reads_at": reads}
    case = Case(name="odd", asked=(answers({}),) * 2, program={"unnoticed": unnoticed}, replay=odd)
    prober = case.prober(record)
    prober.replay.role = lambda _role: ("encoder1_s1",)  # type: ignore[attr-defined]
    pins = " and ".join(f"{net} at PA{net[-1]}" for net in unnoticed)
    says = f"nothing in the program depended on {pins} at 2 times that were tried"
    assert explaining._odd(prober) == [  # type: ignore[arg-type]
        "resets: 2, the first by PIN at 20.000 s, at loop.c:9 (loop)", *[says] * bool(unnoticed),
        "b.c:2 reads the input pins only each 60 ms",
    ]  # fmt: skip
    assert explaining._odd(None) == []


@pytest.mark.parametrize(
    ("reads_s", "gap_s"),
    [([11.9, 12.0], 0.0), ([11.85, 12.0], 0.15), ([11.8, 11.9, 12.0], 0.0), ([11.8, 11.85, 12.0], 0.15), ([], 0.0),
     ([1.0, 8.0, 9.0], 7.0), ([8.0, 1.0], 7.0)],
)  # fmt: skip
def test_how_seldom_a_program_reads_its_pins(reads_s: Sequence[float], gap_s: float) -> None:
    replay = SimpleNamespace(
        reads=lambda since, until: {"a": [round(t * S) for t in reads_s if since <= round(t * S) <= until]}
    )
    assert read_gap(SimpleNamespace(replay=replay), 12 * S) == round(gap_s * S)  # type: ignore[arg-type]


def test_codes_between_two_times_are_those_of_either_motor() -> None:
    record = driven_run((0.0, (1, 1)), (1.0, (2, 1)), (2.0, (2, 3)), (3.0, (0, 0)), until_s=1.0)
    assert codes_between(record, S // 2, 2 * S) == [(S // 2, (1, 1)), (S, (2, 1)), (2 * S, (2, 3))]
    assert codes_between(record, S, 2 * S - 1) == [(S, (2, 1))]


@pytest.mark.parametrize(
    ("changes_s", "since_s"),
    [((), 4.0), ((3.0,), 4.0), ((5.0,), 5.0), ((6.0, 9.0), 9.0), ((9.0, 6.0), 9.0), ((12.0, 12.1), 12.0)],
)
def test_a_thing_stands_since_it_was_last_changed_before_it_was_touched(
    changes_s: Sequence[float], since_s: float
) -> None:
    changes = [WorldChange(t=round(t * S), op="move", name="crate", fields={}) for t in changes_s]
    changes.append(WorldChange(t=11 * S, op="move", name="other", fields={}))
    scene = Scene(driven_run(*STANDS, until_s=1.0, changes=changes))
    assert scene.still_since(HIT, 4 * S) == round(since_s * S)
