"""Names that ship, for a shell that completes them; those of robots, worlds and bodies are in `p2os.cli.names`."""

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import typer

from bluepill_sim.errors import BluePillError
from bluepill_sim.program.image import load_image
from bluepill_sim.program.variables import read_variables
from p2os.toml_record import keys_of, table_of, tables_of
from p2os.toml_schema import Key, Table
from robot_bench.scenario.included_files import read_tables, shipped_file
from robot_bench.scenario.loading import known_scenarios, load_scenario
from robot_bench.scenario.tables import EachRobotTable, TopTable
from simbase.errors import P2osError


def scenario_names(incomplete: str) -> list[str]:
    """Return the scenarios that ship."""
    return [name for name in known_scenarios() if name.startswith(incomplete)]


def variable_names(context: typer.Context, incomplete: str) -> list[str]:
    """Return names of numbers among the variables of the firmware on the line."""
    scenario = context.params.get("scenario") or next(iter(context.args), "")
    with contextlib.suppress(P2osError, BluePillError):  # a shell shows no errors
        firmware = context.params.get("firmware") or load_scenario(scenario, trust=False).firmware
        return read_variables(load_image(firmware)).offered(incomplete)
    return []


def setting_keys(context: typer.Context, incomplete: str) -> list[tuple[str, str]]:
    """Return what `--set` takes of the scenario on the line, `start.x_m=` or `mode=direct`, each with what it is."""
    held: Table = {}
    # A line that ends in `--set` was not taken apart: the scenario is still among its words.
    if name := context.params.get("scenario") or next(iter(context.args), ""):
        path = shipped_file(name) if name in known_scenarios() else Path(name)
        with contextlib.suppress(P2osError):  # a shell shows no errors
            held = read_tables(path).table
    return [one for one in _settings(keys_of(TopTable), held, "") if one[0].startswith(incomplete)]


def _settings(keys: Sequence[Key], held: Table, above: str) -> Iterator[tuple[str, str]]:
    """Yield each key with its doc, those of tables in lists as far as the file has such."""
    for key in keys:
        name = f"{above}{key.name}"
        if key.kind == "tables" or isinstance(held.get(key.name), list):
            for number, row in enumerate(tables_of(held, key.name), 1):
                yield from _settings(_keys_of_row(key, row), row, f"{name}.{number}.")
        elif key.record is not None:
            tables = table_of(held, key.name)
            for one in tables if key.is_named else ("",):
                inner, below = (table_of(tables, one), f"{name}.{one}.") if one else (tables, f"{name}.")
                yield from _settings(keys_of(key.record), inner, below)
        else:
            choices = ("true", "false") if key.kind == "flag" else key.choices
            yield from ((f"{name}={choice}", key.doc) for choice in choices or ("",))


def _keys_of_row(key: Key, row: Table) -> tuple[Key, ...]:
    """Return the keys of a table in a list, by its kind where there are several."""
    if key.variants is None:
        return keys_of(key.record or EachRobotTable)
    kinds, tag = key.variants.kinds(), key.variants.tag
    common = (replace(one, choices=tuple(kinds)) if one.name == tag else one for one in keys_of(key.variants.common))
    kind = kinds.get(str(row.get(tag)))
    return (*common, *(keys_of(kind) if kind is not None else ()))
