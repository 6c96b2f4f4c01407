"""Parts of a scenario: what they sense of its world, what is told of them, and what is refused with its line."""

import itertools
import json
import math
import pickle
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from p2os.errors import ScenarioError
from p2os.pioneer.body.contract import BodyState
from robot_bench.bench import Bench, run_of
from robot_bench.direct.senses import motion_of
from robot_bench.run import parts_of, run_scenario
from robot_bench.scenario.loading import load_scenario
from simbase import user_classes
from simbase.trust import own_code
from tests.p2os.view.pages import ReadPage

PROBE = '''
from bluepill_sim.parts import Picture
from simbase.state import Stateful
from tests.p2os.view.pages import ReadPage

class Probe(Stateful):
    """Writes down every 7 ms what it senses."""
    STATE = ("due", "seen")
    def __init__(self, *, x_m: float = 0.0):
        self.due, self.seen, self.x_m = 7_000_000, [], x_m
    def plug(self, socket):
        self.socket = socket
    def next_deadline(self):
        return self.due
    def advance_to(self, now_ns):
        self.due += 7_000_000
        motion = self.socket.surroundings.motion()
        metres = self.socket.surroundings.range_m(self.x_m, 0.0, 0.0, 0.26, 4.0)
        self.seen.append((now_ns, motion.x_m, motion.forward_mps, motion.force_mps2, motion.rates_radps, metres))
        if len(self.seen) == 10:
            self.socket.note(now_ns, "tenth")
    def words(self):
        return f"{len(self.seen)} <looks>"
    def picture(self):
        return Picture((((255, 0, 0), (0, 0, 0)),))
'''
SCENARIO = """
firmware = "rover.elf"
world = "arena"
robot = "rover"
body = "kinematic"
duration_s = 0.6

[[part]]
kind = "probe.py:Probe"
name = "probe"
x_m = 0.1

[[part]]
kind = "servo"
signal = "PB0"
"""


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Path]:
    (tmp_path / "probe.py").write_text(PROBE)
    (tmp_path / "mine.toml").write_text(SCENARIO)
    yield tmp_path
    sys.modules.pop("p2os_part_probe", None)


def probe_of(bench: Bench) -> Any:
    board: Any = bench.chip
    return board.attached.by_name["probe"]


def test_a_part_senses_the_body_as_it_stood_at_its_last_step(folder: Path) -> None:
    bench = Bench(load_scenario(str(folder / "mine.toml"), trust=True))
    bench.run_until("0.6 s")
    seen = probe_of(bench).seen
    assert [row[0] for row in seen] == [7_000_000 * n for n in range(1, 86)]
    fastest = max(row[2] for row in seen)
    assert fastest > 0.02, "it drives"
    # From 7 ms to the next it has gone as far as its speed says, within what that changes by.
    for before, after in itertools.pairwise(seen):
        middle = (before[2] + after[2]) / 2 * 0.007
        assert abs(after[1] - before[1] - middle) < 0.0004
    mean = sum(row[3][0] for row in seen) / len(seen)
    assert abs(mean - seen[-1][2] / 0.595) < 0.15, "its acceleration adds up to its speed"
    assert {row[3][2] for row in seen} == {9.80665}
    nearer = seen[0][5] - seen[-1][5]
    assert seen[0][5] == 4.0 or abs(nearer - (seen[-1][1] - seen[0][1])) < 0.01
    notes = [line for line in map(json.loads, run_of(bench).recorder.lines()) if line.get("who") == "part"]
    assert [(line["t"], line["what"], line["detail"]) for line in notes] == [(70_000_000, "probe", "tenth")]


def test_it_senses_the_same_in_slices_and_from_a_pickle(folder: Path) -> None:
    scenario = load_scenario(str(folder / "mine.toml"), trust=True)
    whole = Bench(scenario)
    whole.run_until("0.3 s")
    sliced = Bench(scenario, slice_ns=333_333)
    sliced.run_until("0.1 s")
    _ = sliced.pose  # looking at it changes nothing
    other = pickle.loads(pickle.dumps(sliced))  # noqa: S301 - our own
    other.run_until("0.3 s")
    assert probe_of(other).seen == probe_of(whole).seen
    assert other.trace.sha256 == whole.trace.sha256


