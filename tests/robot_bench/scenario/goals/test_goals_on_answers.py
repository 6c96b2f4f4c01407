"""Goals on what a program makes of its sensors' pins, and on the numbers that it prints: at their bounds."""

from collections.abc import Sequence
from typing import Any

import pytest

from adapter_sim.codec import motor_code
from adapter_sim.pinout import load_pinout
from p2os.errors import ScenarioError
from robot_bench.events.kinds import Event, PinEdge, Text
from robot_bench.scenario.goals.judging import load_goal
from robot_bench.scenario.goals.watch import GoalOutcome
from simbase.errors import LONGEST_SHOWN
from tests.robot_bench.recording.records import S
from tests.robot_bench.scenario.goals.test_goal_kinds import MS, at, outcome

PINOUT = load_pinout()


def motors(t: int, left: int, right: int, skew: int = 1000) -> list[PinEdge]:
    """Return the edges of both motors' pins, those of the right one a little later."""
    found = []
    for late, name, value in ((0, "motor1", left), (skew, "motor2", right)):
        wires = PINOUT.value(name).wires
        code = motor_code(value, len(wires))
        found += [PinEdge(t=t + late, wire=wire, level=bool(code >> bit & 1)) for bit, wire in enumerate(wires)]
    return found


def pin(t: int, name: str, level: bool = True) -> PinEdge:
    return PinEdge(t=t, wire={wire.name: wire.name for wire in PINOUT.wires}.get(name, name), level=level)


def flat(*parts: Sequence[Event] | Event) -> list[Event]:
    return [event for part in parts for event in (part if isinstance(part, Sequence) else [part])]


def answers(run: Sequence[Event], end: int = 10 * S, **table: Any) -> GoalOutcome:
    return outcome(
        "answers", run, end, **{"signal": "mean", "within_s": 0.1, **({} if "least" in table else {"most": 0}), **table}
    )


@pytest.mark.parametrize(("t", "met"), [(100 * MS - 1, True), (100 * MS, True), (100 * MS + 1, False)])
def test_goal_answers_allows_so_long_and_no_longer(t: int, met: bool) -> None:
    run = flat(motors(0, 2, 2), pin(S, "DD4"), motors(S + t, -2, 2, skew=0))
    found = answers(run, any_high=["DD4", "DD5"])
    assert found.met is met
    assert found.robustness == pytest.approx(1 - t / (100 * MS), abs=1e-6)
    assert met or found.says.startswith("the motors had +2, +2 from 1.000 s on while one of DD4, DD5 high")


def test_goal_answers_judges_only_while_the_pins_are_so_and_the_motors_do_so() -> None:
    both = flat(motors(0, 3, 3), pin(S, "DD4"), pin(S, "DD5"))
    for table, met in (
        ({"high": ["DD4", "DD5"]}, False), ({"high": ["DD4", "DD3"]}, True),
        ({"any_high": ["DD3"]}, True), ({"any_high": ["DD5", "DD3"]}, False),
        ({"any_high": ["DD4"], "low": ["DD5"]}, True), ({"low": ["DD3"]}, False),
        ({"high": ["DD4"], "moving": ["turn", "back"]}, True), ({"moving": ["forward"]}, False),
    ):  # fmt: skip
        assert answers(both, **table).met is met, table
    assert answers(both, most=3).met
    assert not answers(both, least=3.5).met


@pytest.mark.parametrize(("left", "right", "met"), [(2, 3, True), (3, 3, False), (3, 2, False)])
def test_goal_answers_compares_left_with_right(left: int, right: int, met: bool) -> None:
    table = {"signal": "turn", "least": 1, "any_high": ["DD6"], "moving": ["forward"]}
    assert answers(flat(motors(0, left, right), pin(S, "DD6")), **table).met is met


def test_two_ports_that_are_written_in_turn_are_one_change() -> None:
    run = flat(motors(0, 0, 0), pin(0, "DD4"), motors(S, 2, -2, skew=999_999), motors(2 * S, 0, 0, skew=999_999))
    assert answers(run, any_high=["DD4"], within_s=0.0005).met
    late = flat(motors(0, 0, 0), pin(0, "DD4"), motors(S, 2, -2, skew=1_000_000))
    assert not answers(late, any_high=["DD4"], within_s=0.0005).met


