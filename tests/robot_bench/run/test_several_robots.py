"""Several robots in one world, each with its own chip: they meet, and what they do is the same every time."""

import json
import pickle
import re
from collections import Counter
from pathlib import Path

import pytest

from p2os.cli.main import run as p2os
from p2os.errors import ScenarioError
from robot_bench import Bench, Scenario
from robot_bench.cli.shown.targets import run_target
from robot_bench.events.kinds import Pose, Ranges, Text, WorldChange
from robot_bench.recording.run_folder import TRACE_NAME
from robot_bench.recording.run_record import read_events
from robot_bench.recording.together import named_events, robots_in
from robot_bench.report import make
from robot_bench.report.make import Files
from robot_bench.run import run_together
from robot_bench.scenario.loading import read_scenario
from simbase.errors import UsageError
from tests.p2os.view.pages import ReadPage
from tests.robot_bench.firmware import thumb
from tests.robot_bench.firmware.hurried import hurried

#: Drives straight on at once.
BLIND = f'firmware = "{hurried("dodge")}"\nthreshold_m = 0.05\nmode = "direct"'
SHARED = 'world = "{world}"\nbody = "{body}"\nduration_s = {duration}\n'


def scenario(folder: Path, *robots: str, more: str = "", world: str = "room", body: str = "kinematic",
             duration: float = 3.0) -> Scenario:  # fmt: skip
    text = SHARED.format(world=world, body=body, duration=duration)
    path = folder / "several.toml"
    path.write_text(text + "".join(f"[[robot]]\n{robot}\n" for robot in robots) + more, encoding="utf-8")
    return read_scenario(path)


def robot(name: str, x: float, y: float, heading: float = 0, rest: str = 'firmware = "dodge.elf"') -> str:
    return f'name = "{name}"\nx_m = {x}\ny_m = {y}\nheading_deg = {heading}\n{rest}'


def hashes(bench: Bench) -> dict[str, str]:
    bench.finish()
    return {name: one.trace.sha256 for name, one in bench.robots.items()}


def two(folder: Path, mode: str = "adapter", **options: object) -> Scenario:
    rest = f'firmware = "dodge.elf"\nthreshold_m = 0.6\nmode = "{mode}"'
    return scenario(folder, robot("a", -0.8, 0, 0, rest), robot("b", 0.8, 0.1, 180, rest), **options)  # type: ignore[arg-type] # of scenario


@pytest.mark.parametrize("mode", ["adapter", "direct"])
def test_what_robots_do_depends_on_no_slice_and_not_on_how_they_were_brought_there(mode: str, tmp_path: Path) -> None:
    wanted = two(tmp_path, duration=1.5, mode=mode)
    whole = Bench.from_scenario(wanted)
    whole.run_until("1.5 s")
    pieces = Bench.together(wanted, slice_ns=313_000)["b"]
    for at in (1, 999_999, 1_000_000, 1_000_001, 700_300_000, 1_200_000_000):
        pieces.run_until(at)
        assert all(one.now >= at for one in pieces.robots.values())
        _ = pieces.pose, pieces.robots["a"].pose
    pieces.run_until("1.5 s")
    assert hashes(whole) == hashes(pieces)


def test_a_chip_runs_to_its_own_robots_deadlines_whatever_the_others_do(tmp_path: Path) -> None:
    bench = Bench.from_scenario(two(tmp_path, duration=2))
    stops: Counter[str] = Counter()
    for name, one in bench.robots.items():
        one.on_slice = lambda _at, name=name: stops.update([name])  # type: ignore[misc] # the name is bound now
    bench.run_until("1 s")
    stops.clear()
    bench.run_until("2 s")
    # A second has 10 packets each way of 9 and some bytes, 25 pings, 20 poses, and a sample of the pins each 20 ms.
    assert all(20 < count < 200 for count in stops.values()), stops


def test_a_fork_a_pickle_and_a_rewound_bench_go_on_as_the_first(tmp_path: Path) -> None:
    bench = Bench.from_scenario(two(tmp_path, duration=1.6))
    bench.run_until("1 s")
    saved, forked = pickle.dumps(bench), bench.robots["b"].fork()
    assert forked.scenario.name == "b"
    bench.run_until("1.6 s")
    first = hashes(bench)
    for other in (forked, pickle.loads(saved)):  # noqa: S301  # our own
        other.run_until("1.6 s")
        assert hashes(other) == first
    bench.robots["b"].rewind("0.5 s")
    assert 0.5e9 <= bench.now < 0.51e9
    bench.run_until("1.6 s")
    assert hashes(bench) == first


