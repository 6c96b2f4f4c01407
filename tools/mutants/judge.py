"""Whether tests notice a mutant: they are run over a copy of the tree that holds it, within bounds.

Invariant: only what the tests say of the sound program, too, counts: a test that fails there is left out, and a
time-out is noticed only where the sound program passes in half the time, right after it.

Time is that of a processor, which says the same on a machine that does other things; the clock bounds what waits.
"""

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from tools.hostile.kernel import memory_kb
from tools.mutants import python_source
from tools.mutants.mutant import SourceMutant
from tools.mutants.natives import Natives
from tools.mutants.outcome import OUTCOME_FILE, reported_by
from tools.mutants.tree import Tree

#: Seconds of a processor that the tests of one mutant have, and that those of the sound program take of them.
LIMIT_S = 20
SOUND_LIMIT_S = LIMIT_S / 2
#: What a run takes before its first test, about: the tests share the rest.
START_S = 1.5
#: The same bound by the clock, for what waits.
CLOCK_LIMIT_S = 180.0
#: kB of memory and blocks of 512 bytes of a file that a mutant may fill: some loop and keep what they make.
MOST_KB, FILE_BLOCKS = 3 << 20, 1 << 20
#: How often memory is looked at; no limit of the kernel's bounds it, since a sanitizer reserves more than there is.
LOOK_S = 0.25
BOUNDED = f'ulimit -S -t "$1"; shift; ulimit -f {FILE_BLOCKS}; exec "$@"'
PYTEST = (
    sys.executable, "-m", "pytest", "-x", "-n", "0", "-p", "no:cacheprovider", "-p", "tools.mutants.outcome",
    "-m", "not slow and not soak and not hardware", "--hypothesis-profile", "unshrunk", "--tb", "no",
)  # fmt: skip
_NO_TESTS = 5
#: Tests of a file that may fail on the sound program before the file is left out.
_MOST_FAILED = 20


class MutantStatus(Enum):
    """What became of a mutant."""

    #: A test fails.
    NOTICED = "noticed"
    #: The tests do not end in time, and those of the sound program do in half of it.
    TIMED_OUT = "timed out"
    #: Every test passes.
    SURVIVED = "survived"
    #: The tests do not end in time, but the sound program's are slow as well.
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
class SoundTests:
    """What a file of tests says of the sound program."""

    file: str
    #: Whether it has tests that pass, in `SOUND_LIMIT_S`.
    is_judge: bool = False
    #: What of it does not pass.
    left_out: tuple[str, ...] = ()
    #: How long it keeps a processor busy, without what every run takes to start.
    seconds: float = 0.0


def chosen(nearest: Iterable[SoundTests]) -> tuple[SoundTests, ...]:
    """Return the nearest files of tests that pass together in `SOUND_LIMIT_S`."""
    kept, seconds = list[SoundTests](), START_S
    for each in nearest:
        if each.is_judge and seconds + each.seconds <= SOUND_LIMIT_S:
            kept.append(each)
            seconds += each.seconds
    return tuple(kept)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Run:
    code: int | None  # None: ended for its time
    failed: tuple[str, ...]
    seconds: float