@pytest.mark.parametrize(("gone", "met"), [(300 * MS, True), (300 * MS + 1, False)])
def test_goal_has_reason_looks_so_far_back(gone: int, met: bool) -> None:
    run = flat(motors(0, 2, 2), pin(S, "DD4"), pin(2 * S, "DD4", False), motors(2 * S + gone, 2, -2, skew=0))
    found = outcome("has_reason", run, motion="turn", needs=[["DD4", "DD5"]], within_s=0.3)
    assert found.met is met
    assert met or found.says == f"turn began at {(2 * S + gone) / S:.3f} s with no pin of DD4, DD5 high"


def test_goal_has_reason_wants_one_of_each_list_and_only_after_some_motions() -> None:
    run = flat(motors(0, 2, 2), pin(S, "DD2"), motors(2 * S, -2, -2), motors(3 * S, 2, -2))
    assert outcome("has_reason", run, motion="back", needs=[["DD2"]], within_s=0.3).met
    sides = [["DD2", "DD3"], ["DD6", "DD7"]]
    assert not outcome("has_reason", run, motion="back", needs=sides, within_s=0.3).met
    assert outcome("has_reason", run, motion="turn", before=["forward"], needs=sides, within_s=0.3).met
    assert not outcome("has_reason", run, motion="turn", before=["back"], needs=sides, within_s=0.3).met


@pytest.mark.parametrize(("since", "met"), [(300 * MS - 1, True), (300 * MS, False)])
def test_goal_has_reason_judges_only_what_was_given_for_so_long(since: int, met: bool) -> None:
    run = flat(motors(0, 2, -2), pin(S, "DD3"), motors(S + since, 2, 2, skew=0))
    table = {"motion": "forward", "before": ["turn"], "given": ["DD3"], "needs": [["DD6"]], "within_s": 0.3}
    assert outcome("has_reason", run, **table).met is met
    gone = flat(motors(0, 2, -2), pin(S, "DD3"), pin(2 * S, "DD3", False), motors(2 * S + MS, 2, 2))
    assert outcome("has_reason", gone, **table).met


