"""Each goal tells in one sentence what a run lacks, and nothing when it lacks nothing."""

import math

import pytest

from robot_bench.events.kinds import PinEdge, Verdict, WorldChange
from robot_bench.events.stream import EventStream
from robot_bench.recording.run_record import RunRecord
from robot_bench.scenario.goals.judging import Goal, GoalJudge, Judgement, RunEnd, judge, load_goal
from robot_bench.scenario.goals.kinds import every_kind
from robot_bench.wires.edges import Edges
from tests.robot_bench.recording.records import S, events_in, motor_pins, pose, record, text

EIGHTH = math.pi / 4 * 1e6


def failure(kind: str, run: RunRecord, **arguments: object) -> str | None:
    goal = load_goal({"kind": kind, **arguments}, "mine.toml: [[goal]] 1")
    assert goal.wanted
    (said,) = [*(found := judged(run, goal, end_ns=run.last_ns)).missed, *([None] if found.met else [])]
    return said if said is None else said.removeprefix(f"{kind}: ")


def judged(run: RunRecord, *goals: Goal, end_ns: int, planned_ns: int = 0, can_tell_world: bool = True) -> Judgement:
    return judge(events_in(run), goals, end_ns=end_ns, planned_ns=planned_ns, can_tell_world=can_tell_world)


def test_goal_no_collision() -> None:
    touched = record(poses=[pose(), pose(S, 500_000, -250_000, collisions=2)])
    assert failure("no_collision", record(poses=[pose()])) is None
    assert failure("no_collision", touched) == "2 collision(s), the first at 1.000 s, x 0.50 m, y -0.25 m"


def test_goal_min_distance() -> None:
    run = record(poses=[pose(), pose(S, 3_000_000), pose(2 * S, 3_000_000, 4_000_000)], last_ns=60 * S)
    assert failure("min_distance", run, distance_m=7) is None
    assert failure("min_distance", run, distance_m=7.1) == "7.00 m were driven, 7.10 m are wanted"
    assert failure("min_distance", run, distance_m_a_minute=7) is None
    assert failure("min_distance", run, distance_m_a_minute=7.5) == "7.00 m were driven, 7.50 m are wanted"


def test_goal_cells() -> None:
    run = record(poses=[pose(), pose(1, 600_000), pose(2, -1)])
    assert failure("cells", run, least=3) is None
    assert failure("cells", run, least=4) == "3 cells of 0.5 m were entered, 4 are wanted"


SEQUENCE = [[0, 0], [3, 3], [-4, -4], [0, 0]]


@pytest.mark.parametrize("skew_ns", [0, 300, 999_999])
def test_goal_motor_sequence_that_is_right(skew_ns: int) -> None:
    pins = motor_pins((0, 0, 0), (3, 3, 3), (6, -4, -4), (9, 0, 0), skew_ns=skew_ns)
    assert failure("motor_sequence", record(pins=pins, last_ns=12 * S), values=SEQUENCE, held_s=3) is None


def test_goal_motor_sequence_that_is_wrong() -> None:
    pins = motor_pins((0, 0, 0), (3, 3, 2), (6, -4, -4), (9, 0, 0))
    run = record(pins=pins, last_ns=11 * S)
    assert failure("motor_sequence", run, values=SEQUENCE) == (
        "the motor pins said +0/+0 +3/+2 -4/-4 +0/+0, not +0/+0 +3/+3 -4/-4 +0/+0"
    )
    short = failure("motor_sequence", run, values=[[0, 0], [3, 2], [-4, -4], [0, 0]], held_s=3)
    assert short == "(0, 0) was held 2.000 s, 3 s are wanted"


def test_goal_usart_contains_and_usart_lacks() -> None:
    run = record(usart=text((1, "dodge: CRUISE"), (2, "dodge: TURN_LEFT")))
    assert failure("usart_contains", run, text="TURN") is None
    assert failure("usart_contains", run, text="HELP") == "'HELP' was not printed; the last line is 'dodge: TURN_LEFT'"
    assert failure("usart_lacks", run, text="HELP") is None
    assert failure("usart_lacks", run, text="TURN") == "'usart1 sends TURN' happened 1 time(s), first at 2.000 s"
    assert failure("usart_contains", record(), text="x") == "'x' was not printed; nothing was printed"


def test_goal_usart_in_order() -> None:
    run = record(usart=text((1, "a"), (2, "b"), (3, "a")))
    assert failure("usart_in_order", run, texts=["a", "b", "a"]) is None
    assert failure("usart_in_order", run, texts=["b", "a", "b"]) == (
        "'b' was not printed in its turn; the last line is 'a'"
    )


