"""The commands that get what is missing."""

import importlib.metadata
import json
import re
import sys
import tomllib
from pathlib import Path

import pytest

from p2os.cli.main import report
from simbase import installation
from simbase.errors import MissingDependencyError
from simbase.installation import install_command, reinstall_command

ROOT = Path(__file__).resolve().parents[2]
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
REQUIRES = [
    "pyserial>=3.5",
    'unicorn>=2.1.4; extra == "sim"',
    'pyelftools>=0.31; extra == "sim"',
    'pybullet>=3.2.7; python_version < "3.12" and extra == "bullet"',
    'numpy>=1.26; extra == "bullet"',
    'p2os[bullet,sim]; extra == "all"',
]


@pytest.fixture(autouse=True)
def pip_is_this_pythons(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(installation.shutil, "which", lambda name: str(Path(sys.executable).with_name(name)))
    monkeypatch.setattr(installation, "requires", lambda _name: REQUIRES)


@pytest.mark.parametrize(
    ("extra", "python", "command"),
    [
        ("", "", "pip install pyserial"),
        ("sim", "", "pip install unicorn pyelftools"),
        ("bullet", "3.11", "pip install pybullet numpy"),
        ("bullet", "3.13", 'pybullet needs python_version < "3.12"'),
    ],
)
def test_the_packages_of_an_extra_are_named_for_p2os_is_on_no_index(extra: str, python: str, command: str) -> None:
    assert install_command(extra, python=python) == command


def test_a_pip_of_another_python_is_not_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(installation.shutil, "which", lambda _name: "/elsewhere/bin/pip")
    monkeypatch.setattr(sys, "executable", str(tmp_path / ".venv/bin/python"))
    assert install_command("sim") == f"{tmp_path}/.venv/bin/python -m pip install unicorn pyelftools"
    monkeypatch.chdir(tmp_path)
    assert install_command("sim") == ".venv/bin/python -m pip install unicorn pyelftools"


def test_a_checkout_that_was_never_installed_is_named_by_its_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    def nothing(name: str) -> list[str]:
        raise importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(installation, "requires", nothing)
    assert install_command("sim") == f"pip install -e '{ROOT}[sim]'"
    assert install_command() == f"pip install -e {ROOT}"


def test_what_reads_requirements_is_asked_for_first(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "packaging.requirements", None)
    assert install_command("sim") == "pip install packaging"


@pytest.mark.parametrize(
    ("origin", "command"),
    [
        ({"url": "file:///src/p%202os", "dir_info": {"editable": True}}, "-e '/src/p 2os'"),
        ({"url": "file:///src/p2os", "dir_info": {}}, "/src/p2os"),
        ({"url": "file:///x/p2os-0.1.0-cp311-linux.whl", "archive_info": {}}, "FOLDER_OF_P2OS"),
        (None, "FOLDER_OF_P2OS"),
    ],
)
def test_what_was_built_is_built_again_from_where_it_came(
    monkeypatch: pytest.MonkeyPatch, origin: object, command: str
) -> None:
    monkeypatch.setattr(installation, "_origin", lambda: json.dumps(origin) if origin else None)
    assert reinstall_command() == f"pip install --force-reinstall --no-deps {command}"


def test_an_error_that_names_an_extra_hints_at_its_packages(capsys: pytest.CaptureFixture[str]) -> None:
    for error, hint in (
        (MissingDependencyError("no", extra="sim", hint="export to .csv"), "unicorn pyelftools, or export to .csv"),
        (MissingDependencyError("no", extra="sim"), "unicorn pyelftools"),
    ):
        assert report(error) == 2
        assert capsys.readouterr().err == f"p2os: no\nhint: pip install {hint}\n"


def test_every_extra_that_the_code_names_exists() -> None:
    named = set()
    for package in ("p2os", "bluepill_sim", "robot_bench"):
        for path in (ROOT / package).rglob("*.py"):
            named |= set(re.findall(r'(?:extra=|install_command\()"(\w+)"', path.read_text(encoding="utf-8")))
    assert {"sim", "columns", "export"} <= named <= set(EXTRAS)


def test_no_page_or_hint_names_an_index_that_has_no_p2os() -> None:
    places = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]
    for package in ("p2os", "bluepill_sim", "robot_bench", "hardware"):
        places += (ROOT / package).rglob("*.py")
    told = re.compile(r"""pip install (?:-\w+ )?["']?p2os\b""")
    assert [str(path) for path in places if told.search(path.read_text(encoding="utf-8"))] == []
