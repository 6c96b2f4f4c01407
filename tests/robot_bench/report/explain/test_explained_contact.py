"""Why a contact came about, link by link: each finding whole, with its steps and what the program was asked for it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import pytest

from robot_bench.events.kinds import Contact, Fault, Note, WorldChange
from robot_bench.recording.run_record import RunRecord
from robot_bench.report.explain.contact import ContactAnalysis
from robot_bench.report.explain.probing import Codes, InputEffect, SensorResponse
from robot_bench.report.explain.scene import Scene
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

HIT_S = 6.0
#: What was touched lies ahead, a little to the left; the robot is at x 1.125 m then.
HIT = Contact(t=6 * S, what="'crate'", x_m=1.4, y_m=0.06)
LEGS = ((0.0, AHEAD),)
TURN: Codes = (-2, 2)
AWAY = {2: (3, 2), 3: (3, 1), 4: (2, -2), 5: (-2, 2), 6: (1, 3), 7: (2, 3)}
TOWARD = {place: codes[::-1] for place, codes in AWAY.items()}


def effect(noticed_s: float | None = 5.01, answered_s: float | None = 5.02, *, before: Codes = TURN,
           after: Codes = AHEAD, **fields: object) -> InputEffect:  # fmt: skip
    return InputEffect(
        noticed=None if noticed_s is None else round(noticed_s * S), by="main.c:12 (look)", before=before, after=after,
        answered=None if answered_s is None else round(answered_s * S),
        **{"way": [(4 * S, AHEAD), (5 * S, TURN)], "otherwise_ns": S, **fields},  # type: ignore[arg-type]
    )  # fmt: skip


def asked_at(*rows: Mapping[str, SensorResponse]) -> dict[int, Mapping[str, SensorResponse]]:
    return {(n + 1) * S: {net: replace(one, at=(n + 1) * S) for net, one in row.items()} for n, row in enumerate(rows)}


@dataclass(frozen=True, kw_only=True)
class Case:
    """A contact, and the program that came to it."""

    name: str
    on: Mapping[str, float | tuple[float, ...]] = field(default_factory=lambda: {"DD4": 4.0, "DD5": 5.0})
    hit: Contact = HIT
    legs: Sequence[tuple[float, Codes]] = LEGS
    run: Mapping[str, object] = field(default_factory=dict)
    effect: InputEffect | None = None
    late: InputEffect | None = None
    asked: Sequence[Mapping[str, SensorResponse]] = (answers(AWAY),) * 3
    program: Mapping[str, object] = field(default_factory=dict)
    replay: Mapping[str, object] = field(default_factory=dict)
    end_s: float = 10.0
    exact_s: float = 10.0


QUIET = answers({}, answered=None, otherwise_ns=4_999_999)
CASES = [
    Case(name="wheels that stand", run={"poses": poses(*LEGS, until_s=6.0, driven=False)}),
    Case(name="a blind spot", on={}, hit=replace(HIT, x_m=0.7, y_m=-0.2)),
    Case(name="a thing that comes into a blind spot", on={}, hit=replace(HIT, x_m=0.7, y_m=-0.2),
         run={"changes": [WorldChange(t=5_700_000_000, op="place", name="crate", fields={})]}),
    Case(name="a thing that came into a blind spot as late as counts", on={}, hit=replace(HIT, x_m=0.7, y_m=-0.2),
         run={"changes": [WorldChange(t=5_400_000_000, op="place", name="crate", fields={})]}),
    Case(name="backwards", on={}, hit=replace(HIT, x_m=-1.4, y_m=0.0), legs=((0.0, (-3, -2)),)),
    Case(name="no sensor reported it", on={}),
    Case(name="no sensor reported it, though its sonar measured", on={},
         run={"sonar": [(3 * S, [900] * 8), (5 * S, [800, 800, 800, 700, 400, 800]), (7 * S, [100] * 8)],
              "faults": [Fault(t=S, op="inject", words="sonar-dead 4")]}),
    Case(name="in sight too late for a sensor", on={},
         run={"changes": [WorldChange(t=5_500_000_000, op="move", name="crate", fields={})]}),
    Case(name="in sight as late as counts", on={},
         run={"changes": [WorldChange(t=5_400_000_000, op="move", name="crate", fields={})]}),
    Case(name="a pin that has just gone low", on={"DD4": (4.0, 5.5), "DD5": (2.0, 5.3)}, effect=effect()),
    Case(name="a program that looks no more", effect=effect(None), program={"notices": (0.0, 1.0)}),
    Case(name="a late program", effect=effect(None), late=effect(8.5)),
    Case(name="a late program of a short run", effect=effect(None), late=effect(7.5), end_s=8.0),
    Case(name="a sensor that is ignored", effect=effect(None), late=effect(None),
         asked=(answers(AWAY, unnoticed=(4,)),) * 2),
    Case(name="two sensors that are ignored", effect=effect(None), late=effect(None),
         asked=(answers(AWAY, unnoticed=(4, 5)), answers(AWAY, unnoticed=(3, 4, 5)))),
    Case(name="a sensor that is not noticed here", effect=effect(None), late=effect(None)),
    Case(name="a sensor that is not noticed here, for a short time", on={"DD4": 5.7}, effect=effect(None),
         late=effect(None)),
    Case(name="notice after most of the time", effect=effect(4.8)),
    Case(name="notice after less than the time", effect=effect(4.79)),
    Case(name="notice soon of a short time", on={"DD4": 5.7}, effect=effect(5.849)),
    Case(name="notice as late as counts, of a short time", on={"DD4": 5.7}, effect=effect(5.85)),
    Case(name="nothing is done about it", effect=effect(answered_s=None), asked=(QUIET,) * 3,
         program={"later": QUIET}),
    Case(name="something is done about it later", effect=effect(answered_s=None), asked=(QUIET,) * 3,
         program={"later": answers({}, answered=1_900_000_000)}),
    Case(name="the motors are set no otherwise", effect=effect(otherwise_ns=4_999_999),
         asked=(answers({}, otherwise_ns=4_999_999),) * 3),
    Case(name="the motors are set otherwise here", effect=effect(otherwise_ns=5_000_000),
         asked=(answers({}, otherwise_ns=4_999_999),) * 3),
    Case(name="an answer that comes late", effect=effect(4.01, 4.9), asked=(answers(AWAY, answered=900_000_000),) * 3),
    Case(name="an answer that comes in time", effect=effect(4.01, 4.7),
         asked=(answers(AWAY, answered=799_999_999),) * 3),
    Case(name="an answer that was sooner here",
         effect=effect(4.01, 4.8), asked=(answers(AWAY, answered=900_000_000),) * 3),
    Case(name="an answer that was late twice",
         effect=effect(4.01, 4.9), asked=(answers(AWAY, answered=900_000_000),) * 2),
    Case(name="a turn towards all", effect=effect(4.01, 4.02, before=(-2, 2), after=AHEAD),
         asked=(answers(TOWARD),) * 3),
    Case(name="a turn towards one, as if two were exchanged", effect=effect(4.01, 4.02),
         asked=(answers(AWAY | {3: AWAY[5], 5: AWAY[3]}),) * 4),
    Case(name="a turn towards one, which it did not make here",
         effect=effect(4.01, 4.02, before=(3, 2), after=AHEAD), asked=(answers(AWAY | {4: (1, 3)}),) * 3),
    Case(name="a turn towards one to the right", hit=replace(HIT, y_m=-0.06),
         effect=effect(4.01, 4.02, before=(3, 2), after=AHEAD), asked=(answers(AWAY | {5: (3, 1)}),) * 3),
    Case(name="straight on", effect=effect(4.01, 4.02, before=AHEAD, after=(2, 1))),
    Case(name="straight on for less than counts",
         on={"DD4": 5.01}, effect=effect(5.02, 5.03, before=AHEAD, after=(2, 1))),
    Case(name="straight on for as long as counts",
         on={"DD4": 5.0}, effect=effect(5.02, 5.03, before=AHEAD, after=(2, 1))),
    Case(name="straight on, as without", effect=effect(4.01, 4.02, before=AHEAD, after=AHEAD)),
    Case(name="the left motor is never reversed", effect=effect(4.01, 4.02, before=AHEAD, after=AHEAD),
         asked=(answers(AWAY | {4: (2, -2), 5: (2, 2)}),) * 3),
    Case(name="the right motor is never reversed", effect=effect(4.01, 4.02, before=AHEAD, after=AHEAD),
         asked=(answers(AWAY | {4: (2, 2), 5: (-2, 2)}),) * 3),
    Case(name="a motor is reversed at some time", legs=((0.0, AHEAD), (1.0, (-1, 1)), (1.5, AHEAD)),
         effect=effect(4.01, 4.02, before=AHEAD, after=AHEAD), asked=(answers(AWAY | {4: (2, -2), 5: (2, 2)}),) * 3),
    Case(name="an answer that may be right", legs=((0.0, AHEAD), (4.5, (2, 1))), effect=effect(4.01, 4.5)),
    Case(name="an answer that is over", legs=((0.0, AHEAD), (4.5, (2, 1))),
         effect=effect(4.01, 4.5, before=AHEAD, after=AHEAD, otherwise=((1, 2), AHEAD), otherwise_ns=S // 4)),
    Case(name="no answer", legs=((0.0, AHEAD), (4.5, (2, 1))), effect=effect(4.01, None, before=AHEAD, after=AHEAD)),
    Case(name="no pin was high", on={}, hit=replace(HIT, x_m=1.78, y_m=0.37), run={"meta": {}}),
    Case(name="the line before, a command, and lines that are new", legs=((0.0, AHEAD), (3.0, (2, 2))),
         effect=effect(4.01, 4.02), program={"new": ["a.c:1", "a.c:2", "a.c:3", "a.c:4"]},
         run={"events": [Note(t=S, who="adapter", what="command", detail="VEL 100"),
                         Note(t=2 * S, who="adapter", what="command", detail="VEL 200"),
                         Note(t=7 * S, who="adapter", what="command", detail="VEL 300")]}),
    Case(name="a command after what was replayed", legs=((0.0, AHEAD), (3.0, (2, 2))), effect=effect(4.01, 4.02),
         exact_s=2.9),
    Case(name="a command whose writer is not found", legs=((0.0, AHEAD), (3.0, (2, 2))), effect=effect(4.01, 4.02),
         replay={"writes": None}),
]  # fmt: skip


def run_of(case: Case) -> RunRecord:
    return driven_run(*case.legs, until_s=HIT_S, on=case.on, contacts=[case.hit], **case.run)


def found(case: Case, prober: AskedProber | None, record: RunRecord) -> list[str]:
    analysis = ContactAnalysis(Scene(record), prober, case.hit)  # type: ignore[arg-type]
    finding = analysis.find()
    asked = [] if prober is None else [f"    asked {one}" for one in prober.asked]
    return [
        f"{case.name}: {'cause' if finding.is_cause else 'known'}: {finding.says}",
        *step_lines(analysis.steps),
        *asked,
    ]


def program(case: Case, record: RunRecord) -> AskedProber:
    replay = AskedReplay(record, round(case.end_s * S), round(case.exact_s * S), **case.replay)  # type: ignore[arg-type]
    effects = {case.hit.t: case.effect, min(case.hit.t + 3 * S, replay.end): case.late}
    known = {at: one for at, one in effects.items() if one is not None}
    return AskedProber(replay, effects=known, answered=asked_at(*case.asked), **case.program)  # type: ignore[arg-type]


def test_each_link_that_did_not_hold_is_the_cause() -> None:
    kept = "explained_contact"
    lines = []
    for case in CASES:
        record = run_of(case)
        lines += found(case, program(case, record), record)
    assert is_as_kept(lines, kept)


@pytest.mark.parametrize("case", [CASES[0], CASES[5], CASES[-1]], ids=lambda case: case.name)
def test_without_its_program_no_more_is_known_than_the_trace_holds(case: Case) -> None:
    says = found(case, None, run_of(case))[0]
    if case.on:
        says = found(replace(case, run={}), None, driven_run(*case.legs, until_s=HIT_S, on=case.on))[0]
        assert (
            says
            == f"{case.name}: known: the chip was not replayed, so what the program did with its inputs is not known"
        )
    else:
        assert "the sensor did not tell: DD4 stayed low" in says
