"""The page as one file: the bundle, a header and its frames in it; nothing is loaded when it is opened.

The document is `bundle/index.html` with its places filled: style and script as they stand, the header as JSON, the
frames (and the script of the 3D view) as base64 of gzip. Its policy admits these scripts by their hashes and no others,
no requests, and pictures out of data alone.

Invariant: the same recording gives the same bytes; no text of the recording stands outside of the two data blocks and
the title, which is escaped.
"""

import base64
import gzip
import hashlib
import html
import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cache
from importlib.resources import files
from typing import cast

from p2os.json_record import of_json
from p2os.view.channels import WHOLE_PIXELS
from p2os.view.frames import ViewFrame
from p2os.view.header import PageHeader
from p2os.view.recording import ViewRecording

#: chosen: rows of each list; half a megabyte of packets, packed.
LISTED = 5000
#: Files of the bundle; the last one is for who looks into the package.
PAGE, STYLE, SCRIPT, SCENE = "index.html", "page.css", "page.js", "scene.js"
_HEADER = '<script type="application/json" id="header">'


@cache
def bundled(name: str) -> str:
    """Return a file of the bundle."""
    return files("p2os.view").joinpath("bundle", name).read_text(encoding="utf-8")


def page_of(recording: ViewRecording, *, all_is_in: str = "") -> str:
    """Return a recording as one HTML document; a long one as much as can be seen, with what is left out.

    Args:
        recording: What it shows.
        all_is_in: Where the rest is, for the lines on what is left out; empty: nowhere.
    """
    frames = list(recording.frames(WHOLE_PIXELS, LISTED))
    header = recording.full_header
    return document(replace(header, left_out=(*header.left_out, *left_out(header, frames, all_is_in))), frames)


def document(header: PageHeader, frames: Iterable[ViewFrame] = ()) -> str:
    """Return a page of a header and frames; one without channels is a report of sections alone."""
    data = b"".join(frame.to_bytes() for frame in frames)
    blocks = [f"{_HEADER}{_json(header)}</script>"]
    scripts = [bundled(SCRIPT)]
    if data:
        blocks.append(_block("frames", data))
    if header.world is not None:
        scripts.append(bundled(SCENE))
        blocks.append(_block("scene", bundled(SCENE).encode()))
    policy = (
        f"default-src 'none'; img-src data:; style-src {_hash(bundled(STYLE))}; "
        f"script-src {' '.join(map(_hash, scripts))}; base-uri 'none'; form-action 'none'"
    )
    title = f"{header.title} · {header.verdict}" if header.verdict else header.title
    return filled({
        "csp": f'<meta http-equiv="Content-Security-Policy" content="{policy}">',
        "title": html.escape(title),
        "style": f"<style>{bundled(STYLE)}</style>",
        "data": "\n".join(blocks),
        "script": f"<script>{bundled(SCRIPT)}</script>",
    })  # fmt: skip


def header_in(document: str) -> PageHeader:
    """Return the header of a page that is one file.

    Raises:
        ValueError, TypeError, KeyError: It is none.
    """
    text, end, _ = document.partition(_HEADER)[2].partition("</script>")
    if not end:
        raise ValueError("a document without a header")
    return cast("PageHeader", of_json(PageHeader, json.loads(text)))


def filled(places: Mapping[str, str]) -> str:
    """Return the document with its places filled; what is put in is not looked at for places."""
    text = bundled(PAGE)
    parts = []
    for name in ("csp", "title", "style", "data", "script"):
        before, _, text = text.partition(f"<!--{name}-->")
        parts += [before, places.get(name, "")]
    return "".join((*parts, text))


def left_out(header: PageHeader, frames: Iterable[ViewFrame], all_is_in: str) -> Iterator[str]:
    """Yield a line for each kind of rows of which a page has not all."""
    names = {channel.id: channel for channel in header.channels}
    kinds: dict[str, list[tuple[int, int, str]]] = {}
    for frame in frames:
        kinds.setdefault(frame.kind.name, []).append((frame.count, frame.of, names[frame.channel].name))
    for kind, found in kinds.items():
        shown, there = sum(row[0] for row in found), sum(row[1] for row in found)
        if shown < there:
            of = {name for one, all_, name in found if one < all_}
            which = f" of {next(iter(of))}" if len(of) == 1 else f" of {len(of)} channels"
            where = f"; {all_is_in} has all" if all_is_in else ""
            yield f"{kind}{which}: {shown} of {there} rows{where}"


def _json(header: PageHeader) -> str:
    """Return the header as JSON that ends no script element."""
    text = json.dumps(header.as_json(), ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def _block(name: str, data: bytes) -> str:
    packed = base64.b64encode(gzip.compress(data, mtime=0)).decode()
    return f'<script type="application/octet-stream" id="{name}">{packed}</script>'


def _hash(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
