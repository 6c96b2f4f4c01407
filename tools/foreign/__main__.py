"""`python -m tools.foreign`: programs of others as judges of the emulator and of the virtual robot.

A row of the table (`rows`) names a public source with its commit, what program of it has to be in the cache, what is
said to that program, and what must come back; its judge (`judges`) is the program's own host or tool where it has one.
Nothing of those programs is in this repository, nor what builds them: who has a build puts it into the cache, a folder
outside the checkout (--cache; cache.py has its layout). Rows that can be run here are run, of each other it is said
what is missing.
Invariant: a row passes by what came back alone, and no process of it outlives it.
Exit codes: 0 every row that could be run passed, 1 one did not, 2 wrong usage.
"""

import argparse
import json
import shlex
import sys
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path

from p2os.robots.parameters import known_robots
from tools.foreign.cache import default_cache
from tools.foreign.judges.drives import Drives
from tools.foreign.judges.poses import Poses
from tools.foreign.page import record
from tools.foreign.report import line, table
from tools.foreign.row import ProgramKind, Row, RowStatus, Source
from tools.foreign.rows.table import ROWS
from tools.foreign.running import run


def main(arguments: Sequence[str] | None = None, rows: Sequence[Row] = ROWS) -> int:
    """Run rows and print the table; return the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m tools.foreign",
        description="Run programs of others that are in the cache, and judge what they say.",
    )
    parser.add_argument("rows", nargs="*", metavar="ROW", help="only these; or firmware, or client, for all such")
    parser.add_argument(
        "--cache", type=Path, default=default_cache(), help="where programs of others are [%(default)s]"
    )
    parser.add_argument(
        "--client", action="append", default=[], metavar="NAME=COMMAND",
        help='a client of yours, such as "mine=/home/me/drive {host} {port}", or {url}, or {line}; again for more',
    )  # fmt: skip
    parser.add_argument(
        "--robot", action="append", default=[], metavar="MODEL", help="clients against this model, or all; repeatable",
    )  # fmt: skip
    parser.add_argument("--json", action="store_true", help="print a JSON object a row")
    parser.add_argument("--record", action="store_true", help="note the results for the page")
    chosen = parser.parse_args(arguments)
    mine = [_mine(text, parser) for text in chosen.client]
    names = [name for text in chosen.rows for name in text.split(",") if name]
    taken = [*mine, *(_named(names, rows, parser) if names or not mine else ())]
    results = []
    for row in _on_robots(taken, chosen.robot, parser):
        results.append(result := run(row, chosen.cache, chosen.cache / "log"))
        if chosen.json:
            print(json.dumps({**asdict(result), "status": result.status.value}), flush=True)
        else:
            print(line(result), file=sys.stderr, flush=True)
    if not chosen.json:
        print(table(results))
    if chosen.record:
        record(results)
    return int(any(result.status is RowStatus.FAILED for result in results))


def _named(names: Sequence[str], rows: Sequence[Row], parser: argparse.ArgumentParser) -> list[Row]:
    """Return the rows that are asked for; all of them where none is."""
    known = {row.name for row in rows} | {kind.value for kind in ProgramKind}
    if strange := [name for name in names if name not in known]:
        parser.error(f"no row {strange[0]!r}; there are: {', '.join(row.name for row in rows)}")
    return [row for row in rows if not names or row.name in names or row.kind.value in names]


def _mine(text: str, parser: argparse.ArgumentParser) -> Row:
    name, equals, command = text.partition("=")
    words = tuple(shlex.split(command))
    if not equals or not words:
        parser.error(f"--client {text}: NAME=COMMAND")
    return Row(
        name=name, kind=ProgramKind.CLIENT, source=Source(folder=name, url="", commit=""), program=command,
        said="the robot drives", judge=Drives(program=words[0], commands=(words,)),
    )  # fmt: skip


def _on_robots(rows: Sequence[Row], models: Sequence[str], parser: argparse.ArgumentParser) -> list[Row]:
    """Return the rows, the clients once for each model that is asked for."""
    taken = list(known_robots()) if "all" in models else list(models)
    if strange := set(taken) - set(known_robots()):
        parser.error(f"no robot {strange.pop()!r}; there are: all, {', '.join(known_robots())}")
    found = []
    for row in rows:
        judge = row.judge
        if taken and isinstance(judge, Poses):
            found.append(replace(row, judge=replace(judge, only=tuple(taken))))
            continue
        if not taken or not isinstance(judge, Drives):
            found.append(row)
            continue
        found += [
            replace(row, name=f"{row.name}-{model}", judge=replace(judge, serve=(*judge.serve, "--robot", model)))
            for model in taken
        ]
    return found


if __name__ == "__main__":
    sys.exit(main())
