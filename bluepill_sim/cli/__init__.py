"""`p2os mcu`: the emulated BluePill by itself, for those who write firmware."""

import typer

from bluepill_sim.cli import coverage, debug, info, parts, pins, profile, run, trace
from bluepill_sim.cli.browser import page
from bluepill_sim.cli.comparisons import compare_cores, compare_silicon, races
from simbase.command_line.help_pages import VerbPage

HELP = """Run, inspect and debug a BluePill program, without a robot.

FIRMWARE is an ELF, HEX or BIN file for an STM32F103C8. With debug information
in the ELF, places are shown by symbol and line.

\b
Examples:
  {program} run mine.elf              one second of virtual time
  {program} pins mine.elf --for 2s    what each pin did
"""


def register(app: typer.Typer) -> None:
    """Add the verb and what is below it."""
    mcu = typer.Typer(help=HELP, rich_markup_mode=None)
    add_verbs(mcu)
    app.add_typer(mcu, name="mcu", rich_help_panel="BluePill")


def add_verbs(app: typer.Typer) -> None:
    """Add what stands below it."""
    modules = (run, parts, debug, info, pins, trace, coverage, profile, races, compare_silicon, compare_cores, page)
    for module in modules:
        name = module.__name__.rpartition(".")[2]
        page_class = getattr(module, "PAGE", VerbPage)
        app.command(name.replace("_", "-"), help=module.HELP, cls=page_class)(getattr(module, name))
