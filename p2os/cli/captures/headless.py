"""A browser without a window, told what to show and asked for pictures: Chromium or Chrome, by a pipe of its own.

Nothing listens: commands go in by descriptor 3 and answers come out by 4, each JSON with a 0 behind it.

Source: Chrome DevTools Protocol, domains Page, Runtime, Emulation; `--remote-debugging-pipe`.
Invariant: the browser, and the folder that it keeps its things in, are gone when the block is left.
"""

import base64
import contextlib
import json
import os
import select
import shutil
import subprocess
import time
from collections.abc import Iterator
from tempfile import TemporaryDirectory
from typing import cast

from p2os.errors import RunFailedError
from simbase.errors import MissingDependencyError

#: As distributions and makers call them.
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "microsoft-edge")
#: chosen: a page that takes longer to come, or to draw itself, is taken for one that never does, seconds.
PATIENCE_S = 60.0
_READ_BYTES = 1 << 16


class HeadlessPage:
    """One page of a browser without a window.

    Args:
        commands, answers: Descriptors of the pipe.
    """

    def __init__(self, commands: int, answers: int) -> None:
        self._commands, self._answers = commands, answers
        self._number, self._read = 0, bytearray()
        self._session = ""
        target = cast("str", self._ask("Target.createTarget", url="about:blank")["targetId"])
        attached = self._ask("Target.attachToTarget", targetId=target, flatten=True)
        self._session = cast("str", attached["sessionId"])

    def open(self, url: str, width: int, height: int, *, is_dark: bool) -> None:
        """Show a page in so many pixels.

        Raises:
            RunFailedError: It does not come.
        """
        scheme = {"name": "prefers-color-scheme", "value": "dark" if is_dark else "light"}
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self._ask("Emulation.setDeviceMetricsOverride", **size)
        self._ask("Emulation.setEmulatedMedia", features=[scheme])
        self._ask("Page.navigate", url=url)

    def evaluate(self, expression: str) -> object:
        """Return what an expression of JavaScript is, a promise's result once it is there.

        Raises:
            RunFailedError: It throws.
        """
        found = self._ask("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in found:
            raise RunFailedError(f"the page: {json.dumps(found['exceptionDetails'])[:200]}")
        return cast("dict[str, object]", found["result"]).get("value")

    def wait_for(self, expression: str) -> None:
        """Wait until an expression of JavaScript is true.

        Raises:
            RunFailedError: It never is.
        """
        end = time.monotonic() + PATIENCE_S
        while not self.evaluate(f"Boolean({expression})"):
            if time.monotonic() > end:
                raise RunFailedError(f"the page did not come within {PATIENCE_S:g} s")
            time.sleep(0.05)

    def picture(self) -> bytes:
        """Return what it shows as a PNG."""
        return base64.b64decode(cast("str", self._ask("Page.captureScreenshot", format="png")["data"]))

    def _ask(self, method: str, **about: object) -> dict[str, object]:
        self._number += 1
        command: dict[str, object] = {"id": self._number, "method": method, "params": about}
        if self._session:
            command["sessionId"] = self._session
        with contextlib.suppress(BrokenPipeError):  # it has ended: its answer does not come either
            os.write(self._commands, json.dumps(command).encode() + b"\0")
        while True:
            answer = self._next()
            if answer.get("id") != self._number:
                continue  # an event
            if "error" in answer:
                raise RunFailedError(f"the browser: {answer['error']}")
            return cast("dict[str, object]", answer["result"])

    def _next(self) -> dict[str, object]:
        while b"\0" not in self._read:
            is_there = select.select([self._answers], [], [], PATIENCE_S)[0]
            data = os.read(self._answers, _READ_BYTES) if is_there else b""
            if not data:
                raise RunFailedError("the browser does not answer", hint="does it start by itself?")
            self._read += data
        text, _, self._read = self._read.partition(b"\0")
        found: dict[str, object] = json.loads(text)
        return found


@contextlib.contextmanager
def headless_page() -> Iterator[HeadlessPage]:
    """Start a browser without a window for a block.

    Raises:
        MissingDependencyError: There is none.
        RunFailedError: It does not answer.
    """
    program = next(filter(None, map(shutil.which, BROWSERS)), None)
    if program is None:
        raise MissingDependencyError(
            "a picture of the page needs Chromium or Chrome, which is not here", hint="apt-get install chromium"
        )
    theirs_in, commands = os.pipe()
    answers, theirs_out = os.pipe()
    with (
        TemporaryDirectory(prefix="p2os-render-", ignore_cleanup_errors=True) as folder,
        contextlib.ExitStack() as ends,
    ):
        words = [
            "--headless", "--remote-debugging-pipe", "--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader",
            "--hide-scrollbars", "--no-first-run", "--disable-background-networking", f"--user-data-dir={folder}",
        ]  # fmt: skip
        ends.callback(os.close, commands)
        ends.callback(os.close, answers)
        # Its descriptors 3 and 4, whatever ours are; a shell's <& takes one digit alone.
        shell = [
            "/bin/sh",
            "-c",
            f'exec 3</dev/fd/{theirs_in} 4>/dev/fd/{theirs_out}; exec "$@"',
            "sh",
            program,
            *words,
        ]
        browser = subprocess.Popen(  # noqa: S603 - one of `BROWSERS`
            shell, pass_fds=(theirs_in, theirs_out), stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )  # fmt: skip
        os.close(theirs_in)
        os.close(theirs_out)
        try:
            yield HeadlessPage(commands, answers)
        finally:
            browser.terminate()
            with contextlib.suppress(subprocess.TimeoutExpired):
                browser.wait(5.0)
            browser.kill()
            browser.wait()
