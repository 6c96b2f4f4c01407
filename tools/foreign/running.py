"""Runs a row: what is missing, its judge in a process of its own, and what became of it.

Hosts keep the machine's time, and give up where that has no processor left for them or for the emulator: on such a
machine a row says so.
"""

import os
import tempfile
import time
from pathlib import Path

from simbase.terminal import readable
from tools.foreign.cache import build, built_commit, missing
from tools.foreign.isolation import LeftError, isolated
from tools.foreign.row import Result, Row, RowError, RowPlace, RowStatus


def run(row: Row, cache: Path, logs: Path) -> Result:
    """Run a row.

    Args:
        row: Which.
        cache: Where the programs of others are.
        logs: A folder for what the row and its programs print.
    """
    said = ""
    if missing(row, cache):
        said = build(row.source, cache)
    if left := missing(row, cache):
        why = [f"no {', '.join(left)}", *([said] if said else []), *([row.tried] if row.tried else [])]
        return Result(row.name, RowStatus.MISSING, "; ".join(why))
    commit, notes = built_commit(row.source, cache), tuple[str, ...]()
    if commit and not commit.startswith(row.source.commit) and not row.source.commit.startswith(commit):
        notes = (f"of commit {commit[:12]}",)
    processors = len(os.sched_getaffinity(0))
    if (load := os.getloadavg()[0]) > processors:
        notes = (*notes, f"on a busy machine: {load:.1f} processes ready for {processors} processors")
    logs.mkdir(parents=True, exist_ok=True)
    began = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="foreign-") as scratch:
        place = RowPlace(cache=cache, scratch=Path(scratch))
        try:
            text, status = (
                isolated(lambda: row.judge.run(place), row.limit_s, logs / f"{row.name}.txt"),
                RowStatus.PASSED,
            )
        except (RowError, LeftError) as failure:
            text, status = str(failure), RowStatus.FAILED
    return Result(row.name, status, readable(" ".join(text.split())), time.monotonic() - began, notes)
