"""Writes coverage as an lcov tracefile, which genhtml, editors and CI services read.

Source: geninfo(1) of lcov 1.16, "FILES".
Invariant: the same coverage gives the same bytes.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

from bluepill_sim.analysis.coverage import FileCoverage
from simbase.files import write_text


def write_lcov(files: Sequence[FileCoverage], path: Path, *, sources: Path | None = None) -> None:
    """Write a tracefile.

    Args:
        files: what has run.
        path: where to.
        sources: the folder that relative names of source files start from; None leaves them as the ELF has them.

    Raises:
        FileError: the file cannot be written.
    """
    write_text(path, "\n".join(lcov_lines(files, sources=sources)) + "\n")


def lcov_lines(files: Sequence[FileCoverage], *, sources: Path | None = None) -> Iterator[str]:
    """Return the lines of a tracefile."""
    for file in files:
        name = file.name if sources is None or file.name.startswith("/") else str(sources / file.name)
        yield "TN:"
        yield f"SF:{name}"
        for function, line, _ in file.functions:
            yield f"FN:{line},{function}"
        for function, _, calls in file.functions:
            yield f"FNDA:{calls},{function}"
        yield f"FNF:{len(file.functions)}"
        yield f"FNH:{sum(1 for _, _, calls in file.functions if calls)}"
        for line, branches in sorted(file.branches.items()):
            for block, branch in enumerate(branches):
                was_reached = branch.taken or branch.not_taken
                for way, count in enumerate((branch.taken, branch.not_taken)):
                    yield f"BRDA:{line},{block},{way},{count if was_reached else '-'}"
        ways = file.ways
        yield f"BRF:{len(ways)}"
        yield f"BRH:{sum(1 for count in ways if count)}"
        for line, count in sorted(file.lines.items()):
            yield f"DA:{line},{count}"
        yield f"LF:{len(file.lines)}"
        yield f"LH:{file.lines_hit}"
        yield "end_of_record"
