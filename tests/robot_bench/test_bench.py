"""A bench with a scripted chip: both modes, any slice, cut in two, the same trace."""

import json
import logging
import pickle
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from bluepill_sim.errors import BluePillError
from robot_bench.bench import Bench, run_of
from robot_bench.scenario.loading import load_scenario
from robot_bench.scenario.scenario import Scenario
from simbase.errors import UsageError
from tests.p2os.pioneer.body.bodies import each_body
from tests.robot_bench.modes_and_bodies import MODES, modes_and_bodies
from tests.robot_bench.wires.fake_chip import FakeChip, PinDrive

S, MS = 10**9, 10**6
LEFT, RIGHT = ("PB7", "PB6", "PB5"), ("PA1", "PA2", "PA3")


def drives(*steps: tuple[float, int, int]) -> list[tuple[int, str, PinDrive]]:
    """What a program does that connects at once and sets (seconds, left, right)."""
    script = [(0, "PB13", PinDrive.LOW), (10, "PB12", PinDrive.HIGH)]
    for at, *values in steps:
        for pins, value in zip((LEFT, RIGHT), values, strict=True):
            for bit, pin in enumerate(pins):
                script.append((round(at * S) + 300 * bit, pin, PinDrive.HIGH if value >> bit & 1 else PinDrive.LOW))
    return script


def scenario(mode: str, body: str = "kinematic", duration_s: float = 3.0) -> Scenario:
    return load_scenario("motors").with_options(mode=mode, body=body, duration_s=duration_s)


