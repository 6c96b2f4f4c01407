"""What a campaign has done so far, a line a run, so that nothing is done twice whatever was killed.

Each line is a JSON object with the key of a run (its stage and the hash of its trial) and its outcome, written and
flushed when the run ends. A line that was cut is passed over: that run is done again.

Invariant: what is read back is what was written.
"""

import base64
import json
import os
import zlib
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import IO, cast

from robot_bench.campaign.trial import Done, GoalResult, Hit, Outcome, Verdict
from simbase.files import writing

NAME = "journal.jsonl"


class Journal:
    """Reads what is there, and appends.

    Args:
        folder: Of the campaign.

    Raises:
        FileError: The file cannot be read or written.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / NAME
        self._done: dict[str, Done] = {}
        with writing(self._path):
            self._file: IO[str] = self._path.open("a+", encoding="ascii", newline="\n")
            self._file.seek(0)
            text = self._file.read()
        whole = text[: text.rfind("\n") + 1]
        if len(whole) < len(text):
            self._file.truncate(len(whole))
        for line in whole.splitlines():
            try:
                entry = json.loads(line)
                self._done[entry["key"]] = outcome_of_plain(entry["outcome"]), float(entry["cpu_s"])
            except (ValueError, KeyError, TypeError):  # the disk was full there
                continue

    def __len__(self) -> int:
        return len(self._done)

    def get(self, key: str) -> Done | None:
        """Return what came of a run, and the seconds of a processor that it took; None where it is not done."""
        return self._done.get(key)

    def add(self, key: str, outcome: Outcome, cpu_s: float) -> None:
        """Keep what came of a run.

        Raises:
            FileError: The disk is full.
        """
        self._done[key] = outcome, cpu_s
        line = json.dumps({"key": key, "outcome": plain_of(outcome), "cpu_s": cpu_s}, separators=(",", ":"))
        with writing(self._path, hint="make room, then --resume"):
            self._file.write(f"{line}\n")
            self._file.flush()
            os.fsync(self._file.fileno())

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def plain_of(outcome: Outcome) -> dict[str, object]:
    """Return an outcome as JSON has it."""
    plain: dict[str, object] = {field.name: getattr(outcome, field.name) for field in fields(outcome)}
    return plain | {
        "verdict": outcome.verdict.value,
        "goals": [[getattr(goal, field.name) for field in fields(goal)] for goal in outcome.goals],
        "hits": [[getattr(hit, field.name) for field in fields(hit)] for hit in outcome.hits],
        "blocks": _packed(sorted(outcome.blocks)),
        "lines": sorted(outcome.lines),
    }


def outcome_of_plain(plain: Mapping[str, object]) -> Outcome:
    """Return the outcome that `plain_of` has written.

    Raises:
        KeyError, TypeError, ValueError: It is none.
    """
    rows = {name: cast("list[list[object]]", plain[name]) for name in ("goals", "hits", "way_mm")}
    goal_names, hit_names = ([field.name for field in fields(kind)] for kind in (GoalResult, Hit))
    values = {field.name: plain[field.name] for field in fields(Outcome)}
    values |= {
        "verdict": Verdict(plain["verdict"]),
        "failures": tuple(cast("list[str]", plain["failures"])),
        "goals": tuple(GoalResult(**dict(zip(goal_names, row, strict=True))) for row in rows["goals"]),  # type: ignore[arg-type]  # as they were written
        "hits": tuple(Hit(**dict(zip(hit_names, row, strict=True))) for row in rows["hits"]),  # type: ignore[arg-type]  # as above
        "way_mm": tuple((cast("int", x), cast("int", y)) for x, y in rows["way_mm"]),
        "blocks": frozenset(_unpacked(str(plain["blocks"]))),
        "lines": frozenset(cast("list[str]", plain["lines"])),
    }
    return Outcome(**values)  # type: ignore[arg-type]  # as above


def _packed(addresses: list[int]) -> str:
    """Return addresses in their order in few characters."""
    steps = ",".join(f"{after - before:x}" for before, after in zip([0, *addresses], addresses, strict=False))
    return base64.b64encode(zlib.compress(steps.encode())).decode()


def _unpacked(text: str) -> list[int]:
    steps = zlib.decompress(base64.b64decode(text)).decode()
    found, at = [], 0
    for step in filter(None, steps.split(",")):
        at += int(step, 16)
        found.append(at)
    return found
