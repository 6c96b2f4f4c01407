"""The table of docs/foreign.md: every row with what became of it when it was run last with --record.

`results.json` beside this file has those results; what stands between the page's two marks is generated from it and
from the table, and a test holds the committed page to that.
"""

import json
import re
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path

from tools.foreign.row import Result, Row, RowStatus
from tools.foreign.rows.tried import TRIED

RESULTS = Path(__file__).parent / "results.json"
PAGE = Path(__file__).resolve().parents[2] / "docs" / "foreign.md"
_BLOCK = re.compile(r"(<!-- table: foreign (?P<kind>\w+) -->\n)(?P<body>.*?)(<!-- end -->)", re.DOTALL)
_SHORT_COMMIT = 10


def record(results: Sequence[Result], file: Path = RESULTS) -> None:
    """Note results, beside those of other rows that are noted already, and how each of these ended the time before."""
    noted = {result.name: result for result in recorded(file)}
    for result in results:
        previous = noted.get(result.name)
        noted[result.name] = result if previous is None else replace(result, before=_ended(previous))
    rows = [{**asdict(result), "status": result.status.value} for _, result in sorted(noted.items())]
    file.write_text(json.dumps(rows, indent=1) + "\n")


def recorded(file: Path = RESULTS) -> list[Result]:
    """Return the results that are noted."""
    if not file.exists():
        return []
    return [
        Result(
            row["name"],
            RowStatus(row["status"]),
            row["text"],
            row["seconds"],
            tuple(row["notes"]),
            row.get("before", ""),
        )
        for row in json.loads(file.read_text())
    ]


def written(text: str, rows: Sequence[Row], results: Sequence[Result]) -> str:
    """Return a page's text with its tables made anew."""

    def made(found: re.Match[str]) -> str:
        kind = found["kind"]
        body = _tried() if kind == "tried" else _table([row for row in rows if row.kind.value == kind], results)
        return found[1] + body + found[4]

    return _BLOCK.sub(made, text)


def write_page(rows: Sequence[Row]) -> None:
    """Make the tables of the page anew."""
    PAGE.write_text(written(PAGE.read_text(), rows, recorded()))


def _table(rows: Sequence[Row], results: Sequence[Result]) -> str:
    known = {result.name: result for result in results}
    lines = [
        "| row | source | program | required result | passed in |",
        "|---|---|---|---|---|",
    ]
    for row in rows:
        result = known.get(row.name)
        cells = (f"`{row.name}`", _source(row), row.program, row.said, _shown(row, result))
        lines.append(f"| {' | '.join(_cell(cell) for cell in cells)} |")
    return "\n".join(lines) + "\n"


def _tried() -> str:
    rows = [f"| {_cell(one.name)} | {_cell(one.tried)} | {_cell(one.error)} |" for one in TRIED]
    return "\n".join(["| program | attempt | result |", "|---|---|---|", *rows]) + "\n"


def _source(row: Row) -> str:
    source = row.source
    return f"[{source.folder}]({source.url}) {source.commit[:_SHORT_COMMIT]}" if source.url else "this repository"


def _ended(result: Result) -> str:
    took = f" in {result.seconds:.0f} s" if result.status is not RowStatus.MISSING else ""
    return f"{result.status.value}{took}"


def _shown(row: Row, result: Result | None) -> str:
    """Return how the row ended; what came back of one that passed is in `results.json` alone."""
    if result is None:
        shown = row.tried or "not run"
    else:
        has_passed = result.status is RowStatus.PASSED
        ended = f"{result.seconds:.0f} s" if has_passed else f"{_ended(result)}: {result.text}"
        shown = f"{ended}{', busy' if result.notes else ''}"
    return f"{shown}. Found: {row.found}" if row.found else shown


def _cell(text: str) -> str:
    return " ".join(text.replace("|", "\\|").replace("<", "&lt;").split())
