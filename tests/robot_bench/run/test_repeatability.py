"""The same run is the same trace: any slice, process, hash seed and folder, and cut in two."""

import json
import os
import pickle
import subprocess
import sys
from pathlib import Path

import pytest

from robot_bench.bench import Bench
from robot_bench.scenario.scenario import Scenario, load_scenario

S, MS, US = 10**9, 10**6, 10**3
BODIES = ["kinematic", pytest.param("bullet", marks=pytest.mark.bullet)]
MODES = ["direct", "adapter"]
SLICES_NS = (1 * MS, 100 * US, 7 * US)


def scenario(mode: str, body: str, duration_s: float) -> Scenario:
    return load_scenario("dodge").with_options(mode=mode, body=body, duration_s=duration_s)


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
def test_the_slice_limit_changes_nothing_while_driving(mode: str, body: str) -> None:
    of = scenario(mode, body, 4.4)
    first = Bench(of)
    first.run_until(4 * S)
    snapshot = pickle.dumps(first.snapshot())
    texts = {rest_of(of, snapshot, slice_ns) for slice_ns in SLICES_NS}
    assert len(texts) == 1
    assert '"k":"pose"' in texts.pop()


@pytest.mark.slow
@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("cut_ns", [3_217_654_321, 5 * S])
def test_a_run_restored_half_way_has_the_same_rest(mode: str, body: str, cut_ns: int) -> None:
    of = scenario(mode, body, 7.0)
    first = Bench(of)
    first.run_until(cut_ns)
    snapshot = pickle.dumps(first.snapshot())
    first.run_until(of.duration_ns)
    first.finish()
    assert rest_of(of, snapshot, MS) == first.trace.text


@pytest.mark.slow
@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize("mode", MODES)
def test_process_hash_seed_and_folder_change_nothing(mode: str, body: str, tmp_path: Path) -> None:
    outcomes = []
    for seed in ("1", "2"):
        folder = tmp_path / seed
        folder.mkdir()
        words = ["run", "dodge", "--mode", mode, "--body", body, "--duration", "5s", "--out", "there", "--json"]
        done = subprocess.run(
            [sys.executable, "-m", "p2os", *words],
            cwd=folder, env={**os.environ, "PYTHONHASHSEED": seed}, capture_output=True, text=True, check=False,
            timeout=300,
        )  # fmt: skip
        assert done.returncode in {0, 1}, done.stderr
        outcomes.append(json.loads(done.stdout))
    assert outcomes[0]["trace_sha256"] == outcomes[1]["trace_sha256"]
    assert outcomes[0]["trace_sha256"]
