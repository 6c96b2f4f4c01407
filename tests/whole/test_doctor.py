"""`p2os doctor` where all houses are: nothing that an extra brings is left out."""

import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from p2os.cli.main import run
from simbase.installation import installed_needs

ROOT = Path(__file__).resolve().parents[2]


def test_doctor_lists_the_packages_of_every_extra() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    users = Requirement(*extras["all"]).extras
    wanted = {(Requirement(line).name, extra) for extra in users for line in extras[extra]} | {
        (Requirement(line).name, "") for line in project["dependencies"]
    }
    listed = {need.name for need in installed_needs() if need.kind == "package"}
    assert listed == {name for name, _ in wanted}
    assert {(need.name, need.extra) for need in installed_needs() if need.kind == "package"} <= wanted


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["mcu", "run", "x.elf", "--for", "5"], "p2os: --for '5' has no unit"),
        (["board", "--frob"], "p2os: No such option: --frob"),
    ],
)
def test_a_verb_of_another_house_is_refused_as_one_of_the_toolkit(
    words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(words) == 2
    reported, hint = capsys.readouterr().err.splitlines()
    assert reported.startswith(said)
    assert hint == f"hint: p2os {' '.join(word for word in words[:2] if word.isalpha())} --help"


@pytest.mark.parametrize("verb", ["board", "mcu"])
def test_a_verb_without_the_next_word_shows_what_there_is(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run([verb]) == 0
    reported = capsys.readouterr()
    assert reported.out.startswith(f"Usage: p2os {verb} [OPTIONS] COMMAND")
    assert not reported.err
