"""What became of rows, for a terminal of 80 columns."""

import textwrap
from collections import Counter
from collections.abc import Sequence

from simbase.terminal import readable
from tools.foreign.row import Result, RowStatus

_COLUMNS = 80


def line(result: Result) -> str:
    """Return one row as it ends."""
    took = f" ({result.seconds:.1f} s)" if result.status is not RowStatus.MISSING else ""
    return readable(f"{result.name}: {result.status.value}{took}: {result.text}")


def table(results: Sequence[Result]) -> str:
    """Return the rows that ran with what came back, then what is missing of the others, then how many of each."""
    ran = [result for result in results if result.status is not RowStatus.MISSING]
    name = max((len(result.name) for result in ran), default=0)
    lines = []
    for result in ran:
        head = f"{result.name:{name}}  {result.status.value:6}  {result.seconds:5.1f} s  "
        text = readable("; ".join((result.text, *result.notes)))
        lines += textwrap.wrap(text, _COLUMNS, initial_indent=head, subsequent_indent=" " * len(head)) or [
            head.rstrip()
        ]
    for result in results:
        if result.status is RowStatus.MISSING:
            lines += textwrap.wrap(readable(f"missing: {result.name}: {result.text}"), _COLUMNS, subsequent_indent="  ")
    counts = Counter(result.status for result in results)
    lines.append(", ".join(f"{counts[status]} {status.value}" for status in RowStatus))
    return "\n".join(lines)
