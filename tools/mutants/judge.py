"""Whether tests notice a mutant: they are run over a copy of the tree that holds it, within bounds.

Invariant: only what a test says of the sound program, too, counts: one that fails there is left out, and a time-out is
noticed only where the sound program passes well under the limit, right after it.

Time is that of a processor, which says the same on a machine that does other things; the clock bounds what waits.
"""

import contextlib
import json
import os
import select
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from itertools import pairwise
from pathlib import Path
from typing import IO

from tools.hostile.kernel import memory_kb
from tools.mutants.forks import PytestRun
from tools.mutants.languages import python_source
from tools.mutants.mutant import SourceMutant
from tools.mutants.natives import Natives
from tools.mutants.outcome import BUDGET_S, OUTCOME_FILE, TEST_S, RunReport, clear, reported_by
from tools.mutants.tree import Tree

#: Seconds of a processor that each process of a mutant's tests has, and when no other test begins.
LIMIT_S, BEGIN_S = 20, 12.0
#: Which files of tests are collected together, by their places: to collect one takes as long as some tests. Of how many
#: the long tests are asked.
TOGETHER, LONG_FILES = (0, 2, 6, 100), 5
#: What one test has, a long one so many times as much.
TEST_LIMIT_S, LONGER = 6.0, 2
#: What it may take of that on the sound program where a time-out is to be noticed.
SOUND_PART = 0.5
#: The same bound by the clock, for what waits.
CLOCK_LIMIT_S = 180.0
#: kB of memory, and bytes of a file, that a mutant may fill: some loop and keep what they make.
MOST_KB, FILE_BYTES = 3 << 20, 512 << 20
#: How often memory is looked at; no limit of the kernel's bounds it, since a sanitizer reserves more than there is.
LOOK_S = 0.25
PYTEST = (
    "-x", "-n", "0", "-p", "no:cacheprovider", "-p", "tools.mutants.outcome", "--hypothesis-profile", "unshrunk",
    "--tb", "no",
)  # fmt: skip
#: Which tests are asked first, and which when these have not noticed anything.
SHORT, LONG = "not slow and not soak and not hardware", "slow and not soak and not hardware"
#: How a run ends that has no tests, and how one that was at a limit of the kernel's.
_NO_TESTS, _LIMITS = 5, {-signal.SIGXCPU, -signal.SIGPROF, -signal.SIGKILL}
#: Tests that are left out of one question, for they fail without a change, before it is given up.
_MOST_LEFT_OUT = 20


class MutantStatus(Enum):
    """What became of a mutant."""

    #: A test fails.
    NOTICED = "noticed"
    #: A test does not end in time, and on the sound program it does in half of it.
    TIMED_OUT = "timed out"
    #: Every test passes.
    SURVIVED = "survived"
    #: A test does not end in time, but on the sound program it is slow as well, and no other one fails.
    UNDECIDED = "undecided"
    #: There is no test that is near.
    UNTESTED = "untested"
    #: It is the same program, or none: drawn again.
    NO_MUTANT = "no mutant"


#: What counts as noticed, of all that counts.
NOTICED = (MutantStatus.NOTICED, MutantStatus.TIMED_OUT)


@dataclass(frozen=True, slots=True, kw_only=True)
class MutantOutcome:
    """A verdict, by which test, in how many seconds."""

    verdict: MutantStatus
    by: str = ""
    seconds: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class _Run:
    code: int | None  # None: ended for its time
    seconds: float
    report: RunReport

    @property
    def test(self) -> str:
        """What has failed, or what it was at when it was ended."""
        return self.report.failed[0] if self.report.failed else self.report.last