def test_a_snapshot_of_other_robots_is_refused(tmp_path: Path) -> None:
    bench = Bench.from_scenario(two(tmp_path, duration=1))
    other = Bench.from_scenario(scenario(tmp_path, robot("a", 1, 0), robot("b", -1, 0)))
    with pytest.raises(UsageError, match="another threshold_um"):
        other.restore(bench.snapshot())


@pytest.mark.parametrize("mode", ["adapter", "direct"])
def test_a_robot_that_none_of_the_others_is_near_does_and_hears_the_same_as_alone(mode: str, tmp_path: Path) -> None:
    rest = f'firmware = "{hurried("dodge")}"\nmode = "{mode}"\nthreshold_m = 0.3'
    both = Bench.from_scenario(
        scenario(tmp_path, robot("a", -0.5, -1, 0, rest), robot("b", -1.8, 0.6, 90, rest), duration=2.5)
    )
    path = tmp_path / "alone.toml"
    shared = SHARED.format(world="room", body="kinematic", duration=2.5)
    path.write_text(f"{shared}{rest}\n[start]\nx_m = -0.5\ny_m = -1\n", encoding="utf-8")
    alone = Bench.from_scenario(read_scenario(path))
    seen: dict[str, list[object]] = {"both": [], "alone": []}
    both.robots["a"].events.subscribe(seen["both"].append, Pose, Text, Ranges)
    alone.events.subscribe(seen["alone"].append, Pose, Text, Ranges)
    for bench in (both, alone):
        bench.run_until("2.5 s")
        bench.finish()
    assert seen["both"] == seen["alone"]
    assert both.robots["a"].pose.x_m > -0.4, "it has moved"
    assert both.robots["a"].record().pins == alone.record().pins


def test_a_robot_without_a_program_stands_in_the_way_and_is_named(tmp_path: Path) -> None:
    bench = Bench.from_scenario(scenario(
        tmp_path, robot("driver", -1, 0, 0, BLIND), robot("still", -0.4, 0, 90, ""),
        more='[[goal]]\nkind = "no_collision"\n', duration=3,
    ))  # fmt: skip
    assert list(bench.robots) == ["driver"]
    found = bench.expect("contact still", within="3 s")
    assert found.t > 500_000_000
    missed = bench.judge().missed
    assert len(missed) == 1
    assert missed[0].startswith("driver: no_collision: 1 collision(s): 'still' at ")


@pytest.mark.parametrize("body", ["bullet", "mujoco"])
def test_robots_push_each_other_in_the_engine_itself(body: str, tmp_path: Path) -> None:
    pytest.importorskip("pybullet" if body == "bullet" else "mujoco")
    bench = Bench.from_scenario(scenario(
        tmp_path, robot("driver", -1, 0, 0, BLIND), robot("still", -0.45, 0, 0, ""), duration=3, body=body
    ))  # fmt: skip
    moved: list[WorldChange] = []
    bench.events.subscribe(moved.append, WorldChange)
    bench.run_until("3 s")
    assert bench.record().contacts
    assert moved[-1].name == "still"
    assert float(str(moved[-1].fields["x"])) > float(str(moved[0].fields["x"])) + 0.002


def test_a_robot_hears_the_pings_of_another_and_sees_its_hull(tmp_path: Path) -> None:
    nearest: dict[bool, float] = {}
    for is_heard in (False, True):
        bench = Bench.from_scenario(two(tmp_path, duration=1.6)).robots["b"]
        pioneer = bench.parts.pioneer
        assert pioneer is not None
        assert pioneer.hears is not None
        if not is_heard:
            pioneer.hears = None
        ranges: list[Ranges] = []
        bench.events.subscribe(ranges.append, Ranges)
        bench.run_until("1.6 s")
        bench.finish()
        nearest[is_heard] = min(event.mm[3] for event in ranges) / 1000
    # 1.6 m between the axles, less where the sonar sit on the one and how far the hull of the other comes forward.
    assert 1.2 < nearest[False] < 1.3
    # Both fire at once: the way of the other's ping is half an echo's.
    assert nearest[True] == pytest.approx(nearest[False] / 2, abs=0.05)