@pytest.mark.parametrize(("left", "right", "lacks"), [(9, -3, None), (10, -2, None), (7, -3, "left"), (9, -5, "right")])
def test_goal_encoder_counts_match(left: int, right: int, lacks: str | None) -> None:
    pins = {f"encoder1_s{bit}": [(0, 0)] for bit in (1, 2, 3)}
    poses = [pose(), pose(5 * S, la=round(9.4 * EIGHTH), ra=round(-2.5 * EIGHTH))]
    run = record(pins=pins, poses=poses, usart=text((5.01, f"encoders: done left={left} right={right}")))
    said = failure("encoder_counts_match", run)
    assert (said is None) if lacks is None else (said is not None and said.startswith(lacks))
    assert failure("encoder_counts_match", record()) == "no counts were printed; nothing was printed"


def placed(*numbers: int) -> list[WorldChange]:
    return [WorldChange(t=10 * n * S, op="place", name="post", fields={"sonar": n}) for n in numbers]


def test_goal_sensor_named() -> None:
    said = [(10.2, "sensor 1 on"), (11.2, "sensor 1 off"), (20.2, "sensor 2 on"), (21.2, "sensor 2 off")]
    run = record(changes=placed(1, 2), usart=text(*said), last_ns=30 * S)
    assert failure("sensor_named", run) is None
    missed = record(changes=placed(1, 2), usart=text(*said[:3]), last_ns=30 * S)
    assert (
        failure("sensor_named", missed) == "with something before sonar 2 from 20.000 s on it printed ['sensor 2 on']"
    )
    other = record(changes=placed(1), usart=text(*said, (11.5, "sensor 7 on")), last_ns=30 * S)
    assert failure("sensor_named", other) is not None
    early = record(changes=placed(1), usart=text((5, "sensor 4 on"), *said[:2]), last_ns=30 * S)
    assert failure("sensor_named", early) == "'sensor 4 on' was printed before anything was placed"
    assert failure("sensor_named", record()) == "nothing was placed before a sonar"


def test_a_real_robot_is_not_asked_what_it_cannot_tell() -> None:
    run = record(poses=[pose(collisions=1)])
    goals = (load_goal({"kind": "no_collision"}, "x"), load_goal({"kind": "min_distance", "distance_m": 1}, "x"))
    assert [line.split(":")[0] for line in judged(run, *goals, end_ns=S).missed] == ["no_collision", "min_distance"]
    reported = judged(run, *goals, end_ns=S, can_tell_world=False)
    assert [line.split(":")[0] for line in reported.missed] == ["min_distance"]


def test_what_is_met_is_reported_as_it_was_wanted() -> None:
    run = record(poses=[pose()], usart=text((1, "x")))
    goals = (load_goal({"kind": "no_collision"}, "x"), load_goal({"kind": "usart_lacks", "text": "x"}, "x"))
    found = judged(run, *goals, end_ns=9 * S, planned_ns=9 * S)
    assert found.met == ["touches nothing"]
    assert found.missed == ["usart_lacks: 'usart1 sends x' happened 1 time(s), first at 1.000 s"], (
        "what forbids is judged from the start"
    )


@pytest.mark.parametrize(
    ("kind", "arguments"),
    [
        ("min_distance", {"distance_m": 1}), ("cells", {"least": 2}), ("motor_sequence", {"values": [[1, 1]]}),
        ("usart_contains", {"text": "ready"}), ("usart_in_order", {"texts": ["ready"]}), ("encoder_counts_match", {}),
        ("sensor_named", {}), ("reach", {"x_m": 5, "y_m": 0, "radius_m": 1}),
        ("eventually", {"signal": "x_m", "least": 1}), ("happens", {"event": "contact"}),
        ("in_order", {"events": ["contact"]}), ("wave", {"pin": "PB7"}),
        ("latency", {"from": "contact", "to": "contact", "most_s": 1}),
    ],
)  # fmt: skip
def test_what_is_to_be_reached_is_missed_from_the_planned_end_on_and_not_before(
    kind: str, arguments: dict[str, object]
) -> None:
    run, goal = record(poses=[pose()], usart=text((1, "panic"))), load_goal({"kind": kind, **arguments}, "x")
    early, late = (judged(run, goal, end_ns=end_ns, planned_ns=9 * S) for end_ns in (9 * S - 1, 9 * S))
    assert (len(late.missed), late.not_judged) == (1, [])
    assert (early.missed, early.not_judged) == ([], [f"{goal.wanted}: not judged before 9 s"])


