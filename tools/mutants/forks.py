"""Runs of pytest, forked from one process that has imported what they all do: `python -m tools.mutants.forks`.

A line of JSON from standard input begins a run, and two lines answer: its process as soon as it is there, then how it
has ended. The packages are imported by each run anew: they are what changes from one to the next.
"""

import gc
import importlib
import json
import os
import resource
import sys
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NoReturn

#: What nearly all tests import, none of it of the project.
PRELOADED = (
    "pytest", "xdist.plugin", "_hypothesis_pytestplugin", "hypothesis.strategies", "hypothesis.stateful",
    "typer.testing", "numpy", "unicorn", "elftools.elf.elffile", "serial", "asyncio", "rich.console",
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class PytestRun:
    """What a run is to do, and within which bounds.

    Args:
        words: Of pytest's command line.
        environment: Variables beside those of this process.
        cpu_s: Seconds of a processor that each of its processes has.
        file_bytes: How long a file may become.
    """

    words: tuple[str, ...]
    environment: dict[str, str]
    cpu_s: int
    file_bytes: int

    @property
    def line(self) -> str:
        """Return it as the process takes it."""
        return f"{json.dumps(asdict(self))}\n"


def main() -> None:
    """Serve until standard input ends."""
    for name in PRELOADED:
        with suppress(ImportError):  # an extra
            importlib.import_module(name)
    gc.freeze()
    for line in sys.stdin:
        process = os.fork()
        if not process:
            _run(json.loads(line))
        _answer(process)
        _, status, used = os.wait4(process, 0)
        _answer({"code": os.waitstatus_to_exitcode(status), "seconds": used.ru_utime + used.ru_stime})


def _answer(said: Any) -> None:
    sys.stdout.write(f"{json.dumps(said)}\n")
    sys.stdout.flush()


def _run(wanted: dict[str, Any]) -> NoReturn:
    """Be a run of pytest, in a session of its own."""
    code = 3
    try:
        os.setsid()
        _, most = resource.getrlimit(resource.RLIMIT_CPU)
        resource.setrlimit(resource.RLIMIT_CPU, (wanted["cpu_s"], most))
        resource.setrlimit(resource.RLIMIT_FSIZE, (wanted["file_bytes"], wanted["file_bytes"]))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        nowhere = os.open(os.devnull, os.O_RDWR)
        for stream in range(3):
            os.dup2(nowhere, stream)
        os.environ.update(wanted["environment"])
        import pytest

        sys.argv = ["pytest", *wanted["words"]]
        code = int(pytest.main(wanted["words"]))
    finally:
        os._exit(code)


if __name__ == "__main__":
    sys.path[0] = str(Path.cwd())
    main()
