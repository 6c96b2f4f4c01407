"""How a page reads: its words, its sentences, the cells of its tables, and words that nobody outside knows.

    python -m tests.documentation.readability [--since COMMIT] [PAGE...]

prints a row a page; with a commit, what the page had there too. Counted is what people write: prose and tables
without fenced blocks and without tables that `make generated` writes. A code span is one word of a sentence. A
sentence ends at a full stop, a question mark, the end of its paragraph, list item or at a colon before a list.

textlint and vale were weighed: both need another language's packages on every machine that runs the tests, and know
neither the generated tables nor our own words; the four rules are fewer lines than their configuration.
"""

import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

#: Words of the longest sentence, and of the mean one of a page.
LONGEST, MEAN = 40, 18.0
#: Characters of a table's cell as they are read (a link is its text).
CELL = 120
#: Words of ARCHITECTURE.md without its tables.
MAP_WORDS = 1500

#: Turns of phrase of our own, and what to write in their place.
OURS = {
    r"\bwho names no\b": "without, by default",
    r"\b(?:that|what|which|where|it|this|all|page|section|list|table) (?:of .{1,20} )?stands? in\b": "is in",
    r"\bstands? (?:there|here|below|above|beside|beneath)\b": "is",
    r"\bsaid aloud\b": "reported",
    r"\bnoticed aloud\b": "reported",
    r"\bskipped aloud\b": "skipped with a message",
    r"\baloud\b": "with a message",
    r"\bas if it slept\b": "at the speed of sleeping",
    r"\bwhat is asked\b": "the request",
    r"\bwere all else\b": "if everything else",
    r"\bfor ever\b": "forever",
    r"\bfind theirs\b": "find the equivalent",
    r"\bwhat became of\b": "the result of",
    r"\bcame to nothing\b": "failed",
    r"\bmakes? good\b": "corrects",
    r"(?-i:\bis none\b)": "is not one",
    r"\bof (?:ours|theirs|yours)\b": "our, their, your",
    r"\bof one's own\b": "your own",
    r"\b(?:mends?|mended)\b": "fix",
    r"\bhouses?\b(?!\.md|=)": "distribution",
    r"\bthe judge\b": "the test",
    r"\ba sitting\b": "a day",
    r"\bthis sitting\b": "today",
    r"\bgoes on as\b": "continues as",
    r"\bby (?:its|their) own hand\b": "itself",
}  # fmt: skip

_FENCE = re.compile(r"^\s*```")
_MADE = re.compile(r"^<!-- (?:table|ranges|instructions)\b")
_END = re.compile(r"^<!-- end\b")
_ITEM = re.compile(r"^\s*(?:[-*+]|\d+\.)\s+")
_SPAN = re.compile(r"(`+)(.+?)\1")
_LINK = re.compile(r"!?\[([^\]]*)\]\([^)]*\)")
_WORD = re.compile(r"\S*\w\S*")
_STOP = re.compile(r"(?<=[.?!])[)\"*_]*\s+(?=[(\"*_\[]*[A-Z0-9Q`])")
#: Full stops that end no sentence.
_SHORT = re.compile(r"\b(e\.g|i\.e|cf|vs|etc|approx|No|Fig)\.")


def plain(text: str) -> str:
    """Return Markdown as it is read: a link is its text, a code span the one word `Q`."""
    text = _SPAN.sub("Q", text)
    text = _LINK.sub(r"\1", text)
    return re.sub(r"<[^>]+>", "", text)


def words(text: str) -> int:
    """Count the words of a text that `plain` has made."""
    return len(_WORD.findall(text))


