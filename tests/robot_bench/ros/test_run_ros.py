"""`p2os run --ros` and `--inputs` on the command line: what they refuse."""

import pytest
import typer
from typer.testing import CliRunner

from robot_bench.cli import run as verb
from simbase.errors import P2osError


@pytest.fixture
def app() -> typer.Typer:
    made = typer.Typer()
    verb.register(made)
    return made


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--ros", "dds:999"], "there is no domain 999"),
        (["--ros", "dds:x"], "is no place"),
        (["--ros", "--port", "tcp:127.0.0.1:1"], "--ros cannot stand beside --port"),
        (["--ros", "--gdb", "0"], "--ros cannot stand beside --gdb"),
        (["--ros", "--coverage"], "--ros cannot stand beside --coverage"),
        (["--ros", "--inputs", "x"], "--ros cannot stand beside --inputs"),
        (["--ros", "--seeds", "0-1"], "--ros cannot stand beside a sweep"),
        (["--inputs", "nothing"], "cannot read nothing: no such file or directory"),
        (["--inputs", "x", "--gdb", "0"], "--inputs cannot stand beside --gdb"),
    ],
)
def test_what_cannot_stand_beside_ros_is_refused(app: typer.Typer, words: list[str], says: str) -> None:
    result = CliRunner().invoke(app, ["sensors", *words])
    assert isinstance(result.exception, P2osError), result.output
    assert says in str(result.exception)
    assert result.exception.exit_code == 2


def test_a_robot_on_own_pins_has_no_such_topics(app: typer.Typer) -> None:
    result = CliRunner().invoke(app, ["rover", "--ros"])
    assert "on the wires of the pin-out" in str(result.exception)