@pytest.mark.parametrize("kind", ["probe.py:Probe", "theirs"])
def test_a_fork_and_a_rewound_bench_go_on_as_the_first_with_a_part_of_the_users(
    kind: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if kind == "theirs":
        name = own_code(f"{folder}/probe.py:Probe")
        made = user_classes.find_class(name, what="part", group="p2os.parts", known=())
        point = SimpleNamespace(name="theirs", load=lambda: made)
        theirs = {"p2os.parts": {"theirs": point}}
        monkeypatch.setattr(user_classes, "installed_points", lambda group: theirs.get(group, {}))
    (folder / "mine.toml").write_text(SCENARIO.replace("probe.py:Probe", kind))
    bench = Bench(load_scenario(str(folder / "mine.toml"), trust=True))
    bench.run_until("0.1 s")
    forked = bench.fork()
    found = []
    for one in (bench, forked, bench):
        if one is bench and found:
            bench.rewind("0.05 s")
        one.run_until("0.3 s")
        one.finish()
        found.append((one.trace.sha256, probe_of(one).seen))
    assert found[0] == found[1] == found[2]
    assert len(found[0][1]) == 42


def test_the_report_shows_what_parts_came_to_and_their_pictures(folder: Path) -> None:
    scenario = load_scenario(str(folder / "mine.toml"), trust=True).with_options(duration_s=0.1)
    result = run_scenario(scenario, folder / "run")
    page = ReadPage(result.report.read_text(encoding="utf-8"))
    words = dict(page.table("Parts"))
    assert any("14 <looks>" in text for text in words.values())
    assert any("at +0.0 deg, commanded +0.0 deg by 0 pulses" in text for text in words.values())
    _, picture = page.section("Parts")["blocks"]
    assert (picture["title"], picture["png"][:11]) == ("probe", "iVBORw0KGgo")
    assert "<looks>" not in page.text
    assert parts_of(object()) == []  # type: ignore[arg-type] # a chip without parts


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ('name = "x"', "key 'kind' is missing"),
        ("kind = 3", "kind = 3 is not a text in quotes"),
        ('kind = "servo"\nsignal = 7', "the chip has no leg 7"),
        ('kind = "servo"\nsignal = "PA8"', "PA8 is the robot's left_pwm"),
        ('kind = "w25q16"\non = "SPI1"\nselect = "pb10"', "PB10 is the robot's bumper_front"),
        ('kind = "servos"', "there is no part 'servos'"),
        ('kind = "servo"\nleast_us = "short"', "'short' is not a whole number"),
        ('kind = "servo"\nleast_us = 1.5', "1.5 is not a whole number"),
        ('kind = "servo"\nleast_us = {}', "no number, text, flag or list"),
        ('kind = "probe.py:Prob"', "has no class 'Prob'"),
    ],
)
def test_a_part_that_cannot_be_is_refused_with_its_place(folder: Path, table: str, message: str) -> None:
    path = folder / "bad.toml"
    path.write_text(SCENARIO.split("[[part]]", maxsplit=1)[0] + "[[part]]\n" + table + "\n")
    with pytest.raises(ScenarioError, match=r"bad\.toml:\d+: \[\[part\]\] 1") as caught:
        load_scenario(str(path), trust=True)
    assert message in str(caught.value)


def test_gravity_leans_on_a_ramp_and_turning_pulls_outward() -> None:
    flat, up = BodyState(), BodyState(pitch_rad=math.radians(10), forward_mps=0.5, turn_radps=2.0)
    x, y, z = motion_of(up, up, 1_000_000).force_mps2
    assert (round(x, 4), y, round(z, 4)) == (1.7029, 1.0, 9.6577)
    assert motion_of(flat, up, 1_000_000).rates_radps == (0.0, -math.radians(10) * 1000, 2.0)
    assert motion_of(BodyState(), BodyState(forward_mps=0.001), 1_000_000).force_mps2[0] == pytest.approx(1.0)
