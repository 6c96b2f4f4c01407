"""What a scenario's [[when]] asks for is done after its event, once or each time, whatever the slices."""

import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from p2os.errors import ScenarioError
from p2os.robots.parameters import load_parameters
from robot_bench.bench import Bench
from robot_bench.events.kinds import Fault, PinEdge, WorldChange
from robot_bench.scenario.hands.timed import load_hands
from robot_bench.scenario.trigger_script import load_triggers
from tests.robot_bench.test_bench import MS, S, bench, scenario

P2DX = load_parameters("p2dx")
POST = {"name": "post", "shape": "cylinder", "radius_m": 0.05, "height_m": 0.5}


def made(*tables: dict[str, Any], mode: str = "adapter", slice_ns: int = MS) -> Bench:
    triggers = load_triggers(tables, P2DX, "x.toml")
    return bench(replace(scenario(mode), triggers=triggers), slice_ns)


def reported(one: Bench, kind: type) -> list[tuple[int, str]]:
    found: list[tuple[int, str]] = []
    one.events.subscribe(lambda event: found.append((event.t, event.op)), kind)
    one.run_until("3 s")
    one.finish()
    return found


@pytest.mark.parametrize(("after_s", "at"), [(0, 1050 * MS), (0.25, 1250 * MS)])
def test_a_thing_is_placed_and_held_after_an_edge(after_s: float, at: int) -> None:
    table = {"event": "pin PB7 high", "do": "place", "after_s": after_s, **POST, "before_sonar": 2, "distance_m": 0.4,
             "hold_s": 0.1}  # fmt: skip
    assert reported(made(table), WorldChange) == [(at, "place"), (at + 50 * MS, "move"), (at + 100 * MS, "remove")]


@pytest.mark.parametrize("do", ["place", "move", "remove"])
def test_what_is_done_to_a_thing_is_what_is_asked_for(do: str) -> None:
    (when,) = load_triggers([{"event": "contact", "do": do, **POST, "x_m": 1, "y_m": 2}], P2DX, "x.toml")
    (change,) = when.doing.changes
    place = (0.0, 0.0) if do == "remove" else (1.0, 2.0)
    assert (change.op.value, change.name, change.x_m, change.y_m) == (do, "post", *place)
    assert (change.obstacle is not None) is (do == "place")


@pytest.mark.parametrize(("every", "times"), [(False, 1), (True, 2)])
def test_it_is_done_once_or_each_time(every: bool, times: int) -> None:
    # PB7 rises at 1 s and falls at 2 s; the level that it begins with is no change.
    table = {"event": "pin PB7 changes", "do": "inject", "fault": "sonar-dead 1", "every": every}
    other = {"event": "pin PB6 changes", "do": "clear", "fault": "sonar-dead 1", "every": every}
    found = reported(made(table, other), Fault)
    assert [row for row in found if row[1] == "inject"] == [(1050 * MS, "inject"), (2050 * MS, "inject")][:times]


def test_a_fault_is_cleared_again() -> None:
    table = {"event": "usart1 sends hello", "do": "inject", "fault": "link-down", "for_s": 0.5}
    assert reported(made(table), Fault) == [(550 * MS, "inject"), (1050 * MS, "clear")]


def test_an_event_may_end_the_run_and_the_slices_change_nothing() -> None:
    traces = set()
    for slice_ns in (MS, 10 * MS, 77_777):
        one = made({"event": "pin PB7 high", "do": "end"}, slice_ns=slice_ns)
        one.run_until("3 s")
        assert one.finish() == one.end == 1050 * MS
        assert one.judge().met == ["touches nothing"], "the scenario ended the run: its time was not cut"
        traces.add(one.trace.text)
    assert len(traces) == 1


# PB7 rises at 1 s, which is told with the pose at 1.05 s.
@pytest.mark.parametrize(
    ("after_ns", "at"),
    [(0, 1050 * MS), (50 * MS - 1, 1050 * MS), (50 * MS, 1050 * MS), (50 * MS + 1, 1050 * MS + 1),
     (123_456_789, S + 123_456_789)],
)  # fmt: skip
def test_what_is_due_after_its_event_is_reported_is_done_to_the_nanosecond(after_ns: int, at: int) -> None:
    tables = [{"event": "pin PB7 high", "do": "inject", "fault": "sonar-dead 1", "after_s": after_ns / S}]
    assert reported(made(*tables), Fault) == [(at, "inject")]


