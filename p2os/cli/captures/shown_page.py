"""The page of a verb: served for as long as it runs, its link printed and opened in the browser."""

import contextlib
import sys
import webbrowser
from collections.abc import Iterator
from typing import Annotated

import typer

from p2os.view.live import ShownSource
from p2os.view.targets import ServedPage, served

HOST = "127.0.0.1"
Viewed = Annotated[bool, typer.Option("--view", help="Show it on a page in the browser, too.")]
NoBrowser = Annotated[bool, typer.Option("--no-browser", help="With a page: print its link, open nothing.")]


@contextlib.contextmanager
def shown(source: ShownSource, *, is_opened: bool = True, host: str = HOST, port: int = 0) -> Iterator[ServedPage]:
    """Serve a page for a block, print its link to standard error, and open it where there is a browser.

    Raises:
        UsageError, MissingDependencyError: As of `served`.
    """
    with served(source, host, port) as page:
        sys.stderr.write(f"page: {page.url}\n")
        if page.watch_url:
            sys.stderr.write(f"to look on: {page.watch_url}\n")
        sys.stderr.flush()
        if is_opened:
            with contextlib.suppress(webbrowser.Error):
                webbrowser.open(page.url)
        yield page
