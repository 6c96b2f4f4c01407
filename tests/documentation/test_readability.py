"""Pages read easily: short sentences, cells of a line, the field's words; the rules are those of readability.py."""

import pytest

from tests.documentation.readability import CELL, LONGEST, MAP_WORDS, MEAN, ROOT, Reading, faults, read_pages

#: Pages that break a rule still: mean and longest sentence, wide cells, phrases of ours. A figure may only fall.
CEILINGS: dict[str, tuple[float, int, int, int]] = {}
PAGES = read_pages()
BOUNDS = (MEAN, LONGEST, 0, 0)


@pytest.mark.parametrize("name", PAGES)
def test_a_page_reads_easily(name: str) -> None:
    page = PAGES[name]
    worst = zip(page.figures(), BOUNDS, CEILINGS.get(name, BOUNDS), strict=True)
    shown = "".join(f"\n{name}:{line}: {text}" for line, text in faults(page))
    assert all(figure <= max(bound, ceiling) for figure, bound, ceiling in worst), f"{page.figures()}{shown}"


def test_a_page_that_keeps_the_rules_has_no_ceiling() -> None:
    kept = [
        name for name in CEILINGS
        if name not in PAGES or all(figure <= most for figure, most in zip(PAGES[name].figures(), BOUNDS, strict=True))
    ]  # fmt: skip
    assert kept == [], "take their rows out of CEILINGS"


def test_the_map_is_read_at_one_go() -> None:
    assert Reading((ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")).words_of_prose < MAP_WORDS


@pytest.mark.parametrize(
    ("text", "figures"),
    [
        (" ".join(["word"] * 40) + ".", (40, 40, 0, 0)),
        (" ".join(["word"] * 41) + ".\n\nOne. Two.", (14.3, 41, 0, 0)),
        ("- " + "word " * 20 + "\n- " + "word " * 30, (25, 30, 0, 0)),
        ("Say `p2os run`. A [link of four words](docs/a.md) follows.\n", (4, 6, 0, 0)),
        (f"| a | {'x' * CELL} |\n|---|---|\n| {'y' * (CELL + 1)} | `b \\| c` |", (0, 0, 1, 0)),
        ("```text\n" + "word " * 50 + "is said aloud\n```", (0, 0, 0, 0)),
        ("<!-- table: x -->\n" + "word " * 50 + "\n<!-- end -->\nNo.", (1, 1, 0, 0)),
        ("That is reported aloud, not `aloud`.", (6, 6, 0, 1)),
    ],
)
def test_the_figures_are_those_of_what_is_read(text: str, figures: tuple[float, int, int, int]) -> None:
    assert Reading(text).figures() == figures
