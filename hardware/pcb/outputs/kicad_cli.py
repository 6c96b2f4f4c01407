"""Calls of kicad-cli: rule checks, netlist, gerbers, drawings, pictures.

Everything that needs KiCad 9 stands here and in pours.py. Invariant: nothing is left in the
user's configuration (each call runs with a home folder of its own).
"""

import json
import os
import re
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from hardware.pcb.outputs.sexp import children, parse, word
from simbase.errors import MissingDependencyError, P2osError

_LIMIT_S = 400
NEEDED_MAJOR = 9
GERBER_LAYERS = "F.Cu,B.Cu,F.Mask,B.Mask,F.Paste,F.SilkS,Edge.Cuts"


class KicadFailedError(P2osError):
    """kicad-cli ended with an error."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Violation:
    """One line of a rule check's report."""

    kind: str
    severity: str
    text: str

    def __str__(self) -> str:
        """Return the line that a person reads."""
        return f"{self.severity} {self.kind}: {self.text}"


@lru_cache(maxsize=1)
def version() -> str | None:
    """Return KiCad's version where it is new enough, None where it is missing or older."""
    program = shutil.which("kicad-cli")
    if program is None:
        return None
    with tempfile.TemporaryDirectory() as home:
        done = subprocess.run([program, "version"], capture_output=True, text=True, timeout=_LIMIT_S, check=False,
                              env=_environment(home))  # fmt: skip
    found = re.search(r"(\d+)\.\d+\.\d+", done.stdout)
    return found[0] if found and int(found[1]) >= NEEDED_MAJOR else None


def run(*arguments: str | Path, good: tuple[int, ...] = (0,)) -> str:
    """Run kicad-cli and return what it printed.

    Raises:
        MissingDependencyError: There is no KiCad 9.
        KicadFailedError: It ended with another exit code than expected.
    """
    if version() is None:
        raise MissingDependencyError("KiCad 9 is not installed", hint="tools/install_board_tools.sh")
    with tempfile.TemporaryDirectory() as home:
        done = subprocess.run(["kicad-cli", *map(str, arguments)], capture_output=True, text=True, timeout=_LIMIT_S,
                              check=False, env=_environment(home))  # fmt: skip
    if done.returncode not in good:
        raise KicadFailedError(f"kicad-cli {' '.join(map(str, arguments[:3]))}: {(done.stderr or done.stdout)[-400:]}")
    return done.stdout


def written(*arguments: str | Path, source: Path) -> str:
    """Run kicad-cli on a file and return what it wrote.

    Raises:
        MissingDependencyError: As `run`.
        KicadFailedError: As `run`.
    """
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "written"
        run(*arguments, "-o", file, source)
        return file.read_text(encoding="utf-8")


_ERC = ("sch", "erc", "--severity-all")
_DRC = ("pcb", "drc", "--severity-all", "--schematic-parity")


def erc(schematic: Path) -> list[Violation]:
    """Return every finding of the electrical rule check, warnings included."""
    sheets = json.loads(written(*_ERC, "--format", "json", source=schematic))["sheets"]
    return [_violation(entry) for sheet in sheets for entry in sheet["violations"]]


def drc(board: Path) -> list[Violation]:
    """Return every finding of the design rule check, unconnected items and differences to the schematic included."""
    found = json.loads(written(*_DRC, "--format", "json", source=board))
    groups = ("violations", "unconnected_items", "schematic_parity")
    return [_violation(entry) for group in groups for entry in found[group]]


def reports(variant: str, schematic: Path, board: Path) -> dict[str, str]:
    """Return KiCad's own reports of both rule checks by file name, without their dates."""
    calls = {"erc": (_ERC, schematic), "drc": (_DRC, board)}
    return {
        f"{variant}-{name}.rpt": without_dates(written(*words, source=file)) for name, (words, file) in calls.items()
    }


def netlist(schematic: Path) -> dict[str, list[tuple[str, str]]]:
    """Return the nets that KiCad reads from a schematic: name to sorted (reference, pin)."""
    tree = parse(written("sch", "export", "netlist", "--format", "kicadsexpr", source=schematic))
    nets = {}
    for net in children(children(tree, "nets")[0], "net"):
        members = [(word(children(pin, "ref")[0]), word(children(pin, "pin")[0])) for pin in children(net, "node")]
        nets[word(children(net, "name")[0])] = sorted(members)
    return nets


def fabrication(board: Path, folder: Path) -> None:
    """Write gerbers, drill files and KiCad's own placement file into a folder."""
    run("pcb", "export", "gerbers", "--layers", GERBER_LAYERS, "--use-drill-file-origin", "-o", f"{folder}/", board)
    run("pcb", "export", "drill", "--format", "excellon", "--excellon-separate-th", "--drill-origin", "plot", "-o",
        f"{folder}/", board)  # fmt: skip
    for file in sorted(folder.iterdir()):
        file.write_text(without_dates(file.read_text(encoding="utf-8")), encoding="utf-8", newline="\n")


def without_dates(text: str) -> str:
    """Return a fabrication file without the lines that hold when and by which program it was written."""
    return "\n".join(line for line in text.splitlines() if not _DATED.search(line)) + "\n"


def schematic_pdf(schematic: Path, file: Path) -> None:
    """Write all pages of a schematic as one PDF."""
    run("sch", "export", "pdf", "-o", file, schematic)


def step(board: Path, file: Path) -> None:
    """Write the bare board, its outline and holes, as STEP without its date: bodies of parts are pictures only."""
    run("pcb", "export", "step", "--force", "--board-only", "-o", file, board)
    text = re.sub(r"'\d{4}-\d\d-\d\dT[\d:]+[^']*'", "''", file.read_text(encoding="utf-8"))
    file.write_text(text, encoding="utf-8", newline="\n")


def picture(board: Path, file: Path, *arguments: str) -> None:
    """Render a picture of the board."""
    run("pcb", "render", *arguments, "-o", file, board)


_DATED = re.compile(
    r"CreationDate|Created by KiCad|GenerationSoftware|DRILL file|FORMAT=.*date|^; #@! TF\.CreationDate"
    r"|^ERC report \(|^\*\* Created on"
)


def _violation(entry: dict[str, object]) -> Violation:
    items = entry["items"]
    where = "; ".join(str(item["description"]) for item in items) if isinstance(items, list) else ""
    return Violation(kind=str(entry["type"]), severity=str(entry["severity"]), text=f"{entry['description']}: {where}")


def _environment(home: str) -> dict[str, str]:
    return {**os.environ, "HOME": home, "XDG_CONFIG_HOME": home, "XDG_CACHE_HOME": home, "LC_ALL": "C.UTF-8"}
