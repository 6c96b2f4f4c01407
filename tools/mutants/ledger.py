"""What was judged, so that a run is resumed; and the committed list of survivors, with why some cannot be noticed."""

import json
import threading
import tomllib
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from tools.mutants.judge import NOTICED, MutantOutcome, MutantStatus
from tools.mutants.mutant import SourceMutant

#: The committed list.
SURVIVORS = Path(__file__).with_name("survivors.toml")
HEADER = """\
# Mutants that their nearest tests do not notice; `make mutants NOTE=1` adds those that it finds, with an empty
# `equivalent`. Either a test is written and the row goes, or `equivalent` says in a line why no test can notice it:
# because what it changes cannot be seen from outside. Such a one does not count, and another is drawn for it.
"""

Row = tuple[str, str, str]

#: Seconds by which a file of tests may take longer than it is known to.
LEAST_S = 0.1


class Ledger:
    """Judgements, a line of JSON each, written when they are made.

    One that a test has noticed holds as long as that file of tests stays as it is, with its helpers and data; one that
    tests have not, as long as these are the nearest, and stay as they are.

    Args:
        file: Where they are kept.
    """

    def __init__(self, file: Path) -> None:
        self._file, self._lock = file, threading.Lock()
        self._judged: dict[str, list[tuple[MutantOutcome, dict[str, str]]]] = {}
        self._sound: dict[str, dict[str, float | None]] = {}
        #: Seconds of a processor that files of tests took when they were last run to their ends.
        self.lasted: dict[str, float] = {}
        lines = file.read_text(encoding="utf-8").splitlines() if file.exists() else []
        for line in lines:
            with suppress(ValueError, KeyError, TypeError, AttributeError):  # cut where a run was ended
                self._read(json.loads(line))

    def judgement(self, mutant: SourceMutant, asked: Mapping[str, str]) -> MutantOutcome | None:
        """Return what was found of a mutant, or nothing.

        Args:
            mutant: Which.
            asked: Its nearest files of tests, each with a digest of it.
        """
        for judgement, files in reversed(self._judged.get(mutant.key, [])):
            is_all = judgement.verdict in {*NOTICED, MutantStatus.NO_MUTANT} or files.keys() == asked.keys()
            if is_all and files.items() <= asked.items():
                return judgement
        return None

    def sound(self, digest: str) -> dict[str, float | None]:
        """Return in what time tests pass on the sound program in a tree that held the same; none where they fail."""
        return self._sound.setdefault(digest, {})

    def add(self, mutant: SourceMutant, asked: Mapping[str, str], judgement: MutantOutcome) -> None:
        """Keep a judgement."""
        by = judgement.by.partition("::")[0]
        files = {
            name: digest for name, digest in asked.items()
            if judgement.verdict is not MutantStatus.NO_MUTANT and (judgement.verdict not in NOTICED or name == by)
        }  # fmt: skip
        row = {"key": mutant.key, "verdict": judgement.verdict.value, "by": judgement.by, "files": files,
               "seconds": round(judgement.seconds, 1), "kind": mutant.kind, "name": mutant.name}  # fmt: skip
        self._append(row)

    def add_sound(self, digest: str, tests: Mapping[str, float | None]) -> None:
        """Keep what tests say of the sound program."""
        known = self._sound.get(digest, {})
        if new := {test: seconds for test, seconds in tests.items() if test not in known}:
            self._append({"tree": digest, "sound": new})

    def add_lasted(self, files: Mapping[str, float]) -> None:
        """Keep how long files of tests take, where that is not known about."""
        known = self.lasted
        new = {
            name: round(seconds, 2) for name, seconds in files.items()
            if not known.get(name, -1.0) / 2 <= seconds <= known.get(name, -1.0) * 2 + LEAST_S
        }  # fmt: skip
        if new:
            self._append({"lasted": new})

    def _read(self, row: dict[str, Any]) -> None:
        if "lasted" in row:
            self.lasted |= row["lasted"]
        elif "sound" in row:
            self._sound.setdefault(row["tree"], {}).update(row["sound"])
        else:
            judgement = MutantOutcome(verdict=MutantStatus(row["verdict"]), by=row["by"], seconds=row["seconds"])
            self._judged.setdefault(row["key"], []).append((judgement, dict(row["files"].items())))

    def _append(self, row: dict[str, Any]) -> None:
        with self._lock:
            self._read(row)
            self._file.parent.mkdir(parents=True, exist_ok=True)
            is_cut = self._file.exists() and self._file.read_bytes()[-1:] not in {b"", b"\n"}
            with self._file.open("a", encoding="utf-8") as file:
                file.write("\n" * is_cut + json.dumps(row) + "\n")


def survivors(file: Path = SURVIVORS) -> dict[Row, str]:
    """Return the committed survivors, and of each why it is equivalent; nothing where that is not said."""
    rows = tomllib.loads(file.read_text(encoding="utf-8")).get("mutant", [])
    return {(row["path"], row["before"], row["after"]): row["equivalent"] for row in rows}


def write_survivors(rows: Mapping[Row, str], file: Path = SURVIVORS) -> None:
    """Write the list, by path."""
    blocks = [_block(row, reason) for row, reason in sorted(rows.items())]
    file.write_text("\n".join([HEADER, *blocks]), encoding="utf-8")


def with_new(rows: Mapping[Row, str], found: Iterable[SourceMutant]) -> dict[Row, str]:
    """Return the list with what was found, whose reasons are still to be said."""
    return {**{mutant.row: "" for mutant in found}, **rows}


def _block(row: Row, reason: str) -> str:
    values = zip(("path", "before", "after", "equivalent"), (*row, reason), strict=True)
    return "[[mutant]]\n" + "".join(f"{key} = {json.dumps(value, ensure_ascii=False)}\n" for key, value in values)
