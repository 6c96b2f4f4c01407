"""The page of fidelity: per peripheral and per robot what is modelled, what was chosen, what it was compared with.

Nothing is said here twice: what is modelled and chosen is that of docs/peripherals.md, the drivers' rows are those of
tests/bluepill_sim/peripherals/sequences, what silicon has shown is the table of docs/silicon.md, and a robot's numbers
and their sources are those of its file in p2os/robots.
"""

import re
import tomllib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tests.bluepill_sim.peripherals.sequences.table import ROWS

ROOT = Path(__file__).resolve().parents[2]
SECTION = re.compile(r"^## (?P<title>.+?)$(?P<text>.*?)(?=^## |\Z)", re.MULTILINE | re.DOTALL)
#: What begins a paragraph or an item of a list that says more than what is modelled.
MARK = re.compile(r"\*{0,2}\b(?P<kind>chosen|not modelled)\*{0,2}(?P<more>[^:.*]{0,40}):\s*", re.IGNORECASE)
#: A choice within a sentence.
ASIDE = re.compile(r"\(\*chosen\*: (?P<said>[^()]*(?:\([^()]*\)[^()]*)*)\)")
#: How docs/silicon.md writes that silicon has shown nothing yet.
NOTHING = {"–": "nothing"}
#: Sources of a robot's numbers, as its file's comments name them.
SOURCES = ("ARIA", "player", "MobileSim", "manual", "RosAria", "AMRISim")
_HEAD = """# Fidelity

How far each model is to be trusted: what it does, what was *chosen* where the manuals are silent, what it was compared
with, and what nobody here has seen. Made of the data sheets when this site is built.

**Nobody here has had a Pioneer, and no model was measured on our own silicon.** Drivers' rows are sentences of public
drivers, headers and manuals that are checked on the models ([the order of things](sequences.md)); silicon is what
others have published, and what the [kit](silicon.md) will compare. Whole programs of others that run on the chip or
drive the robot stand in [foreign programs](foreign.md), and [validation](validation.md) has the bench as a whole.

## Peripherals

Figures count statements of the data sheets; each leads to what they say.

| peripheral | modelled | chosen | not modelled | drivers' rows held | seen on silicon | the kit compares |
|---|---|---|---|---|---|---|
"""
_ROBOTS = """
## Robots

Each number of a robot's file has its source beside it; `chosen` counts those that nobody says. Seen at a real robot:
none. [The virtual Pioneer](pioneer.md) has the controller's data sheet, and [validation](validation.md) lays it beside
a simulator of others.

| robot | file | based on | controller | sources named | chosen |
|---|---|---|---|---|---|
"""


@dataclass(frozen=True, slots=True)
class DataSheet:
    """What docs/peripherals.md says of a model."""

    title: str
    anchor: str
    modelled: int  # items that say what it does
    chosen: tuple[str, ...]
    not_modelled: tuple[str, ...]


def models(text: str) -> Iterator[DataSheet]:
    """Yield the models of the page of data sheets: its sections that name a source file of a peripheral."""
    for section in SECTION.finditer(text):
        said: dict[str, list[str]] = {"chosen": [], "not modelled": []}
        about, *items = re.split(r"\n\s*\n|\n(?=- )", section["text"].strip())
        if not re.match(r"`(?:peripherals|fabric)/", about):
            continue
        modelled, below = 0, ""  # what a mark at the end of a paragraph says of the list below it
        for item in items:
            words, listed = " ".join(item.removeprefix("- ").split()), item.startswith("- ")
            said["chosen"] += [aside["said"] for aside in ASIDE.finditer(words)]
            words = ASIDE.sub("", words)
            marks = list(MARK.finditer(words))
            if below and listed and not marks:
                kind, _, more = below.partition(":")
                said[kind] += [more + one for one in statements(words)]
                continue
            below = ""
            modelled += listed and not (marks and marks[0].start() == 0)
            ends = [*(one.start() for one in marks), len(words)][1:]
            for mark, end in zip(marks, ends, strict=True):
                kind, more = mark["kind"].lower(), f"{mark['more'].strip(' ,')}: " if mark["more"].strip(" ,") else ""
                found = statements(words[mark.end() : end])
                said[kind] += [more + one for one in found]
                below = "" if found else f"{kind}:{more}"
        title = section["title"]
        yield DataSheet(title, slug(title), modelled, tuple(said["chosen"]), tuple(said["not modelled"]))