class Judge:
    """Judges mutants in one copy of the tree, one after the other.

    Args:
        tree: The copy.
        scratch: A folder for what tests and compilers write, the home folder of the tests.
        natives: The libraries of this copy.
        limit_s: Seconds of a processor that the tests of one mutant have.
    """

    def __init__(self, tree: Tree, scratch: Path, natives: Natives, limit_s: int = LIMIT_S) -> None:
        self._limit_s = limit_s
        self._tree, self._scratch, self._natives = tree, scratch, natives
        self._running: subprocess.Popen[bytes] | None = None
        self._lock, self._is_over = threading.Lock(), False

    def sound(self, test: str) -> SoundTests:
        """Return what a file of tests says of the sound program."""
        run = self._run((test,), (), "--maxfail", str(_MOST_FAILED))
        left_out: tuple[str, ...] = ()
        if run.failed and len(run.failed) < _MOST_FAILED and test not in run.failed:
            left_out = run.failed
            run = self._run((test,), left_out)
        if run.code == _NO_TESTS:
            return SoundTests(file=test)
        if run.code != 0:
            return SoundTests(file=test, left_out=(*left_out, test))
        seconds = max(0.0, run.seconds - START_S)
        return SoundTests(file=test, is_judge=seconds + START_S <= SOUND_LIMIT_S, left_out=left_out, seconds=seconds)

    def judged(self, mutant: SourceMutant, tests: Sequence[SoundTests]) -> MutantOutcome:
        """Return whether tests notice a mutant."""
        if not tests:
            return MutantOutcome(verdict=MutantStatus.UNTESTED)
        files = tuple(test.file for test in tests)
        left_out = tuple(each for test in tests for each in test.left_out)
        run = self._run_with(mutant, files, left_out)
        if run is None:
            return MutantOutcome(verdict=MutantStatus.NO_MUTANT)
        if run.code is None:
            is_sure = self._run(files, left_out).code == 0
            return MutantOutcome(
                verdict=MutantStatus.TIMED_OUT if is_sure else MutantStatus.UNDECIDED, seconds=run.seconds
            )
        if run.code == 0:
            return MutantOutcome(verdict=MutantStatus.SURVIVED, seconds=run.seconds)
        by = run.failed[0] if run.failed else f"exit code {run.code}"
        return MutantOutcome(verdict=MutantStatus.NOTICED, by=by, seconds=run.seconds)

    def end(self) -> None:
        """End what runs, from another thread, and begin nothing any more."""
        with self._lock:
            self._is_over = True
            self._kill()

    def _run_with(self, mutant: SourceMutant, files: tuple[str, ...], left_out: tuple[str, ...]) -> _Run | None:
        """Run tests while the tree holds a mutant; None where the compiler makes no other program of it."""
        with self._tree.holding({mutant.path: mutant.text}):
            if mutant.path.endswith(".py"):
                return self._run(files, left_out)
            built = self._natives.built_with(mutant)
            if not built:
                return None
            with self._tree.holding(built):
                return self._run(files, left_out)

    def _run(self, tests: tuple[str, ...], left_out: tuple[str, ...], *options: str) -> _Run:
        reported = self._scratch / "reported.json"
        reported.unlink(missing_ok=True)
        words = ["sh", "-c", BOUNDED, "sh", str(self._limit_s), *PYTEST, *options, *tests]
        words += [word for test in left_out for word in ("--deselect", test)]
        with self._lock:
            if self._is_over:
                raise InterruptedError
            self._running = subprocess.Popen(
                words, cwd=self._tree.folder, env=self._environment(reported), stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
            )  # fmt: skip
        code = _ended(self._running)
        with self._lock:
            self._kill()
            if self._is_over:
                raise InterruptedError
        failed, seconds = reported_by(reported)
        if code in {-signal.SIGXCPU, -signal.SIGKILL} or seconds > self._limit_s:
            code = None
        return _Run(code=code, failed=failed, seconds=seconds)

    def _kill(self) -> None:
        """End the tests, and what they have started and left in their session's group."""
        if self._running is not None:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(self._running.pid, signal.SIGKILL)
            self._running.wait()
            self._running = None

    def _environment(self, reported: Path) -> dict[str, str]:
        """Return the tests' environment: the copy comes before what is installed, and the user's files stay his."""
        kept = {name: value for name, value in os.environ.items() if not name.startswith(("PYTEST", "XDG_", "MAKE"))}
        folder = str(self._scratch)
        return kept | {
            "PYTHONPATH": os.pathsep.join(map(str, self._tree.path)), "HOME": folder, "TMPDIR": folder,
            OUTCOME_FILE: str(reported),
        }  # fmt: skip


def _ended(running: "subprocess.Popen[bytes]") -> int | None:
    """Wait for a process; return its exit code, or None where it takes more time or memory than it may."""
    ends = time.monotonic() + CLOCK_LIMIT_S
    while time.monotonic() < ends and memory_kb(running.pid) < MOST_KB:
        with contextlib.suppress(subprocess.TimeoutExpired):
            return running.wait(LOOK_S)
    return None


def is_mutant(mutant: SourceMutant) -> bool:
    """Tell whether a change makes another program, as far as that is seen without a compiler."""
    return not mutant.path.endswith(".py") or python_source.is_other_program(mutant.source, mutant.text)
