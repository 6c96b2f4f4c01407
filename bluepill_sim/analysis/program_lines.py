"""What has run of a program as its page shows it: lines of its sources and functions, out of a `Coverage`.

It is kept in the last line of the trace of a run that was measured, with the text of the sources, so that it can be
shown where these are not.

Invariant: the same coverage and sources give the same lines.
"""

from pathlib import Path

from bluepill_sim.analysis.coverage import Coverage, FileCoverage
from bluepill_sim.program.line_table import source_lines

#: When a line ran first that has not run; and that has no code.
NOT_YET, NO_CODE = -1, -2


def program_lines(coverage: Coverage, sources: Path) -> dict[str, object]:
    """Return the lines of each source file and the functions, each with whether and when it ran first.

    Args:
        coverage: Of a run, or of one that goes on.
        sources: Where source files are looked for that are not where they were built.
    """
    first_ns = coverage.first_ns()
    functions = [
        [one.name, one.instructions_hit, one.instructions, one.ways_hit, one.ways, first_ns.get(one.address, NOT_YET)]
        for one in coverage.functions() if one.instructions
    ]  # fmt: skip
    return {"files": [_lines(file, sources) for file in coverage.files()], "functions": functions}


def _lines(file: FileCoverage, sources: Path) -> dict[str, object]:
    text = source_lines(file.name, sources)
    last = max([len(text), *file.lines])
    return {
        "name": file.name,
        "lines": text,
        "ran_ns": [_ran_ns(file, line) for line in range(1, last + 1)],
        "one_way": sorted({line for line, _ in file.one_way}),
    }


def _ran_ns(file: FileCoverage, line: int) -> int:
    if line not in file.lines:
        return NO_CODE
    return file.first_ns.get(line, 0) if file.lines[line] else NOT_YET