class Judge:
    """Judges mutants in one copy of the tree, one after the other.

    Args:
        tree: The copy.
        scratch: A folder for what tests and compilers write, the home folder of the tests.
        natives: The libraries of this copy.
        sound: By test, the seconds of a processor in which it passes on the sound program, or none where it does not;
            other judges of the same tree may share it.
        lasted: Is told how long files of tests take.
    """

    def __init__(
        self, tree: Tree, scratch: Path, natives: Natives, sound: dict[str, float | None] | None = None,
        lasted: Callable[[Mapping[str, float]], None] = lambda _: None,
    ) -> None:  # fmt: skip
        self._tree, self._scratch, self._natives = tree, scratch, natives
        self._sound = {} if sound is None else sound
        self._lasted = lasted
        self._server: subprocess.Popen[bytes] | None = None
        self._running = 0
        self._lock, self._is_over = threading.Lock(), False

    def judged(self, mutant: SourceMutant, files: Sequence[str]) -> MutantOutcome:
        """Return whether files of tests notice a mutant, asked in this order."""
        if not files:
            return MutantOutcome(verdict=MutantStatus.UNTESTED)
        changed = self._changed(mutant)
        if changed is None:
            return MutantOutcome(verdict=MutantStatus.NO_MUTANT)
        found, seconds = MutantOutcome(verdict=MutantStatus.UNTESTED), 0.0
        short = [(files[begin:end], SHORT) for begin, end in pairwise(TOGETHER)]
        for asked, marked in (*short, (files[:LONG_FILES], LONG)):
            budget_s = BEGIN_S * (1 if marked is SHORT else LONGER) - seconds
            if not asked or budget_s < 0.0:
                continue
            one = self._asked(changed, asked, marked, budget_s)
            seconds += one.seconds
            if one.verdict in NOTICED:
                found = one
                break
            if one.verdict is not MutantStatus.UNTESTED and found.verdict is not MutantStatus.UNDECIDED:
                found = one
        return replace(found, seconds=seconds)

    def _asked(self, changed: dict[str, bytes], files: Sequence[str], marked: str, budget_s: float) -> MutantOutcome:
        """Return what some files of tests say, with what fails or is too slow without a change left out."""
        seconds, slow = 0.0, list[str]()
        for _ in range(_MOST_LEFT_OUT):
            with self._tree.holding(changed):
                run = self._run(files, marked, *self._left_out(files, slow), budget_s=budget_s)
            seconds += run.seconds
            if marked is SHORT:
                self._lasted(run.report.files)
            if run.code in {0, _NO_TESTS} or run.report.is_stopped:
                verdict = MutantStatus.UNTESTED if run.code == _NO_TESTS else MutantStatus.SURVIVED
                verdict = MutantStatus.UNDECIDED if slow else verdict
                return MutantOutcome(verdict=verdict, by=slow[0] if slow else "", seconds=seconds)
            test = run.test or files[0]
            sound_s = self.sound_s(test)
            if sound_s is None:
                print(f"\rmutants: left out, for it fails without a change: {test}", file=sys.stderr)
            elif run.code is not None:
                return MutantOutcome(verdict=MutantStatus.NOTICED, by=test, seconds=seconds)
            elif sound_s <= _limit_s(marked) * SOUND_PART:
                return MutantOutcome(verdict=MutantStatus.TIMED_OUT, by=test, seconds=seconds)
            else:
                slow.append(test)
        return MutantOutcome(verdict=MutantStatus.UNDECIDED, seconds=seconds)

    def sound_s(self, test: str) -> float | None:
        """Return the seconds in which a test passes on the sound program, or nothing; of a file, whether it is read."""
        if test not in self._sound:
            run = self._run([test], f"({SHORT}) or ({LONG})", *([] if "::" in test else ["--collect-only"]))
            self._sound[test] = run.seconds if run.code == 0 else None
        return self._sound[test]

    def _left_out(self, files: Sequence[str], slow: Sequence[str]) -> list[str]:
        passes = [*self._sound.items()]
        left = [test for test, seconds in passes if seconds is None and test.partition("::")[0] in files]
        left += slow
        return [word for test in left for word in ("--deselect", test)]

    def end(self) -> None:
        """End what runs, from another thread, and begin nothing any more."""
        with self._lock:
            self._is_over = True
            self._kill()
            if self._server is not None:
                self._server.kill()

    def _changed(self, mutant: SourceMutant) -> dict[str, bytes] | None:
        """Return the files that a mutant changes; None where the compiler makes no other program of it."""
        changed = {mutant.path: mutant.text}
        if mutant.path.endswith(".py"):
            return changed
        with self._tree.holding(changed):
            built = self._natives.built_with(mutant)
        return changed | built if built else None

    def _run(self, tests: Sequence[str], marked: str, *options: str, budget_s: float = BEGIN_S) -> _Run:
        reported = self._scratch / "reported.json"
        clear(reported)
        bounds = {BUDGET_S: str(budget_s), TEST_S: str(_limit_s(marked))}
        asked = PytestRun(
            words=(*PYTEST, "-m", marked, *options, *tests), environment={OUTCOME_FILE: str(reported)} | bounds,
            cpu_s=LIMIT_S, file_bytes=FILE_BYTES,
        )  # fmt: skip
        with self._lock:
            if self._is_over:
                raise InterruptedError
            server = self._server = self._served()
            _written(server, asked.line)
            self._running = int(_line(server))
        is_in_time = self._waits(server)
        with self._lock:
            self._kill()
        ended = json.loads(_line(server))
        if self._is_over:
            raise InterruptedError
        code = ended["code"] if is_in_time and ended["code"] not in _LIMITS else None
        return _Run(code=code, seconds=ended["seconds"], report=reported_by(reported))

    def _served(self) -> "subprocess.Popen[bytes]":
        """Return the process that runs are forked from."""
        if self._server is not None and self._server.poll() is None:
            return self._server
        return subprocess.Popen(
            [sys.executable, "-m", "tools.mutants.forks"],
            cwd=self._tree.folder, env=self._tree.environment(self._scratch),
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, bufsize=0,
        )  # fmt: skip

    def _waits(self, server: "subprocess.Popen[bytes]") -> bool:
        """Wait for the end of a run; tell whether it has come before its time or memory was over."""
        ends = time.monotonic() + CLOCK_LIMIT_S
        while time.monotonic() < ends and memory_kb(self._running) < MOST_KB:
            if select.select([_end(server.stdout)], [], [], LOOK_S)[0]:
                return True
        return False

    def _kill(self) -> None:
        """End the tests, and what they have started and left in their session's group."""
        if self._running:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(self._running, signal.SIGKILL)
            self._running = 0


def _limit_s(marked: str) -> float:
    return TEST_LIMIT_S * (1 if marked is SHORT else LONGER)


def _end(pipe: IO[bytes] | None) -> IO[bytes]:
    if pipe is None:
        raise OSError("a process without pipes")
    return pipe


def _written(server: "subprocess.Popen[bytes]", text: str) -> None:
    _end(server.stdin).write(text.encode())


def _line(server: "subprocess.Popen[bytes]") -> str:
    """Return a line of an answer.

    Raises:
        OSError: The process that runs are forked from has ended.
    """
    line = _end(server.stdout).readline()
    if not line:
        raise OSError("the process that tests are forked from has ended (hint: python -m tools.mutants.forks)")
    return line.decode()


def is_mutant(mutant: SourceMutant) -> bool:
    """Tell whether a change makes another program, as far as that is seen without a compiler."""
    return not mutant.path.endswith(".py") or python_source.is_other_program(mutant.source, mutant.text)