@pytest.mark.parametrize(("kind", "arguments"), [("no_collision", {}), ("usart_lacks", {"text": "panic"})])
def test_what_is_forbidden_is_missed_at_any_time(kind: str, arguments: dict[str, object]) -> None:
    run = record(poses=[pose(collisions=1)], usart=text((1, "panic")))
    early, late = (
        judged(run, load_goal({"kind": kind, **arguments}, "x"), end_ns=t, planned_ns=9 * S) for t in (2 * S, 9 * S)
    )
    assert early == late
    assert len(early.missed) == 1


#: Kind → arguments with which a robot that stands still at the origin, prints and touches nothing meets it so far.
HOLDS_SO_FAR: dict[str, dict[str, object]] = {
    "no_collision": {}, "min_distance": {"distance_m_a_minute": 1e-9}, "motor_sequence": {"values": [[1, 1]]},
    "usart_lacks": {"text": "panic"}, "encoder_counts_match": {}, "sensor_named": {},
    "avoid": {"x_m": 5, "y_m": 0, "radius_m": 1}, "stay_within": {"x_m": 0, "y_m": 0, "radius_m": 1},
    "clearance": {"least_m": 0.1}, "stop_within": {"after": "usart1 sends sensor", "within_s": 1},
    "moves_on": {"way_m": 1, "within_s": 9}, "turns_away": {"near_m": 0.5, "free_m": 0.8},
    "steers_away": {"near_m": 0.5, "free_m": 0.8, "within_s": 1}, "no_idle_turn": {"free_m": 0.8, "within_s": 1},
    "turns_long": {"row": 3, "way_m": 0.3, "least_deg": 120}, "turn_ends": {"low": ["DD4"], "within_s": 1},
    "reports_motion": {"motion": "turn", "matches": "turn", "within_s": 1},
    "backs_on_path": {"off_m": 0.1}, "smooth": {"most_mps2": 1}, "energy": {"most_j": 5},
    "hold_heading": {"heading_deg": 0, "tolerance_deg": 1}, "hold_speed": {"speed_mps": 0, "tolerance_mps": 0.1},
    "always": {"signal": "x_m", "most": 1}, "happens": {"event": "contact", "least": 0, "most": 1},
    "never": {"event": "contact"}, "latency": {"from": "usart1 sends left", "to": "usart1 sends sensor", "most_s": 2},
    "answers": {"signal": "mean", "most": 3, "within_s": 1}, "lasts": {"motion": "stand", "most_s": 9},
    "has_reason": {"motion": "turn", "needs": [["DD1"]], "within_s": 1},
    "prints_numbers": {"matches": "left=(\\d)", "most": 0}, "prints_lines": {"matches": ["left.*", "sensor.*"]},
    "pin_holds": {"pin": "PB7", "level": "high"}, "wave": {"pin": "motor1_comm2", "least_hz": 0.5},
}  # fmt: skip
#: Those that are decided once they are met: no later event can change it.
DECIDED_ONCE = {"cells", "usart_contains", "usart_in_order", "reach", "eventually", "in_order"}


