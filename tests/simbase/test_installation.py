"""The commands that get what is missing."""

import json
import re
import sys
import tomllib
from dataclasses import dataclass
from email.message import Message
from pathlib import Path

import pytest

from simbase import installation
from simbase.command_line.program import report
from simbase.errors import MissingDependencyError
from simbase.installation import (
    doubled_packages,
    install_command,
    missing_distributions,
    reinstall_command,
    way_to_build,
)

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


@dataclass(frozen=True)
class Installed:
    """A distribution, as far as it is looked at."""

    name: str
    requires: list[str]
    version: str = "0.1.0"

    @property
    def metadata(self) -> Message:
        extras = Message()
        for name in dict.fromkeys(re.findall(r'extra == "(\w+)"', " ".join(self.requires))):
            extras["Provides-Extra"] = name
        return extras


@pytest.fixture(autouse=True)
def pip_is_this_pythons(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(installation.shutil, "which", lambda name: str(Path(sys.executable).with_name(name)))
    monkeypatch.setattr(installation, "installed_distributions", lambda: (Installed("p2os", REQUIRES),))


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
    monkeypatch.setattr(installation, "installed_distributions", tuple)
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
    monkeypatch.setattr(installation, "_origin", lambda _name: json.dumps(origin) if origin else None)
    assert reinstall_command() == f"pip install --force-reinstall --no-deps {command}"


def houses(*names: str) -> tuple[Installed, ...]:
    """Return distributions as houses.toml describes them: below, of others, and by an extra what is above."""
    rows = {
        "simbase": ["packaging>=23"],
        "p2os": [
            "simbase==0.1.0", "pyserial>=3.5", 'mcap>=1.1; extra == "export"',
            'bluepill-sim==0.1.0; extra == "emulator"', 'robot-bench==0.1.0; extra == "bench"',
        ],
        "bluepill-sim": ["simbase==0.1.0", "unicorn>=2.1.4"],
    }  # fmt: skip
    return tuple(Installed(name, rows[name]) for name in names)


def test_an_extra_is_looked_for_in_every_distribution(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(installation, "installed_distributions", lambda: houses("bluepill-sim", "p2os", "simbase"))
    assert install_command("export") == "pip install mcap"
    assert install_command() == "pip install unicorn pyserial packaging"


def test_what_no_extra_brings_is_what_the_distributions_always_need(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(installation, "installed_distributions", lambda: houses("bluepill-sim", "simbase"))
    assert install_command("sim") == "pip install unicorn packaging"


def test_a_distribution_that_is_missing_is_reported_by_the_extra_that_brings_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for there, missing in (
        (("p2os", "simbase"), {"bluepill-sim": "emulator", "robot-bench": "bench"}),
        (("bluepill-sim", "p2os", "simbase"), {"robot-bench": "bench"}),
        (("bluepill-sim", "simbase"), {}),
        ((), {}),
    ):
        monkeypatch.setattr(installation, "installed_distributions", lambda names=there: houses(*names))
        installation.installed_version.cache_clear()
        assert missing_distributions() == missing
    installation.installed_version.cache_clear()


def test_a_package_of_two_distributions_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    @dataclass(frozen=True)
    class Point:
        name: str
        dist: Installed | None

    whole, house = Installed("p2os", []), Installed("bluepill-sim", [])
    points = [Point("p2os", whole), Point("bluepill_sim", whole), Point("bluepill_sim", house), Point("x", None)]
    monkeypatch.setattr(
        installation, "every_installed_point", lambda group: points if group == installation.GROUP else []
    )
    assert doubled_packages() == {"bluepill_sim": ["bluepill-sim", "p2os"]}


@pytest.mark.parametrize(
    ("file", "compiler", "reported"),
    [
        ("_part.left_out", "/usr/bin/g++", "pip install --force-reinstall --no-deps -e /src (no C compiler was found)"),
        ("_part.left_out", "", "sudo apt-get install g++ && pip install --force-reinstall --no-deps -e /src (no"),
        ("something.else", "/usr/bin/g++", "(nothing was built in this folder)"),
    ],
)
def test_a_part_that_was_not_compiled_says_why(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, file: str, compiler: str, reported: str
) -> None:
    (tmp_path / "package").mkdir()
    (tmp_path / "package" / "__init__.py").touch()
    (tmp_path / "package" / file).write_text("no C compiler was found\n", encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(installation, "_origin", lambda _: '{"url": "file:///src", "dir_info": {"editable": true}}')
    assert reported in way_to_build("package._part", compiler)
    sys.modules.pop("package")


def test_an_error_that_names_an_extra_hints_at_its_packages(capsys: pytest.CaptureFixture[str]) -> None:
    for error, hint in (
        (MissingDependencyError("no", extra="sim", hint="export to .csv"), "unicorn pyelftools, or export to .csv"),
        (MissingDependencyError("no", extra="sim"), "unicorn pyelftools"),
    ):
        assert report("p2os", error) == 2
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
    reported = re.compile(r"""pip install (?:-\w+ )?["']?p2os\b""")
    assert [str(path) for path in places if reported.search(path.read_text(encoding="utf-8"))] == []
