"""Runs decks with ngspice in batch mode and reads figures and traces back.

Invariant: nothing is written outside a folder of the call's own.
"""

import re
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

from hardware.pcb.spice.deck import Deck, Limit
from simbase.errors import MissingDependencyError, P2osError

_LIMIT_S = 120


class SimulationError(P2osError):
    """ngspice could not simulate a deck."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DeckResult:
    """What a deck gave."""

    deck: Deck
    figures: dict[str, float]
    #: Sweep values, then one list a trace.
    columns: list[list[float]]

    def verdicts(self) -> list[tuple[Limit, float, bool]]:
        """Return each limit with its figure and whether it is kept."""
        return [
            (limit, self.figures[limit.measure], limit.low <= self.figures[limit.measure] <= limit.high)
            for limit in self.deck.limits
        ]


def is_installed() -> bool:
    """Tell whether ngspice can be called."""
    return shutil.which("ngspice") is not None


def simulate(deck: Deck) -> DeckResult:
    """Run a deck.

    Raises:
        MissingDependencyError: There is no ngspice.
        SimulationError: It failed, or a measure is missing; the message has its last words.
    """
    if not is_installed():
        raise MissingDependencyError("ngspice is not installed", hint="apt-get install ngspice")
    with tempfile.TemporaryDirectory() as folder:
        file, data = Path(folder) / "deck.cir", Path(folder) / "traces.txt"
        file.write_text(deck_text(deck, data), encoding="utf-8")
        done = subprocess.run(["ngspice", "-b", str(file)], capture_output=True, text=True, timeout=_LIMIT_S,
                              check=False,
                              cwd=folder)  # fmt: skip
        figures = {name: float(value) for name, value in _MEASURED.findall(done.stdout)}
        missing = [limit.measure for limit in deck.limits if limit.measure not in figures]
        if missing or not data.exists():
            words = (done.stdout + done.stderr)[-600:]
            raise SimulationError(f"{deck.name}: no figure for {', '.join(missing) or 'the traces'}\n{words}")
        rows = [[float(word) for word in line.split()] for line in data.read_text(encoding="utf-8").splitlines()]
    count = len(deck.traces)
    columns = [[row[0] for row in rows], *([row[2 * index + 1] for row in rows] for index in range(count))]
    return DeckResult(deck=deck, figures=figures, columns=columns)


def deck_text(deck: Deck, data: Path) -> str:
    """Return the file that ngspice reads; the traces go to `data`."""
    lines = [f"* {deck.title}", deck.circuit.strip(), ".control", "set numdgt=9", "run"]
    lines += [f"meas {measure}" for measure in deck.measures]
    lines += [f"wrdata {data} " + " ".join(expression for expression, _ in deck.traces), "quit", ".endc", ".end"]
    return "\n".join(lines) + "\n"


_MEASURED = re.compile(r"^([a-z_0-9]+)\s+=\s+([-+0-9.eE]+)", re.MULTILINE)
