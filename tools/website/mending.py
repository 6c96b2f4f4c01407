"""What is changed in the built pages: the one script that Zensical would have from another host is ours."""

import re
from pathlib import Path

#: What lets a search work in a page that was opened from a file: it would be fetched from a network of copies.
SHIM = re.compile(r"https://unpkg\.com/iframe-worker[^\"]*")
OWN = Path("assets") / "file_worker.js"


def mend(folder: Path) -> None:
    """Lead every page of a built site to our own script."""
    for page in folder.rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        up = "../" * (len(page.relative_to(folder).parts) - 1)
        page.write_text(SHIM.sub(f"{up}{OWN.as_posix()}", text), encoding="utf-8")
