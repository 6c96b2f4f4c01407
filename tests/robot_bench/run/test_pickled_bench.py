"""A whole bench is pickled, and goes on in another process as if nothing had been."""

import json
import os
import pickle
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import pytest

from p2os.pioneer.body.factory import installed_bodies
from robot_bench.adapter import FirmwareAdapter, is_available
from robot_bench.bench import Bench, run_of
from robot_bench.recording.trace import TraceWriter
from robot_bench.scenario.fault_script import FaultChange
from robot_bench.scenario.loading import load_scenario
from robot_bench.scenario.scenario import Scenario
from simbase.errors import FileError, UsageError
from tests.robot_bench.firmware.hurried import hurried_scenario
from tests.robot_bench.run.finished_bench import finished
from tests.robot_bench.wires.fake_chip import FakeChip
from tests.tools.forked_python import forked_python

S = 10**9
#: So long before a line of the trace its bytes are under way: half a character of 115200 bit/s, one of 9600 bit/s.
UNDER_WAY_NS = {"usart": 43_000, "wire": 1_000_000}
WAYS = [("direct", "model"), ("adapter", "model"), *([("adapter", "firmware")] if is_available() else [])]
#: Of each body, when it is cut: at its beginning, at rest, and while it drives; from 0.7 s on it does.
CUTS = {"kinematic": (0, 300_000_007, 817_654_321, 1_200_000_001), "bullet": (817_654_321,)}
#: Half a second: how long the program waits.
TICKS = 50


def scenario(way: tuple[str, str] = ("adapter", "model"), body: str = "kinematic", duration_s: float = 1.3) -> Scenario:
    mode, core = way
    return hurried_scenario("dodge", TICKS, mode=mode, adapter_core=core, body=body, duration_s=duration_s)


def loaded(data: bytes) -> Any:
    return pickle.loads(data)  # noqa: S301 - our own bytes


def in_another_process(data: bytes, folder: Path, hash_seed: str | None = None) -> Any:
    """Return what comes of pickled benches in a process of another folder, or in a new one with a hash seed."""
    environment = {} if hash_seed is None else {"PYTHONHASHSEED": hash_seed}
    done = subprocess.run(
        [forked_python() if hash_seed is None else sys.executable, "-m", "tests.robot_bench.run.finished_bench"],
        input=data, capture_output=True, cwd=folder, timeout=200, check=False,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path), **environment},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr.decode()
    return loaded(done.stdout)


def cut_runs(of: Scenario, *cuts_ns: int) -> list[tuple[Bench, tuple[str, str]]]:
    """Return what stands at each cut, and with bytes under way on each line, beside what the unbroken run gave."""
    whole = finished(Bench(of))
    last = {row["k"]: row["t"] for row in map(json.loads, whole[0].splitlines())}
    under_way = {last[kind] - before_ns for kind, before_ns in UNDER_WAY_NS.items() if kind in last}
    bench, cut = Bench(of), []
    for cut_ns in sorted(under_way | set(cuts_ns)):
        bench.run_until(cut_ns)
        again = loaded(pickle.dumps(bench))
        assert again.now == bench.now, "it goes on there, and does not begin anew"
        cut.append((again, whole))
    assert finished(bench) == whole, "pickling changes nothing"
    return cut


def go_on_in_another_process(pairs: Iterable[tuple[str, tuple[str, str]]], folder: Path) -> None:
    cut = [each for body, way in pairs for each in cut_runs(scenario(way, body), *CUTS[body])]
    found = in_another_process(pickle.dumps([bench for bench, _ in cut]), folder, "7")
    assert found == [whole for _, whole in cut]


BODIES = [body for body in CUTS if body in installed_bodies()]


@pytest.mark.slow
def test_a_bench_goes_on_in_another_process(tmp_path: Path) -> None:
    """Each way with the first body, and each other body in the first way: neither knows the other."""
    first, *others = BODIES
    go_on_in_another_process([*((first, way) for way in WAYS), *((body, WAYS[0]) for body in others)], tmp_path)


@pytest.mark.soak
def test_a_bench_of_each_body_goes_on_in_each_way(tmp_path: Path) -> None:
    go_on_in_another_process(product(BODIES, WAYS), tmp_path)


def test_a_bench_is_pickled_from_within_a_slice() -> None:
    taken: list[bytes] = []
    bench = Bench(scenario(), slice_ns=700_000)
    # In the midst of nothing, and while it drives.
    bench.on_slice = lambda now: taken.append(pickle.dumps(bench)) if now // (S * 3 // 4) > len(taken) - 1 else None
    whole = finished(bench)
    assert len(taken) == 2
    assert [finished(loaded(data)) for data in taken] == [whole] * 2


