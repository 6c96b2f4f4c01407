"""What was judged, so that a run is resumed; and the committed list of survivors, with why some cannot be noticed."""

import json
import threading
import tomllib
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

from tools.mutants.judge import MutantOutcome, MutantStatus, SoundTests
from tools.mutants.mutant import SourceMutant

#: The committed list.
SURVIVORS = Path(__file__).with_name("survivors.toml")
HEADER = """\
# Mutants that their nearest tests do not notice; `make mutants NOTE=1` adds those that it finds, with an empty
# `equivalent`. Either a test is written and the row goes, or `equivalent` says in a line why no test can notice it:
# because what it changes cannot be seen from outside. Such a one does not count, and another is drawn for it.
"""

Row = tuple[str, str, str]


class Ledger:
    """Judgements by the key of the question, a line of JSON each, written when they are made.

    Args:
        file: Where they are kept.
    """

    def __init__(self, file: Path) -> None:
        self._file, self._lock = file, threading.Lock()
        self._judged: dict[str, MutantOutcome] = {}
        self._sound: dict[tuple[str, str], SoundTests] = {}
        lines = file.read_text(encoding="utf-8").splitlines() if file.exists() else []
        for line in lines:
            with suppress(ValueError, KeyError, TypeError):  # cut where a run was ended
                self._read(json.loads(line))

    def judgement(self, key: str) -> MutantOutcome | None:
        """Return the judgement of a question, or nothing."""
        return self._judged.get(key)

    def sound(self, digest: str, test: str) -> SoundTests | None:
        """Return what a file of tests said of the sound program in a tree that held the same, or nothing."""
        return self._sound.get((digest, test))

    def add(self, key: str, mutant: SourceMutant, judgement: MutantOutcome) -> None:
        """Keep a judgement."""
        row = {"key": key, "verdict": judgement.verdict.value, "by": judgement.by,
               "seconds": round(judgement.seconds, 1), "kind": mutant.kind, "name": mutant.name}  # fmt: skip
        self._append(row)

    def add_sound(self, digest: str, sound: SoundTests) -> None:
        """Keep what a file of tests says of the sound program."""
        if (digest, sound.file) not in self._sound:
            self._append({"tree": digest, **asdict(sound)})

    def _read(self, row: dict[str, Any]) -> None:
        if "tree" in row:
            fields = {key: value for key, value in row.items() if key != "tree"}
            self._sound[row["tree"], row["file"]] = SoundTests(**fields | {"left_out": tuple(row["left_out"])})
        else:
            self._judged[row["key"]] = MutantOutcome(
                verdict=MutantStatus(row["verdict"]), by=row["by"], seconds=row["seconds"]
            )

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
