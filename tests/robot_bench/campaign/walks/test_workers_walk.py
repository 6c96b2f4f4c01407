"""Workers of campaigns in this process: what forks and workers of Dask do with work, limits and what goes wrong."""

from collections.abc import Callable, Iterator
from random import Random
from types import SimpleNamespace
from typing import Any
from unittest import mock

from robot_bench.campaign.campaign_file import RunLimits
from robot_bench.campaign.trial import Outcome, TrialVerdict
from robot_bench.campaign.workers import dask_workers, processes
from tests.tools.suite.acted import Acted, taken
from tests.tools.suite.approved import Trace, judge_of, said, tried


def outcome_of(name: str) -> Outcome:
    return Outcome(verdict=TrialVerdict.PASSED, sha256=name)


def worked(name: str) -> Callable[[Callable[[], None]], Outcome]:
    def work(look: Callable[[], None]) -> Outcome:
        look()
        if name == "bug":
            raise KeyError(name)
        return outcome_of(name)

    return work


def limits(_draw: Random) -> Iterator[str]:
    """Set limits below, at and above what the system lets a process raise again."""
    calls: list[str] = []
    for hard in (-1, 100, 300):
        acted: Any = Acted(calls, "", getrlimit=[(7, hard)] * 3)
        acted.RLIM_INFINITY = -1
        with mock.patch.object(processes, "resource", acted):
            for most in (99, 100, 200):
                processes._limit(3, most)
        yield said([hard, taken(calls)])


def served(_draw: Random) -> Iterator[str]:
    """Serve works in a fork that is none: to the last one, until it has done enough, and until nobody waits."""
    works: Any = [worked(name) for name in ("a", "b", "bug", "c")]
    for name, places, sent, parents in (
        ("all", [1, 2, 0, None], [None] * 9, [7]), ("gone", [1], [OSError("gone")], [7]),
        ("memory", [3, None], [None] * 9, [7]), ("most", [1, 1, 1, 1, None], [None] * 9, [7]),
        ("orphan", [], [None] * 9, [8]), ("cut", [EOFError()], [None] * 9, [7]), ("odd", [OSError()], [None] * 9, [7]),
    ):  # fmt: skip
        calls: list[str] = []
        cpu_s, polls = iter(n * 1.25 for n in range(99)), iter([False, True] * 20)
        pipe: Any = Acted(calls, "pipe", recv=places, send=sent)
        pipe.poll = lambda seconds, polls=polls, calls=calls: calls.append(f"poll {seconds}") or next(polls)
        acted: Any = Acted(calls, "resource")
        acted.RLIMIT_CORE, acted.RLIMIT_CPU, acted.RLIMIT_AS = 0, 1, 2
        system: Any = Acted(calls, "os", getpid=[5] * 9)
        system.getppid = lambda parents=parents: parents[0]

        def limited(work: Any, _limits: object, look: Any, name: str = name) -> tuple[object, bool]:
            try:
                return work(look), name != "memory"
            except Exception as error:  # noqa: BLE001  # as the true one does
                return repr(error), True

        with (
            mock.patch.object(processes, "signal", Acted(calls, "signal", signal=[None] * 9)) as signals,
            mock.patch.object(processes, "resource", acted), mock.patch.object(processes, "os", system),
            mock.patch.object(processes, "_cpu_s", lambda cpu_s=cpu_s: next(cpu_s)),
            mock.patch.object(processes, "_limited", limited), mock.patch.object(processes, "MOST_WORKS", 4),
            mock.patch.object(processes, "tempfile", SimpleNamespace(tempdir="")) as folder,
            mock.patch.object(processes, "gc", Acted(calls, "gc")),
        ):  # fmt: skip
            for number, what in enumerate(("SIGINT", "SIGTERM", "SIGXCPU", "SIG_IGN", "SIG_DFL", "SIGKILL")):
                setattr(signals, what, f"{number} {what}")
            processes._serve(pipe, works, 0, RunLimits(), 7, "folder")  # type: ignore[arg-type]  # as it is shown
            yield said([name, folder.tempdir, taken(calls)])


class Future:
    """A piece of work at some worker."""

    def __init__(self, status: str, result: object = None) -> None:
        self.status, self._result = status, result

    def result(self, timeout: int) -> object:
        if isinstance(self._result, Exception):
            raise self._result
        return self._result if timeout == 10 else timeout

    def exception(self, timeout: int) -> str:
        return f"died after {timeout}"


class Client:
    """What submits to workers: each work meets its statuses, one after the other."""

    def __init__(self, calls: list[str], statuses: dict[str, list[Future]], status: list[str]) -> None:
        self.dashboard_link = ""
        self._calls, self._statuses, self._kept = calls, statuses, status

    @property
    def status(self) -> str:
        return self._kept.pop(0) if self._kept else "running"

    def submit(self, action: Any, work: str, _limits: object, **named: object) -> Future:
        self._calls.append(said([action.__name__, work, named]))
        return self._statuses[work].pop(0)

    def cancel(self, futures: list[Future]) -> None:
        self._calls.append(f"cancel {[one.status for one in futures]}")

    def close(self, timeout: int) -> None:
        self._calls.append(f"close {timeout}")
        raise OSError("gone")


