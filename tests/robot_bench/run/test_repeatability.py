"""The same run is the same trace: any slice, process, hash seed and folder, and cut in two."""

import os
import pickle
import subprocess
import sys
from pathlib import Path

import pytest

from p2os.pioneer.body.factory import installed_bodies
from robot_bench.bench import Bench
from robot_bench.scenario.scenario import Scenario
from tests.robot_bench.firmware.hurried import hurried, hurried_scenario
from tests.tools.forked_python import forked_python

S, MS, US = 10**9, 10**6, 10**3
BODIES = ["kinematic", pytest.param("bullet", marks=pytest.mark.bullet)]
MODES = ["direct", "adapter"]
SLICES_NS = (1 * MS, 13 * US)


def scenario(mode: str, body: str, duration_s: float) -> Scenario:
    return hurried_scenario("dodge", mode=mode, body=body, duration_s=duration_s)


def rest_of(of: Scenario, snapshot: bytes | None, slice_ns: int) -> str:
    bench = Bench(of, slice_ns=slice_ns)
    if snapshot is not None:
        bench.restore(pickle.loads(snapshot))  # noqa: S301 - our own bytes
    bench.run_until(of.duration_ns)
    bench.finish()
    return bench.trace.text


@pytest.mark.parametrize("mode", MODES)
def test_the_slice_limit_changes_nothing_from_power_on(mode: str) -> None:
    of = scenario(mode, "kinematic", 0.15)
    texts = {rest_of(of, None, slice_ns) for slice_ns in SLICES_NS}
    assert len(texts) == 1


@pytest.mark.slow
@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize("mode", MODES)
def test_neither_the_slice_limit_nor_a_restart_half_way_changes_anything_while_driving(mode: str, body: str) -> None:
    of = scenario(mode, body, 1.2)
    first = Bench(of)
    first.run_until(S)
    snapshot = pickle.dumps(first.snapshot())
    first.run_until(of.duration_ns)
    first.finish()
    assert {rest_of(of, snapshot, slice_ns) for slice_ns in SLICES_NS} == {first.trace.text}
    assert '"k":"pose"' in first.trace.text


#: Runs dodge with a program into folders, in each mode and on each body that its arguments name; prints the hashes.
RUNS = """
import sys
from pathlib import Path
from robot_bench.report.make import Files
from robot_bench.run import run_scenario
from robot_bench.scenario.loading import load_scenario
modes, bodies, firmware = sys.argv[1:]
for mode in modes.split():
    for body in bodies.split():
        scenario = load_scenario("dodge").with_options(mode=mode, body=body, firmware=firmware, duration_s=1.2)
        print(run_scenario(scenario, Path(f"{mode}-{body}"), files=Files.SUMMARY).outcome["trace_sha256"])
"""


@pytest.mark.slow
def test_process_hash_seed_and_folder_change_nothing(tmp_path: Path) -> None:
    hashes, program = [], hurried("dodge")
    bodies = [body for body in ("kinematic", "bullet") if body in installed_bodies()]
    other = {"PYTHONHASHSEED": "1"} if os.environ.get("PYTHONHASHSEED") != "1" else {"PYTHONHASHSEED": "2"}
    for name, python, environment in (("here", forked_python(), {}), ("there", sys.executable, other)):
        folder = tmp_path / name
        folder.mkdir()
        done = subprocess.run(
            [python, "-c", RUNS, " ".join(MODES), " ".join(bodies), program], cwd=folder,
            env={**os.environ, **environment}, capture_output=True, text=True, check=False, timeout=300,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        hashes.append(done.stdout.splitlines())
    assert hashes[0] == hashes[1]
    assert len({*hashes[0]}) == len(MODES) * len(bodies)
