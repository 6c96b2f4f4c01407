"""Coverage and profile of a whole run: what `run --coverage --profile` leaves in the run folder.

Written by what `p2os mcu coverage` and `p2os mcu profile` are made of. How deep the stack went is not
measured here: that takes paint in the SRAM, which a program could read. A run that goes back, as under a
debugger, cannot be measured: what ran twice would count twice.

Invariant: the run is the same as one that is not measured.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from bluepill_sim.analysis.coverage import Coverage
from bluepill_sim.analysis.coverage_page import coverage_page
from bluepill_sim.analysis.coverage_text import coverage_lines, refuse_without_lines, shortfall
from bluepill_sim.analysis.cycle_profile import ASLEEP, CycleProfile
from bluepill_sim.analysis.flame_graph import flame_svg
from bluepill_sim.analysis.interrupts.latency import LatencyProbe
from bluepill_sim.analysis.lcov import lcov_lines
from bluepill_sim.analysis.observation import Observation
from bluepill_sim.analysis.profile_text import exception_lines, function_lines
from bluepill_sim.analysis.program_lines import program_lines
from bluepill_sim.board import BluePill
from bluepill_sim.program.functions import FunctionTable
from bluepill_sim.program.line_table import read_lines
from bluepill_sim.program.static_code import StaticCode
from robot_bench.events.codec import Json
from simbase.errors import FileError
from simbase.timing import NS_PER_S

#: chosen: so many functions stand in the report.
_SHOWN_FUNCTIONS = 8


@dataclass(slots=True)
class Measurement:
    """What listens to one run."""

    board: BluePill
    coverage: Coverage | None
    profile: CycleProfile | None
    latency: LatencyProbe | None
    observation: Observation
    fail_under: float = 0.0

    @property
    def failures(self) -> list[str]:
        """What was asked for and did not come: `fail_under` percent of the lines."""
        too_few = None if self.coverage is None else shortfall(self.coverage, self.fail_under)
        return [] if too_few is None else [too_few]

    def write(self, folder: Path, sources: Path) -> Json:
        """End the measurement, write the files into a run folder, and return the figures that its trace keeps.

        Args:
            folder: The run folder.
            sources: Where source files are looked for that are not where they were built.

        Raises:
            FileError: The disk is full, or the folder cannot be written.
        """
        self.observation.finish()
        name = Path(self.board.image.name).name
        title = f"{name}, {self.board.now_ns / NS_PER_S:g} s"
        texts: dict[str, str] = {}
        facts: Json = {}
        if self.coverage is not None:
            files = self.coverage.files()
            texts["coverage.txt"] = _joined([f"coverage of {title}", "", *coverage_lines(self.coverage)])
            texts["coverage.html"] = coverage_page(self.coverage, title=f"Coverage of {title}", sources=sources)
            if files:
                texts["coverage.info"] = _joined(lcov_lines(files, sources=sources))
            table = coverage_lines(self.coverage, missed=False)
            facts["coverage"] = {"files": sorted(texts), "table": table, **_sums(self.coverage)}
            facts["program"] = program_lines(self.coverage, sources)
        if self.profile is not None and self.latency is not None:
            waits = exception_lines(self.latency.by_name, self.board.hclk_hz)
            texts["profile.txt"] = _joined([f"profile of {title}", "", *function_lines(self.profile), *waits])
            texts["profile.folded"] = _joined(self.profile.folded())
            texts["profile.svg"] = flame_svg(self.profile.stacks, title=title, hz=self.board.hclk_hz)
            facts["profile"] = {
                "files": ["profile.folded", "profile.svg", "profile.txt"],
                "table": function_lines(self.profile, most=_SHOWN_FUNCTIONS),
                "cycles": self.profile.total_cycles,
                "asleep_cycles": sum(n for names, n in self.profile.stacks.items() if names[-1:] == (ASLEEP,)),
            }
        try:
            for file, text in texts.items():
                (folder / file).write_text(text, encoding="utf-8")
        except OSError as error:
            raise FileError(f"cannot write into {folder}: {error.strerror or error}") from error
        return facts


@contextmanager
def measuring(board: BluePill, *, coverage: bool, profile: bool, fail_under: float = 0.0) -> Iterator[Measurement]:
    """Listen to a board for a block, or until the figures are written.

    Raises:
        BluePillError: `fail_under` percent of the lines are asked for, and the program has no debug information.
    """
    code = StaticCode(board.chip.memory)
    lines = Coverage(board.image, read_lines(board.image), code, board.chip.ns_of) if coverage else None
    if lines is not None and fail_under:
        refuse_without_lines(lines, board.image.name)
    cycles = CycleProfile(FunctionTable(board.image), code) if profile else None
    latency = LatencyProbe(board) if profile else None
    listeners = [listener for listener in (lines, cycles, latency) if listener is not None]
    try:
        with Observation(board, listeners) as observation:
            yield Measurement(board, lines, cycles, latency, observation, fail_under)
    finally:
        if latency is not None:
            latency.detach()


def _sums(coverage: Coverage) -> Json:
    """Return counts over the whole program: of lines where they are known, of ways of branches."""
    files = coverage.files()
    ways = [count for pair in coverage.branches().values() for count in pair]
    return {
        "lines": sum(len(file.lines) for file in files),
        "lines_hit": sum(file.lines_hit for file in files),
        "branch_ways": len(ways),
        "branch_ways_hit": sum(1 for count in ways if count),
    }


def _joined(lines: "Iterator[str] | list[str]") -> str:
    return "".join(f"{line}\n" for line in lines)
