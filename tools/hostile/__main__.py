"""The command line: attack, print a row each, and end with 1 where something did not hold."""

import shutil
import sys
import time
from pathlib import Path
from typing import Annotated

import typer

from tools.hostile.attacks import ATTACKS
from tools.hostile.judgement import AttackOutcome, outcomes
from tools.hostile.robots import CLIENTS, ROBOTS
from tools.hostile.targets import TARGETS

ALL_TARGETS, ALL_ATTACKS = (*TARGETS, *CLIENTS), (*ATTACKS, *ROBOTS)
OWN = str(Path(sys.executable).with_name("p2os"))


def _shown(outcome: AttackOutcome) -> str:
    row = f"{outcome.target:13} {outcome.phase:5} {outcome.attack:14}"
    if outcome.skipped:
        return f"{row} not tried: {outcome.skipped}"
    stopped = "" if outcome.stopped_s is None else f"; STOP after {outcome.stopped_s * 1000:.1f} ms"
    return f"{row} {'FAULT: ' + '; '.join(outcome.faults) if outcome.faults else 'holds' + stopped}"


def main(
    targets: Annotated[list[str] | None, typer.Argument(help=f"Of {', '.join(ALL_TARGETS)}; all, if none.")] = None,
    attack: Annotated[list[str] | None, typer.Option(help=f"Of {', '.join(ALL_ATTACKS)}; again for one more.")] = None,
    p2os: Annotated[str, typer.Option(help="The program that is attacked.")] = OWN,
    seconds: Annotated[float, typer.Option(min=0.2, help="How long an attack lasts.")] = 2.0,
    seed: Annotated[int, typer.Option(help="Of what is drawn.")] = 0,
) -> None:
    """Attack every socket of every verb while wheels are watched."""
    names, ways = targets or list(ALL_TARGETS), attack or list(ALL_ATTACKS)
    for given, known in ((names, ALL_TARGETS), (ways, ALL_ATTACKS)):
        if unknown := [each for each in given if each not in known]:
            raise typer.BadParameter(f"{', '.join(unknown)} is none of {', '.join(known)}")
    if (found := shutil.which(p2os)) is None:
        raise typer.BadParameter(f"there is no program {p2os}")
    began, tried, wrong = time.monotonic(), 0, 0
    for each in outcomes(str(Path(found).absolute()), names, ways, lasts_s=seconds, seed=seed):
        tried, wrong = tried + (not each.skipped), wrong + bool(each.faults)
        print(_shown(each), flush=True)
    print(f"{tried} attacks in {time.monotonic() - began:.0f} s: {wrong or 'no'} fault{'' if wrong == 1 else 's'}")
    raise typer.Exit(1 if wrong else 0)


if __name__ == "__main__":
    typer.run(main)
