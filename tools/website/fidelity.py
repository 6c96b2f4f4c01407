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
#: What begins a list of statements in docs/peripherals.md.
MARK = re.compile(r"\*{0,2}\b(?P<kind>Modelled|Chosen|Not modelled)\b(?P<more>[^:.*\n]{0,30})\*{0,2}:", re.IGNORECASE)
INSTANCE = re.compile(r"\(.*|,.*| to .*| and .*|\d+$")
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

| peripheral | chosen | not modelled | drivers' rows held | seen on silicon | the kit compares |
|---|---|---|---|---|---|
"""
_ROBOTS = """
## Robots

Each number of a robot's file has its source beside it; `chosen` counts those that nobody says. Seen at a real robot:
none. [The virtual Pioneer](pioneer.md) has the controller's data sheet, and [validation](validation.md) lays it beside
a simulator of others.

| robot | file | controller | sources named | chosen |
|---|---|---|---|---|
"""


@dataclass(frozen=True, slots=True)
class Model:
    """What docs/peripherals.md says of a model."""

    title: str
    anchor: str
    chosen: tuple[str, ...]
    not_modelled: tuple[str, ...]


def models(text: str) -> Iterator[Model]:
    """Yield the models of the page of data sheets that say what they model."""
    for section in SECTION.finditer(text):
        said: dict[str, list[str]] = {"chosen": [], "not modelled": []}
        marks = list(MARK.finditer(section["text"]))
        if not marks:
            continue
        for mark, end in zip(marks, [*(one.start() for one in marks[1:]), len(section["text"])], strict=True):
            told = said.get(mark["kind"].lower())
            if told is not None:
                words = f"{mark['more'].strip(' ,')}: " if mark["more"].strip(" ,") else ""
                told += [words + one for one in statements(section["text"][mark.end() : end])]
        title = section["title"].partition(" (")[0]
        yield Model(title, slug(section["title"]), tuple(said["chosen"]), tuple(said["not modelled"]))


def statements(text: str) -> list[str]:
    """Return the statements of a paragraph: what semicolons and full stops part, outside of brackets."""
    text = " ".join(re.split(r"\n\s*\n", text.strip(), maxsplit=1)[0].split()).rstrip("*").strip()
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
    return {name.strip(): (shown.strip(), kit.strip()) for name, _, shown, kit in rows}


def family(title: str) -> set[str]:
    """Return the names of the peripherals that a title is about, without their numbers: {"USART"} of "USART1 to 3"."""
    names = re.findall(r"[A-Za-z]+", re.sub(r"\bto\b|\band\b", " ", title.replace("bxCAN", "CAN").replace("1, ", " ")))
    return {re.sub(r"\d+$", "", name).upper() for name in names}


def page() -> str:
    """Return the page."""
    held: Counter[str] = Counter(row.peripheral.upper() for row in ROWS if row.check is not None)
    asked: Counter[str] = Counter(row.peripheral.upper() for row in ROWS)
    measured = silicon()
    lines, details = [], []
    for model in models((ROOT / "docs" / "peripherals.md").read_text(encoding="utf-8")):
        names = {re.sub(r"A$", "", name) if name == "GPIOA" else name for name in family(model.title)}
        rows = sum(asked[name] for name in names)
        shown, kit = next((value for name, value in measured.items() if names & family(name)), ("nothing", "no"))
        drivers = f"{sum(held[name] for name in names)} of {rows}" if rows else "no rows"
        first = f"[{model.title}](peripherals.md#{model.anchor})"
        cells = (first, _count(model.chosen, model), f"{len(model.not_modelled)}", drivers, shown, kit)
        lines.append(f"| {' | '.join(cells)} |")
        if model.chosen or model.not_modelled:
            details += [f"### {model.title}: chosen, not modelled", ""]
            details += [f"- *chosen*: {one}" for one in model.chosen]
            details += [f"- *not modelled*: {one}" for one in model.not_modelled]
            details.append("")
    parts = [_HEAD, "\n".join(lines), "\n", _ROBOTS, "\n".join(robots()), "\n\n## Peripherals, in words\n\n"]
    return "".join(parts) + "\n".join(details)


def _count(said: tuple[str, ...], model: Model) -> str:
    return f"[{len(said)}](#{slug(f'{model.title}: chosen, not modelled')})" if said else "0"


def robots() -> Iterator[str]:
    """Yield a row for each robot's file."""
    for path in sorted((ROOT / "p2os" / "robots").glob("*.toml")):
        text = path.read_text(encoding="utf-8")
        found = tomllib.loads(text)
        comments = "\n".join(re.findall(r"#(.*)$", text, re.MULTILINE))
        named = [one for one in SOURCES if one.lower() in comments.lower()]
        chosen = len(re.findall(r"\bchosen\b", comments.partition("\n\n")[0] and comments)) - ("nobody agrees" in text)
        yield (f"| {found.get('title', path.stem)} | `{path.name}` | {', '.join(found.get('firmware', []))} "
               f"| {', '.join(named) or 'those of its parent'} | {max(chosen, 0)} |")  # fmt: skip
