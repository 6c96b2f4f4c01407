"""`p2os check`: says whether scenario files can be run, without running them."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from p2os.cli.groups import BENCH
from p2os.toml_schema import placed, within
from robot_bench.bench import Bench
from robot_bench.scenario.included_files import as_toml
from robot_bench.scenario.json_schema import scenario_schema
from robot_bench.scenario.loading import load_scenario
from robot_bench.scenario.scenario import Scenario
from robot_bench.scenario.sweep import rows
from simbase.errors import P2osError, UsageError, shown_name
from simbase.timing import NS_PER_S
from simbase.trust import Code, Trust

HELP = """Check scenario files without running them.

Checked are keys, ranges, names, events, firmware, world, parts and wires, in
all included files. Keys and names are checked in each row of a sweep, parts and
wires in one row for each value. Nothing is executed: Python files need only
exist.

Exit code: 0 all can be run, 1 one cannot.

\b
Examples:
  p2os check patrol.toml                    a summary, or errors with their lines
  p2os check tests/*.toml
  p2os check --schema > scenario.schema.json   for editors that check TOML
"""


#: Names are read, and nothing is executed.
_NOTHING = Trust(only_reads=True)


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("check", help=HELP, rich_help_panel=BENCH)(check)


def check(
    files: Annotated[list[str] | None, typer.Argument(help="Scenario files, or names.", metavar="FILE")] = None,
    firmware: Annotated[
        Path | None, typer.Option(help="ELF, HEX or BIN in place of the scenarios'.", metavar="FILE")
    ] = None,
    schema: Annotated[bool, typer.Option("--schema", help="Print the JSON schema of scenarios.")] = False,
) -> None:
    """Check scenarios."""
    if schema:
        typer.echo(json.dumps(scenario_schema(), indent=2))
        return
    if not files:
        raise UsageError("which scenario?", hint="p2os check FILE, or --schema")
    wrong = 0
    for name in files:
        try:
            found = load_scenario(name, firmware=firmware, trust=_NOTHING)
            _build(found)
            codes = {code.where: code for code in found.codes}
            runs = _check_rows(name, found, firmware, codes)
        except P2osError as error:
            wrong += 1
            typer.echo(f"wrong  {error}" + (f" (hint: {error.hint})" if error.hint else ""))
            continue
        typer.echo(
            f"ok     {name}: {found.duration_ns / NS_PER_S:g} s of {found.firmware.name} in {found.world}, "
            f"{len(found.goals)} goals{f', {runs} runs' if runs > 1 else ''}"
        )
        for code in codes.values():
            typer.echo(f"not checked: code  {shown_name(code.where)} = {shown_name(code.named)}")
    if wrong:
        raise typer.Exit(1)


def _check_rows(name: str, scenario: Scenario, firmware: Path | None, codes: dict[str, Code]) -> int:
    """Check every row of a sweep; return how many runs there are, and add to the code that is not looked into.

    A bench takes several times as long as its scenario: it is built for the first row with each value.

    Raises:
        P2osError: A value of a parameter cannot be.
    """
    count, built = 0, set[str]()
    for settings in rows(scenario.axes) if scenario.axes else ():
        place = str(within(scenario.where, "sweep"))
        row = load_scenario(name, firmware=firmware, settings=settings, set_by=place, trust=_NOTHING)
        codes |= {code.where: code for code in row.codes}
        words = [f"{key} = {as_toml(value)}" for key, value in settings]
        if not built.issuperset(words):
            built.update(words)
            with placed(f"{place} {', '.join(words)}"):
                _build(row)
        count += 1
    return max(count, 1) * max(len(scenario.seeds), 1)


def _build(scenario: Scenario) -> None:
    robots = tuple(
        replace(robot, scenario=robot.scenario and _without_code(robot.scenario)) for robot in scenario.robots
    )
    # The cheapest body: what is refused here, every body refuses.
    Bench.from_scenario(replace(_without_code(scenario), robots=robots), body="kinematic")


def _without_code(scenario: Scenario) -> Scenario:
    """Return a scenario with what ships in the place of code, and without the parts that are code."""
    return replace(
        scenario,
        adapter_core="model" if isinstance(scenario.adapter_core, Code) else scenario.adapter_core,
        controller_kind="pioneer" if isinstance(scenario.controller_kind, Code) else scenario.controller_kind,
        parts=tuple(part for part in scenario.parts if not isinstance(part.kind, Code)),
    )
