"""docs/board-simulation.md: every deck with its plot, its figures, its limits, and what it cannot say.

Invariant: the page is a function of the decks and of the figures alone.
"""

from collections.abc import Mapping

from hardware.pcb.spice.deck import Deck

_HEAD = """# The board, simulated

Circuits of the [adapter board](board.md) in ngspice, with our own behavioural models, built from the netlist.
No board exists: these are consequences of data sheets, not measurements.

<!-- soak: every circuit, which the test below simulates too -->
```sh
python -m hardware.pcb simulate     # run all, renew the plots, write this page
```

`hardware/pcb/spice/deck.py` gives the source of each figure. `tests/hardware/test_pcb_spice.py` and
`make board-check` fail when a figure leaves its limits. Only what is outside the board is written by hand.
"""


def page_text(decks: tuple[Deck, ...], figures: Mapping[str, Mapping[str, float]]) -> str:
    """Return the page.

    Args:
        decks: In the order of the page.
        figures: What each measure gave, by deck and measure.
    """
    return _HEAD + "".join(_section(deck, figures[deck.name]) for deck in decks)


def shown(value: float) -> str:
    """Return a figure as the page shows it: three digits."""
    if value == 0 or 0.01 <= abs(value) < 10000:
        return f"{float(f'{value:.3g}'):g}"
    return f"{value:.2e}"


def _section(deck: Deck, figures: Mapping[str, float]) -> str:
    rows = []
    for limit in deck.limits:
        value, low, high = shown(figures[limit.measure]), shown(limit.low), shown(limit.high)
        rows.append(f"| {limit.meaning} | {value} {limit.unit} | {low} … {high} |")
    table = "\n".join(["| figure | simulated | limits |", "| --- | --- | --- |", *rows])
    return (
        f"\n## {deck.title}\n\n![{deck.name}](pictures/board/sim-{deck.name}.png)\n\n{table}\n\n"
        f"**Limits.** {deck.cannot_say}\n"
    )
