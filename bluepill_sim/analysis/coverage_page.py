"""Coverage as one HTML page: the sources with how often each line ran and which ways its branches went.

A page without script or network. Sources that are not found show their lines without text.
Invariant: the same coverage and sources give the same bytes.
"""

from collections.abc import Iterator
from html import escape
from pathlib import Path

from bluepill_sim.analysis.coverage import Coverage, FileCoverage
from bluepill_sim.analysis.coverage_text import coverage_lines
from bluepill_sim.program.line_table import source_lines

_STYLE = """
body{font:15px system-ui,sans-serif;margin:1.5rem auto;max-width:72rem;padding:0 1rem;color:#1b1b1b;background:#fdfcf8}
pre,table{font:13px/1.45 ui-monospace,Menlo,Consolas,monospace}
pre{overflow-x:auto}
table{border-collapse:collapse;width:100%}
td{padding:0 .6rem;white-space:pre-wrap;vertical-align:top}
td:nth-child(-n+3){text-align:right;color:#555;width:1%;white-space:pre}
tr.ran td:first-child{background:#d9ecd5}
tr.missed td{background:#f6d5d0}
tr.partial td{background:#fbeec4}
summary{font-weight:600;cursor:pointer;padding:.3rem 0}
"""
_LEGEND = (
    "Left of each line: how often it ran, and the ways of its branches (taken / not taken). "
    "Red did not run; yellow ran, but one of its branches went one way only."
)


def coverage_page(coverage: Coverage, *, title: str, sources: Path | None = None) -> str:
    """Return the page.

    Args:
        coverage: of a run.
        title: what it is of.
        sources: the folder where relative names start from, and files lie that are not where they were built.
    """
    body = [f"<h1>{escape(title)}</h1>", f"<pre>{escape(chr(10).join(coverage_lines(coverage)))}</pre>"]
    if coverage.has_lines:
        body.append(f"<p>{_LEGEND}</p>")
        for file in coverage.files():
            body += _listing(file, sources)
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>{_STYLE}</style></head>\n<body>\n"
        + "\n".join(body)
        + "\n</body></html>\n"
    )


def _listing(file: FileCoverage, sources: Path | None) -> Iterator[str]:
    text = source_lines(file.name, sources)
    what = "" if text else ": the source is not here"
    yield f"<details open><summary>{escape(file.name)}{what}</summary><table>"
    for number in range(1, len(text) + 1) if text else sorted(file.lines):
        count = file.lines.get(number)
        branches = file.branches.get(number, [])
        ways = " ".join(f"{row.taken}/{row.not_taken}" for row in branches)
        kind = "" if count is None else "ran" if count else "missed"
        if count and not all(row.taken and row.not_taken for row in branches):
            kind = "partial"
        line = escape(text[number - 1]) if text else ""
        cells = ("" if count is None else str(count), ways, str(number), line)
        yield f'<tr class="{kind}">' + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>"
    yield "</table></details>"
