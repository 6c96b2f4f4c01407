"""Tests of pytest as the judge of mutants: those that drive a bench by the fixture `bench`.

The suite is run with the program itself first, then with a file of each mutant, as `pytest --firmware FILE -x` does.
What its benches executed and recorded is known from the chips and the traces of the tests.

Not here: processes. Each run leaves modules of the tests behind, so each is to have a process of its own.

Invariant: the files of the tests are not written to, and no run folder is made.
"""

import contextlib
import hashlib
import os
import resource
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from bluepill_sim.board import BluePill
from bluepill_sim.program.image import ELF_MAGIC, Image
from bluepill_sim.program.mutants import Mutant, mutated_file
from bluepill_sim.program.static_code import StaticCode
from robot_bench.campaign.variants.mutation.trial import Fate, MutantResult
from robot_bench.events.codec import Json
from simbase.entry_points import installed_points
from simbase.files import writing_temporary

if TYPE_CHECKING:
    import pytest

#: What pytest ends with.
_PASSED, _FAILED = 0, 1


@dataclass(slots=True)
class SuiteRun:
    """What came of a run of the tests."""

    #: Nothing: all passed; else the first that failed.
    failed: str = ""
    #: It could not be run: what pytest's exit code means.
    broken: str = ""
    #: Instructions that ran.
    addresses: set[int] = field(default_factory=set)
    #: Of the traces of all tests, in their order.
    sha256: str = ""
    #: What it took of a processor, where somebody has measured it.
    cpu_s: float = 0.0

    def to_plain(self) -> Json:
        """Return it as JSON has it."""
        return {
            "failed": self.failed, "broken": self.broken, "addresses": sorted(self.addresses), "sha256": self.sha256,
            "cpu_s": self.cpu_s,
        }  # fmt: skip

    @classmethod
    def from_plain(cls, found: Json) -> "SuiteRun":
        """Return what `to_plain` had."""
        addresses = set(cast("list[int]", found["addresses"]))
        cpu_s = float(cast("float", found["cpu_s"]))
        return cls(str(found["failed"]), str(found["broken"]), addresses, str(found["sha256"]), cpu_s)


def load_pytest() -> None:
    """Import pytest and its plugins, so that the forks that run it need not each do so."""
    for name in ("pytest", *(plugin.module for plugin in installed_points("pytest11").values())):
        with contextlib.suppress(Exception):  # pytest itself says what ails a plugin
            import_module(name)


def run_suite(paths: Sequence[Path], firmware: Path) -> SuiteRun:
    """Run tests with a program, up to the first that fails.

    Args:
        paths: Files or folders of tests.
        firmware: Takes the place of theirs.
    """
    import pytest

    watch = _Watch()
    # Whether a test fails is all that is asked: pytest need not rewrite what it asserts, nor read sources to say why.
    # In one word with its option the program's path is none that pytest begins to collect at.
    words = ["-x", "-q", "--assert=plain", "--tb=no", "-p", "no:cacheprovider", "--bench-record=none"]
    with _silent():
        code = int(pytest.main([*words, f"--firmware={firmware}", *map(str, paths)], plugins=[watch]))
    watch.found.sha256 = watch.digest.hexdigest()
    if code == _FAILED:
        watch.found.failed = watch.found.failed or "a test"
    elif code != _PASSED:
        watch.found.broken = f"pytest ended with exit code {code}"
    return watch.found


@dataclass(frozen=True, slots=True, kw_only=True)
class Suite:
    """Tests that pass with the program itself."""

    paths: tuple[Path, ...]
    base: SuiteRun
    #: The bytes of the program's file, and the program.
    data: bytes
    image: Image

    def try_mutant(self, mutant: Mutant, cpu_s: int) -> MutantResult:
        """Run the tests with a mutant.

        Args:
            mutant: The change.
            cpu_s: So much of a processor it may take; the process that takes more is ended by SIGXCPU.
        """
        resource.setrlimit(resource.RLIMIT_CPU, (cpu_s, cpu_s))
        suffix = ".elf" if self.data.startswith(ELF_MAGIC) else ".bin"
        with writing_temporary():
            made = tempfile.TemporaryDirectory(prefix="p2os-mutant-")
        with made as folder:
            file = Path(folder) / f"mutant{suffix}"
            with writing_temporary():
                file.write_bytes(mutated_file(self.data, mutant, self.image))
            found = run_suite(self.paths, file)
        if found.failed or found.broken:  # a suite that cannot be collected could with the program itself
            return MutantResult(Fate.MISSED, "pytest", found.failed or found.broken)
        return MutantResult(Fate.SAME if found.sha256 == self.base.sha256 else Fate.SURVIVED, "pytest")


class _Watch:
    """A plugin that looks at each test's bench when the test is over."""

    def __init__(self) -> None:
        self.found = SuiteRun()
        self.digest = hashlib.sha256()

    def pytest_runtest_teardown(self, item: "pytest.Item") -> None:
        """Take what the bench of a test executed and recorded."""
        bench = getattr(item, "funcargs", {}).get("bench")
        if bench is None:
            return
        self.digest.update(bench.trace.sha256.encode())
        for one in bench.robots.values():
            if isinstance(one.chip, BluePill):
                code = StaticCode(one.chip.chip.memory)
                for start in one.chip.entered_blocks:
                    self.found.addresses.update(code.block(start).addresses)

    def pytest_runtest_logreport(self, report: Any) -> None:
        """Note the first test that failed."""
        if report.failed and not self.found.failed:
            self.found.failed = str(report.nodeid).rpartition("/")[2]


@contextlib.contextmanager
def _silent() -> Iterator[None]:
    """Let nothing be printed: what the tests say of a mutant is no result."""
    with (
        Path(os.devnull).open("w", encoding="utf-8") as nowhere,
        contextlib.redirect_stdout(nowhere),
        contextlib.redirect_stderr(nowhere),
    ):
        yield
