"""Write docs/sequences.md from the rows of tests/bluepill_sim/peripherals/sequences.

Usage: python -m tools.generators.sequences
"""

from collections import Counter
from collections.abc import Sequence
from itertools import groupby
from operator import attrgetter
from pathlib import Path

from tests.bluepill_sim.peripherals.sequences.row import SequenceRow
from tests.bluepill_sim.peripherals.sequences.sources import Citation
from tests.bluepill_sim.peripherals.sequences.table import ROWS

ROOT = Path(__file__).resolve().parents[2]
PAGE = Path("docs/sequences.md")
_HEAD = """# The order of things: what public drivers say, as tests

Made by `python -m tools.generators.sequences` from the tables in `tests/bluepill_sim/peripherals/sequences`.
Drivers, headers and manuals say in which order a peripheral wants things: what comes first, what only works after
something else, what clears a flag. Each such sentence is a row here, in our words: where it stands, and whether the
models of [peripherals.md](peripherals.md) hold it. A row is checked on a chip as it comes out of reset, by its
registers alone (exceptions and sleep by a program), and `make test` runs every check; a row that the models do not
answer says why.
Facts are taken from the sources, nothing of their text or code. Nothing here was measured on silicon.

To add one: a function with `@TABLE.row(...)` in the file of its peripheral, seen to fail with the model broken by hand,
then `make generated`. What such tests are worth: [what the rows notice](#what-the-rows-notice).
"""


def page(rows: Sequence[SequenceRow] = ROWS) -> str:
    """Return the page."""
    tables = {name: tuple(group) for name, group in groupby(rows, key=attrgetter("peripheral"))}
    parts = [_HEAD, "## Share\n", _share(tables), _NOTICED, "## Sources\n", _sources(rows)]
    for name, group in tables.items():
        parts += [f"## {name}\n", _table(group)]
    return "\n".join(parts)


def _share(tables: dict[str, tuple[SequenceRow, ...]]) -> str:
    lines = ["| peripheral | rows | checked | not modelled |", "|---|---|---|---|"]
    for name, rows in [*tables.items(), ("all", tuple(row for group in tables.values() for row in group))]:
        checked = sum(row.check is not None for row in rows)
        lines.append(f"| {name} | {len(rows)} | {checked} ({100 * checked // len(rows)} %) | {len(rows) - checked} |")
    return "\n".join(lines) + "\n"


def _sources(rows: Sequence[SequenceRow]) -> str:
    cited = [source for row in rows for source in row.sources]
    places = Counter(
        (one.repository.name, one.repository.owner, one.repository.commit) for one in cited if isinstance(one, Citation)
    )
    lines = ["| name | repository, commit | citations |", "|---|---|---|"]
    lines += [
        f"| {name} | [{owner}](https://github.com/{owner}) {commit} | {count} |"
        for (name, owner, commit), count in places.most_common()
    ]
    others = sum(not isinstance(source, Citation) for source in cited)
    lines.append(
        f"| manuals, our pages | RM0008 rev. 21, PM0075, ARMv7-M, [peripherals.md](peripherals.md) | {others} |"
    )
    return "\n".join(lines) + "\n"


def _table(rows: Sequence[SequenceRow]) -> str:
    lines = ["| row | what is said | where | checked |", "|---|---|---|---|"]
    for row in rows:
        sentence = row.sentence + (f" *Chosen*: {row.choice}." if row.choice else "")
        state = f"not modelled: {row.not_modelled}" if row.check is None else "yes"
        lines.append(f"| `{row.slug}` | {sentence} | {', '.join(map(str, row.sources))} | {state} |")
    return "\n".join(lines) + "\n"


#: The one part that is measured, not made: `python -m tools.mutants --sample sequences`.
_NOTICED = """## What the rows notice

`python -m tools.mutants --sample sequences` draws 60 changes of the models (from all lines of
`bluepill_sim/peripherals` and of the devices in C) and asks the tests nearest to each, these rows among them. Measured
on 26 and 27 Nov 2026:

| draw | noticed | 95 % |
|---|---|---|
| seed 41 | 46 of 60 (77 %) | 65 to 86 % |
| seed 42, after what seed 41 left had tests | 44 of 60 (73 %) | 61 to 83 % |
| seed 42, with the walks | 56 of 60 (93 %) | 84 to 97 % |
| seed 43, drawn after that | 52 of 60 (87 %) | 76 to 93 % |
| seed 44, after what seed 43 left had tests | 46 of 60 (77 %) | 65 to 86 % |
| the same without 6 that are equivalent | 46 of 54 (85 %) | 73 to 92 % |
| seed 45, when programs had walks too | 51 of 60 (85 %) | 74 to 92 % |
| seed 46, after what seed 45 left | 53 of 60 (88 %) | 78 to 94 % |
| seed 47, after what seed 46 left | 52 of 60 (87 %) | 76 to 93 % |
| the same with others drawn for 3 that are equivalent | 55 of 60 (92 %) | 82 to 96 % |

Of seed 47 three can be noticed by nobody: CAN's bit rate is never 0, so that what stood for one is never taken; a reset
drops the tries that it took back before (both are gone from the code); and FMP is put back behind each write of RFxR.
Seed 45 left AFIO's route of USART3, and eight of what the code said twice or what only costs time; seed 46 two of that
kind. What seed 47 left else are a loop that goes one input too far, where a wave's change takes the short way, and what
has walks since.

A row asks one thing. What it leaves is found by walks (`tests/bluepill_sim/peripherals/walks`): each peripheral is
driven at random from reset, in every mode, and all that can be seen after each step is a line: what was done and read,
registers, edges and words that came out, lines inside the chip, when it acts next, routes, warnings. In every third
episode a program makes the accesses, and in the middle of each another board goes on from a snapshot. They reach 99 %
of the lines and 94 % of the branches of the devices in C in some seven seconds of a processor, and a checksum of each
episode is approved in `approved.json`. A walk says that a model does what it did, not
that this is right: that is for rows and tests. Who changes a model writes the traces at both commits, reads the
difference, and approves it with the change:

    WALKS=$(echo tests/bluepill_sim/peripherals/walks/test_*.py)
    python -m tests.tools.suite.approved $WALKS --write before    # and, changed, --write behind
    diff -u -r before behind
    python -m tests.tools.suite.approved $WALKS --approve
"""

if __name__ == "__main__":
    (ROOT / PAGE).write_text(page(), encoding="utf-8")