def test_the_first_that_ends_ends_the_run_for_all(tmp_path: Path) -> None:
    more = '[[goal]]\nkind = "usart_contains"\nrobot = "b"\ntext = "motors: ready"\nends_run = "met"\n'
    bench = Bench.from_scenario(scenario(
        tmp_path, robot("a", -1, 0), robot("b", 1, 0, 0, 'firmware = "motors.elf"'), more=more
    ))  # fmt: skip
    bench.run_until("3 s")
    assert bench.now < 2_000_000_000
    assert bench.judge().met == ["b: prints 'motors: ready'"]


@pytest.mark.parametrize(("met", "asked"), [("ab", True), ("a", False), ("b", False), ("", False)])
def test_a_run_passed_where_each_of_its_robots_has(met: str, asked: bool, tmp_path: Path) -> None:
    """Whoever keeps failures alone keeps a run in which one robot fails."""
    kinds = {True: 'kind = "no_collision"', False: 'kind = "min_distance"\ndistance_m = 9'}
    goals = [f'[[goal]]\nrobot = "{name}"\n{kinds[name in met]}\n' for name in "ab"]
    several, reported = two(tmp_path, "direct", more="".join(goals), duration=0.02), list[bool]()

    def is_kept(passed: bool) -> bool:
        reported.append(passed)
        return not passed

    result = run_together(several, tmp_path / "run", is_kept=is_kept, files=Files.SUMMARY)
    assert (reported, result.passed) == ([asked], asked)
    assert [(tmp_path / "run" / name / TRACE_NAME).exists() for name in "ab"] == [not asked] * 2


def test_robots_of_three_kinds_share_a_world(tmp_path: Path) -> None:
    rest = f'firmware = "{hurried("dodge")}"\nthreshold_m = 0.6'
    bench = Bench.from_scenario(scenario(
        tmp_path, robot("pioneer", -1, 1.5, 0, rest), robot("direct", 1, 1.5, 0, f'{rest}\nmode = "direct"'),
        robot("rover", 0, -0.5, 0, 'firmware = "rover.elf"\nmodel = "rover"'), robot("still", -1.5, -1.5, 0, ""),
        world="arena", duration=2.2,
    ))  # fmt: skip
    bench.run_until("2.2 s")
    assert re.search(r"left (299|30\d) right (299|30\d) mm/s", bench.robots["rover"].text), "by its encoders"
    moved = {name: one.pose for name, one in bench.robots.items()}
    assert moved["pioneer"].x_m > -0.95
    assert moved["direct"].x_m > 1.05
    assert bench.judge().missed == []