@dataclass(frozen=True)
class Reading:
    """What is counted of a page."""

    text: str

    @cached_property
    def lines(self) -> list[str]:
        """Lines that somebody wrote: neither fenced nor generated; empty ones in their place."""
        found: list[str] = []
        all_lines = self.text.splitlines()
        ends = [n for n, line in enumerate(all_lines) if _END.match(line)]
        fenced, made_until = False, -1
        for number, line in enumerate(all_lines):
            if _FENCE.match(line):
                fenced = not fenced
                found.append("")
            elif not fenced and number > made_until and _MADE.match(line):
                made_until = next((end for end in ends if end > number), -1)
                found.append("")
            else:
                found.append("" if fenced or number <= made_until or line.startswith("<!--") else line)
        return found

    @cached_property
    def cells(self) -> list[tuple[int, str]]:
        """Cells of tables with their lines, as they are read."""
        return [
            (number, _LINK.sub(r"\1", cell).replace("`", "").strip())
            for number, line in enumerate(self.lines, 1) if line.lstrip().startswith("|")
            for cell in re.split(r"(?<!\\)\|", line.strip().strip("|")) if not re.fullmatch(r"[\s:-]*", cell)
        ]  # fmt: skip

    @cached_property
    def sentences(self) -> list[tuple[int, str]]:
        """Sentences of paragraphs and list items, each with the line at which its paragraph begins."""
        found: list[tuple[int, str]] = []
        for number, paragraph in self._paragraphs():
            text = _SHORT.sub(r"\1", plain(paragraph))
            found += [(number, one) for one in _STOP.split(text) if words(one)]
        return found

    def _paragraphs(self) -> Iterator[tuple[int, str]]:
        start, held = 0, ""
        for number, line in enumerate([*self.lines, ""], 1):
            is_apart = not line.strip() or line.startswith("#") or line.lstrip().startswith("|")
            if is_apart or _ITEM.match(line):
                if held:
                    yield start, held
                start, held = number, "" if is_apart else _ITEM.sub("", line)
            else:
                start, held = (start, f"{held} {line.strip()}") if held else (number, line.strip())

    @cached_property
    def words(self) -> int:
        """All words: headings, prose and tables."""
        return sum(words(plain(line.replace("|", " "))) for line in self.lines)

    @cached_property
    def words_of_prose(self) -> int:
        """Words of headings and prose."""
        return sum(words(plain(line)) for line in self.lines if not line.lstrip().startswith("|"))

    @property
    def mean(self) -> float:
        """Words of the mean sentence."""
        return sum(words(one) for _, one in self.sentences) / max(1, len(self.sentences))

    @property
    def longest(self) -> int:
        """Words of the longest sentence."""
        return max((words(one) for _, one in self.sentences), default=0)

    @property
    def wide_cells(self) -> list[tuple[int, str]]:
        """Cells that no line holds."""
        return [(number, cell) for number, cell in self.cells if len(cell) > CELL]

    @property
    def ours(self) -> list[tuple[int, str]]:
        """Phrases of our own, with what to write instead."""
        found = []
        for number, line in enumerate(self.lines, 1):
            text = plain(line)
            found += [(number, f"{hit[0]!r}: {instead}") for phrase, instead in OURS.items()
                      for hit in re.finditer(phrase, text, re.IGNORECASE)]  # fmt: skip
        return found

    def figures(self) -> tuple[float, int, int, int]:
        """Mean, longest sentence, wide cells, phrases of our own."""
        return (round(self.mean, 1), self.longest, len(self.wide_cells), len(self.ours))


#: What `make generated` writes whole, and what is no page of ours to read through.
NOT_READ = {"CHANGELOG.md", "docs/registers.md", "docs/sequences.md"}


def read_pages() -> dict[str, Reading]:
    """Every page that is held to the rules."""
    names = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/*.md")])
    return {
        name: Reading(path.read_text(encoding="utf-8"))
        for path in names if (name := path.relative_to(ROOT).as_posix()) not in NOT_READ
    }  # fmt: skip


def _before(commit: str, name: str) -> Reading:
    shown = subprocess.run(
        ["git", "show", f"{commit}:{name}"], cwd=ROOT, capture_output=True, text=True, check=False, timeout=60
    )
    return Reading(shown.stdout)


def main(arguments: list[str]) -> None:
    """Print the figures of pages, and of one that is named what breaks a rule."""
    since = arguments[1] if arguments[:1] == ["--since"] else None
    named = arguments[2:] if since else arguments
    row = "{:<28}{:>8}{:>8}{:>7}{:>9}{:>7}{:>7}"
    print(row.format("page", "before", "words", "mean", "longest", "cells", "ours"))  # noqa: T201 -- what it is for
    before_all = after_all = 0
    for name, page in read_pages().items():
        if named and name not in named:
            continue
        before = _before(since, name).words if since else 0
        before_all, after_all = before_all + before, after_all + page.words
        mean, longest, cells, ours = page.figures()
        print(row.format(name, before or "", page.words, mean, longest, cells, ours))  # noqa: T201
        if named:
            for number, text in faults(page):
                print(f"  {name}:{number}: {text}")  # noqa: T201
    print(row.format("all", before_all or "", after_all, "", "", "", ""))  # noqa: T201


def faults(page: Reading) -> list[tuple[int, str]]:
    """Every place of a page that breaks a rule, by line."""
    long = [(n, f"{words(text)} words: {text[:90]}") for n, text in page.sentences if words(text) > LONGEST]
    wide = [(n, f"cell of {len(cell)} characters: {cell[:70]}") for n, cell in page.wide_cells]
    return sorted([*long, *wide, *page.ours])


if __name__ == "__main__":
    main(sys.argv[1:])
