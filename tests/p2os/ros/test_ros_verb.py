"""`p2os ros` on the command line: what it refuses, and the file that it writes."""

from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from p2os.cli.robots import ros
from p2os.errors import TransportError
from simbase.errors import P2osError, UsageError


@pytest.fixture
def app() -> typer.Typer:
    made = typer.Typer()
    ros.register(made)
    return made


def run(app: typer.Typer, *words: str) -> str:
    """Return what a command prints; raise what it ends with."""
    result = CliRunner().invoke(app, list(words))
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.output


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["urdf"], "of which robot"),
        (["urdf", "nothing"], "no robot model"),
        (["tcp:127.0.0.1:1", "p2dx"], "go with urdf"),
        (["tcp:127.0.0.1:1", "--out", "x"], "go with urdf"),
        (["tcp:127.0.0.1:1", "--transport", "carrier"], "no transport 'carrier'"),
        (["tcp:127.0.0.1:1", "--name", "a b"], "no name of a node"),
        (["tcp:127.0.0.1:1", "--namespace", "r1"], "no namespace"),
        (["tcp:127.0.0.1:1", "--interface", "a b"], "no network"),
    ],
)
def test_what_cannot_be_is_refused_with_a_hint_before_a_robot_is_looked_for(
    app: typer.Typer, words: list[str], says: str
) -> None:
    with pytest.raises(P2osError, match=says) as caught:
        run(app, *words)
    assert caught.value.exit_code == 2
    assert caught.value.hint


def test_a_router_that_is_not_there_is_told_with_what_to_do(app: typer.Typer, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("zenoh", reason="the extra ros is not installed")
    monkeypatch.setattr("p2os.ros.zenoh_node.CONNECT_MS", 50)
    with pytest.raises(TransportError, match=r"find a router on tcp/127\.0\.0\.1:9") as caught:
        run(app, "tcp:127.0.0.1:1", "--transport", "zenoh", "--interface", "127.0.0.1:9")
    assert "--router" in str(caught.value.hint)


def test_a_urdf_is_printed_or_written_and_not_over_a_file(app: typer.Typer, tmp_path: Path) -> None:
    file = tmp_path / "robot.urdf"
    run(app, "urdf", "p2dx", "--out", str(file), "--namespace", "/r1")
    assert '<link name="r1/base_link">' in file.read_text()
    assert '<link name="base_link">' in run(app, "urdf", "p2dx")
    with pytest.raises(UsageError):
        run(app, "urdf", "p2dx", "--out", str(file))
    run(app, "urdf", "p2at", "--out", str(file), "--force")
    assert '<robot name="p2at"' in file.read_text()