def test_expectations_are_of_one_robot_and_time_goes_on_for_all(tmp_path: Path) -> None:
    bench = Bench.from_scenario(scenario(tmp_path, robot("a", -1, 0), robot("b", 1, 0, 0, 'firmware = "motors.elf"')))
    bench.robots["b"].expect_text("motors: ready", within="3 s")
    assert abs(bench.now - bench.robots["b"].now) < 1_000_000
    bench.robots["b"].place("post", shape="cylinder", radius_m=0.1, height_m=0.5, x_m=0.0, y_m=1.0)
    with pytest.raises(Exception, match="post"):
        bench.place("post", shape="cylinder", radius_m=0.1, height_m=0.5, x_m=0.0, y_m=1.5)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('name = "b"', 'name = "a"', "several.toml:11: [[robot]] 2: name = 'a': two robots are called so"),
        ('name = "b"', 'name = "b c"', "several.toml:11: [[robot]] 2: name = 'b c': that is no name for a robot"),
        ('name = "b"', 'name = "north wall"', "that is no name for a robot"),
        ('name = "b"', "", "several.toml:10: [[robot]] 2: key 'name' is missing"),
        ("x_m = 1", 'x_m = "1"', 'several.toml:12: [[robot]] 2: x_m = "1" is not a number of metres'),
        ("x_m = 1", "x_m = -1", "robot 2 at -1, 0 would stand in robot 1"),
        ('firmware = "motors.elf"', 'firmware = "m.elf"', "several.toml:15: firmware: there is no file 'm.elf'"),
        ('firmware = "motors.elf"', "speed = 1", "several.toml:15: [[robot]] 2: unknown key 'speed'"),
        ('firmware = "motors.elf"', 'firmware = "motors.elf"\nmodel = "p9"', "several.toml:16: no robot model"),
        ('robot = "b"', 'robot = "c"', "20: [[goal]] 2: robot = 'c': no robot with a program is called so"),
        ("least_m = 0.1", "least_m = -1", "several.toml:21: [[goal]] 2: least_m = -1 is out of range"),
        ("duration_s = 3.0", 'duration_s = 3.0\nfirmware = "dodge.elf"', "4: firmware beside [[robot]]"),
        ("duration_s = 3.0", "duration_s = 3.0\nthreshold_m = 1", "4: threshold_m beside [[robot]]"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_robot_is_told_with_its_line(old: str, new: str, said: str, tmp_path: Path) -> None:
    goals = '[[goal]]\nkind = "no_collision"\n[[goal]]\nkind = "clearance"\nrobot = "b"\nleast_m = 0.1\n'
    robots = robot("a", -1, 0), robot("b", 1, 0, 0, 'firmware = "motors.elf"')
    scenario(tmp_path, *robots, more=goals)
    path = tmp_path / "several.toml"
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(ScenarioError) as caught:
        read_scenario(path)
    assert said in str(caught.value)


def test_goals_without_a_robot_are_each_ones_and_robots_without_a_place_have_room(tmp_path: Path) -> None:
    goals = '[[goal]]\nkind = "no_collision"\n[[goal]]\nkind = "cells"\nleast = 2\nrobot = "b"\n'
    rest = 'firmware = "dodge.elf"'
    found = scenario(tmp_path, f'name = "a"\n{rest}', f'name = "b"\n{rest}', more=goals)
    kinds = [[goal.kind for goal in one.goals] for one in found.programmed]
    assert kinds == [["no_collision"], ["no_collision", "cells"]]
    one, other = (place.start for place in found.robots)
    assert (one.x_m, one.y_m) != (other.x_m, other.y_m)
    moved = found.with_options(world="arena", seed=3, duration_s=1)
    assert {(one.world, one.seed, one.duration_ns) for one in moved.programmed} == {("arena", 3, 1_000_000_000)}


def test_a_run_has_a_folder_for_each_robot_and_says_of_whom_it_speaks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("x.bin").write_bytes(thumb.SLEEP)
    more = '[[goal]]\nkind = "min_distance"\nrobot = "b"\ndistance_m = 1\n'
    rest = 'firmware = "x.bin"\nmode = "direct"'
    scenario(tmp_path, robot("a", -1, 0, 0, rest), robot("b", 1, 0, 0, rest), more=more, duration=0.2)
    assert p2os(["run", "several.toml", "--out", "there"]) == 1
    out = capsys.readouterr().out
    assert "scenario         several in room, 2 robots, body kinematic" in out
    assert "failed  b: min_distance: 0.00 m were driven" in out
    outcome = json.loads(Path("there/summary.json").read_text(encoding="utf-8"))
    assert list(outcome["robots"]) == ["a", "b"]
    assert [outcome["robots"][name]["passed"] for name in "ab"] == [True, False]
    page = ReadPage(Path("there/report.html").read_text(encoding="utf-8"))
    links = [row[0]["href"] for row in page.section("Robots")["blocks"][0]["rows"]]
    assert links == ["a/report.html", "b/report.html"]
    assert all(Path("there", link).is_file() for link in links)
    cells = [row[-1] for row in page.section("Robots")["blocks"][0]["rows"]]
    assert [cell["standing"] for cell in cells] == ["passed", "failed"]
    assert len(page.rows("a pose")) == len(page.rows("b pose")) == 5
    missed = [(row[2], row[4]) for row in page.rows("events") if row[3] == "goal missed"]
    assert [(who, words.partition(":")[0]) for who, words in missed] == [("b goals", "drives at least 1 m")]
    target = run_target("there")
    assert target is not None
    assert target.source.recording.header.verdict == page.header["verdict"] == "failed"
    summary = Path("there/summary.json").read_bytes()
    monkeypatch.setattr(make, "_plots", lambda: None)  # no plot is looked at
    Path("there/summary.json").unlink()
    assert p2os(["report", "there"]) == 0
    assert Path("there/summary.json").read_bytes() == summary.replace(b'"several"', b'"there"')  # the folder's name
    capsys.readouterr()
    assert p2os(["explain", "there", "--json"]) == 0
    explained = json.loads(capsys.readouterr().out)["robots"]
    assert [explained[name]["standing"] for name in "ab"] == ["nothing", "cause"]
    assert p2os(["explain", "there", "--firmware", "x.bin"]) == 2
    assert "p2os explain there/a --firmware FILE" in capsys.readouterr().err
    assert p2os(["run", "several.toml", "--out", "there"]) == 2, "it holds a run"
    assert "holds a run already" in capsys.readouterr().err
    assert p2os(["run", "several.toml", "--json", "--set", "robot.b.x_m=0.5", "--seeds", "0-1", "--keep", "none"]) == 1
    assert {run["trace_sha256"] for run in json.loads(capsys.readouterr().out)["runs"]} != {outcome["trace_sha256"]}
    assert p2os(["run", "several.toml", "--gdb", "0"]) == 2
    assert "for a robot alone" in capsys.readouterr().err


def test_the_events_of_all_are_one_stream_in_order_of_time_each_with_its_robot(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    two(tmp_path, duration=0.7)
    assert p2os(["run", "several.toml", "--out", "one"]) == 0
    every = list(named_events(Path("one")))
    for name in "ab":
        assert [event for robot, event in every if robot == name] == list(read_events(Path("one", name)))
    assert [event.t for _, event in every] == sorted(event.t for _, event in every)
    assert [robot for robot, event in every if event.t == 0] == sorted(robot for robot, event in every if event.t == 0)
    assert p2os(["report", "one", "--events", "all.jsonl"]) == 0
    lines = Path("all.jsonl").read_text(encoding="utf-8").splitlines()
    assert [json.loads(line)["robot"] for line in lines] == [robot for robot, _ in every]
    assert p2os(["report", "one", "--events", "all.mcap"]) == 2
    assert "a scene is of one robot" in capsys.readouterr().err
    assert p2os(["run", "several.toml", "--out", "other", "--set", "robot.b.y_m=0.2"]) == 0
    assert p2os(["diff", "one", "one"]) == 0
    assert robots_in(Path("one")) == ["a", "b"]
    assert robots_in(Path()) == [], "a folder of runs is no run of several robots"
    capsys.readouterr()
    assert p2os(["diff", "one", "other"]) == 1
    out = capsys.readouterr().out
    assert "; a: worldchange differs first" in out  # where b stands, as a has it
    reported = [line.rpartition("   ")[0] for line in out.splitlines() if line.endswith(("   one", "   other"))]
    assert all(ours != theirs for ours, theirs in zip(reported[::2], reported[1::2], strict=True)), out


def test_a_goal_may_bound_how_far_another_robot_is(tmp_path: Path) -> None:
    far = '[[goal]]\nrobot = "a"\nkind = "always"\nsignal = "apart_m"\nthing = "b"\nleast = {}\n'
    bench = Bench.from_scenario(two(tmp_path, duration=0.3, more=far.format(1.5) + far.format(1.8)))
    bench.run_until("0.3 s")
    found = bench.judge()
    assert found.met == ["a: has always apart_m from b at least 1.5"]
    nobody = Bench.from_scenario(two(tmp_path, duration=0.1, more=far.format(1.5).replace('"b"', '"c"')))
    nobody.run_until("0.1 s")
    assert nobody.judge().missed == ["a: always: apart_m was never reported"]
    assert found.missed == ["a: always: apart_m was out of bounds by 0.157 m at 0.000 s"]


@pytest.mark.parametrize("keys", ['signal = "apart_m"', 'signal = "x_m"\nthing = "b"'])
def test_a_distance_without_a_thing_and_a_thing_without_a_distance_are_refused(keys: str, tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match="apart_m and thing belong together"):
        two(tmp_path, more=f'[[goal]]\nkind = "always"\n{keys}\nleast = 1\n')


@pytest.mark.slow
def test_the_two_robots_that_ship_move_and_never_touch(tmp_path: Path) -> None:
    bench = Bench.from_scenario("two-dodge")
    bench.run_until(bench.end)
    assert bench.judge().missed == []
    others = [event for event in bench.record().changes if event.name == "east"]
    assert len(others) > 100


def test_a_verdict_of_one_robot_that_ends_the_run_cuts_the_time_of_none(tmp_path: Path) -> None:
    (tmp_path / "x.bin").write_bytes(thumb.SLEEP)
    rest = 'firmware = "x.bin"\nmode = "direct"'
    reach = '[[goal]]\nkind = "reach"\nx_m = -1\ny_m = 0\nradius_m = 1\nrobot = "a"\nends_run = "met"\n'
    for goal, untouched in ((reach, {"a", "b"}), (reach.replace('ends_run = "met"\n', ""), set[str]())):
        more = goal + '[[goal]]\nkind = "no_collision"\n'
        bench = Bench.from_scenario(
            scenario(tmp_path, robot("a", -1, 0, 0, rest), robot("b", 1, 0, 0, rest), more=more)
        )
        bench.run_until("0.2 s")
        found = bench.judge()
        assert {line.partition(":")[0] for line in found.met if "touches" in line} == untouched
        assert len(found.not_judged) == 2 - len(untouched)
