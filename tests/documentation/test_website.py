"""The site is built strictly of docs/, asks nobody for anything, and what is generated of it is whole."""

import re
import runpy
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from tests.bluepill_sim.peripherals.sequences.table import ROWS
from tests.documentation.command_lines import command_line
from tests.documentation.page import ROOT
from tools.website import fidelity, gallery, judging, reference

CONFIG = (ROOT / "tools/website/zensical.toml").read_text(encoding="utf-8")
WHOLE = '<a href="b.html#there">b</a><img src="p.png"><link rel="stylesheet" href="s.css"><a href="https://x.y/">x</a>'


@pytest.fixture
def built(tmp_path: Path) -> Path:
    """A site of two pages without a fault."""
    (tmp_path / "a.html").write_text(WHOLE, encoding="utf-8")
    (tmp_path / "b.html").write_text('<h2 id="there">b</h2>', encoding="utf-8")
    (tmp_path / "s.css").write_text("p { background: url(p.png) }", encoding="utf-8")
    (tmp_path / "p.png").touch()
    (tmp_path / "search.json").write_text('{"items": [1]}', encoding="utf-8")
    return tmp_path


def test_a_site_without_a_fault_has_none(built: Path) -> None:
    assert judging.faults(built) == []


@pytest.mark.parametrize(
    ("file", "text", "fault"),
    [
        ("a.html", '<script src="https://x.y/z.js"></script>', "a.html: fetches https://x.y/z.js"),
        ("a.html", '<link rel="preconnect stylesheet" href="//x.y/z">', "a.html: fetches //x.y/z"),
        ("a.html", "<style>@import 'https://x.y/z.css';</style>", "a.html: fetches https://x.y/z.css"),
        ("a.html", '<p style="background: url(https://x.y/z)">', "a.html: fetches https://x.y/z"),
        ("s.css", "@font-face { src: url('https://x.y/f.woff2') }", "s.css: fetches https://x.y/f.woff2"),
        ("a.html", '<a href="c.html">c</a>', "a.html: no c.html"),
        ("a.html", '<img src="c.png">', "a.html: no c.png"),
        ("a.html", '<a href="b.html#here">b</a>', "a.html: no anchor b.html#here"),
        ("a.html", '<a href="../outside.html">o</a>', "a.html: no ../outside.html"),
        ("search.json", '{"items": []}', "the search index is empty"),
    ],
)
def test_a_fault_of_a_built_site_is_named(built: Path, file: str, text: str, fault: str) -> None:
    (built / file).write_text(text, encoding="utf-8")
    assert judging.faults(built) == [fault]


def test_every_page_of_docs_is_in_the_navigation_once() -> None:
    named = re.findall(r'= "([\w./-]+\.md)"', CONFIG)
    assert len(named) == len(set(named))
    assert {path.relative_to(ROOT / "docs").as_posix() for path in (ROOT / "docs").rglob("*.md")} <= set(named)


@pytest.mark.slow
def test_every_command_has_its_help_in_the_reference() -> None:
    page = reference.page()
    group = command_line()
    found = [" ".join(path) for path, _ in reference.commands(group)]
    assert set(group.commands) == {words.split()[1] for words in found if words.count(" ") == 1}
    for words in found:
        assert re.search(rf"^##+ {re.escape(words)}\n\n```text\nUsage: {re.escape(words)}\b", page, re.MULTILINE), words
    drive = page.partition("\n## p2os drive\n")[2].partition("\n## ")[0]
    assert "\n$ p2os drive " in drive


def test_the_page_of_fidelity_has_every_peripheral_and_robot() -> None:
    page = fidelity.page()
    models = list(fidelity.models((ROOT / "docs/peripherals.md").read_text(encoding="utf-8")))
    assert len(models) >= 20
    assert sum(bool(model.chosen) for model in models) >= 15
    assert all(f"| {model.title} | [{model.modelled}](peripherals.md#{model.anchor}) |" in page for model in models)
    assert all(model.modelled for model in models)
    assert all(f"`{path.name}`" in page for path in (ROOT / "p2os/robots").glob("*.toml"))
    asked = sum(row.peripheral == "I2C" for row in ROWS)
    assert re.search(rf"^\| I2C1 and I2C2 \|.* \| \d+ of {asked} \| nothing \| registers \|", page, re.MULTILINE)