@pytest.mark.parametrize(("after_ns", "at"), [(50 * MS, 1050 * MS), (50 * MS + 1, 1050 * MS + 1), (S, 2 * S)])
def test_a_run_ends_so_long_after_the_event(after_ns: int, at: int) -> None:
    one = made({"event": "pin PB7 high", "do": "end", "after_s": after_ns / S})
    one.run_until("3 s")
    assert one.end == at
    assert 0 <= one.finish() - at < 1000  # a block of the program


def test_a_bench_saved_between_event_and_action_goes_on_alike() -> None:
    table = {"event": "usart1 sends hello", "do": "inject", "fault": "sonar-dead 2", "after_s": 0.5}
    whole, first, second = made(table), made(table), made(table)
    first.run_until("0.7 s")
    second.restore(pickle.loads(pickle.dumps(first.snapshot())))  # noqa: S301 - our own bytes
    for one in (whole, second):
        one.run_until("3 s")
        one.finish()
    assert second.trace.text == whole.trace.text
    (text,) = [t for t, line in whole.record().usart if b"hello" in line]
    assert [fault.t for fault in whole.record().faults] == [text + 500 * MS]


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"do": "inject", "fault": "sonar-ded 3"}, "no fault 'sonar-ded'"),
        ({"do": "inject", "fault": "reboot", "for_s": 1.0}, "for_s, but reboot happens once"),
        ({"do": "place", **POST}, "key 'x_m' is missing"),
        ({"do": "place", **POST, "before_sonar": 99}, "before_sonar = 99, the robot has 8"),
    ],
)
def test_what_cannot_be_done_is_refused_by_the_table_that_asks_for_it(keys: dict[str, object], says: str) -> None:
    for load, table, kind in ((load_triggers, {"event": "contact"}, "when"), (load_hands, {"at_s": 1.0}, "hand")):
        with pytest.raises(ScenarioError) as caught:
            load([table | keys], P2DX, "x.toml")
        assert str(caught.value) == f"x.toml: [[{kind}]] 1: {says}"


@pytest.mark.parametrize(
    ("table", "says"),
    [
        ({"event": "pin PB99 high", "do": "end"}, "there is no wire"),
        ({"event": "contact", "do": "explode"}, "is none of place, move, remove, inject, clear, press"),
        ({"event": "contact", "do": "end", "fault": "reboot"}, "unknown key 'fault'"),
        ({"event": "contact", "do": "inject", "fault": "reboots"}, "no fault 'reboots'"),
        ({"event": "contact", "do": "place", "name": "x", "shape": "box"}, "'x_m' is missing"),
        ({"do": "end"}, "key 'event' is missing"),
    ],
)
def test_a_wrong_table_is_refused_with_its_place(table: dict[str, Any], says: str) -> None:
    with pytest.raises(ScenarioError, match=says) as refused:
        load_triggers([table], P2DX, "x.toml")
    assert "x.toml: [[when]] 1" in str(refused.value)


@pytest.mark.parametrize("chain", ["aa", "ab ba", "ab bc ca", "xa ab ba"])
def test_triggers_that_wait_for_each_other_are_refused(chain: str) -> None:
    rows = [chain] if len(chain) == 2 else chain.split()
    tables = [{"id": row[0], "after": row[1], "event": "time 1", "do": "end"} for row in rows]
    with pytest.raises(ScenarioError, match="in turn: neither happens"):
        load_triggers(tables, P2DX, "x.toml")


def test_mode_a_has_no_controller_to_break() -> None:
    with pytest.raises(ScenarioError, match="mode direct has none"):
        made({"event": "contact", "do": "inject", "fault": "reboot"}, mode="direct")


ROVER = """firmware = "rover.elf"
world = "arena"
robot = "rover"
body = "kinematic"
duration_s = 3.0
"""


def rover(text: str, tmp_path: Path) -> Bench:
    (tmp_path / "rover.toml").write_text(ROVER + text)
    return Bench.from_scenario(tmp_path / "rover.toml")


