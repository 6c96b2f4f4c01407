"""What a campaign has done so far, a line a run, so that nothing is done twice whatever was killed.

Each line is a JSON object with the key of a run (its stage and the hash of its trial), its outcome and, last, a
checksum of all before it, written and flushed when the run ends. A line counts only where its checksum holds: what was
damaged, changed by hand, or written by a p2os whose lines had none is named and left out, and its run is done again. A
last line that was cut, as by a kill or a full disk, is taken off.

Invariant: what is read back is what was written.
"""

import base64
import contextlib
import hashlib
import json
import os
import zlib
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import BinaryIO, cast

from robot_bench.campaign.trial import Done, GoalResult, HullContact, Outcome, TrialVerdict
from simbase.errors import FileError
from simbase.files import LONGEST_LINE, writing

NAME = "journal.jsonl"
#: What stands before a line's checksum: hexadecimal digits of the SHA-256 of all before it, and the end of the object.
_SUM = b',"sum":"'
_SUM_DIGITS = 16
_END = b'"}'
#: What reading an outcome of another version raises.
_NO_OUTCOME = (ValueError, KeyError, TypeError, AttributeError, RecursionError, zlib.error)


class Journal:
    """Reads what is there, and appends.

    Args:
        folder: Of the campaign.

    Raises:
        FileError: The file cannot be read or written, or is no journal.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / NAME
        self._done: dict[str, Done] = {}
        #: Lines that do not count, from 1, each with what is wrong with it.
        self.left_out: dict[int, str] = {}
        with writing(self._path):
            self._file: BinaryIO = self._path.open("a+b")
            self._file.seek(0)
            self._read()

    def _read(self) -> None:
        number, length = 0, 0
        while line := self._file.readline(LONGEST_LINE):
            number += 1
            if not line.endswith(b"\n"):
                if len(line) == LONGEST_LINE:
                    raise FileError(f"{self._path}:{number}: no line of a journal", hint="move the file away")
                self._file.truncate(length)
                return
            length += len(line)
            try:
                entry = json.loads(_checked(line.removesuffix(b"\n")))
                self._done[str(entry["key"])] = outcome_of_plain(entry["outcome"]), float(entry["cpu_s"])
            except _LeftOutError as error:
                self.left_out[number] = str(error)
            except _NO_OUTCOME:
                self.left_out[number] = "what it holds is no outcome"

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
        entry = {"key": key, "outcome": plain_of(outcome), "cpu_s": cpu_s}
        line = json.dumps(entry, separators=(",", ":")).encode("ascii")
        with writing(self._path, hint="make room, then --resume"):
            self._file.write(_summed(line) + b"\n")
            self._file.flush()
            os.fsync(self._file.fileno())

    def close(self) -> None:
        """Close the file; a full disk was reported when it was first met."""
        with contextlib.suppress(OSError):
            self._file.close()


class _LeftOutError(Exception):
    """A line does not count."""


def _summed(line: bytes) -> bytes:
    """Return an object with its checksum as its last entry."""
    head = line.removesuffix(b"}")
    return head + _SUM + _sum_of(head) + _END


def _checked(line: bytes) -> bytes:
    """Return a line whose checksum holds.

    Raises:
        _LeftOutError: It does not, or there is none.
    """
    head, mark, found = line.rpartition(_SUM)
    if not mark:
        try:
            is_older = isinstance(json.loads(line), dict)
        except (ValueError, RecursionError):
            is_older = False
        raise _LeftOutError("no checksum, as an earlier p2os wrote it" if is_older else "damaged")
    if found != _sum_of(head) + _END:
        raise _LeftOutError("damaged or changed: its checksum does not hold")
    return line


def _sum_of(data: bytes) -> bytes:
    return hashlib.sha256(data).hexdigest()[:_SUM_DIGITS].encode("ascii")


def plain_of(outcome: Outcome) -> dict[str, object]:
    """Return an outcome as JSON has it."""
    plain: dict[str, object] = {field.name: getattr(outcome, field.name) for field in fields(outcome)}
    return plain | {
        "verdict": outcome.verdict.value,
        "goals": [[getattr(goal, field.name) for field in fields(goal)] for goal in outcome.goals],
        "hits": [[getattr(hit, field.name) for field in fields(hit)] for hit in outcome.hits],
        "blocks": _packed(sorted(outcome.blocks)),
        "ways": _packed(sorted(outcome.ways)),
        **{name: sorted(getattr(outcome, name)) for name in _TEXTS},
    }


def outcome_of_plain(plain: Mapping[str, object]) -> Outcome:
    """Return the outcome that `plain_of` has written.

    Raises:
        KeyError, TypeError, ValueError, AttributeError, zlib.error: It is none.
    """
    rows = {name: cast("list[list[object]]", plain[name]) for name in ("goals", "hits", "way_mm")}
    goal_names, hit_names = ([field.name for field in fields(kind)] for kind in (GoalResult, HullContact))
    values = {field.name: plain[field.name] for field in fields(Outcome) if field.name not in _LATER}
    values |= {
        "verdict": TrialVerdict(plain["verdict"]),
        "failures": tuple(cast("list[str]", plain["failures"])),
        "goals": tuple(GoalResult(**dict(zip(goal_names, row, strict=False))) for row in rows["goals"]),  # type: ignore[arg-type]  # as they were written
        "hits": tuple(HullContact(**dict(zip(hit_names, row, strict=True))) for row in rows["hits"]),  # type: ignore[arg-type]  # as above
        "way_mm": tuple((cast("int", x), cast("int", y)) for x, y in rows["way_mm"]),
        "blocks": frozenset(_unpacked(str(plain["blocks"]))),
        "ways": frozenset(_unpacked(str(plain.get("ways", _NONE)))),
        **{name: frozenset(cast("list[str]", plain.get(name, []))) for name in _TEXTS},
    }
    return Outcome(**values)  # type: ignore[arg-type]  # as above


#: Sets of texts of an outcome; and what an outcome of an earlier p2os does not tell.
_TEXTS = ("lines", "transitions", "happened")
_LATER = frozenset({"ways", "transitions", "happened"})


def _packed(addresses: list[int]) -> str:
    """Return addresses in their order in few characters."""
    steps = ",".join(f"{after - before:x}" for before, after in zip([0, *addresses], addresses, strict=False))
    return base64.b64encode(zlib.compress(steps.encode())).decode()


#: No addresses.
_NONE = _packed([])


def _unpacked(text: str) -> list[int]:
    steps = zlib.decompress(base64.b64decode(text)).decode()
    found, at = [], 0
    for step in filter(None, steps.split(",")):
        at += int(step, 16)
        found.append(at)
    return found