def test_two_that_go_on_from_one_pickle_are_equal_and_share_nothing() -> None:
    bench = Bench(scenario())
    bench.run_until(S)
    data = pickle.dumps(bench)
    one, other = loaded(data), loaded(data)
    one.run_until(S + S // 4)
    assert other.now == bench.now < one.now
    assert finished(other) == finished(one) == finished(bench)


def test_the_trace_file_goes_on_where_it_stood_wherever_the_process_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    bench = Bench(scenario(), trace=TraceWriter(Path("trace.jsonl")))
    bench.trace.meta({"scenario": "dodge"})
    bench.run_until(S)
    data = pickle.dumps([bench])
    assert Path("trace.jsonl").stat().st_size == bench.trace.written, "all of it is in the file by then"
    text, digest = finished(bench)
    for _ in range(2):
        assert in_another_process(data, elsewhere) == [(text, digest)]
    Path("trace.jsonl").write_text("another run's\n")
    with pytest.raises(FileError, match="is not the trace that this run has begun"):
        loaded(data)
    assert Path("trace.jsonl").read_text() == "another run's\n"


def test_a_bench_at_its_end_can_be_pickled_too(tmp_path: Path) -> None:
    bench = Bench(scenario(duration_s=0.1), trace=TraceWriter(tmp_path / "trace"))
    finished(bench)
    bench.trace.end({"passed": True})
    again = loaded(pickle.dumps(bench))
    assert again.trace.sha256 == bench.trace.sha256
    assert run_of(again).recorder.last_line == run_of(bench).recorder.last_line


def test_what_was_printed_last_is_known_after_a_restart() -> None:
    bench = Bench(scenario(("direct", "model"), duration_s=0.6))
    bench.run_until(S // 2)
    assert run_of(bench).recorder.last_line
    assert run_of(loaded(pickle.dumps(bench))).recorder.last_line == run_of(bench).recorder.last_line


def test_a_bench_that_was_restarted_is_as_one_that_was_just_built() -> None:
    """Nothing of its life before comes again: no listener, no fault, and no state to rewind to."""
    bench, seen = Bench(scenario(duration_s=0.5)), list[object]()
    begin = bench.snapshot()
    bench.events.subscribe(seen.append)
    bench.run_until("50 ms")
    bench.inject("sonar-dead 1")
    bench.run_until("60 ms")
    bench.checkpoint()
    bench.restart(begin)
    seen.clear()
    bench.run_until("80 ms")
    bench.rewind("70 ms")
    new = Bench(scenario(duration_s=0.5))
    new.run_until("70 ms")
    assert (bench.now, bench.record().faults, seen) == (new.now, [], [])
    assert finished(bench) == finished(new)


def test_a_run_can_be_made_longer_where_it_goes_on() -> None:
    bench, longer = Bench(scenario(duration_s=0.5)), Bench(scenario(duration_s=0.7))
    bench.run_until(S // 4)
    longer.restore(bench.snapshot())
    assert finished(longer) == finished(Bench(scenario(duration_s=0.7)))


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"seed": 1}, "another seed: 0 there, 1 here"),
        ({"world": "arena"}, "another world"),
        ({"body": "bullet"}, "another body: kinematic there, bullet here"),
        ({"mode": "direct"}, "another mode: adapter there, direct here"),
        ({"threshold_um": 1}, "another threshold_um"),
        ({"faults": (FaultChange(S, "fault reboot"),)}, "another faults"),
    ],
)
def test_a_snapshot_of_another_run_is_refused(changes: dict[str, Any], says: str) -> None:
    if changes.get("body") == "bullet":
        pytest.importorskip("pybullet")
    bench = Bench(scenario(duration_s=0.1))
    other = Bench(replace(scenario(duration_s=0.1), **changes))
    before = other.snapshot()
    with pytest.raises(UsageError, match=says):
        other.restore(bench.snapshot())
    assert other.snapshot() == before


def test_another_firmware_is_refused(tmp_path: Path) -> None:
    elf, other = tmp_path / "firmware.elf", load_scenario("motors").firmware
    elf.write_bytes(scenario().firmware.read_bytes())
    data = pickle.dumps(Bench(replace(scenario(), firmware=elf)))
    elf.write_bytes(other.read_bytes())
    with pytest.raises(UsageError, match="saved with another firmware"):
        loaded(data)


def test_another_version_is_refused_before_anything_else_is_read() -> None:
    make, (version, recipe) = Bench(scenario()).__reduce__()
    with pytest.raises(UsageError, match=r"another version of p2os: 0\.0\.1 there, .* here"):
        make("0.0.1", b"of another shape")
    *recipe_of, snapshot = loaded(recipe)
    del snapshot["script"]
    with pytest.raises(UsageError, match="another state of this version: not a snapshot of a bench"):
        make(version, pickle.dumps((*recipe_of, snapshot)))


@pytest.mark.skipif(not is_available(), reason="no C++17 compiler")
def test_the_state_of_another_build_of_the_adapter_is_refused() -> None:
    adapter = Bench(scenario(("adapter", "firmware"))).parts.adapter
    assert isinstance(adapter, FirmwareAdapter)
    with pytest.raises(UsageError, match="another build of the adapter's firmware"):
        adapter.restore(replace(adapter.snapshot(), build="0" * 64))
    with pytest.raises(TypeError, match="not a snapshot"):
        adapter.restore(b"")


def test_a_bench_with_a_chip_of_the_callers_says_what_to_pickle_in_its_place() -> None:
    with pytest.raises(TypeError, match=r"pickle its snapshot\(\)"):
        pickle.dumps(Bench(scenario(), chip=FakeChip()))
