"""A process inside one checkout that runs the jobs of `probe.py`; killed and started anew where a job hangs."""

import json
import os
import select
import subprocess
import sys
from pathlib import Path
from typing import IO, Any

PROBE = Path(__file__).with_name("probe.py")
PACKAGE = "bluepill_sim"


class WorkerError(Exception):
    """A job did not end as it should."""


class Worker:
    """One checkout's probe."""

    def __init__(self, checkout: Path, budget_s: float) -> None:
        """Start nothing yet.

        Args:
            checkout: its folder.
            budget_s: the longest that a job may take, in s.
        """
        self.checkout = checkout.resolve()
        #: The longest that a job may take.
        self.budget_s = budget_s
        self._process: subprocess.Popen[str] | None = None

    def ask(self, do: str, **job: Any) -> Any:
        """Run a job and return its answer.

        Raises:
            WorkerError: it failed, the process died, or it took too long.
        """
        process = self._process or self._start()
        try:
            _there(process.stdin).write(json.dumps({"do": do, **job}) + "\n")
            _there(process.stdin).flush()
        except OSError:
            return self._died()
        if not select.select([_there(process.stdout)], [], [], self.budget_s)[0]:
            self.close()
            raise WorkerError(f"did not end within {self.budget_s:g} s")
        line = _there(process.stdout).readline()
        if not line:
            return self._died()
        answer = json.loads(line)
        if "error" in answer:
            raise WorkerError(f"failed: {answer['error']}")
        return answer

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
            self._process = None

    def _start(self) -> "subprocess.Popen[str]":
        own = self.checkout / ".venv" / "bin" / "python"
        self._process = subprocess.Popen(
            [str(own) if own.exists() else sys.executable, "-P", str(PROBE)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            cwd=self.checkout,
            env={**os.environ, "PYTHONPATH": str(self.checkout)},
        )
        return self._process

    def _died(self) -> Any:
        process, self._process = self._process, None
        code = None if process is None else process.wait()
        raise WorkerError(f"took its process with it ({code})")


def _there(stream: IO[str] | None) -> IO[str]:
    if stream is None:
        raise RuntimeError("the probe was started without a pipe")
    return stream