def by_dask(_draw: Random) -> Iterator[str]:
    """Do works by workers of Dask that die, lose results, have another version, or do nothing."""

    def done(name: str, version: str = "1") -> Future:
        return Future("finished", (outcome_of(name), 1.5, version))

    lost, died, waits = Future("lost"), Future("error"), Future("pending")
    cases: list[tuple[str, dict[str, list[Future]], list[str]]] = [
        ("all", {"a": [done("a")], "b": [done("b")]}, []),
        ("lost", {"a": [lost, Future("cancelled"), done("a")], "b": [Future("finished", OSError("x")), done("b")]}, []),
        ("died", {"a": [died] * 9, "b": [done("b")]}, []),
        ("twice", {"a": [died, lost, died, done("a")], "b": [done("b")]}, []),
        ("other", {"a": [done("a", "2")], "b": [waits]}, []),
        ("idle", {"a": [waits], "b": [done("b")]}, []),
        ("cut", {"a": [waits, done("a")], "b": [waits, done("b")]}, ["running", "closed"]),
    ]
    for name, statuses, status in cases:
        calls: list[str] = []
        now = iter(range(0, 10**6, 50))
        clock: Any = SimpleNamespace(
            monotonic=lambda now=now: next(now), sleep=lambda seconds, calls=calls: calls.append(f"sleep {seconds:g}")
        )
        workers: Any = object.__new__(dask_workers.DaskWorkers)
        workers._look, workers._limits = (lambda calls=calls: calls.append("look")), RunLimits(cpu_s=100)
        workers._address, workers._cluster = "tcp://x", Acted(calls, "cluster") if name == "all" else None
        workers._client = client = Client(calls, statuses, status)
        workers._connected = lambda patience_s, client=client, calls=calls: (
            calls.append(f"connected {patience_s:g}") or client
        )
        with (
            mock.patch.object(dask_workers, "time", clock), mock.patch.object(dask_workers, "MOST_TRIES", 3),
            mock.patch.object(dask_workers, "installed_version", return_value="1"),
        ):  # fmt: skip
            ended = tried(workers._do, ["a", "b"], lambda place, one, calls=calls: calls.append(
                said([place, one[0].failures, one[0].sha256, one[1]])))  # fmt: skip
        yield said([name, ended, workers.where, calls])
        calls.clear()
        workers.close()
        yield said(calls)


def limited_by_dask(_draw: Random) -> Iterator[str]:
    """Do work in a worker of Dask: in time, out of it, and with a bug; meet a scheduler late or never."""
    for name, seconds in (("a", [0.0, 2.0, 2.5]), ("a", [1.0, 3.0, 3.5]), ("a", [1.0, 3.001, 3.5]), ("bug", [0.0] * 3)):
        now = iter(seconds)
        with (
            mock.patch.object(dask_workers, "time", SimpleNamespace(thread_time=lambda now=now: next(now))),
            mock.patch.object(dask_workers, "installed_version", return_value="1"),
        ):
            found, cpu_s, version = dask_workers.run_limited(worked(name), RunLimits(cpu_s=2.0))  # type: ignore[arg-type]
            yield said([name, getattr(found, "failures", ()), cpu_s, version])
    for refusals, patience_s in ((0, 5), (2, 100), (9, 100), (9, 149), (9, 150)):
        calls: list[str] = []
        now = iter(range(0, 10**6, 50))
        answers = [OSError("no"), ValueError("odd")] * refusals
        distributed: Any = Acted(calls, "", Client=[*answers[:refusals], "client"])
        clock = SimpleNamespace(monotonic=lambda now=now: next(now), sleep=lambda _: None)
        workers: Any = object.__new__(dask_workers.DaskWorkers)
        workers._look, workers._address = (lambda: None), "tcp://x"
        with mock.patch.dict("sys.modules", distributed=distributed), mock.patch.object(dask_workers, "time", clock):
            yield said([refusals, patience_s, tried(workers._connected, patience_s=patience_s), taken(calls)])
    for address in ("tcp://y", None):
        calls, cluster = [], SimpleNamespace(scheduler_address="tcp://here")
        distributed = Acted(calls, "", LocalCluster=[cluster], Client=["client"])
        with mock.patch.dict("sys.modules", distributed=distributed):
            made: Any = dask_workers.DaskWorkers(address, 3, RunLimits(memory_mb=100))
        yield said([made._address, made._client, taken(calls)])
    with mock.patch.dict("sys.modules", distributed=None):
        yield tried(dask_workers.DaskWorkers, None, 3, RunLimits()).partition(" (")[0]


TRACES: dict[str, Trace] = {
    "limits": limits, "served": served, "by dask": by_dask, "limited by dask": limited_by_dask,
}  # fmt: skip
test_what_workers_do_is_what_was_approved = judge_of(__file__, TRACES)
