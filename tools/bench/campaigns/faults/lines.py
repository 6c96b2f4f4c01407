"""Ask `p2os explain` for the source line of drawn faults: with the program itself as the good version, and without.

    python tools/bench/campaigns/faults/lines.py FOLDER [NAME...] [--seed 41] [--back] [--runs 24] [--minutes 10]

FOLDER has the programs (`draw.py --build FOLDER`). The failure that `search.py FOLDER` has left is taken; where there
is none, a campaign's folder of so many points is made beside the program, which a later call takes. `--back` changes
the program back in place of naming a good version. A line is printed for each: what was said, and whether the planted
line is among the lines that it names (`right`), uses the macro that is wrong there (`used`), is not (`wrong`), or none
is named (`unknown`).
"""

import argparse
import json
import re
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path

import draw

from robot_bench.campaign.trial import trial_of
from robot_bench.campaign.variants.against import Other
from robot_bench.campaign.variants.fault_line import by_version
from robot_bench.firmware.build import HERE
from simbase.errors import UsageError

P2OS = Path(sys.executable).with_name("p2os")
#: chosen: what fails is not at stake here.
CONFIRMATIONS = 1


def campaign(name: str, folder: Path, runs: int) -> Path:
    """Run the campaign that `p2os campaign new` writes for a program, unless it is there; return its folder."""
    out = folder / f"{name}-points"
    if not (out / "summary.json").is_file():
        file = folder / f"{name}-points.toml"
        given = ["--firmware", str(folder / f"{name}.elf"), "--runs", str(runs), "--out", str(file)]
        file.unlink(missing_ok=True)
        _p2os("campaign", "new", name.partition("-")[0], *given)
        text = re.sub(r"confirmations = \d+", f"confirmations = {CONFIRMATIONS}", file.read_text(encoding="utf-8"))
        file.write_text(text, encoding="utf-8")
        asked = ["--resume", str(out)] if out.is_dir() else [str(file), "--out", str(out)]
        _p2os("campaign", *asked, "-j", "1")
    return out


def by_failure(name: str, folder: Path, good: Path) -> dict[str, str] | None:
    """Return what `p2os explain --against` says of the failure that a search has left; None where there is none."""
    left = sorted(folder.glob(f"{name}-seed*/failure/*.toml"))
    if not left:
        return None
    try:
        return asdict(by_version([trial_of(str(left[0]))], Other.read(good)))
    except UsageError as error:
        return {"line": "", "says": str(error)}


def judged(found: dict[str, str], fault: draw.DrawnFault) -> str:
    """Return whether what was said names the planted line; `used`: a line that uses the macro which is wrong."""
    if not found.get("line"):
        return "unknown"
    file, _, lines = found["line"].rpartition(":")
    spans = [span.partition("-") for span in lines.split(", ")]
    lengths = fault.right.count("\n")
    planted = range(fault.line, fault.line + lengths + 1)
    is_named = any(int(first) <= line <= int(last or first) for first, _, last in spans for line in planted)
    if is_named and Path(file).name == fault.file:
        return "right"
    macro = re.match(r"#define (\w+)", _text_of(fault.file, fault.line))
    named = " ".join(
        _text_of(file, line) for first, _, last in spans for line in range(int(first), int(last or first) + 1)
    )
    return "used" if macro and re.search(rf"\b{macro[1]}\b", named) else "wrong"


def _text_of(file: str, line: int) -> str:
    """Return a line of a source of the programs; nothing where it is no source of theirs."""
    path = HERE / Path(file).name
    return path.read_text(encoding="utf-8").splitlines()[line - 1] if path.is_file() else ""


def _p2os(*arguments: str) -> str:
    return subprocess.run([P2OS, *arguments], capture_output=True, text=True, check=False).stdout


def main() -> int:
    """Ask for each."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("folder", type=Path)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--seed", type=int, choices=draw.SEEDS, default=draw.SEEDS[-1])
    parser.add_argument("--back", action="store_true")
    parser.add_argument("--runs", type=int, default=24)
    parser.add_argument("--minutes", type=float, default=10.0)
    asked = parser.parse_args()
    faults = {
        f"{program}-{number:02d}": fault
        for program in draw.DRAWN
        for number, fault in enumerate((one for one in draw.kept(asked.seed) if one.program == program), 1)
    }
    for name in asked.names or faults:
        good = HERE / f"{faults[name].program}.elf"
        found = None if asked.back else by_failure(name, asked.folder, good)
        if found is None:
            out = campaign(name, asked.folder, asked.runs)
            against = [] if asked.back else ["--against", str(good)]
            said = _p2os("explain", str(out), *against, "--minutes", str(asked.minutes), "--json")
            found = json.loads(said) if said.startswith("{") else {"line": "", "says": "nothing fails"}
        planted = f"{faults[name].file}:{faults[name].line}"
        print(f"{name} {planted}: {judged(found, faults[name])}: {found['line']} {found['says']}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
