"""The source of a campaign's program against what its points have run: lines and both ways of branches.

Invariant: it says the same of the same blocks and ways, whatever run them.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from bluepill_sim.analysis.coverage import Coverage, FileCoverage
from bluepill_sim.board import BluePill
from p2os.errors import ScenarioError
from robot_bench.bench.board import boot
from robot_bench.campaign.reaching.reach import ToReach, ToReachTable
from robot_bench.campaign.trial import Trial, unpacked
from simbase.errors import P2osError, nearest, shown
from simbase.units import ranges_text


@dataclass(frozen=True, slots=True)
class SourceReached:
    """What of a program was reached."""

    files: tuple[FileCoverage, ...]
    #: Ways of all conditional branches, also of those without a line: those that were gone, and all.
    ways: int
    ways_of: int

    @property
    def lines(self) -> int:
        """How many lines with code were reached."""
        return sum(file.lines_hit for file in self.files)

    @property
    def lines_of(self) -> int:
        """How many lines have code."""
        return sum(len(file.lines) for file in self.files)

    def unreached(self) -> Iterator[tuple[str, str]]:
        """Yield each file that has lines that nothing has reached, with these: `("a.c", "4-6, 9")`."""
        for file in self.files:
            if file.missed_lines:
                yield file.name, ranges_text(file.missed_lines)

    def one_way(self) -> Iterator[tuple[str, str]]:
        """Yield each file that has lines whose branches have run and always gone the same way, with these."""
        for file in self.files:
            if lines := sorted({line for line, _ in file.one_way}):
                yield file.name, ranges_text(lines)


def source_reached(trial: Trial, blocks: Iterable[int], ways: Iterable[int]) -> SourceReached | None:
    """Return what outcomes have reached of a trial's program; None where robots have several programs.

    Args:
        trial: Has the program.
        blocks: As of `Outcome.blocks`.
        ways: As of `Outcome.ways`.
    """
    try:
        board = _board(trial)
        if board is None:
            return None
        found = Coverage.of_board(board, blocks, ((way & ~1, bool(way & 1)) for way in ways))
        gone = [count for both in found.branches().values() for count in both]
        return SourceReached(tuple(found.files()), sum(map(bool, gone)), len(gone))
    except P2osError:  # the page then does without
        return None


def reach_of(table: ToReachTable, trial: Trial) -> ToReach:
    """Return what a table of the file asks for, of the program of a trial.

    Raises:
        ScenarioError: The program has no such line.
    """
    if table.line is None:
        return ToReach(table.said, table.words)
    name, _, number = table.line.rpartition(":")
    board = _board(trial)
    if board is None:
        raise ScenarioError(f"line {shown(table.line)}: robots of several programs have no one line")
    coverage = Coverage.of_board(board, (), ())
    names = {file.name.rsplit("/", 1)[-1]: file for file in coverage.files()}
    file = names.get(name.rsplit("/", 1)[-1])
    if file is None:
        raise ScenarioError(f"{trial.firmware_name} has no code of {shown(name)}", hint=nearest(name, list(names)))
    if int(number) not in file.lines:
        near = min(file.lines, key=lambda line: (abs(line - int(number)), line))
        raise ScenarioError(f"{shown(table.line)} gave no code", hint=f'line = "{name}:{near}"')
    return ToReach(table.said, blocks=coverage.blocks_of(file.name, int(number)))


def _board(trial: Trial) -> BluePill | None:
    if len(trial.programs) != 1:
        return None
    with unpacked(trial.files) as folder:
        scenario = trial.scenario(folder)
        robots = [robot.scenario for robot in scenario.robots if robot.scenario is not None]
        chip = boot(robots[0] if robots else scenario)
    return chip if isinstance(chip, BluePill) else None
