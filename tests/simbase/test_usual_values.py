"""Options that may stand without a value: what is inserted where none follows, and nothing where there are no words."""

from collections.abc import Mapping
from typing import ClassVar

import pytest
import typer
from typer.testing import CliRunner

from simbase.command_line.gdb_option import usual_port
from simbase.command_line.help_pages import Usual, VerbPage


class Page(VerbPage):
    usual: ClassVar[Mapping[str, Usual]] = {"--gdb": usual_port}


APP = typer.Typer()


@APP.command(cls=Page)
def show(gdb: int = typer.Option(-1, "--gdb"), what: str = typer.Argument("nothing")) -> None:
    typer.echo(f"{gdb} {what}")


@pytest.mark.parametrize(
    ("words", "seen"),
    [([], "-1 nothing"), (["--gdb"], "3333 nothing"), (["--gdb", "0"], "0 nothing"), (["--gdb", "dodge"], "3333 dodge"),
     (["dodge", "--gdb"], "3333 dodge"), (["dodge", "--gdb", "7"], "7 dodge")],
)  # fmt: skip
def test_a_usual_value_is_inserted_where_none_follows(words: list[str], seen: str) -> None:
    assert CliRunner().invoke(APP, words).output.strip() == seen