def test_goal_has_reason_allows_so_many_in_a_row() -> None:
    begins = [[*motors(n * S, 2, -2), *motors(n * S + S // 2, 2, 2)] for n in range(1, 7)]
    table = {"motion": "forward", "before": ["turn"], "needs": [["DD6"]], "within_s": 0.1, "row": 2}
    assert outcome("has_reason", flat(*begins[:2]), **table).met
    third = outcome("has_reason", flat(*begins[:3]), **table)
    assert not third.met
    assert third.says == "forward began at 3.500 s with no pin of DD6 high, 3 times in a row"
    reason = [pin(3 * S, "DD6"), pin(4 * S, "DD6", False)]
    assert outcome("has_reason", flat(*begins[:2], reason[0], begins[2], reason[1], *begins[3:5]), **table).met
    assert not outcome("has_reason", flat(*begins[:2], reason[0], begins[2], reason[1], *begins[3:6]), **table).met


@pytest.mark.parametrize(("t", "met"), [(S - 1, False), (S, True), (2 * S, True), (2 * S + 1, False)])
def test_goal_lasts_no_shorter_and_no_longer(t: int, met: bool) -> None:
    run = flat(motors(0, 2, 2, skew=0), motors(S, -2, -2, skew=0), motors(S + t, 2, -2, skew=0))
    assert outcome("lasts", run, motion="back", least_s=1, most_s=2).met is met
    assert outcome("lasts", run, motion="back", before=["turn"], least_s=1, most_s=2).met


def test_goal_lasts_is_missed_while_it_goes_on_and_from_the_beginning() -> None:
    assert not outcome("lasts", flat(motors(0, 0, 0)), motion="stand", most_s=9.9).met
    assert outcome("lasts", flat(motors(0, 0, 0)), motion="stand", most_s=10).met
    assert outcome("lasts", flat(motors(0, 0, 0)), motion="stand", least_s=20).met  # it is not over


@pytest.mark.parametrize(("t", "met"), [(199 * MS, False), (200 * MS, True), (201 * MS, True)])
def test_goal_answers_counts_a_pin_for_so_long_after_it_has_fallen(t: int, met: bool) -> None:
    run = flat(motors(0, 0, 0), pin(S, "DD4"), pin(2 * S, "DD4", False), motors(2 * S + t, 3, 3, skew=0))
    assert answers(run, any_high=["DD4"], within_s=0.0005).met
    assert answers(run, any_high=["DD4"], within_s=0.0005, lingers_s=0.2).met is met
    again = flat(run[:-6], pin(2 * S + 100 * MS, "DD4"), pin(2 * S + 150 * MS, "DD4", False), run[-6:])
    assert answers(again, any_high=["DD4"], within_s=0.0005, lingers_s=0.2).met is False
    assert answers(run, low=["DD4"], within_s=0.0005, lingers_s=0.2).met is False  # it is low in the end
    back = flat(run[:-6], pin(2 * S + 100 * MS, "DD4"), motors(2 * S + 500 * MS, 3, 3, skew=0))
    assert answers(back, any_high=["DD4"], within_s=0.0005, lingers_s=0.2).met is False


@pytest.mark.parametrize(("before", "met"), [(1, True), (0, False)])
def test_goal_answers_sees_a_pin_fall_where_nothing_else_happens(before: int, met: bool) -> None:
    run = flat(motors(0, 3, 3), pin(S, "DD4"), pin(2 * S, "DD4", False))
    table = {"low": ["DD4"], "lingers_s": 0.2, "within_s": 1.5}
    assert answers(run, 2 * S + 200 * MS + 1500 * MS + 1 - before, **table).met is met


def turn_ends(*parts: Sequence[Event] | Event, end: int = 20 * S, **table: Any) -> GoalOutcome:
    return outcome("turn_ends", flat(*parts), end, **{"low": ["DD3", "DD4", "DD6"], "within_s": 1, **table})


def turning(t: int, lasts: int = 2 * S) -> list[PinEdge]:
    """Return a turn that goes on for a second where its way is free."""
    return flat(
        motors(t - S // 4, 2, 2), pin(t, "DD4"), motors(t, 2, -2, skew=0), pin(t + S, "DD4", False),
        motors(t + lasts, 3, 3, skew=0),
    )  # fmt: skip


@pytest.mark.parametrize(("t", "met"), [(2 * S - 1, True), (2 * S, True), (2 * S + 1, False)])
def test_goal_turn_ends_allows_so_long_where_the_way_is_free(t: int, met: bool) -> None:
    found = turn_ends(turning(S, t))
    assert found.met is met
    assert found.robustness == pytest.approx(1 - (t - S) / S, abs=1e-6)
    assert met or found.says == "it turned on from 2.000 s, where DD3, DD4, DD6 were low, for more than 1 s"
    assert turn_ends(turning(S, t), lingers_s=0.2).met
    assert turn_ends(pin(0, "DD6"), turning(S, t)).met  # something else is in the way
    back = flat(motors(0, 2, 2), motors(S // 2, -2, -2), turning(S, t)[6:])
    assert turn_ends(back).met  # it did not come forward


@pytest.mark.parametrize(("x_m", "met"), [(0.499, True), (0.5, False)])
def test_goal_turn_ends_judges_so_many_in_one_place(x_m: float, met: bool) -> None:
    table = {"row": 2, "way_m": 0.5}
    short = [turning(n * 3 * S, S) for n in (1, 2)]
    assert not turn_ends(short[0], turning(6 * S, 3 * S), **table).met
    assert turn_ends(*short, turning(9 * S, 3 * S), **table).met
    way = [at(8 * S), at(8 * S + S // 2, x_m)]
    assert turn_ends(at(0), *short, way, turning(9 * S, 3 * S), **table).met is met
    assert turn_ends(at(0), at(1, x_m), turning(3 * S, S), turning(6 * S, S), turning(9 * S, 3 * S), **table).met


@pytest.mark.parametrize(("t", "met"), [(300 * MS - 1, False), (300 * MS, True)])
def test_goal_turn_ends_does_not_judge_what_comes_out_of_a_passage(t: int, met: bool) -> None:
    gap = flat(motors(0, 2, 2), pin(S, "DD3"), pin(S, "DD6"))
    out = flat(pin(S + t, "DD3", False), pin(S + t, "DD6", False), turning(3 * S, 3 * S))
    table = {"passage": ["DD3", "DD6"], "passage_s": 0.3}
    assert turn_ends(gap, out, **table).met is met
    assert not turn_ends(gap, pin(S, "DD4"), pin(S + t - 1, "DD4", False), out, **table).met
    twice = flat(pin(2 * S - t, "DD3"), pin(2 * S, "DD3", False))
    assert not turn_ends(gap, pin(S, "DD3", False), out, **table).met
    assert turn_ends(gap, pin(S + 1, "DD3", False), twice, pin(2 * S, "DD6", False), out[2:], **table).met is met
    assert not turn_ends(gap, out, turning(8 * S, 3 * S), **table).met  # the next one comes out of none


def says(t: int, *pieces: str) -> list[Text]:
    return [Text(t=t, data=piece.encode()) for piece in pieces]


@pytest.mark.parametrize(("t", "met"), [
    (-100 * MS - 1, False), (-100 * MS, True), (0, True), (100 * MS, True), (100 * MS + 1, False)
])  # fmt: skip
def test_goal_reports_motion_wants_a_line_so_long_before_or_after(t: int, met: bool) -> None:
    drives, turns, line = motors(0, 2, 2), motors(S, 2, -2, skew=0), says(S + t, "car: tu", "rn\n")
    run = [*drives, *(line if t < 0 else turns), *(turns if t < 0 else line), at(9 * S)]
    found = outcome("reports_motion", run, motion="turn", matches="turn$", within_s=0.1)
    assert found.met is met
    assert met or found.says == "turn began at 1.000 s, and no line with 'turn$' came within 0.1 s"
    assert not outcome("reports_motion", run, motion="turn", matches="back", within_s=0.1).met
    assert outcome("reports_motion", run, motion="turn", before=["back"], matches="back", within_s=0.1).met


def test_goal_reports_motion_wants_a_line_each_time() -> None:
    twice = flat(motors(S, 2, -2), motors(S + 10 * MS, 2, 2), motors(S + 20 * MS, 2, -2))
    table = {"motion": "turn", "matches": "turn", "within_s": 0.1}
    assert not outcome("reports_motion", flat(twice, says(S + 30 * MS, "turn\n"), at(9 * S)), **table).met
    assert outcome("reports_motion", flat(twice, says(S + 30 * MS, "turn\n", "turn\n"), at(9 * S)), **table).met
    assert not outcome("reports_motion", flat(says(S - 1, "turn\n"), twice, at(9 * S)), **table).met
    assert not outcome("reports_motion", flat(twice, says(S + 30 * MS, "turn", " turn"), at(9 * S)), **table).met


def prints(value: str, **table: Any) -> GoalOutcome:
    run = [at(0, left=0.1), at(S, left=0.3), at(2 * S, left=0.2), Text(t=2 * S, data=f"left {value} mm/s\n".encode())]
    return outcome("prints_numbers", run, **{"matches": r"left (-?\d+)", "times": 0.001, **table})


@pytest.mark.parametrize(("value", "met"), [("169", False), ("170", True), ("330", True), ("331", False)])
def test_goal_prints_numbers_that_the_signal_had(value: str, met: bool) -> None:
    found = prints(value, signal="left_mps", tolerance=0.03, over_s=1.0)
    assert found.met is met
    assert met or found.says == f"'left {value} mm/s' at 2.000 s: left_mps was 0.2 to 0.3"


def test_goal_prints_numbers_within_bounds() -> None:
    assert prints("200", least=0.2, most=0.2).met
    assert not prints("201", most=0.2).met
    assert not prints("199", least=0.2).met
    assert prints("many", most=0.2).says.startswith("no line matched")


@pytest.mark.parametrize(
    ("pieces", "says"),
    [
        (["car: ready\n", "car: go 1\n"], ""),
        (["car: rea", "dy\ncar: go 1\n", "car: g"], ""),  # the last one has not come to its end
        (["car: ready\n", "go 1\n"], "'go 1' at 2.000 s: it prints no such line"),
        (["car: ready\n", "car: go 1car: go 2\n"], "'car: go 1car: go 2' at 2.000 s: it prints no such line"),
        (["car: go 1\n", "car: ready\n"], "'car: go 1' at 1.000 s: it begins with another line"),
        (["car: ready\n", "car: stop\n", "car: go\n"], "'car: stop' at 2.000 s: it prints no such line"),
        (["car: ready"], "no line was printed to its end; the last line is 'car: ready'"),
        (["r" * 9999], f"no line was printed to its end; the last line is '{'r' * (LONGEST_SHOWN - 4)}..."),
    ],
)
def test_goal_prints_lines_that_are_known_alone(pieces: list[str], says: str) -> None:
    texts = [Text(t=number * S, data=line.encode()) for number, piece in enumerate(pieces, 1)
             for line in piece.splitlines(keepends=True)]  # fmt: skip
    found = outcome("prints_lines", texts, matches=["car: ready", r"car: go \d"], first="car: ready")
    assert (found.met, found.says) == (not says, says)


@pytest.mark.parametrize(
    ("table", "refusal"),
    [
        ({"kind": "answers", "signal": "mean", "within_s": 1}, "needs least or most"),
        ({"kind": "answers", "signal": "mean", "most": 1, "within_s": 1, "moving": ["ahead"]}, "no motion 'ahead'"),
        ({"kind": "answers", "signal": "mean", "most": 1, "within_s": 1, "high": ["PB99"]}, "no wire 'PB99'"),
        ({"kind": "has_reason", "motion": "turn", "needs": [], "within_s": 1}, "needs is no list"),
        ({"kind": "has_reason", "motion": "turn", "needs": ["PB0"], "within_s": 1}, "no list of lists"),
        ({"kind": "turn_ends", "low": [], "within_s": 1}, "low is empty"),
        ({"kind": "turn_ends", "low": ["DD3"], "within_s": 1, "passage": ["DD6"]}, "'DD6' of passage is no pin of low"),
        ({"kind": "reports_motion", "motion": "turn", "matches": "(", "within_s": 1}, "is no regular expression"),
        ({"kind": "lasts", "motion": "turn"}, "needs least_s or most_s"),
        ({"kind": "prints_numbers", "matches": "left", "most": 1}, "has not one group"),
        ({"kind": "prints_numbers", "matches": "(", "most": 1}, "matches"),
        ({"kind": "prints_lines", "matches": []}, "matches is empty"),
        ({"kind": "prints_lines", "matches": [1]}, "matches"),
        ({"kind": "prints_lines", "matches": ["a", "("]}, "is no regular expression"),
        ({"kind": "prints_lines", "matches": ["a"], "first": "("}, "is no regular expression"),
    ],
)
def test_what_judges_nothing_is_refused(table: dict[str, Any], refusal: str) -> None:
    with pytest.raises(ScenarioError, match=refusal):
        load_goal(table, "x")


def test_who_is_asked_for_an_answer_only_where_there_is_a_question_says_so() -> None:
    late = {"from_": "pin DD1 high", "to": "pin DD2 high", "most_s": 1}
    assert not outcome("latency", [at(0)], **late).met
    assert outcome("latency", [at(0)], **late, if_any=True).met
    stops = {"after": "pin DD1 high", "within_s": 1}
    assert not outcome("stop_within", [at(0)], **stops).met
    assert outcome("stop_within", [at(0)], **stops, if_any=True).met
