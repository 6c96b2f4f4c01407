"""Workers of Dask: the same set of runs when a worker is killed and the scheduler begins anew."""

import itertools
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest

from robot_bench.campaign.campaign_file import RunLimits
from robot_bench.campaign.conduct import CampaignProgress
from robot_bench.campaign.trial import Outcome, run_trial, trial_of
from robot_bench.campaign.whole import begin, carry_out
from robot_bench.campaign.workers import dask_workers
from robot_bench.campaign.workers.dask_workers import DaskWorkers
from robot_bench.campaign.workers.processes import Processes
from simbase.errors import UsageError

pytestmark = pytest.mark.skipif(find_spec("distributed") is None, reason="the extra campaign is not installed")

FILE = """
scenario = "dodge"
search = "random"
batch = 6
near_misses = 1
[budget]
runs = 18
[cheap]
duration_s = 6
[full]
duration_s = 6
body = "kinematic"
[vary]
start.heading_deg = { from = 0, to = 350, step = 10 }
[[draw]]
kind = "post"
count = { from = 0, to = 3 }
[[goal]]
kind = "moves_on"
way_m = 0.4
within_s = 5.6
"""


class Cluster:
    """A scheduler and workers as programs of their own."""

    def __init__(self) -> None:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.port = probe.getsockname()[1]
        self.scheduler = self._begin("scheduler", "--port", str(self.port), "--no-dashboard")
        self.workers = [self.begin_worker() for _ in range(2)]

    @property
    def address(self) -> str:
        return f"tcp://127.0.0.1:{self.port}"

    def begin_worker(self) -> "subprocess.Popen[bytes]":
        return self._begin("worker", self.address, "--nthreads", "1", "--no-nanny", "--no-dashboard")

    def begin_scheduler_anew(self) -> None:
        self.scheduler.kill()
        self.scheduler.wait()
        self.scheduler = self._begin("scheduler", "--port", str(self.port), "--no-dashboard")

    def _begin(self, what: str, *words: str) -> "subprocess.Popen[bytes]":
        command = [sys.executable, "-m", "distributed.cli.dask_" + what, "--host", "127.0.0.1", *words]
        return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def close(self) -> None:
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()


@pytest.fixture
def cluster() -> Iterator[Cluster]:
    found = Cluster()
    yield found
    found.close()


def rows_of(folder: Path, workers: DaskWorkers | Processes, on_run: object = None) -> list[tuple[object, ...]]:
    ticks = itertools.count()
    file = folder / "mine.toml"
    folder.mkdir()
    file.write_text(FILE)
    campaign = begin(file, folder / "kept", firmware=None, overrides={})
    whole = carry_out(
        campaign, folder / "kept", workers, clock=lambda: next(ticks),
        on_run=on_run or (lambda _: None),  # type: ignore[arg-type]  # a listener
    )  # fmt: skip
    return [
        (row.number, row.finding, *((run.stage, run.outcome.sha256) for run in row.runs)) for row in whole.progress.rows
    ]


@pytest.mark.soak
def test_a_killed_worker_and_a_scheduler_begun_anew_change_nothing(cluster: Cluster, tmp_path: Path) -> None:
    expected = rows_of(tmp_path / "here", Processes(2, RunLimits()))
    assert {row[1].value for row in expected} >= {"passed", "confirmed"}  # type: ignore[attr-defined]  # a finding

    def on_run(progress: CampaignProgress) -> None:
        if progress.runs == 4:
            os.kill(cluster.workers[0].pid, signal.SIGKILL)
            cluster.workers.append(cluster.begin_worker())
        elif progress.runs == 11:
            cluster.begin_scheduler_anew()
            cluster.workers += [cluster.begin_worker() for _ in range(2)]

    workers = DaskWorkers(cluster.address, 0, RunLimits())
    try:
        assert rows_of(tmp_path / "there", workers, on_run) == expected
    finally:
        workers.close()


@pytest.mark.slow
def test_dask_of_this_machine_comes_to_what_a_process_comes_to() -> None:
    trial = trial_of("dodge", settings=[("body", "kinematic"), ("mode", "direct"), ("duration_s", 1)])
    workers = DaskWorkers(None, 1, RunLimits())
    found: dict[int, Outcome] = {}
    try:
        workers.run([trial], lambda place, done: found.update({place: done[0]}))
    finally:
        workers.close()
    assert found[0].sha256 == run_trial(trial).sha256


@pytest.mark.slow
def test_a_scheduler_that_is_not_there_is_reported_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dask_workers, "BEGIN_S", 0.0)
    monkeypatch.setattr(dask_workers, "ATTEMPT_S", 0.5)
    with pytest.raises(UsageError, match="no scheduler answers at tcp://"):
        DaskWorkers("tcp://127.0.0.1:9", 0, RunLimits())
