"""Lay out what the site is made of: pages, pictures, files that pages name, and the configuration.

A page of docs/ keeps its place; pages of the top folder stand in `project/`. What else a page links to inside the
repository (a source, a drawing) is copied to `files/`, so that no link leads out of the site. A page is changed where
GitHub and Zensical read Markdown differently, and nowhere else.
"""

import os
import re
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from tools.website import api, fidelity, gallery, reference

ROOT = Path(__file__).resolve().parents[2]
OWN = Path(__file__).parent
#: Pages outside of docs/, by where they stand in the site.
TOP = {f"{name}.md": f"project/{name.lower()}.md"
       for name in ("README", "ARCHITECTURE", "CONTRIBUTING", "CHANGELOG", "PROTOCOL")}  # fmt: skip
TOP |= {f".github/{name}.md": f"project/{name.lower()}.md" for name in ("CODE_OF_CONDUCT", "SECURITY")}
LINK = re.compile(r"(?P<before>\]\(|\b(?:src|href)=\")(?P<file>[^)\s#\":]+)(?P<rest>#[^)\s\"]*)?(?=[)\"])")
SPAN = re.compile(r"`[^`\n]+`")
NOTE = re.compile(r"<!-- (?:not run|slow|soak|given): .*-->\n")
FENCE = re.compile(r"\s*```")
ITEM = re.compile(r"(?:[-*]|\d+\.) ")


def stage(folder: Path) -> list[str]:
    """Write all that Zensical needs into a folder; return what is wrong with the generated pages.

    Raises:
        ValueError: a page links to a file that is not there.
    """
    shutil.rmtree(folder, ignore_errors=True)
    places = pages()
    files: dict[Path, Path] = {}
    texts = {place: as_staged(source, places, files) for source, place in places.items()}
    made, wrong = generated()
    for place, text in (texts | made).items():
        _target(folder, place).write_text(text, encoding="utf-8")
    files |= {path: path.relative_to(ROOT / "docs") for path in (ROOT / "docs" / "pictures").rglob("*.*")}
    for path, place in files.items():
        shutil.copy(path, _target(folder, place))
    shutil.copytree(OWN / "assets", folder / "docs" / "assets")
    config = (OWN / "zensical.toml").read_text(encoding="utf-8")
    listed = "".join(f'      {{ "{name}" = "{api.FOLDER}/{name}.md" }},\n' for name in api.MODULES)
    config = config.replace("API\n", listed)
    (folder / "zensical.toml").write_text(config, encoding="utf-8")
    wrong += [f"{place}: not in the navigation" for place in sorted({*places.values(), *made} - named(config))]
    return wrong


def _target(folder: Path, place: Path) -> Path:
    """Return where something of the site is staged, in a folder that is there."""
    target = folder / "docs" / place
    target.parent.mkdir(parents=True, exist_ok=True)
    return target


def named(config: str) -> set[Path]:
    """Return the pages that the navigation of a configuration names."""
    return {Path(name) for name in re.findall(r'= "([\w./-]+\.md)"', config)}


def pages() -> dict[Path, Path]:
    """Return every page that a person wrote, with its place in the site."""
    found = {path: path.relative_to(ROOT / "docs") for path in sorted((ROOT / "docs").rglob("*.md"))}
    return found | {ROOT / name: Path(place) for name, place in TOP.items()}


def generated() -> tuple[dict[Path, str], list[str]]:
    """Return the pages that are made of the code, and what is wrong with them."""
    documented, wrong = api.pages()
    made: dict[str, str] = {
        "reference/commands.md": reference.page(),
        "fidelity.md": fidelity.page(),
        "gallery.md": gallery.page(),
        **documented,
    }
    return {Path(name): text for name, text in made.items()}, wrong


def as_staged(source: Path, places: Mapping[Path, Path], files: dict[Path, Path]) -> str:
    """Return a page as Zensical reads it; files that it links to are noted with their place in the site."""
    here = places[source]

    def led(link: re.Match[str]) -> str:
        target = (source.parent / link["file"]).resolve()
        if target in places:
            place = places[target]
        elif target.is_relative_to(ROOT / "docs"):
            place = target.relative_to(ROOT / "docs")
        elif target.is_file():
            place = files.setdefault(target, Path("files") / str(target.relative_to(ROOT)).lstrip("."))
        else:
            raise ValueError(f"{source.relative_to(ROOT)}: no {link['file']}")
        return f"{link['before']}{os.path.relpath(place, here.parent)}{link['rest'] or ''}"

    text = NOTE.sub("", source.read_text(encoding="utf-8"))
    return "\n".join(_lines(text.splitlines(), led)) + "\n"


def _lines(lines: Sequence[str], led: Callable[[re.Match[str]], str]) -> Iterator[str]:
    is_code, before = False, ""
    for line in lines:
        if FENCE.match(line):
            is_code = not is_code
        elif not is_code:
            if ITEM.match(line) and before and not ITEM.match(before) and not before.startswith(" "):
                yield ""  # GitHub begins a list below a line of text, Python-Markdown does not
            spans = [span.span() for span in SPAN.finditer(line)]
            line = LINK.sub(  # noqa: PLW2901
                lambda link, spans=spans: link[0] if any(a < link.start() < b for a, b in spans) else led(link), line
            )
        yield line
        before = line