def statements(text: str) -> list[str]:
    """Return the statements of a paragraph: what semicolons and full stops part, outside of brackets."""
    parts, depth, start = [], 0, 0
    for at, sign in enumerate(text):
        depth += (sign == "(") - (sign == ")")
        if depth == 0 and (sign == ";" or (sign == "." and text[at + 1 : at + 2] in {" ", ""})):
            parts.append(text[start:at].strip())
            start = at + 1
    return [part for part in [*parts, text[start:].strip()] if part]


def slug(title: str) -> str:
    """Return the anchor of a heading."""
    return re.sub(r"[^\w\- ]", "", re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", title).lower()).replace(" ", "-")


def silicon() -> dict[str, tuple[str, str]]:
    """Return what silicon has shown and what the kit compares, by the anchor that a row of docs/silicon.md leads to."""
    rows = re.findall(
        r"^\| ([^|]+) \| [^|]*\(peripherals\.md#([\w-]+)\)[^|]* \| ([^|]*) \| ([^|]*) \|$",
        (ROOT / "docs" / "silicon.md").read_text(encoding="utf-8"), re.MULTILINE,
    )  # fmt: skip
    return {name.strip(): (NOTHING.get(shown.strip(), shown.strip()), kit.strip()) for name, _, shown, kit in rows}


def family(title: str) -> set[str]:
    """Return the kinds of peripherals that a title is about: {"USART"} of "USART1 to USART3", {"CAN"} of "bxCAN"."""
    return {re.sub(r"^BX|\d+$|(?<=^GPIO)[A-E]$", "", name) for name in re.findall(r"[A-Z][A-Z0-9]+", title.upper())}


def page() -> str:
    """Return the page."""
    held: Counter[str] = Counter(row.peripheral.upper() for row in ROWS if row.check is not None)
    asked: Counter[str] = Counter(row.peripheral.upper() for row in ROWS)
    measured = silicon()
    lines, details = [], []
    for model in models((ROOT / "docs" / "peripherals.md").read_text(encoding="utf-8")):
        names = family(model.title)
        rows = sum(asked[name] for name in names)
        shown, kit = next((value for name, value in measured.items() if names & family(name)), ("nothing", "no"))
        drivers = f"{sum(held[name] for name in names)} of {rows}" if rows else "no rows"
        modelled = f"[{model.modelled}](peripherals.md#{model.anchor})"
        counts = (_count(said, model) for said in (model.chosen, model.not_modelled))
        cells = (model.title, modelled, *counts, drivers, shown, kit)
        lines.append(f"| {' | '.join(cells)} |")
        if model.chosen or model.not_modelled:
            details += [f"### {model.title}", ""]
            details += [f"- *chosen*: {one}" for one in model.chosen]
            details += [f"- *not modelled*: {one}" for one in model.not_modelled]
            details.append("")
    parts = [_HEAD, "\n".join(lines), "\n", _ROBOTS, "\n".join(robots()), "\n\n## Peripherals, in words\n\n"]
    return "".join(parts) + "\n".join(details)


def _count(said: tuple[str, ...], model: DataSheet) -> str:
    return f"[{len(said)}](#{slug(model.title)})" if said else "0"


def robots() -> Iterator[str]:
    """Yield a row for each robot's file; what it leaves out is that of the file that it is based on."""
    folder = ROOT / "p2os" / "robots"
    for path in sorted(folder.glob("*.toml")):
        texts = [path.read_text(encoding="utf-8")]
        while base := tomllib.loads(texts[-1]).get("based_on"):
            texts.append((folder / f"{base}.toml").read_text(encoding="utf-8"))
        found = [tomllib.loads(text) for text in texts]
        firmware = next(one["firmware"] for one in found if "firmware" in one)
        comments = "\n".join(re.findall(r"#(.*)$", "\n".join(texts), re.MULTILINE))
        named = [one for one in SOURCES if one.lower() in comments.lower()]
        chosen = len(re.findall(r"^ chosen\b", comments, re.MULTILINE))
        cells = (found[0]["title"], f"`{path.name}`", f"{found[0].get('based_on', '')}", ", ".join(firmware))
        yield f"| {' | '.join((*cells, ', '.join(named), str(chosen)))} |"
