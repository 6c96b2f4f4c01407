"""A page that is one file, read back as its script reads it."""

import base64
import gzip
import json
import re
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from p2os.view.frames import ViewFrame, frames_in

_BLOCK = r'<script type="{kind}" id="{name}">(.*?)</script>'


@dataclass
class ReadPage:
    """What a page holds."""

    text: str

    @cached_property
    def header(self) -> dict[str, Any]:
        """Its header."""
        found: dict[str, Any] = json.loads(self._block("application/json", "header"))
        return found

    @cached_property
    def frames(self) -> dict[str, ViewFrame]:
        """Its frames, by the channel's name, behind its robot's where there are several."""
        packed = self._block("application/octet-stream", "frames")
        names = {one["id"]: f"{one['source']} {one['name']}".strip() for one in self.header["channels"]}
        kinds = {one["id"]: one["kind"] for one in self.header["channels"]}
        frames = frames_in(gzip.decompress(base64.b64decode(packed)))
        return {
            (f"{names[one.channel]} waves" if kinds[one.channel] == "waves" else names[one.channel]): one
            for one in frames
        }

    def rows(self, channel: str) -> list[tuple[Any, ...]]:
        """Return the rows of a channel."""
        frame = self.frames[channel]
        columns = [
            values if not column.is_wide
            else [tuple(values[at : at + frame.width]) for at in range(0, len(values), frame.width)]
            for column, values in zip(frame.kind.columns, frame.columns, strict=True)
        ]  # fmt: skip
        return list(zip(*columns, strict=True))

    def section(self, title: str) -> dict[str, Any]:
        """Return a section."""
        return next(one for one in self.header["sections"] if one["title"] == title)

    def table(self, title: str) -> list[list[str]]:
        """Return the texts of a section's first table."""
        block = next(one for one in self.section(title)["blocks"] if one["kind"] == "table")
        return [[cell["text"] for cell in row] for row in block["rows"]]

    def _block(self, kind: str, name: str) -> str:
        found = re.search(_BLOCK.format(kind=kind, name=name), self.text, re.DOTALL)
        assert found is not None, f"no block {name}"
        return found[1]
