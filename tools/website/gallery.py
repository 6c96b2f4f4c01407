"""The page of pictures: each that docs/ shows, with the words that it has there, and the page that explains it."""

import os
import re
from pathlib import Path

from tests.documentation.page import ROOT, pages

SHOWN = re.compile(r"!\[(?P<words>[^]]+)\]\((?P<file>[^)\s]+)\)")
PICTURES = ROOT / "docs" / "pictures"
_HEAD = """# Gallery

Every picture of these pages is made by this project's own tools: `make pictures` draws anew what has changed, and
`make test` names a picture that is older than what it shows. Each leads to the page that explains it.

<div class="gallery" markdown>
"""


def page() -> str:
    """Return the page."""
    parts, seen = [_HEAD], set[Path]()
    for one in pages():
        for shown in SHOWN.finditer("\n".join(one.prose)):
            picture = (one.path.parent / shown["file"]).resolve()
            if not one.path.is_relative_to(ROOT / "docs") or not picture.is_relative_to(PICTURES) or picture in seen:
                continue
            seen.add(picture)
            file, where = (os.path.relpath(path, ROOT / "docs") for path in (picture, one.path))
            parts.append(f"[![{shown['words']}]({file}){{ loading=lazy }}]({where})\n")
    return "\n".join(parts) + "\n</div>\n"
