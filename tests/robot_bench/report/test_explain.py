"""`p2os explain`: what it says of programs with known mistakes, and that it says no more than it can show."""

import json
import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import zip_longest
from pathlib import Path

import pytest
import typer
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from bluepill_sim.core.recorder import RECORD
from robot_bench.cli import explain as verb
from robot_bench.events.kinds import Fault, Pose
from robot_bench.firmware.build import COMPILER, HERE, compiler_version
from robot_bench.recording.run_record import RunRecord, read_run
from robot_bench.recording.signals import motor_steps
from robot_bench.report.explain import findings
from robot_bench.report.explain.chain import WIDTH, ChainLink, Evidence, Explanation, Standing
from robot_bench.report.explain.contact import exchanged
from robot_bench.report.explain.explain import explain
from robot_bench.report.explain.findings import all_steady_since, held_codes, injected, let_go
from robot_bench.report.explain.probing import SAME_NS, SensorResponse, first_row, parted
from robot_bench.report.explain.replay import ChipReplay, Hold, ReplayPart
from robot_bench.report.explain.scene import Scene
from robot_bench.report.make import Files
from robot_bench.run import run_scenario
from robot_bench.scenario.loading import load_scenario
from robot_bench.wires.edges import Edges
from simbase.errors import FileError, UsageError
from simbase.timing import NS_PER_MS, NS_PER_S
from tests.robot_bench.report.seeded_bugs import LONGER, NAMED, OTHERS, UNFAIR, Bug, build, scenario_text

DODGE = HERE / "dodge.elf"
NETS = [f"DD{n}" for n in range(1, 9)]


def run_with(firmware: Path, folder: Path, text: str) -> RunRecord:
    """Run a firmware in a scenario and return its record."""
    plan = folder / "plan.toml"
    plan.write_text(text)
    run_scenario(load_scenario(str(plan), firmware=firmware), folder / "run", files=Files.SUMMARY)
    return read_run(folder / "run")


