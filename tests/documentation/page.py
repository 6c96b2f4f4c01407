"""A page of the documentation as data: its fenced blocks, code spans, headings and links.

Lines directly before a fence may say how the block is to be taken, invisibly to a reader of the page:

    <!-- not run: REASON -->         it needs hardware or the network
    <!-- slow: REASON -->            it runs among the slow tests
    <!-- soak: REASON -->            it runs in `make soak`
    <!-- given: FILE = SOURCE -->    a file of the reader's; here a copy of SOURCE, a path from the root
"""

import re
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
RUN = {"python", "console", "sh", "c", "toml"}  # languages of blocks that are run
FENCE = re.compile(r"^(?P<indent>\s*)```(?P<language>\S*)\s*$")
NOTE = re.compile(r"^<!-- (?P<kind>not run|slow|soak|given): (?P<text>.+) -->$")
HEADING = re.compile(r"^#{1,6} +(?P<text>.+?) *$")
SPAN = re.compile(r"(?<!`)`(?P<text>[^`\n]+)`(?!`)")
LINK = re.compile(r"\]\((?P<page>[^)\s#:]*)(?:#(?P<anchor>[^)\s]+))?\)")


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """A fenced block, with what the lines before it say."""

    language: str
    text: str
    line: int  # of the fence, counted from 1
    section: int  # number of the heading above it
    notes: tuple[tuple[str, str], ...] = ()

    @property
    def pace(self) -> int:
        """Where it runs: 0 always, 1 among the slow tests, 2 in `make soak`."""
        return 2 if self.note("soak") else 1 if self.note("slow") else 0

    def note(self, kind: str) -> str | None:
        """Return the text of the note of that kind, or None."""
        return next((text for name, text in self.notes if name == kind), None)

    @property
    def is_run(self) -> bool:
        """Whether it is done what the block says."""
        return self.language in RUN and self.note("not run") is None

    @property
    def entries(self) -> list[tuple[str, list[str]]]:
        """Commands of a `console` or `sh` block, each with the lines of output that the page shows for it."""
        found: list[tuple[str, list[str]]] = []
        for line in re.sub(r"\\\n\s*", "", self.text).splitlines():
            if self.language == "sh":
                if line.strip() and not line.lstrip().startswith("#"):
                    found.append((line.strip(), []))
            elif line.startswith("$ "):
                found.append((line[2:], []))
            elif line == "^C":
                found.append((line, []))
            elif line.strip():
                assert found, f"line {self.line}: output without a command: {line}"
                found[-1][1].append(line)
        return found


@dataclass(frozen=True)
class Page:
    """A Markdown file of the repository."""

    path: Path
    blocks: list[Block] = field(init=False, default_factory=list)
    prose: list[str] = field(init=False, default_factory=list)  # lines outside of fences; inside, empty ones

    def __post_init__(self) -> None:
        inside: tuple[str, int, list[str]] | None = None
        section, notes = 0, []
        for number, line in enumerate(self.path.read_text(encoding="utf-8").splitlines(), 1):
            fence = FENCE.match(line)
            if inside is not None:
                language, start, lines = inside
                if fence:
                    text = "".join(f"{each}\n" for each in lines)
                    block = Block(language=language, text=text, line=start, section=section, notes=tuple(notes))
                    self.blocks.append(block)
                    inside, notes = None, []
                else:
                    lines.append(line)
                self.prose.append("")
                continue
            if fence:
                inside = (fence["language"], number, [])
            elif note := NOTE.match(line):
                notes.append((note["kind"], note["text"]))
            else:
                notes = []
                section += bool(HEADING.match(line))
            self.prose.append("" if fence else line)
        assert inside is None, f"{self}: the block of line {inside and inside[1]} has no end"

    def __str__(self) -> str:
        return self.path.relative_to(ROOT).as_posix()

    @cached_property
    def anchors(self) -> set[str]:
        """Anchors as GitHub makes them of headings."""
        found: set[str] = set()
        for line in self.prose:
            if heading := HEADING.match(line):
                words = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading["text"]).lower()
                slug = re.sub(r"[^\w\- ]", "", words).replace(" ", "-")
                copies = sum(re.fullmatch(rf"{re.escape(slug)}(-\d+)?", other) is not None for other in found)
                found.add(f"{slug}-{copies}" if copies else slug)
        return found

    def spans(self) -> Iterator[tuple[int, str]]:
        """Yield each code span of the prose with its line number."""
        for number, line in enumerate(self.prose, 1):
            for span in SPAN.finditer(line):
                yield number, span["text"].replace(r"\|", "|")

    def links(self) -> Iterator[tuple[int, str, str]]:
        """Yield line, page (empty: this one) and anchor (or empty) of each link inside the repository."""
        for number, line in enumerate(self.prose, 1):
            for link in LINK.finditer(SPAN.sub("``", line)):
                yield number, link["page"], link["anchor"] or ""


def pages() -> list[Page]:
    """Every Markdown file of the repository, whether committed already or new.

    The pages of the project that `p2os new` writes are for its folder: test_cli_new.py does what they say there.
    """
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", "*.md"],
        cwd=ROOT, capture_output=True, text=True, check=False, timeout=60,
    )  # fmt: skip
    names = listed.stdout.split() or [str(path.relative_to(ROOT)) for path in ROOT.glob("docs/*.md")]
    return [Page(ROOT / name) for name in sorted(names) if (ROOT / name).exists() and "/template/" not in name]
