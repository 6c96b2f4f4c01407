"""`p2os campaign` as one types it: the file that it writes, exit codes, and what is wrong in a line."""

import hashlib
import json
from importlib.resources import files
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from robot_bench.campaign.campaign_file import load_campaign
from robot_bench.cli.campaigns import campaign
from simbase.errors import P2osError, UsageError

FILE = """
scenario = "dodge"
search = "random"
batch = 2
[budget]
runs = 2
[cheap]
mode = "direct"
duration_s = 1
[full]
body = "kinematic"
duration_s = 1
[vary]
start.heading_deg = { from = 0, to = 350, step = 10 }
[[goal]]
kind = "GOAL"
"""

SCENARIO = """
firmware = "build/my robot.elf"
world = "room"
duration_s = 2
threshold_m = 0.6
[[goal]]
kind = "no_collision"
"""


@pytest.fixture
def app() -> typer.Typer:
    found = typer.Typer()
    found.callback()(lambda: None)
    campaign.register(found)
    return found


@pytest.fixture(autouse=True)
def in_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def run(app: typer.Typer, *words: str) -> tuple[int, str]:
    result = CliRunner().invoke(app, ["campaign", *words])
    if isinstance(result.exception, P2osError):
        raise result.exception
    return result.exit_code, result.stdout


def written(goal: str) -> Path:
    Path("mine.toml").write_text(FILE.replace("GOAL", goal))
    return Path("mine.toml")


@pytest.mark.parametrize("scenario", ["dodge", "rover", "two-dodge"])
def test_the_file_that_new_writes_is_a_campaign_for_every_scenario(app: typer.Typer, scenario: str) -> None:
    code, said = run(app, "new", scenario)
    assert (code, said.splitlines()[-1]) == (0, f"next: p2os campaign {scenario}-campaign.toml")
    written = load_campaign(Path(f"{scenario}-campaign.toml"))
    assert written.draws or written.vary
    with pytest.raises(UsageError, match="is there already"):
        run(app, "new", scenario)


@pytest.mark.parametrize("out", ["c.toml", "sub/c.toml"])
@pytest.mark.parametrize("is_absolute", [False, True])
def test_the_file_that_new_writes_names_program_scenario_and_whatever_else_was_given(
    app: typer.Typer, out: str, is_absolute: bool
) -> None:
    Path("sub").mkdir()
    Path("build").mkdir()
    program, folder = Path("build/my robot.elf"), Path.cwd() if is_absolute else Path()
    program.write_bytes(Path(str(files("robot_bench.firmware").joinpath("motors.elf"))).read_bytes())
    Path("mine.toml").write_text(SCENARIO)
    words = ["--firmware", str(folder / program), "--out", out, "--runs", "7", "--seed", "5", "--search", "random"]
    code, said = run(app, "new", str(folder / "mine.toml"), *words)
    assert (code, said.splitlines()[-1]) == (0, f"next: p2os campaign {out}"), "nothing is left to be given again"
    written = load_campaign(Path(out))
    assert [*written.trial.programs] == ["my robot.elf"]
    assert written.trial.files["my robot.elf"] == program.read_bytes()
    assert (written.budget.runs, written.seed, written.search) == (7, 5, "random")


@pytest.mark.parametrize(
    "words",
    [["-j", "2"], ["--against", "x.elf"], ["--resume", "x"], ["--dask", "local"], ["--scheduler", "x"], ["--json"]],
)
def test_what_no_campaign_file_holds_is_refused_beside_new(app: typer.Typer, words: list[str]) -> None:
    with pytest.raises(UsageError, match="cannot stand beside new"):
        run(app, "new", "dodge", *words)
    assert not Path("dodge-campaign.toml").exists()


@pytest.mark.slow
def test_what_fails_ends_with_1_and_the_command_that_runs_it_again(app: typer.Typer) -> None:
    code, said = run(app, str(written('usart_contains"\ntext = "never printed')), "-j", "1", "--out", "kept")
    assert code == 1
    assert "p2os run kept/failures/0001/dodge.toml" in said
    assert said.splitlines()[-1].startswith("2 confirmed of 2 points, 6 runs, ")
    program = Path(str(files("robot_bench.firmware").joinpath("dodge.elf"))).read_bytes()
    sha256 = hashlib.sha256(program).hexdigest()
    assert f"firmware dodge.elf, sha256 {sha256[:16]}" in said.splitlines()
    assert f"dodge.elf ({sha256[:16]})" in Path("kept/report.html").read_text(encoding="utf-8")
    code, again = run(app, "--resume", "kept", "--json")
    assert (code, json.loads(again)["findings"]["confirmed"]) == (1, 2)
    assert json.loads(again)["firmware"] == [{"name": "dodge.elf", "sha256": sha256}]


def test_what_passes_ends_with_0(app: typer.Typer) -> None:
    code, said = run(app, str(written("no_collision")), "--runs", "1")
    assert (code, said.splitlines()[-2]) == (0, "report  campaigns/mine-001/report.html")


DISTURBED = """
[[disturb]]
fault = "sonar-stuck {sonar} 0.3"
at_s = 0.5
"""


@pytest.mark.parametrize(
    ("sonar", "says"), [("", "'{sonar}' is no number"), ("{ from = 1, to = 9 }", "'9' is no number")]
)
def test_a_fault_that_cannot_be_is_refused_before_anything_runs(app: typer.Typer, sonar: str, says: str) -> None:
    text = FILE.replace("GOAL", "no_collision").replace('mode = "direct"', 'body = "kinematic"') + DISTURBED
    Path("mine.toml").write_text(f"{text}sonar = {sonar}\n" if sonar else text)
    with pytest.raises(P2osError, match=rf"^mine.toml:\d+: \[\[disturb\]\] 1: .*{says}"):
        run(app, "mine.toml")
    Path("mine.toml").write_text(f"{text}sonar = {{ from = 1, to = 8 }}\n")
    assert load_campaign(Path("mine.toml")).disturbances


def test_points_without_any_verdict_end_with_1_and_each_reason_is_reported_once(app: typer.Typer) -> None:
    path = written("no_collision")
    path.write_text(path.read_text().replace("[cheap]", "[limits]\nmemory_mb = 64\n[cheap]"))
    code, said = run(app, "mine.toml", "-j", "1")
    assert code == 1
    assert said.count("its process ended") == 1
    assert said.splitlines()[0].startswith("error  points 1, 2: ")
    assert said.splitlines()[-1].startswith("2 error of 2 points")


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ([], "which campaign?"),
        (["new"], "a campaign for which scenario?"),
        (["mine.toml", "--search", "sobl"], "there is no search 'sobl'"),
        (["mine.toml", "--dask", "cloud"], "there is no --dask 'cloud'"),
        (["mine.toml", "--dask", "local", "--scheduler", "tcp://x"], "cannot stand together"),
        (["mine.toml", "--resume", "kept"], "--resume goes on with what was begun"),
        (["--resume", "nowhere"], "nowhere is no campaign's folder"),
        (["nothing.toml"], "cannot read nothing.toml"),
    ],
)
def test_a_line_that_is_wrong_is_refused(app: typer.Typer, words: list[str], says: str) -> None:
    written("no_collision")
    with pytest.raises(P2osError, match=says):
        run(app, *words)


def test_the_schema_is_json(app: typer.Typer) -> None:
    assert json.loads(run(app, "--schema")[1])["title"] == "A campaign of p2os"
