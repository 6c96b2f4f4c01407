"""Which lines of a program have run, as sections of its page; out of `program_lines`.

Invariant: nothing but these lines is shown.
"""

from collections.abc import Iterator, Sequence
from typing import Any, cast

from bluepill_sim.analysis.program_lines import NO_CODE, NOT_YET
from p2os.view.header import PageBlock, PageCell, PageSection, PageSource, PageTable, PanelHeader
from robot_bench.events.codec import Json

#: The panel that shows them.
PROGRAM = "program", "Program"


def program_panel_of(program: Json) -> PanelHeader:
    """Return the panel of a run that is over."""
    name, title = PROGRAM
    return PanelHeader(name=name, title=title, sections=program_sections(program))


def program_sections(program: Json) -> list[PageSection]:
    """Return the share that has run, by function, and the sources with what ran of them."""
    files = cast("list[Json]", program["files"])
    code = [at for file in files for at in cast("list[int]", file["ran_ns"]) if at != NO_CODE]
    functions = cast("list[list[Any]]", program["functions"])
    ran, gone, ways = (sum(row[place] for row in functions) for place in (1, 3, 4))
    what = "lines" if code else "instructions"
    hit = sum(at != NOT_YET for at in code) if code else ran
    all_ = len(code) if code else sum(row[2] for row in functions)
    note = f"{hit} of {all_} {what} have run ({share(hit, all_)}); {gone} of {ways} ways of branches were gone"
    shown = [block for file in files if (block := source_block(file)) is not None]
    sections = [PageSection(title="What has run", note=note, blocks=list(_functions(functions)))]
    return [*sections, PageSection(title="Sources", blocks=shown)] if shown else sections


def share(part: int, whole: int) -> str:
    """Return a share in percent."""
    return f"{100 * part / whole:.0f} %" if whole else "–"


def source_block(file: Json, first: int = 1, last: int | None = None, next_line: int = 0) -> PageSource | None:
    """Return lines of a file; None where its text is not to be had."""
    lines = cast("list[str]", file["lines"])
    if not lines:
        return None
    ran_ns = cast("list[int]", file["ran_ns"])[first - 1 : last]
    one_way = [line for line in cast("list[int]", file["one_way"]) if line >= first and (last is None or line <= last)]
    return PageSource(title=str(file["name"]), lines=lines[first - 1 : last], first=first, ran_ns=ran_ns,
                      one_way=one_way, next=next_line)  # fmt: skip


def _functions(functions: Sequence[Sequence[Any]]) -> Iterator[PageBlock]:
    if not functions:
        return
    rows = [
        [PageCell(text=name, at_ns=first_ns if first_ns > 0 else None),
         PageCell(text=share(hit, there), is_number=True), PageCell(text=f"{hit} of {there}", is_number=True),
         PageCell(text=f"{gone} of {ways}" if ways else "–", is_number=True)]
        for name, hit, there, gone, ways, first_ns in functions
    ]  # fmt: skip
    yield PageTable(head=("function", "share", "instructions", "ways of branches"), rows=rows)