@pytest.fixture(scope="module")
def unfair(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of the shipped `dodge` that no program could have passed, its folder."""
    folder = tmp_path_factory.mktemp("unfair")
    run_with(DODGE, folder, scenario_text(UNFAIR, 8.0))
    return folder / "run"


def answers(codes: dict[int, tuple[int, int]]) -> dict[str, SensorResponse]:
    """Return answers to each sensor alone, those not named by driving slower."""
    return {
        net: SensorResponse(at=0, base=(3, 3), codes=codes.get(place, (2, 2)), noticed=1, answered=2)
        for place, net in enumerate(NETS, 1)
    }


AWAY = {3: (3, 2), 4: (2, -2), 5: (-2, 2), 6: (2, 3)}


def side(net: str) -> str:
    """Return the side that a sensor of the pin-out looks to."""
    return "left" if int(net[2:]) <= 4 else "right"


def test_answers_that_turn_away_show_no_exchange() -> None:
    assert exchanged(NETS, [answers(AWAY)] * 3, side) == ""


@pytest.mark.parametrize(("one", "other"), [(3, 6), (4, 6), (3, 5), (4, 5)])
def test_an_exchange_of_two_sensors_is_reported_by_their_answers(one: int, other: int) -> None:
    swapped = AWAY | {one: AWAY[other], other: AWAY[one]}
    assert exchanged(NETS, [answers(swapped)] * 3, side) == f"DD{one} and DD{other} exchanged"


@pytest.mark.parametrize(("times", "is_sure"), [(1, False), (2, False), (3, True), (4, True)])
def test_an_exchange_is_named_of_three_moments_that_agree(times: int, is_sure: bool) -> None:
    swapped = AWAY | {3: AWAY[6], 6: AWAY[3]}
    mirrored = {9 - place: codes for place, codes in AWAY.items()}
    assert bool(exchanged(NETS, [answers(swapped)] * times, side)) is is_sure
    assert bool(exchanged(NETS, [answers(mirrored)] * times, side)) is is_sure


def test_all_answers_mirrored_are_left_and_right_exchanged() -> None:
    mirrored = {9 - place: codes for place, codes in AWAY.items()}
    assert exchanged(NETS, [answers(mirrored)] * 3, side).startswith("left and right exchanged")


def test_answers_that_change_from_time_to_time_count_neither_way() -> None:
    toward = AWAY | {4: (-2, 2), 5: (2, -2)}
    assert exchanged(NETS, [answers(AWAY), answers(toward), answers(AWAY)], side) == ""


ROWS = st.lists(st.integers(0, 2), max_size=40)


@given(common=ROWS, ours=ROWS, theirs=ROWS, has_more=st.tuples(st.booleans(), st.booleans()))
def test_the_first_row_that_differs_is_found(
    common: list[int], ours: list[int], theirs: list[int], has_more: tuple[bool, bool]
) -> None:
    """Where the one that ends has more rows than were recorded, its end is no difference."""
    ours, theirs = common + ours, common + theirs
    one, other = (
        ReplayPart(packed_rows=b"".join(RECORD.pack(n, 0, row) for n, row in enumerate(rows)), has_more_rows=more)
        for rows, more in zip((ours, theirs), has_more, strict=True)
    )
    ends_with_more = has_more[0] if len(ours) < len(theirs) else has_more[1]
    pairs = (zip if ends_with_more else zip_longest)(ours, theirs)
    assert first_row(one, other) == next((n for n, (a, b) in enumerate(pairs) if a != b), None)
    assert [row[2] for row in one.rows] == ours
    assert all(one.row(n) == (n, 0, row) for n, row in enumerate(ours))


def pose(t: int, x_m: float) -> Pose:
    """Return a pose that looks along x."""
    return Pose(
        t=t,
        x=round(x_m * 1e6),
        y=0,
        z=0,
        heading=0,
        pitch=0,
        left=0,
        right=0,
        left_angle=0,
        right_angle=0,
        collisions=0,
    )


AHEAD, TURN = (3, 3), (2, -2)


def test_how_long_motors_had_other_codes_is_counted_by_what_they_had() -> None:
    one = [(0, AHEAD), (50, TURN), (60, AHEAD)]
    assert parted(one, one, 100) == {}
    assert parted(one, [(0, AHEAD)], 100) == {(TURN, AHEAD): 10}
    assert parted(one, [(0, AHEAD), (49, TURN), (61, AHEAD)], 100) == {(AHEAD, TURN): 2}
    assert parted([(0, TURN)], [(0, AHEAD)], 7) == {(TURN, AHEAD): 7}


@pytest.mark.parametrize(
    ("turns_ns", "says"),
    [(0, "+3, +3"), (SAME_NS - 1, "+3, +3"), (SAME_NS, "+3, +3 for 0.99 of 1.00 s"),
     (100 * NS_PER_MS, "+3, +3 for 0.90 of 1.00 s"), (501 * NS_PER_MS, "+2, -2 for 0.50 of 1.00 s")],
)  # fmt: skip
def test_the_codes_told_are_those_of_most_of_the_time_not_of_its_end(turns_ns: int, says: str) -> None:
    assert held_codes([(NS_PER_S, AHEAD), (2 * NS_PER_S - turns_ns, TURN)], 2 * NS_PER_S) == says


def test_a_point_is_in_a_cone_up_to_its_border_and_the_threshold() -> None:
    record = RunRecord(meta={"threshold_m": 0.5, "robot": {"sonar": [[0.1, 0.0, 0.0]], "sonar_cone_rad": 0.5}})
    record.pins["DD1"] = Edges([(0, 0)])
    scene = Scene(record)
    (sensor,) = scene.sensors
    here = pose(0, 0.0)
    assert scene.inside_m(sensor, here, 0.5, 0.0) > 0
    assert scene.inside_m(sensor, here, 0.61, 0.0) < 0  # 0.51 m from the sensor
    assert scene.inside_m(sensor, here, 0.4, 0.3 * 0.2) > 0  # 0.197 rad of 0.25
    assert scene.inside_m(sensor, here, 0.4, 0.3 * 0.27) < 0  # 0.264 rad


def test_a_text_is_no_wider_than_a_terminal_and_names_its_evidence() -> None:
    found = Explanation(
        failure="no_collision: " + "x " * 90, standing=Standing.CAUSE, summary="word " * 60,
        steps=(ChainLink(t=1_500_000_000, part="firmware", says="y " * 100, evidence=Evidence.CHANGED),),
        also=("z " * 80,),
    )  # fmt: skip
    lines = found.text().splitlines()
    assert max(map(len, lines)) <= WIDTH
    assert "[changed]" in found.text()
    assert found.line.startswith("cause: word")


def test_the_replay_of_a_chip_is_the_run_and_a_held_pin_changes_it(unfair: Path) -> None:
    record = read_run(unfair)
    replay = ChipReplay(DODGE, record)
    assert replay.exact_until == replay.end == record.last_ns
    since, until = 4 * NS_PER_S, 4 * NS_PER_S + NS_PER_S // 2
    assert not replay.run(since, until).edges
    assert not replay.run(since, until, [Hold(wire="DD4", level=False, since=since, until=until)]).edges
    changed = replay.run(since, until, [Hold(wire="DD4", level=True, since=since, until=until)]).edges
    assert changed
    assert 0 < changed[0][0] - since <= 11_000_000
    assert not replay.run(since, until).edges  # and looking left no trace


def test_the_replay_has_the_memory_and_the_crystal_of_the_run(tmp_path: Path) -> None:
    record = run_with(DODGE, tmp_path, 'sram = "random"\ncrystal_ppm = 900\n' + scenario_text(UNFAIR, 4.0, 1.0))
    replay = ChipReplay(DODGE, record)
    assert replay.exact_until == replay.end == record.last_ns
    record.meta["crystal_ppm"] = 0
    assert ChipReplay(DODGE, record).exact_until < record.last_ns


def test_an_input_may_be_held_at_the_other_level_edge_for_edge(unfair: Path) -> None:
    record = read_run(unfair)
    at = next(t for t in record.pins["DD4"].times if t > 4 * NS_PER_S)
    since, until = at - NS_PER_S // 2, at + NS_PER_S // 2
    was = bool(record.pins["DD4"].levels[record.pins["DD4"].times.index(at) - 1])
    replay = ChipReplay(DODGE, record)
    inverted = replay.run(since, until, [Hold(wire="DD4", level=None, since=since, until=until)]).edges
    pieces = [
        Hold(wire="DD4", level=not was, since=since, until=at),
        Hold(wire="DD4", level=was, since=at, until=until),
    ]
    assert inverted == replay.run(since, until, pieces).edges != replay.run(since, until).edges


def test_a_program_that_waits_for_its_link_is_not_taken_to_be_stuck(unfair: Path) -> None:
    record = read_run(unfair)
    failures = {"failures": ["'usart1 sends something' did not happen, from 3.100 s to 3.600 s"]}
    found = explain(replace(record, last_ns=3_600_000_000, end=failures), DODGE)
    assert found.standing is Standing.UNKNOWN, found.text()


def test_a_run_that_no_program_could_pass_is_not_explained(unfair: Path) -> None:
    found = explain(read_run(unfair), DODGE)
    assert found.standing is Standing.UNKNOWN
    assert {step.part for step in found.steps} >= {"sensor", "firmware", "motion", "contact"}
    assert any(re.search(r"motors_bits\.c:\d+ \(write_code\)", step.says) for step in found.steps)


def test_without_the_firmware_the_trace_alone_is_explained(unfair: Path) -> None:
    found = explain(read_run(unfair), None)
    assert found.standing is Standing.UNKNOWN
    assert "--firmware" in found.limits[0]
    other = explain(read_run(unfair), HERE / "motors.elf")
    assert "another file" in other.limits[0]


def test_a_trace_that_the_chip_does_not_follow_is_not_trusted(unfair: Path) -> None:
    record = read_run(unfair)
    late = record.pins["motor1_comm1"]
    late.times[1] += 1  # one nanosecond
    found = explain(record, DODGE)
    assert any("parts from the run" in limit for limit in found.limits)


def test_a_file_that_is_no_trace_is_refused(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text("duration_s = 1\n")
    with pytest.raises(FileError, match=r"mine\.toml is no trace"):
        verb.read_record(tmp_path / "mine.toml")


def test_the_verb_prints_one_json_object_and_says_by_its_exit_code_that_the_cause_is_not_known(unfair: Path) -> None:
    app = typer.Typer()
    verb.register(app)
    app.callback()(lambda: None)
    done = CliRunner().invoke(app, ["explain", str(unfair / "trace.jsonl"), "--json"])
    assert done.exit_code == 1  # the cause is not known
    found = json.loads(done.output)
    assert found["failure"].startswith("no_collision")
    assert found["standing"] == "unknown"
    assert "whether that answer was right is not known" in found["line"]


def test_who_took_the_work_at_the_rims_is_not_guessed(unfair: Path) -> None:
    record = read_run(unfair)
    spent = "energy: more than 0.1 J from 0.500 s, x 0.00 m, y 0.00 m, on"
    found = explain(replace(record, end={**record.end, "failures": [spent]}), DODGE)
    assert (found.standing, found.summary) == (Standing.UNKNOWN, "what took the work is not known")


def explained_against(run: Path, reference: Path) -> Sequence[str]:
    """Return what the verb says of a run beside another program."""
    app = typer.Typer()
    verb.register(app)
    app.callback()(lambda: None)
    done = CliRunner().invoke(app, ["explain", str(run), "--against", str(reference), "--json"])
    return [step["says"] for step in json.loads(done.output)["steps"] if reference.name in step["says"]]


def test_against_itself_a_program_does_the_same_all_the_time(unfair: Path) -> None:
    same = ["dodge.elf would have asked the motors for the same all the time"]
    assert explained_against(unfair, DODGE) == same


def test_against_another_program_the_first_command_that_differs_is_told(unfair: Path) -> None:
    (says,) = explained_against(unfair, HERE / "motors.elf")
    assert re.match(r"sets the motors to [+-]\d, [+-]\d, where motors\.elf, given the same inputs, has [+-]\d", says)


def test_against_a_run_means_against_its_program(unfair: Path, tmp_path: Path) -> None:
    (tmp_path / "trace.jsonl").write_bytes((unfair / "trace.jsonl").read_bytes())
    assert verb._reference(tmp_path) == verb.program_of(read_run(unfair)) == DODGE
    lines = (unfair / "trace.jsonl").read_text().splitlines(keepends=True)
    meta = json.loads(lines[0]) | {"firmware_sha256": "0" * 64}
    (tmp_path / "trace.jsonl").write_text(json.dumps(meta) + "\n" + "".join(lines[1:]))
    with pytest.raises(UsageError, match="is not here any more"):
        verb._reference(tmp_path)


FAULTS = [
    Fault(t=5, op="inject", words="low-battery 9.0"), Fault(t=10, op="inject", words="sonar-stuck 3 1.2"),
    Fault(t=20, op="clear", words="sonar-stuck 3 1.2"), Fault(t=30, op="inject", words="stop-button"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("at", "on", "sonar", "found"),
    [(9, "sonar", 3, None), (10, "sonar", 3, (10, "sonar-stuck 3 1.2")), (19, "sonar", 3, (10, "sonar-stuck 3 1.2")),
     (20, "sonar", 3, None), (15, "sonar", 4, None), (15, "wheels", 0, None), (29, "wheels", 0, None),
     (30, "wheels", 0, (30, "stop-button"))],
)  # fmt: skip
def test_a_fault_explains_only_what_it_acts_on_and_while_it_lasts(
    at: int, on: str, sonar: int, found: tuple[int, str] | None
) -> None:
    assert injected(RunRecord(faults=FAULTS), at, on, sonar) == found


@pytest.mark.parametrize(("after_ns", "is_over"), [(5 * NS_PER_S, False), (5 * NS_PER_S + 1, True)])
def test_a_reboot_explains_wheels_that_stand_for_as_long_as_it_takes(after_ns: int, is_over: bool) -> None:
    record = RunRecord(faults=[Fault(t=7, op="inject", words="reboot")])
    assert injected(record, 7 + after_ns, "wheels") == (None if is_over else (7, "reboot"))


@pytest.mark.parametrize(
    ("at", "says"),
    [(99, None), (100, "rst high holds the adapter in reset, since 0.000 s"),
     (200, "rst high holds the adapter in reset: it was so from 0.000 s to 0.000 s"),
     (200 + 5 * NS_PER_S - 1, "rst high holds the adapter in reset: it was so from 0.000 s to 0.000 s"),
     (200 + 5 * NS_PER_S, None)],
)  # fmt: skip
def test_a_control_wire_that_let_the_robot_go_is_told_until_it_is_connected_again(at: int, says: str | None) -> None:
    record = RunRecord(pins={"rst": Edges([(0, 0), (100, 1), (200, 0)]), "p2dx_con": Edges([(0, 1)])})
    found = let_go(record, at)
    assert (None if found is None else found[2]) == says


def test_the_codes_of_the_motors_at_many_times_go_through_the_edges_once(monkeypatch: pytest.MonkeyPatch) -> None:
    edges = [(0, 0), *((100 + step, 1 - step % 2) for step in range(400))]
    record = RunRecord(pins={"motor1_comm1": Edges(edges), "motor2_comm4": Edges([(0, 0), (150, 1)])})
    asked: list[int] = []
    monkeypatch.setattr(findings, "motor_steps", lambda pins, motor: asked.append(motor) or motor_steps(pins, motor))
    at = [99, 100, 149, 150, 151, 9999]
    assert all_steady_since(record, [*at, *range(1000)])[: len(at)] == [
        ((0, 0), 0), ((-1, 0), 100), ((0, 0), 149), ((-1, -1), 150), ((0, -1), 151), ((0, -1), 499),
    ]  # fmt: skip
    assert asked == [1, 2]
    assert all_steady_since(RunRecord(pins={}), [5]) == [((0, 0), 0)]


def test_a_passed_run_has_nothing_to_explain(unfair: Path) -> None:
    record = read_run(unfair)
    assert explain(replace(record, end={"goals_met": ["all"]}), None).standing is Standing.NOTHING


#: In `make test` every other one.
SEEDED = (*NAMED, *OTHERS)

needs_compiler = pytest.mark.skipif(compiler_version() is None, reason=f"{COMPILER} is not installed")


@needs_compiler
@pytest.mark.parametrize(
    "bug",
    [
        *(pytest.param(bug, marks=pytest.mark.slow, id=bug.name) for bug in SEEDED[::4]),
        *(
            pytest.param(bug, marks=pytest.mark.soak, id=bug.name)
            for bug in (*SEEDED[1::4], *SEEDED[2::4], *SEEDED[3::4], *LONGER)
        ),
    ],
)
def test_a_seeded_bug_is_explained_or_said_to_be_unknown_and_never_wrong(bug: Bug, tmp_path: Path) -> None:
    firmware = build(bug, tmp_path)
    record = run_with(firmware, tmp_path, scenario_text(bug.thing, bug.duration_s, bug.placed_s, bug.x_m))
    found = explain(record, firmware)
    assert (not record.end["passed"]) is bug.fails
    is_right = any(answer in found.summary for answer in bug.answers)
    assert is_right or found.standing is not Standing.CAUSE, found.text()
    assert is_right is bug.is_found, found.text()


@pytest.mark.parametrize(
    ("meta", "gives_up_s"), [({}, 15), ({"gives_up_s": None}, 15), ({"gives_up_s": 2.5}, 2.5), ({"gives_up_s": 90}, 90)]
)
def test_how_long_a_program_may_go_on_is_what_its_scenario_says(meta: dict[str, float], gives_up_s: float) -> None:
    assert Scene(RunRecord(meta=meta)).gives_up_ns == gives_up_s * NS_PER_S


@needs_compiler
@pytest.mark.soak
def test_a_program_that_may_go_on_for_longer_is_not_told_to_never_leave_what_it_does(tmp_path: Path) -> None:
    bug = next(bug for bug in LONGER if bug.name == "never-clear-again")
    firmware = build(bug, tmp_path)
    text = scenario_text(bug.thing, bug.duration_s, bug.placed_s, bug.x_m)
    for gives_up_s in (12, 40):
        folder = tmp_path / str(gives_up_s)
        folder.mkdir()
        record = run_with(firmware, folder, f"gives_up_s = {gives_up_s}\n{text}")
        said = explain(record, firmware).summary
        assert ("never leaves what it does" in said) is (gives_up_s == 12), said
