"""Which lines in C and C++ each file of tests runs: gcov counts them in a copy of the tree, whose libraries note them.

A line of JSON for each file of tests is kept; it holds until the file, its helpers or the libraries are others.

Invariant: what is returned of a source was counted on the text that stands there now.
"""

import hashlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from tools.mutants.judge import SHORT
from tools.mutants.natives import Library, libraries, sources_digest
from tools.mutants.nearest import Counted, Nearest
from tools.mutants.tree import Tree

#: Where counts are kept, in the project.
KEPT = Path("build", "mutants", "native_lines.jsonl")
#: Which tests run, and how long a file of them may take by the clock.
PYTEST = (
    "-m", "pytest", "-n", "0", "-p", "no:cacheprovider", "-m", SHORT, "--hypothesis-profile", "unshrunk", "--tb", "no",
)  # fmt: skip
LIMIT_S = 300


@dataclass(frozen=True, slots=True, kw_only=True)
class _OfTest:
    """What one file of tests runs."""

    #: Of it, its helpers and the libraries.
    digest: str
    #: Of each source that it runs lines of, the digest of its text, the lines that it runs, and those that it does not.
    sources: dict[str, tuple[str, list[int], list[int]]]


class NativeLines:
    """What files of tests run of the libraries.

    Args:
        root: The project.
        file: Where counts are kept, from the project's folder.
    """

    def __init__(self, root: Path, file: Path = KEPT) -> None:
        self._root, self._file = root, root / file
        self._counted: dict[str, _OfTest] = {}
        for line in self._file.read_text(encoding="utf-8").splitlines() if self._file.exists() else ():
            with suppress(ValueError, KeyError, TypeError):  # cut where a run was ended
                row = json.loads(line)
                self._counted[row["test"]] = _OfTest(digest=row["digest"], sources=row["sources"])

    def count(self, nearest: Nearest, paths: Iterable[str], jobs: int) -> None:
        """Count what is not known yet of the files of tests that may run some sources.

        Args:
            nearest: Says which these are.
            paths: The sources; all libraries of their packages are counted.
            jobs: How many run at once.

        Raises:
            OSError: There is no gcov, or a library does not compile.
        """
        packages = sorted({path.partition("/")[0] for path in paths if not path.endswith(".py")})
        for package in packages:
            chosen = [library for library in libraries(self._root) if library.sources[0].startswith(f"{package}/")]
            self._count(chosen, nearest, [*nearest.of_package_in_c(package)], jobs)

    def _count(self, chosen: Sequence[Library], nearest: Nearest, tests: Sequence[str], jobs: int) -> None:
        of_libraries = " ".join(sources_digest(self._root, each) for each in chosen)
        wanted = {name: f"{nearest.digest_of(name, self._root)} {of_libraries}" for name in tests}
        left = [name for name in tests if name not in self._counted or self._counted[name].digest != wanted[name]]
        if not left or not chosen:
            return
        if shutil.which("gcov") is None:
            raise OSError("lines in C are counted by gcov, which is not here (hint: apt-get install gcc)")
        with tempfile.TemporaryDirectory(prefix="counts-") as folder, ThreadPoolExecutor(jobs) as pool:
            free = _counters(self._root, chosen, Path(folder), min(jobs, len(left)))
            for number, (name, found) in enumerate(zip(left, pool.map(partial(_counted, free), left), strict=True), 1):
                print(f"\rlines in C: {number} of {len(left)} files of tests", end="", file=sys.stderr, flush=True)
                self._add(name, wanted[name], found)
        print(file=sys.stderr)

    def _add(self, name: str, digest: str, sources: dict[str, tuple[list[int], list[int]]]) -> None:
        of_text = {source: (_digest(self._root / source), *lines) for source, lines in sources.items()}
        self._counted[name] = _OfTest(digest=digest, sources=of_text)
        self._file.parent.mkdir(parents=True, exist_ok=True)
        with self._file.open("a", encoding="utf-8") as file:
            file.write("\n" + json.dumps({"test": name, "digest": digest, "sources": of_text}) + "\n")

    def lines(self) -> Counted:
        """Return the lines that each file of tests runs, by source; under "" those that have code."""
        found: dict[str, dict[str, frozenset[int]]] = {}
        digests: dict[str, str] = {}
        for test, counted in self._counted.items():
            for source, (digest, seen, unseen) in counted.sources.items():
                if digests.setdefault(source, _digest(self._root / source)) == digest:
                    of_source = found.setdefault(source, {"": frozenset()})
                    of_source[test] = frozenset(seen)
                    of_source[""] |= {*seen, *unseen}
        return found


