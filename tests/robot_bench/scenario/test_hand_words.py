"""What hands do: in words, as tables of a file, and written down so that a file says the same."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from p2os.errors import ScenarioError
from robot_bench.cli.shown.saved_hands import scenario_text
from robot_bench.scenario.hands.timed import HAND_TABLES, hand_at
from robot_bench.scenario.hands.words import WORDS, meant_by
from robot_bench.scenario.loading import load_scenario, read_scenario
from simbase.errors import UsageError
from simbase.timing import NS_PER_S, nanos

WHERE = "mine.toml"


@pytest.mark.parametrize(
    ("words", "do", "keys"),
    [
        ("fault sonar-stuck 3 0.2", "inject", {"fault": "sonar-stuck 3 0.2"}),
        ("clear sonar-stuck 3", "clear", {"fault": "sonar-stuck 3"}),
        ("press bumper front 1", "press", {"button": "bumper front 1"}),
        ("pin DD3 low", "set_pin", {"pin": "DD3", "level": "low"}),
        ("volts PA0 2.6", "set_volts", {"pin": "PA0", "volts": 2.6}),
        ("let go PA0", "let_go", {"what": "PA0"}),
        ("type usart2 go on", "type", {"port": "usart2", "text": "go on\n"}),
        ("move box 1 to 1.5 -0.25", "move", {"name": "box 1", "x_m": 1.5, "y_m": -0.25}),
        ("move to to 1 2 heading 90", "move", {"name": "to", "x_m": 1.0, "y_m": 2.0, "heading_deg": 90.0}),
        ("place wall 1 box 2 0.1 at 1 0 heading -45.5", "place",
         {"name": "wall 1", "length_m": 2.0, "width_m": 0.1, "height_m": 0.5, "x_m": 1.0, "y_m": 0.0,
          "heading_deg": -45.5}),
        ("place post cylinder 0.1 at 1 1", "place",
         {"name": "post", "shape": "cylinder", "radius_m": 0.1, "height_m": 0.5, "x_m": 1.0, "y_m": 1.0}),
        ("remove box 1", "remove", {"name": "box 1"}),
        ("carry robot to 1 -1", "carry", {"x_m": 1.0, "y_m": -1.0}),
        ("drive -0.2 45", "drive", {"forward_mps": -0.2, "turn_dps": 45.0}),
    ],
)  # fmt: skip
def test_words_are_the_keys_of_a_table(words: str, do: str, keys: dict[str, object]) -> None:
    assert meant_by(words) == (do, keys)
    assert do in HAND_TABLES
    hand_at(5, do, keys, load_scenario("motors").parameters, WHERE)


@pytest.mark.parametrize(
    "words",
    ["", "dance", "move crate", "move crate to 1", "move crate to 1 x", "place a box 1 at 1 1", "drive 1",
     "drive 1 2 3", "let PA0", "pin PB7", "volts PA0", "volts PA0 nan", "carry crate to 1 1", "move a to 1e999 1"],
)  # fmt: skip
def test_words_that_mean_nothing_are_refused_with_how_they_are_written(words: str) -> None:
    with pytest.raises(UsageError) as raised:
        meant_by(words)
    assert raised.value.hint


@given(st.builds("{} {}".format, st.sampled_from([*WORDS, "x"]), st.text(max_size=30)))
def test_whatever_is_said_means_a_hand_or_is_refused(words: str) -> None:
    try:
        do, keys = meant_by(words)
        hand_at(0, do, keys, _PARAMETERS, WHERE)
    except (UsageError, ScenarioError):
        return
    assert do in HAND_TABLES


_PARAMETERS = load_scenario("motors").parameters


@given(st.integers(0, 1_000_000 * NS_PER_S))
def test_the_time_in_a_file_is_that_nanosecond(at: int) -> None:
    hand = hand_at(at, "let_go", {"what": "wheels"}, _PARAMETERS, WHERE)
    assert nanos(float(repr(hand.table["at_s"]))) == at


def test_what_a_hand_does_is_counted_from_its_time() -> None:
    hand = hand_at(70, "set_pin", {"pin": "DD3", "level": "high", "for_s": 2.0}, _PARAMETERS, WHERE)
    assert [(one.at, one.level) for one in hand.doing.actions] == [(70, True), (70 + 2 * NS_PER_S, None)]
    drive = hand_at(70, "drive", {"forward_mps": 0.2, "for_s": 1.0}, _PARAMETERS, WHERE)
    assert [(one.at, one.speeds) for one in drive.doing.actions] == [(70, (0.2, 0.0)), (70 + NS_PER_S, None)]


@pytest.mark.parametrize(
    ("table", "says"),
    [
        ('at_s = 1.0\ndo = "end"', "do ="), ('do = "type"\ntext = "x"', "at_s"),
        ('at_s = 99.0\ndo = "type"\ntext = "x"', "over by then"),
        ('at_s = 1.0\ndo = "drive"\nforward_mps = 3', "forward_mps"),
        ('at_s = 1.0\ndo = "let_go"\nwhat = "PZ1"', "PZ1"),
        ('at_s = 1.0\ndo = "inject"\nfault = "sonar-dead 99"', "1 to 8"),
    ],
)  # fmt: skip
def test_a_table_that_cannot_be_is_refused(table: str, says: str, tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(f'extends = "motors"\nduration_s = 9\n\n[[hand]]\n{table}\n', encoding="utf-8")
    with pytest.raises(ScenarioError) as raised:
        read_scenario(path)
    assert says in str(raised.value)


def test_a_scenario_is_written_down_as_one_that_is_the_same(tmp_path: Path) -> None:
    there, elsewhere = tmp_path / "there", tmp_path / "runs"
    there.mkdir()
    elsewhere.mkdir()
    world = there / "mine_world.toml"
    world.write_text('name = "mine"\nextent_m = [-2, -2, 2, 2]\n', encoding="utf-8")
    text = 'extends = "motors"\nworld = "mine_world.toml"\nseeds = "0-3"\n\n[start]\nx_m = 0.25\ny_m = 0.1\n\n'
    path = there / "mine.toml"
    path.write_text(text + '[[hand]]\nat_s = 0.5\ndo = "press"\nbutton = "stop-button"\n', encoding="utf-8")
    scenario = read_scenario(path, settings=[("adapter.refresh_ms", 90)])
    scenario = scenario.with_options(seed=7, duration_s=3.5, body="kinematic")
    hands = [hand_at(123_456_789, "move", {"name": "box", "x_m": 1.0, "y_m": 0.5}, scenario.parameters, WHERE)]
    saved = elsewhere / "saved.toml"
    saved.write_text(scenario_text(scenario, hands, elsewhere), encoding="utf-8")
    again = read_scenario(saved)
    for name in ("seed", "body", "duration_ns", "start", "faults", "changes", "parameters", "adapter", "mode"):
        assert getattr(again, name) == getattr(scenario, name), name
    assert Path(again.world).resolve() == world.resolve()
    assert again.firmware.resolve() == scenario.firmware.resolve()
    assert sorted(again.hands, key=lambda one: one.at) == sorted([*scenario.hands, *hands], key=lambda one: one.at)
    assert [goal.table for goal in again.goals] == [goal.table for goal in scenario.goals]
    assert again.seeds == ()


def test_a_run_without_goals_is_written_down_with_one_that_can_fail(tmp_path: Path) -> None:
    saved = tmp_path / "saved.toml"
    saved.write_text(scenario_text(load_scenario("free-drive"), [], tmp_path), encoding="utf-8")
    assert len(read_scenario(saved).goals) == 1