def test_a_level_is_put_on_a_wire_of_a_robot_on_own_pins_and_let_go(tmp_path: Path) -> None:
    one = rover(
        '[[when]]\nevent = "time 1"\ndo = "set_pin"\npin = "PB10"\nlevel = "low"\nfor_s = 0.2\n'
        '[[goal]]\nkind = "pin_holds"\npin = "bumper_front"\nlevel = "high"\nto_s = 0.9\n'
        '[[goal]]\nkind = "happens"\nevent = "pin PB10 low"\nmost = 1\n', tmp_path,
    )  # fmt: skip
    edges: list[tuple[int, bool]] = []
    one.events.subscribe(lambda edge: edges.append((edge.t, edge.level)), PinEdge, wires=["bumper_front"])
    one.run_until("3 s")
    assert one.level("PB10")
    one.finish()
    assert edges[-2:] == [(1050 * MS, False), (1250 * MS, True)]  # told with the pose after it
    assert len(one.judge().met) == 2


def test_volts_are_put_on_a_pin_and_read_by_its_converter(tmp_path: Path) -> None:
    # The rover reads its front sensor on PA1: 2.6 V are something at 0.1 m.
    table = '[[when]]\nevent = "time 1"\ndo = "set_volts"\npin = "PA1"\nvolts = 2.6\nevery = true\n'
    one = rover(table + table.replace("time 1", "robot moves"), tmp_path)
    one.run_until("2 s")
    assert one.chip.pin("PA1").volts is not None  # type: ignore[attr-defined]  # an emulated one
    assert "hand" in {note.who for note in one.record().events}


def test_what_is_typed_arrives_at_the_usart_and_stands_in_the_trace(monkeypatch: pytest.MonkeyPatch) -> None:
    typed: list[tuple[int, bytes]] = []
    one = made({"event": "pin PB7 high", "do": "type", "text": "go\n"})
    monkeypatch.setattr(one.chip.usart1, "receive", lambda data: typed.append((one.chip.now_ns, data)), raising=False)
    one.run_until("3 s")
    assert [data for _, data in typed] == [b"go\n"]
    assert 1050 * MS < typed[0][0] < 1060 * MS
    assert [(note.what, note.detail) for note in one.record().events if note.who == "hand"] == [
        ("type", "usart1 'go\\n'")
    ]


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"do": "press", "button": "stop-button"}, "stop-button"),
        ({"do": "drop_link"}, "link-down"),
        ({"do": "sag_battery", "volts": 11.5}, "low-battery 11.5"),
    ],
)
def test_buttons_the_link_and_the_battery_are_faults_in_words(table: dict[str, Any], words: str) -> None:
    one = made({"event": "pin PB7 high", **table, "for_s": 0.5})
    seen: list[tuple[int, str, str]] = []
    one.events.subscribe(lambda fault: seen.append((fault.t, fault.op, fault.words)), Fault)
    one.run_until("3 s")
    one.finish()
    assert seen == [(1050 * MS, "inject", words), (1550 * MS, "clear", words)]


def test_an_event_counts_only_after_that_of_another() -> None:
    # PB6 changes before and after PB7's rise; only what comes after counts.
    one = made(
        {"event": "pin PB7 high", "do": "clear", "fault": "sonar-dead 1", "id": "first", "after_s": 5},
        {"event": "pin PB7 changes", "do": "inject", "fault": "sonar-dead 1", "after": "first"},
    )
    assert [row for row in reported(one, Fault) if row[1] == "inject"] == [(2050 * MS, "inject")]


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"do": "press", "button": "horn"}, "there is no button 'horn'"),
        ({"do": "set_pin", "pin": "PD9", "level": "low"}, "there is no wire 'PD9'"),
        ({"do": "set_volts", "pin": "DD1", "volts": 1.0}, "volts are put on a pin"),
        ({"do": "end", "after": "nobody"}, "there is none with the id 'nobody'"),
        ({"do": "type"}, "text"),
    ],
)
def test_what_cannot_be_done_is_refused(table: dict[str, Any], words: str) -> None:
    with pytest.raises(ScenarioError, match=words):
        load_triggers([{"event": "contact", **table}], P2DX, "x.toml")
