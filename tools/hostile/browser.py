"""A page of somebody else's in a real browser, which sends what it can to ports of this machine."""

import base64
import contextlib
import os
import shutil
import signal
import subprocess
import tempfile
import threading
from collections.abc import Sequence
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

PROGRAMS = ("chromium", "chromium-browser", "google-chrome")
#: No sandbox, which root has none of; nothing goes beyond this machine.
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync",
    "--disable-background-networking", "--disable-component-update",
)  # fmt: skip
#: A browser that starts on a busy machine.
LIMIT_S = 30.0
PAGE = """<!doctype html><script>
const body = Uint8Array.from(atob("$body"), (each) => each.charCodeAt(0));
for (const port of [$ports]) for (let n = 0; n < 3; n += 1) {
  fetch(`http://127.0.0.1:${port}/`, {method: "POST", mode: "no-cors", body}).catch(() => 0);
  fetch(`http://127.0.0.1:${port}/json`, {mode: "no-cors"}).catch(() => 0);
  const line = new WebSocket(`ws://127.0.0.1:${port}/`, ["foxglove.sdk.v1", "foxglove.websocket.v1"]);
  line.onopen = () => line.send(body);
}
fetch("/sent");
</script>"""


class MissingProgramError(Exception):
    """What an attack needs is not installed."""


def post_from_a_page(ports: Sequence[int], body: bytes, lasts_s: float) -> None:
    """Open a page that posts a body to each port and tries a WebSocket there, and leave it open for a while.

    Raises:
        MissingProgramError: There is no browser.
        RuntimeError: The browser did not come to the end of the page's script.
    """
    program = next(filter(None, map(shutil.which, PROGRAMS)), None)
    if program is None:
        raise MissingProgramError("no Chromium here (hint: apt-get install chromium)")
    page = PAGE.replace("$body", base64.b64encode(body).decode()).replace("$ports", ",".join(map(str, ports))).encode()
    is_sent = threading.Event()

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            if self.path == "/sent":
                is_sent.set()
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(page if self.path == "/" else b"")

        def log_message(self, *_args: object) -> None:
            """Say nothing."""

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server, tempfile.TemporaryDirectory() as profile:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        words = [program, *FLAGS, f"--user-data-dir={profile}", f"http://127.0.0.1:{server.server_port}/"]
        quiet = subprocess.DEVNULL
        browser = subprocess.Popen(words, stdin=quiet, stdout=quiet, stderr=quiet, start_new_session=True)
        try:
            if not is_sent.wait(LIMIT_S):
                raise RuntimeError(f"{program} did not open the page")
            with contextlib.suppress(subprocess.TimeoutExpired):
                browser.wait(lasts_s)
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(browser.pid, signal.SIGKILL)
            browser.wait()
            server.shutdown()