def still() -> RunRecord:
    """Return two seconds of a run in which every goal of `HOLDS_SO_FAR` is held."""
    ticks = Edges()
    for tick in range(5):
        ticks.append(tick * S // 4, tick % 2)
    pins = {**motor_pins((0.5, 1, 1)), "motor1_comm2": ticks}
    return record(
        poses=[pose(), pose(1, 0, work=0), pose(2 * S, 1, work=0)], pins=pins,
        usart=text((0.5, "left=0 right=0"), (1, "sensor 1 on"), (1.5, "sensor 1 off")),
        changes=[WorldChange(t=S // 2 + 1, op="place", name="a", fields={"sonar": 1, "x": 0.0, "y": 0.0})],
    )  # fmt: skip


def test_every_kind_of_goal_is_held_so_far_or_decided_once() -> None:
    wrong = {*HOLDS_SO_FAR} ^ DECIDED_ONCE ^ {*every_kind()}
    assert wrong == set(), (
        "give it a row of HOLDS_SO_FAR, or of DECIDED_ONCE, in tests/robot_bench/scenario/goals/test_goals.py"
    )


@pytest.mark.parametrize("kind", HOLDS_SO_FAR)
def test_what_holds_so_far_is_open_where_the_time_was_cut_and_met_where_it_was_not(kind: str) -> None:
    arguments, events = HOLDS_SO_FAR[kind], [*events_in(still())]
    if kind == "motor_sequence":
        events = [event for event in events if not isinstance(event, PinEdge) or event.wire != "motor1_comm2"]
    judge = GoalJudge([load_goal({"kind": kind, **arguments}, "mine.toml: [[goal]] 1")])
    judge.feed(events)
    judge.advance_to(9 * S - 1)
    cut = judge.finish(RunEnd(9 * S - 1, 9 * S))
    assert (cut.met, cut.missed, len(cut.not_judged)) == ([], [], 1)
    assert cut.not_judged[0].endswith(": not judged before 9 s")
    for end in (RunEnd(9 * S, 9 * S), RunEnd(9 * S), RunEnd(2 * S, 9 * S, by_scenario=True)):
        assert len(judge.finish(end).met) == 1, end


@pytest.mark.parametrize("kind", HOLDS_SO_FAR)
def test_a_run_that_went_back_is_judged_at_its_new_end_alone(kind: str) -> None:
    judge = GoalJudge([load_goal({"kind": kind, **HOLDS_SO_FAR[kind]}, "mine.toml: [[goal]] 1")])
    stream, verdicts = EventStream(), list[int]()
    stream.record(lambda events, _limit: verdicts.extend(one.t for one in events if isinstance(one, Verdict)))
    judge.subscribe(stream)
    saved = judge.snapshot(), stream.snapshot()
    for end in (2 * S, None, 3 * S, None, S, None):  # None: nobody says that it ends before 4 s
        if end is not None:
            judge.end_at(RunEnd(end))
        for limit in (S, 2 * S, 3 * S, 4 * S):
            stream.release(limit)
        assert verdicts == ([] if end is None else [end])
        verdicts.clear()
        judge.restore(saved[0])
        stream.restore(saved[1])


@pytest.mark.parametrize(
    ("kind", "window"),
    [("pin_holds", "to_s"), ("wave", "to_s"), ("always", "to_s"), ("hold_speed", "to_s"), ("hold_heading", "to_s"),
     ("happens", "within_s")],
)  # fmt: skip
@pytest.mark.parametrize(("end_ns", "is_met"), [(3 * S - 1, False), (3 * S, True), (3 * S + 1, True)])
def test_what_held_to_the_end_of_its_window_is_met_in_a_run_that_was_cut_later(
    kind: str, window: str, end_ns: int, is_met: bool
) -> None:
    goal = load_goal({"kind": kind, **HOLDS_SO_FAR[kind], window: 3}, "mine.toml: [[goal]] 1")
    found = judged(still(), goal, end_ns=end_ns, planned_ns=9 * S)
    assert (found.met, found.missed) == ([goal.wanted] if is_met else [], [])
    assert bool(found.not_judged) is not is_met


@pytest.mark.parametrize(
    ("kind", "arguments"),
    [("reach", {"x_m": 5, "y_m": 0, "radius_m": 1, "within_s": 3}), ("happens", {"event": "contact", "within_s": 3}),
     ("eventually", {"signal": "x_m", "least": 1, "to_s": 3}), ("wave", {"pin": "PB7", "to_s": 3})],
)  # fmt: skip
@pytest.mark.parametrize(("end_ns", "is_missed"), [(3 * S - 1, False), (3 * S, True)])
def test_what_was_not_reached_in_its_window_is_missed_in_a_run_that_was_cut_later(
    kind: str, arguments: dict[str, object], end_ns: int, is_missed: bool
) -> None:
    goal = load_goal({"kind": kind, **arguments}, "mine.toml: [[goal]] 1")
    found = judged(still(), goal, end_ns=end_ns, planned_ns=9 * S)
    assert (len(found.missed), len(found.not_judged)) == ((1, 0) if is_missed else (0, 1))


def test_a_run_that_a_verdict_ended_was_not_cut() -> None:
    reach = {"kind": "reach", "x_m": 0, "y_m": 0, "radius_m": 1, "ends_run": "met"}
    far = {"kind": "min_distance", "distance_m": 1}
    goals = [load_goal(table, "mine.toml: [[goal]]") for table in (reach, {"kind": "no_collision"}, far)]
    found = judged(still(), *goals, end_ns=2 * S, planned_ns=9 * S)
    assert (found.met, found.missed) == ([goals[0].wanted, "touches nothing"], [])
    assert found.not_judged == ["drives at least 1 m: not judged before 9 s"]