@pytest.mark.parametrize(
    ("title", "names"),
    [("USART1 to USART3", {"USART"}), ("I2C1 and I2C2", {"I2C"}), ("bxCAN", {"CAN"}), ("GPIOA to GPIOE", {"GPIO"})],
)
def test_a_title_is_of_its_peripheral_whatever_its_number(title: str, names: set[str]) -> None:
    assert fidelity.family(title) - {"TO", "AND"} == names


def test_statements_are_parted_where_they_end_and_not_in_brackets() -> None:
    text = """## X

`peripherals/x.py`; RM0008 1.

- **A** is (*chosen*: zero (or so)).
- B.
- *Chosen*: one (by 1.5; see 2); two.
- Not modelled, with a warning: three. Four
  goes on.

*Chosen* for reception: five.

## No peripheral

- *Chosen*: six.
"""
    (model,) = fidelity.models(text)
    assert (model.title, model.modelled) == ("X", 2)
    assert model.chosen == ("zero (or so)", "one (by 1.5; see 2)", "two", "for reception: five")
    assert model.not_modelled == ("with a warning: three", "with a warning: Four goes on")


def test_statements_of_a_list_are_those_of_its_item_or_of_the_mark_before_it() -> None:
    items = "- *Chosen*: one\n  more. Not modelled: two.\n- Free.\n"
    text = f"## X\n\n`peripherals/x.py`; RM0008 1.\n\n{items}\n*Chosen* for pins:\n\n- three; four.\n\nOther.\n"
    (model,) = fidelity.models(text)
    assert model.chosen == ("one more", "for pins: three", "for pins: four")
    assert model.not_modelled == ("two",)


def test_the_gallery_has_each_picture_that_a_page_shows() -> None:
    page = gallery.page()
    pictures = ROOT / "docs/pictures"
    shown = {path.relative_to(ROOT / "docs").as_posix() for path in pictures.rglob("*.*")}
    assert {name for name in shown if f"({name})" not in page} == set(), "no page shows them"


def test_the_drawings_are_those_of_their_generator() -> None:
    generator = runpy.run_path(str(ROOT / "tools/generators/drawings.py"))
    made = {f"{name}.svg": generator["svg"](drawing) for name, drawing in generator["drawings"]().items()}
    there = {path.name: path.read_text(encoding="utf-8") for path in generator["FOLDER"].iterdir()}
    assert there == made, "make generated"


@pytest.fixture
def staging() -> Any:
    pytest.importorskip("pdoc", reason="pdoc comes with the extras dev and site")
    return import_module("tools.website.staging")


def test_links_of_a_page_lead_to_where_things_stand_in_the_site(staging: Any) -> None:
    files: dict[Path, Path] = {}
    places = staging.pages()
    text = staging.as_staged(ROOT / "docs/tutorials/lab.md", places, files)
    assert "](../client.md)" in text
    assert "<!-- not run" not in text
    assert "](../docs/" not in staging.as_staged(ROOT / "README.md", places, files)
    assert files[ROOT / "NOTICE"] == Path("files/NOTICE")


@pytest.mark.slow
def test_the_site_is_built_strictly_and_has_no_fault(tmp_path: Path) -> None:
    pytest.importorskip("zensical", reason="zensical comes with the extra site: the site is not built")
    assert import_module("tools.website.__main__").build(tmp_path / "site") == []
    home = (tmp_path / "site/index.html").read_text(encoding="utf-8")
    assert "pictures/demo.gif" in home
    assert "assets/file_worker.js" in home
