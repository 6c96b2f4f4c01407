"""Pages read easily: short sentences, cells of a line, the field's words; the rules are those of readability.py."""

import pytest

from tests.documentation.readability import CELL, LONGEST, MAP_WORDS, MEAN, ROOT, Reading, faults, read_pages

#: Pages that break a rule still: mean and longest sentence, wide cells, phrases of ours. A figure may only fall.
CEILINGS = {
    # the reference of the chip, the board, the adapter and the command line
    "PROTOCOL.md": (14.6, 34, 1, 1),
    "docs/adapter-firmware.md": (17.5, 50, 9, 5),
    "docs/adapter.md": (24.9, 74, 0, 2),
    "docs/bluepill.md": (24.4, 65, 4, 1),
    "docs/board-build.md": (16.3, 58, 0, 1),
    "docs/board-simulation.md": (11.4, 25, 0, 1),
    "docs/board.md": (26.1, 110, 7, 2),
    "docs/browser.md": (26.3, 67, 0, 0),
    "docs/cli.md": (17.1, 59, 1, 2),
    "docs/core.md": (25.5, 73, 6, 3),
    "docs/debugging.md": (20.2, 64, 1, 2),
    "docs/foreign.md": (24.7, 68, 0, 2),
    "docs/houses.md": (17.3, 39, 0, 19),
    "docs/mutation.md": (22.6, 53, 2, 2),
    "docs/outside-body.md": (20.3, 74, 0, 2),
    "docs/parts.md": (19.4, 89, 7, 3),
    "docs/peripheral.md": (23.8, 59, 0, 1),
    "docs/peripherals.md": (29.0, 132, 0, 3),
    "docs/requirements.md": (28.5, 33, 8, 3),
    "docs/silicon.md": (19.3, 51, 4, 1),
    "docs/stopping.md": (23.4, 47, 0, 0),
    "docs/troubleshooting.md": (13.1, 25, 3, 3),
    "docs/validation.md": (21.8, 63, 4, 2),
    "docs/view.md": (20.7, 58, 3, 0),
}  # fmt: skip
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
