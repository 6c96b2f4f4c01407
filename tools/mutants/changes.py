"""Which lines of which files are mutated: those that differ from a commit, or whole files."""

import re
import subprocess
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from tools.mutants.languages import c_source, python_source
from tools.mutants.mutant import Edit, SourceMutant, edited

ROOT = Path(__file__).parents[2]
#: What makes the mutants of a file, by its ending.
LANGUAGES = {
    ".py": python_source.mutants, ".c": c_source.mutants, ".h": c_source.mutants, ".cpp": c_source.mutants,
    ".hpp": c_source.mutants,
}  # fmt: skip
#: Folders whose files are programs of the project: the rest are tests, tools, examples and what is generated.
PACKAGES = ("simbase", "p2os", "bluepill_sim", "adapter_sim", "robot_bench", "adapter_fw/core", "hardware")
#: Data that is code in its ending alone, and programs that run on a chip.
LEFT_OUT = (
    "robot_bench/firmware/",
    "robot_bench/cli/project/template/",
    "robot_bench/cli/project/beside/",
    "bluepill_sim/analysis/silicon/",
)

Lines = Mapping[str, frozenset[int] | None]


class ChangeError(Exception):
    """What was asked cannot be mutated; says why, and what to try."""


def files(wanted: Iterable[str]) -> Lines:
    """Return whole files, or all of folders.

    Raises:
        ChangeError: A file is not there, or is none that can be mutated.
    """
    listed = _git("ls-files", "--cached", "--others", "--exclude-standard").splitlines()
    found: dict[str, None] = {}
    for name in (each.rstrip("/") for each in wanted):
        below = [path for path in listed if path == name or path.startswith(f"{name}/")]
        ours = [path for path in below if _can_be_mutated(path)]
        if not below:
            raise ChangeError(f"{name} is not there (hint: a path from the project's folder)")
        if not ours:
            raise ChangeError(f"{name} is no code of a package in Python, C or C++ (of {', '.join(PACKAGES)})")
        found |= dict.fromkeys(ours)
    return dict.fromkeys(found)


def since(commit: str) -> Lines:
    """Return the lines that differ from a commit, those of files that git does not know yet among them.

    Of a branch that has gone on since, what differs from where this one left it.

    Raises:
        ChangeError: There is no such commit.
    """
    if commit.startswith("-") or not _git("rev-parse", "--verify", "--quiet", f"{commit}^{{commit}}", may_fail=True):
        raise ChangeError(f"git knows no commit {commit} (hint: git log --oneline)")
    base = _git("merge-base", commit, "HEAD", may_fail=True).strip() or commit
    lines: dict[str, frozenset[int] | None] = dict(_lines_of(_git("diff", "--unified=0", "--no-renames", base)))
    new = _git("ls-files", "--others", "--exclude-standard").splitlines()
    lines |= dict.fromkeys(new)
    return {path: each for path, each in lines.items() if _can_be_mutated(path)}


def mutants_of(lines: Lines, root: Path = ROOT) -> list[SourceMutant]:
    """Return every mutant of these lines, in the order of files and of what stands in them."""
    found: list[SourceMutant] = []
    for path, wanted in lines.items():
        made = LANGUAGES[Path(path).suffix](path, (root / path).read_bytes())
        found += [each for each in made if wanted is None or wanted & {*range(each.first_line, each.last_line + 1)}]
    return found


def read_planted(file: Path) -> list[dict[str, str]]:
    """Return the faults that somebody has put down in a file, as planted.toml has them.

    Raises:
        ChangeError: The file is none of that kind.
        OSError: It cannot be read.
    """
    try:
        rows = tomllib.loads(file.read_text(encoding="utf-8"))["fault"]
        return [{key: str(row[key]) for key in ("path", "before", "after")} for row in rows]
    except (ValueError, LookupError, TypeError) as error:
        raise ChangeError(f"{file}: {error!r} (hint: [[fault]] with path, before and after, as planted.toml)") from None


def planted(rows: Iterable[Mapping[str, str]]) -> list[SourceMutant]:
    """Return the mutants that somebody has put down, by what stands once in a file and what stands there instead.

    Raises:
        ChangeError: A file is not there, or has the place not at all or more than once.
    """
    found = []
    for row in rows:
        path, before = row["path"], row["before"].encode()
        if not _can_be_mutated(path):
            raise ChangeError(f"{path} is no code of a package (hint: a path from the project's folder)")
        source = (ROOT / path).read_bytes()
        if (count := source.count(before)) != 1:
            raise ChangeError(f"{path} has {row['before']!r} {count} times (hint: more of the line)")
        start = source.index(before)
        edit = Edit(start=start, end=start + len(before), text=row["after"].encode())
        found.append(edited(path, source, "planted", [edit]))
    return found


def _can_be_mutated(path: str) -> bool:
    is_ours = any(path.startswith(f"{package}/") for package in PACKAGES) and not path.startswith(LEFT_OUT)
    return is_ours and Path(path).suffix in LANGUAGES and (ROOT / path).is_file()


def _lines_of(difference: str) -> Iterator[tuple[str, frozenset[int]]]:
    """Go through the files of a `git diff --unified=0`, each with the lines that are new in it."""
    for part in re.split(r"^diff --git .*$", difference, flags=re.MULTILINE)[1:]:
        file = re.search(r"^\+\+\+ b/(.*?)\t?$", part, re.MULTILINE)
        if file is None:
            continue
        hunks = re.findall(r"^@@ -\S+ \+(\d+)(?:,(\d+))? @@", part, re.MULTILINE)
        yield (
            file[1],
            frozenset(line for first, count in hunks for line in range(int(first), int(first) + int(count or 1))),
        )


def _git(*words: str, may_fail: bool = False) -> str:
    done = subprocess.run(
        ["git", "-c", "core.quotepath=off", *words], cwd=ROOT, capture_output=True, text=True, check=False
    )
    if done.returncode and not may_fail:
        raise ChangeError(f"git {words[0]}: {done.stderr.strip() or 'failed'} (hint: run it in a git checkout)")
    return done.stdout
