"""Things that are made once a run, whichever of its workers needs them first."""

import fcntl
import os
from collections.abc import Callable
from pathlib import Path

import pytest


def made_once(factory: pytest.TempPathFactory, name: str, make: Callable[[Path], Path]) -> Path:
    """Return what `make` has made in the folder it is given, now or in another worker before.

    Args:
        factory: Of the worker.
        name: Of what is made, one of a kind in the run.
        make: Returns the file or folder that it has made; if it raises, the next one who asks tries again.
    """
    ours = factory.getbasetemp()
    folder = (ours.parent if "PYTEST_XDIST_WORKER" in os.environ else ours) / "made-once" / name
    folder.mkdir(parents=True, exist_ok=True)
    note = folder.with_suffix(".path")
    with folder.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not note.exists():
            note.write_text(str(make(folder)), encoding="utf-8")
    return Path(note.read_text(encoding="utf-8"))
