"""What verbs print, in an empty folder, and what came of a run that was none."""

import contextlib
import io
import os
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest import mock

import typer

from robot_bench.run import RunResult
from simbase.errors import P2osError
from tests.tools.suite.approved import rounded


@contextlib.contextmanager
def in_folder() -> Iterator[Path]:
    """Stand in an empty folder, at a terminal of 80 columns that is none."""
    before = Path.cwd()
    with TemporaryDirectory(prefix="p2os-test-") as name, mock.patch.dict(os.environ, {"COLUMNS": "80"}):
        os.chdir(name)
        try:
            yield Path(name)
        finally:
            os.chdir(before)


def printed(action: Any, *arguments: object, **named: object) -> Iterator[str]:
    """Yield what something prints, and how it ends."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            ended = action(*arguments, **named)
        except typer.Exit as error:
            ended = f"exit {error.exit_code}"
        except P2osError as error:
            ended = f"{error} ({error.hint})"
    yield from (rounded(line) for line in out.getvalue().splitlines())
    yield from (f"! {rounded(line)}" for line in err.getvalue().splitlines())
    yield f"= {ended}"


OUTCOME: dict[str, object] = {
    "scenario": "mine",
    "world": "room",
    "mode": "adapter",
    "body": "kinematic",
    "seed": 3,
    "virtual_s": 12.34,
    "passed": True,
    "real_time_factor": 7.77,
    "distance_m": 1.234,
    "collisions": 2,
    "min_clearance_m": 0.1234,
    "usart_baud": 9600,
    "usart_lines": 2,
    "usart_last": "bye",
    "coverage": None,
    "trace_sha256": "0123456789abcdef0123",
    "last_blocks": None,
    "notes": [],
    "hits": [],
    "failures": [],
    "goals_met": ["a", "b"],
    "goals_not_judged": [],
    "explained": None,
}


def result_of(**changes: object) -> RunResult:
    outcome: Any = OUTCOME | changes
    stopped = bool(changes.get("interrupted"))
    return RunResult(folder=Path("runs/1"), outcome=outcome, report=Path("runs/1/report.html"), was_interrupted=stopped)
