"""A second, emulated BluePill runs the adapter core and drives a virtual Pioneer for the first one."""

from dataclasses import replace
from itertools import groupby, pairwise
from pathlib import Path

import pytest

from p2os.protocol.commands import Command
from p2os.protocol.frames import Decoder, Frame
from robot_bench.bench import Bench
from robot_bench.scenario.loading import load_scenario
from robot_bench.scenario.scenario import Scenario
from simbase.timing import NS_PER_MS, NS_PER_S
from tests.adapter_fw.budgets import documented, is_as_documented
from tests.adapter_fw.builds import built
from tests.adapter_fw.second_bluepill import SecondBluePillBench


def scenario(name: str, duration_s: float) -> Scenario:
    wanted = load_scenario(name).with_options(mode="adapter", body="kinematic")
    return replace(wanted, duration_ns=int(duration_s * NS_PER_S))


def speeds(data: bytes) -> list[tuple[str, object]]:
    """Return each speed that differs from the one before it, by the names of the commands."""
    decoder, said = Decoder(), []
    decoder.receive(data, 0)
    while (item := decoder.next_item()) is not None:
        assert isinstance(item, Frame), "the line is clean"
        said.append(Command.from_frame(item))
    pairs = [[(command.name, command.argument) for command in said if command.name == name] for name in ("VEL", "RVEL")]
    return [value for pair in pairs for value, _ in groupby(pair)]


def finished(bench: Bench) -> Bench:
    bench.run_until(bench.end)
    bench.finish()
    return bench


def second_bench(elf: Path, wanted: Scenario) -> SecondBluePillBench:
    bench: SecondBluePillBench = type("Bench", (SecondBluePillBench,), {"elf": elf})(wanted)
    return bench


def check(bench: SecondBluePillBench) -> None:
    report = bench.second.report
    assert bench.second.chip.fault is None
    assert (report["losses"], report["rejected"]) == (0, 0)


def model_bytes(wanted: Scenario) -> bytes:
    bench, sent = Bench(wanted), []
    take = bench.parts.adapter.take_output
    bench.parts.adapter.take_output = lambda: [sent.append(frame) or frame for frame in take()]
    finished(bench)
    return b"".join(sent)


@pytest.mark.soak
def test_dodge_is_driven_among_obstacles_without_touching_one(tmp_path: Path) -> None:
    bench = second_bench(built("bluepill", tmp_path)[0], scenario("dodge", 5))
    bench.run_until(int(3.9 * NS_PER_S))
    assert bench.second.state == "driving"
    assert bench.second.report["sips"] >= 32
    assert bench.parts.body.state.forward_mps > 0.1
    check(finished(bench))
    assert is_as_documented(bench.second.report["longest_pass_cycles"], documented("longest pass").cortex_m)
    sent = speeds(bytes(byte for _, byte in bench.second.sent))
    assert max(value for name, value in sent if name == "VEL") > 100
    assert len({value for name, value in sent if name == "RVEL"}) > 1, "it turns"
    assert bench.parts.body.state.collisions == 0


@pytest.mark.soak
def test_motors_through_either_adapter_are_the_same_speeds_and_leave_at_9600_baud(tmp_path: Path) -> None:
    wanted = scenario("motors", 9.7)
    bench = second_bench(built("bluepill", tmp_path)[0], wanted)
    check(finished(bench))
    sent = bench.second.sent
    assert speeds(bytes(byte for _, byte in sent)) == speeds(model_bytes(wanted))
    # Nothing leaves before the boot is over, and a frame has no gap.
    first = [at for at, _ in sent[:6]]
    assert bytes(byte for _, byte in sent[:6]) == bytes.fromhex("FA FB 03 1D 00 1D"), "STOP comes first"
    spans = {later - earlier for earlier, later in pairwise(first)}
    assert all(abs(span - 10 * NS_PER_S / 9600) < 1_000 for span in spans)
    assert first[0] > 300 * NS_PER_MS
