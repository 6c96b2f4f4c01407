"""Coverage for a person to read: a table by file or by function, what did not run, branches that went one way.

Invariant: a file without debug information gives a table by function, one without symbols the stretches that ran.
"""

from collections.abc import Sequence

from bluepill_sim.analysis.columns import in_columns
from bluepill_sim.analysis.coverage import Coverage, FileCoverage, FunctionCoverage
from bluepill_sim.errors import BluePillError
from simbase.units import ranges_text

#: chosen: so many stretches of a program without symbols are listed.
_SHOWN_PIECES = 40


def coverage_lines(coverage: Coverage, *, missed: bool = True) -> list[str]:
    """Return the summary of a run, with `missed` also the lines and branches that it left out."""
    if coverage.has_lines:
        files = coverage.files()
        found = _by_file(files)
        if missed:
            found += _missed_lines(files)
    elif functions := coverage.functions():
        found = ["no debug information: by function, in instructions (compile with -Og -g for lines)", ""]
        found += _by_function(functions)
    else:
        found = ["no debug information and no symbols: by address (give the ELF, compiled with -Og -g)", ""]
        found += _by_address(coverage.pieces())
    return [*found, *one_way_lines(coverage)] if missed else found


def refuse_without_lines(coverage: Coverage, firmware: object) -> None:
    """Refuse a program without debug information where its lines are to be counted.

    Raises:
        BluePillError: It has none.
    """
    if not coverage.has_lines:
        raise BluePillError(f"{firmware}: no debug information in it", hint="build with -g, and give the ELF itself")


def shortfall(coverage: Coverage, least_percent: float) -> str | None:
    """Return by how much too few lines ran, or None where they suffice.

    Args:
        coverage: Of the whole run.
        least_percent: Least share of the lines, 0 to 100; 0 asks for nothing.
    """
    files = coverage.files()
    share = 100 * sum(file.lines_hit for file in files) / max(1, sum(len(file.lines) for file in files))
    if share >= least_percent:
        return None
    return f"coverage: {share:.1f} % of the lines are less than {least_percent:g} %"


def one_way_lines(coverage: Coverage) -> list[str]:
    """Return the branches that ran and went one way only, and how many were not reached."""
    rows = []
    for branch in coverage.one_way():
        place, function = coverage.place(branch.address), coverage.function_name(branch.address)
        file = f"{place.partition(':')[0]}:"
        ways = [
            "its caller" if address is None else coverage.place(address).removeprefix(file)
            for address in (branch.gone, branch.missed)
        ]
        if ways[0] == ways[1]:  # two conditions of one line
            ways = [f"{ways[0]} {address or 0:#010x}" for address in (branch.gone, branch.missed)]
        rows.append((place, function, str(branch.times), *ways))
    found = ["", "branches that went one way only:"] if rows else []
    if rows:
        found += in_columns(("at", "in", "times", "always to", "never to"), rows, right=(2,))
    if unreached := coverage.unreached:
        found += ["", f"{unreached} branch{'es' if unreached != 1 else ''} did not run at all"]
    return found


def _by_file(files: Sequence[FileCoverage]) -> list[str]:
    def row(name: str, some: Sequence[FileCoverage]) -> list[str]:
        ways = [count for file in some for count in file.ways]
        calls = [calls for file in some for _, _, calls in file.functions]
        return [
            name,
            *_share(sum(file.lines_hit for file in some), sum(len(file.lines) for file in some)),
            *_share(_hit(ways), len(ways)),
            *_share(_hit(calls), len(calls)),
        ]

    rows = [row(_short(file.name), [file]) for file in files]
    headers = ("file", "lines", "", "branch ways", "", "functions", "")
    return in_columns(headers, [*rows, row("all", files)], right=range(1, 7))


def _by_function(functions: Sequence[FunctionCoverage]) -> list[str]:
    rows = [
        [f.name, str(f.calls), *_share(f.instructions_hit, f.instructions), *_share(f.ways_hit, f.ways)]
        for f in functions
    ]
    sums = [
        sum(getattr(f, name) for f in functions) for name in ("instructions_hit", "instructions", "ways_hit", "ways")
    ]
    rows.append(["all", "", *_share(*sums[:2]), *_share(*sums[2:])])
    return in_columns(("function", "calls", "instructions", "", "branch ways", ""), rows, right=range(1, 6))


def _by_address(pieces: Sequence[tuple[int, int]]) -> list[str]:
    found = [f"{first:#010x} to {end - 1:#010x} ran" for first, end in pieces[:_SHOWN_PIECES]]
    left = len(pieces) - len(found)
    return [*found, f"and {left} more stretches"] if left else found


def _missed_lines(files: Sequence[FileCoverage]) -> list[str]:
    rows = [f"{_short(file.name)}: {ranges_text(file.missed_lines)}" for file in files if file.missed_lines]
    return ["", "lines that did not run:", *rows] if rows else []


def _share(hit: int, whole: int) -> tuple[str, str]:
    return f"{hit}/{whole}", f"{hit / whole:.1%}" if whole else ""


def _hit(counts: Sequence[int]) -> int:
    return sum(1 for count in counts if count)


def _short(name: str) -> str:
    return name.rsplit("/", 1)[-1]