class _Counter:
    """A copy of the tree whose libraries count."""

    def __init__(self, root: Path, folder: Path, objects: Path) -> None:
        self.tree, self._objects, self._counts = Tree(root, folder), objects, folder / "counts"
        home = folder / "home"
        home.mkdir()
        self._environment = self.tree.environment(home) | {
            "GCOV_PREFIX": str(self._counts), "GCOV_PREFIX_STRIP": str(len(objects.parts) - 1),
        }  # fmt: skip

    def counted(self, test: str) -> dict[str, tuple[list[int], list[int]]]:
        """Return the lines that a file of tests runs, and does not, of the sources that it runs anything of."""
        shutil.rmtree(self._counts, ignore_errors=True)
        self._counts.mkdir()
        with suppress(subprocess.TimeoutExpired):
            subprocess.run(
                [sys.executable, *PYTEST, test], cwd=self.tree.folder, env=self._environment, timeout=LIMIT_S,
                stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, stdin=subprocess.DEVNULL, check=False,
            )  # fmt: skip
        written = sorted(self._counts.glob("*.gcda"))
        for each in written:
            note = each.with_suffix(".gcno")
            note.symlink_to(self._objects / note.name)
        found: dict[str, tuple[set[int], set[int]]] = {}
        for row in _read(self._counts, written):
            seen, unseen = found.setdefault(os.path.normpath(row["file"]), (set(), set()))
            for line in row["lines"]:
                (seen if line["count"] else unseen).add(line["line_number"])
        return {source: (sorted(seen), sorted(unseen - seen)) for source, (seen, unseen) in found.items()
                if seen and not source.startswith("/")}  # fmt: skip


def _counters(root: Path, chosen: Iterable[Library], folder: Path, jobs: int) -> "SimpleQueue[_Counter]":
    """Return copies of the tree whose libraries count."""
    objects = folder / "objects"
    objects.mkdir(parents=True)
    made = [_Counter(root, folder / str(number), objects) for number in range(jobs)]
    for library in chosen:
        _build(made[0].tree.folder, objects, library)
        for other in made[1:]:
            shutil.copy2(made[0].tree.folder / library.file, other.tree.folder / library.file)
    free: SimpleQueue[_Counter] = SimpleQueue()
    for each in made:
        free.put(each)
    return free


def _counted(free: "SimpleQueue[_Counter]", test: str) -> dict[str, tuple[list[int], list[int]]]:
    counter = free.get()
    try:
        return counter.counted(test)
    finally:
        free.put(counter)


def _read(folder: Path, written: Sequence[Path]) -> Iterator[dict[str, Any]]:
    if not written:
        return
    words = ["gcov", "--json-format", "--stdout", *(each.name for each in written)]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    for line in done.stdout.splitlines():
        with suppress(ValueError):
            yield from json.loads(line)["files"]


def _build(tree: Path, objects: Path, library: Library) -> None:
    """Put a library that counts into a copy of the tree."""
    made = []
    for name in library.sources:
        made.append(objects / f"{Path(library.file).stem}-{name.replace('/', '-')}.o")
        _run(tree, [*library.compiler, "--coverage", "-c", name, "-o", str(made[-1])])
    (tree / library.file).unlink(missing_ok=True)
    _run(tree, [*library.compiler, "--coverage", "-shared", *map(str, made), "-o", library.file, "-lm"])


def _run(folder: Path, words: list[str]) -> None:
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        raise OSError(f"{words[0]} cannot build what counts: {done.stderr.strip()[-300:]}")


def _digest(file: Path) -> str:
    return hashlib.sha256(file.read_bytes() if file.exists() else b"").hexdigest()[:16]