def bench(of: Scenario, slice_ns: int = MS, *, block_ns: int = 700, drives_at: tuple[float, float] = (1, 2)) -> Bench:
    forward, turn = drives_at
    chip = FakeChip(drives((0, 0, 0), (forward, 3, 3), (turn, -4, 1)), [(S // 2, b"hello\nworld")], block_ns=block_ns)
    return Bench(of, chip=chip, slice_ns=slice_ns)


def finished(made: Bench) -> Bench:
    made.run_until(made.scenario.duration_ns)
    made.finish()
    return made


def entries(made: Bench, kind: str) -> list[dict[str, object]]:
    return [entry for entry in map(json.loads, made.trace.text.splitlines()) if entry["k"] == kind]


#: Of what is run several times: it drives as soon as the adapter's link stands, after 0.66 s.
SOON = (0.7, 1.0)


@pytest.mark.parametrize(("mode", "body"), modes_and_bodies())
def test_the_slice_limit_changes_nothing(mode: str, body: str) -> None:
    def run(slice_ns: int) -> Bench:
        return finished(bench(scenario(mode, body, 1.2), slice_ns, drives_at=SOON))

    assert len({run(slice_ns).trace.sha256 for slice_ns in (10 * MS, MS, 100_000)}) == 1


@pytest.mark.parametrize("body", each_body("mujoco"))
def test_encoders_that_cannot_have_changed_are_not_waited_for_and_change_nothing(
    body: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def run() -> tuple[str, int]:
        made, stops = bench(scenario("direct", body)), []
        run_of(made).loop.on_slice = stops.append
        run_of(made).loop.slice_ns = S
        return finished(made).trace.sha256, len(stops)

    ahead = run()
    engine = bench(scenario("direct", body)).parts.body.step.__self__  # nobody drives by hand
    monkeypatch.setattr(type(engine), "steps_within", lambda *_: 0)
    each = run()
    assert ahead[0] == each[0]
    assert each[1] == 3 * 200
    assert ahead[1] < each[1] * 0.6, "a second of standing at a boundary included"


# The adapter samples each 2 ms, and stops for the first time after that at 302 ms.
@pytest.mark.parametrize("edge_ns", [302 * MS - 1, 302 * MS, 302 * MS + 1, 305 * MS])
def test_an_edge_that_the_chip_has_made_before_the_adapter_stopped_sampling_is_not_missed(edge_ns: int) -> None:
    # A chip of long blocks runs far ahead of a sample; an edge in between comes before the adapter waits for edges.
    def wire_of(block_ns: int) -> str:
        script = [(0, "PB13", PinDrive.LOW), (10, "PB12", PinDrive.LOW), (edge_ns, "PB12", PinDrive.HIGH)]
        made = finished(Bench(scenario("adapter", duration_s=1.0), chip=FakeChip(script, block_ns=block_ns)))
        return "".join(line for line in made.trace.text.splitlines(keepends=True) if '"k":"wire"' in line)

    assert wire_of(700)
    assert wire_of(700) == wire_of(37 * MS) == wire_of(400 * MS)


@pytest.mark.parametrize("mode", MODES)
def test_the_first_level_of_every_wire_is_what_it_is_when_all_of_time_0_was_driven(mode: str) -> None:
    made = bench(scenario(mode, duration_s=0.0001))
    made.run_until(made.scenario.duration_ns)
    levels = {net.name: int(net.level(0)) for net in made.parts.harness}
    made.finish()
    assert {net: edges[0] for net, edges in made.record().pins.items()} == {net: (0, v) for net, v in levels.items()}


@pytest.mark.parametrize(("mode", "body"), modes_and_bodies())
def test_a_bench_restored_half_way_goes_on_alike(mode: str, body: str) -> None:
    of = scenario(mode, body, 1.5)
    whole, seconds = bench(of, drives_at=SOON), []
    for cut_ns in (500_000_000 + 87_000 * 7, 1_034_567_890):  # in the midst of a text, and while it drives
        whole.run_until(cut_ns)
        second = bench(of, drives_at=SOON)
        second.restore(pickle.loads(pickle.dumps(whole.snapshot())))  # noqa: S301 - our own bytes
        seconds.append(second)
    unbroken = finished(bench(of, drives_at=SOON)).trace.text
    assert [finished(second).trace.text for second in seconds] == [unbroken] * 2
    assert entries(whole, "pose")[-1]["l"], "it drives"


@pytest.mark.parametrize("mode", MODES)
def test_the_robot_drives_as_its_pins_say(mode: str) -> None:
    made = finished(bench(scenario(mode)))
    pose = entries(made, "pose")[-1]
    assert pose["t"] == 3 * S
    # -4 and +1 steps of 62.5 mm/s, reached by then from 187.5 mm/s at 300 mm/s² or more a wheel: 1.46 s is not enough.
    assert pose["l"] < 0 < pose["r"]  # type: ignore[operator]
    assert run_of(made).recorder.distance_m > 0.1
    assert run_of(made).recorder.min_clearance_m is not None


def test_the_trace_begins_with_every_wire_and_ends_with_a_pose() -> None:
    made = finished(bench(scenario("direct", duration_s=1.02)))
    assert len([edges for edges in made.record().pins.values() if edges[0][0] == 0]) == 22
    assert [entry["t"] for entry in entries(made, "pose")][-2:] == [S, S + 20 * MS]


def test_text_is_reported_by_line_and_the_rest_at_the_end() -> None:
    made = finished(bench(scenario("direct", duration_s=1)))
    lines = [(entry["t"], bytes.fromhex(str(entry["hex"]))) for entry in entries(made, "usart")]
    assert lines == [(S // 2 + 87_000 * 5, b"hello\n"), (S, b"world")]
    assert run_of(made).recorder.last_line == "world"


def test_text_without_an_end_is_reported_in_pieces() -> None:
    made = finished(Bench(scenario("direct", duration_s=1), chip=FakeChip(text=[(0, b"x" * 100)])))
    assert [len(bytes.fromhex(str(entry["hex"]))) for entry in entries(made, "usart")] == [64, 36]


def test_a_fight_over_a_wire_is_reported() -> None:
    chip = FakeChip([*drives((0, 0, 0)), (S, "PA4", PinDrive.HIGH)])
    made = finished(Bench(scenario("direct", duration_s=1.5), chip=chip))
    fights = [entry for entry in entries(made, "event") if entry["what"] == "contention"]
    assert [(entry["t"], entry["detail"]) for entry in fights] == [(S, "DD1 is driven hard by bluepill and sensor")]


def test_the_adapter_is_reset_by_an_edge_at_its_very_time() -> None:
    chip = FakeChip([*drives((0, 0, 0)), (S + 123, "PB13", PinDrive.HIGH), (S + 456_789, "PB13", PinDrive.LOW)])
    made = finished(Bench(scenario("adapter", duration_s=2), chip=chip))
    reported = [(entry["t"], entry["what"]) for entry in entries(made, "event") if entry["who"] == "adapter"]
    assert (S + 123, "reset") in reported
    assert (S + 456_789 + 300 * MS, "booted") in reported


def test_changes_of_the_world_happen_at_their_time() -> None:
    sensors = load_scenario("sensors").with_options(mode="direct", body="kinematic", duration_s=2)
    early = replace(sensors, changes=tuple(replace(change, at=change.at - 5 * S) for change in sensors.changes[:20]))
    made = finished(Bench(early, chip=FakeChip(drives((0, 0, 0)))))
    changes = [(entry["t"], entry["op"], entry.get("sonar")) for entry in entries(made, "obstacle")]
    assert changes[0] == (S, "place", 1)
    assert changes[-1] == (S + 950 * MS, "move", None)
    near = [at for at, level in made.record().pins["DD1"] if level]
    assert near == [S + 50 * MS], "sampled at S before the post stood there, and 50 ms later"


def test_warnings_of_the_chip_stand_in_the_log() -> None:
    chip = FakeChip(drives((0, 0, 0)))
    made = Bench(scenario("direct", duration_s=1), chip=chip)
    for sink in chip.warning_sinks:
        sink("TIM2 is not modelled")
    finished(made)
    assert entries(made, "event")[0] == {
        "k": "event", "t": 0, "who": "chip", "what": "warning", "detail": "TIM2 is not modelled",
    }  # fmt: skip


@pytest.mark.parametrize("slice_ns", [100_000, MS, 10 * MS])
def test_a_run_ends_a_second_after_the_firmware_has_died(slice_ns: int) -> None:
    chip = FakeChip(drives((0, 0, 0), (0.2, 3, 3)), halts_at=S // 2)
    made = finished(Bench(scenario("direct"), chip=chip, slice_ns=slice_ns))
    assert entries(made, "pose")[-1]["t"] == S + S // 2
    assert made.finish() == S + S // 2


@pytest.mark.parametrize("slice_ns", [100_000, MS, 10 * MS])
def test_a_run_goes_on_when_the_firmware_comes_back_from_a_fault(slice_ns: int) -> None:
    chip = FakeChip(drives((0, 0, 0), (0.2, 3, 3)), halts_at=S // 2)
    chip.recovers_at = S
    made = finished(Bench(scenario("direct", duration_s=2), chip=chip, slice_ns=slice_ns))
    assert chip.fault is not None
    assert made.finish() == 2 * S


@pytest.mark.parametrize("mode", MODES)
def test_a_program_looks_at_levels_pose_and_text_of_a_run_and_changes_nothing_by_it(mode: str) -> None:
    looked, unseen = bench(scenario(mode)), finished(bench(scenario(mode)))
    looked.run_until("1.5 s")
    assert [looked.level(wire) for wire in (*LEFT, "motor1_comm1", "motor2_comm3")] == [True, True, False, True, False]
    assert looked.text == "hello\nworld"
    assert (looked.now, looked.record().last_ns) >= (1_500_000_000, 1_400_000_000)
    assert looked.pose.x_m == pytest.approx(looked.parts.body.state.x_m)
    looked.run_until("3 s")
    looked.finish()
    assert looked.trace.sha256 == unseen.trace.sha256


def test_judging_ends_a_run_once_and_leaves_open_what_a_longer_one_could_meet() -> None:
    made = bench(scenario("adapter"))
    made.run_until("1.5 s")
    judgement = made.judge()
    held = "motor_sequence: (0, 0) was held 1.000 s, 3 s are wanted"
    assert (judgement.met, judgement.missed, len(judgement.not_judged)) == ([], [held], 3)
    digest = made.trace.sha256
    assert made.judge() == judgement
    assert made.finish() == made.now
    with pytest.raises(UsageError, match=r"the run was ended at 1\.5 s"):
        made.run_until("2 s")
    assert made.trace.sha256 == digest


def test_a_bench_is_made_of_a_scenario_by_name_by_file_or_as_it_is(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(load_scenario("motors").text, encoding="utf-8")
    for one in ("motors", file, str(file), load_scenario("motors")):
        made = Bench.from_scenario(one, body="kinematic", mode="direct", seed=7, duration_s=2)
        found = made.scenario
        assert (found.body, found.mode, found.seed, made.end) == ("kinematic", "direct", 7, 2 * S)


@pytest.mark.parametrize(
    ("do", "message"),
    [
        (lambda made: made.level("PB99"), "there is no wire 'PB99'"),
        (lambda made: made.run_until("2"), "'2' has no unit"),
        (lambda made: made.from_scenario("motors", firmware="none.elf"), "there is no firmware file none.elf"),
    ],
)
def test_a_wrong_word_to_a_bench_is_refused_with_a_hint(do: Callable[[Bench], object], message: str) -> None:
    with pytest.raises((UsageError, BluePillError), match=message) as refused:
        do(bench(scenario("direct")))
    assert refused.value.hint or "such as 2s" in str(refused.value)


@pytest.mark.parametrize("wrong", [3, None, b"motors", ["motors"]])
def test_what_is_no_scenario_makes_no_bench(wrong: Any) -> None:
    with pytest.raises(UsageError, match="is no scenario") as refused:
        Bench.from_scenario(wrong)
    assert refused.value.hint == "a name, a TOML file, or a Scenario"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"firmware": 3}, "firmware = 3 is no text or path"),
        ({"mode": 3}, "mode = 3 is no text"),
        ({"adapter_core": b"model"}, "adapter_core = b'model' is no text"),
        ({"body": 3}, "body = 3 is no text"),
        ({"world": 3}, "world = 3 is no text or path"),
        ({"seed": "7"}, "seed = '7' is no whole number"),
        ({"seed": True}, "seed = True is no whole number"),
        ({"seed": 1.5}, "seed = 1.5 is no whole number"),
        ({"duration_s": "2s"}, "duration_s = '2s' is no number"),
        ({"usart_baud": 9600.5}, "usart_baud = 9600.5 is no whole number"),
    ],
)
def test_an_option_of_another_type_is_refused(options: Any, message: str) -> None:
    with pytest.raises(UsageError, match=re.escape(message)):
        scenario("direct").with_options(**options)


def test_a_bench_logs_what_its_parts_note_with_their_time(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "p2os")
    finished(bench(scenario("adapter")))
    lines = [record.getMessage() for record in caplog.records if record.name == "p2os.bench"]
    assert lines[0].startswith("adapter at 0.")
    assert any(line.startswith("pioneer at ") and line.endswith(": opened") for line in lines)
    assert not any(": command" in line for line in lines)


def test_a_bench_shows_what_the_page_says_and_nothing_else() -> None:
    page = (Path(__file__).parents[2] / "docs" / "bench.md").read_text(encoding="utf-8")
    rows = page.partition("| call | what it gives |\n|---|---|\n")[2].partition("\n\n")[0].splitlines()
    listed = {name for row in rows for name in re.findall(r"`(\w+)[^`]*`", row.split("|")[1])}
    made = bench(scenario("adapter"))
    assert {name for name in dir(made) if not name.startswith("_")} == listed
