"""The public face of each package: a flat, short `__all__`, fetched on first use, and documented page by page."""

import ast
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from tests.test_architecture import PACKAGES

ROOT = Path(__file__).resolve().parents[2]
#: chosen: what a reader of `help(package)` still looks through.
MOST_PUBLIC = 20
#: What a program that only names a package must not have loaded.
HEAVY = (
    "construct", "serial", "typer", "rich", "numpy", "unicorn", "elftools", "pybullet", "mujoco", "matplotlib",
    "pyarrow", "asyncio", "socket", "importlib.metadata", "packaging",
)  # fmt: skip


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_offers_a_short_sorted_list_of_names_and_each_is_there(package: str) -> None:
    module = import_module(package)
    assert 0 < len(module.__all__) <= MOST_PUBLIC
    assert set(module.__all__) <= set(dir(module))
    assert all(getattr(module, name) is not None for name in module.__all__)


@pytest.mark.parametrize("package", PACKAGES)
def test_what_tools_read_of_a_package_is_what_a_program_gets(package: str) -> None:
    tree = ast.parse((ROOT / package / "__init__.py").read_text(encoding="utf-8"))
    read = {
        alias.name: f"{node.module}"
        for branch in tree.body if isinstance(branch, ast.If)
        for node in branch.body if isinstance(node, ast.ImportFrom) for alias in node.names
    }  # fmt: skip
    module = import_module(package)
    assert sorted(read) == sorted(module.__all__)
    assert {name: getattr(import_module(home), name) is getattr(module, name) for name, home in read.items()} == (
        dict.fromkeys(read, True)
    )


@pytest.mark.parametrize("package", PACKAGES)
def test_importing_a_package_loads_nothing_heavy(package: str) -> None:
    code = f"import sys, {package}; print(*sorted({set(HEAVY)} & sys.modules.keys()))"
    done = subprocess.run([sys.executable, "-S", "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_a_name_that_a_package_has_not_is_reported_as_python_tells_it() -> None:
    with pytest.raises(AttributeError, match="module 'p2os' has no attribute 'Robbot'"):
        _ = import_module("p2os").Robbot


@pytest.fixture
def api() -> Any:
    pytest.importorskip("pdoc", reason="pdoc comes with the extra dev")
    return import_module("tools.website.api")


@pytest.mark.slow
def test_the_pages_of_the_api_are_made_without_a_warning_and_every_public_name_is_documented(api: Any) -> None:
    made, wrong = api.pages()
    assert wrong == []
    page = made["reference/api/robot_bench.md"]
    assert all(f"#Bench.{name} }}" in page for name in ("from_scenario", "run_until", "pose", "level", "text", "judge"))
    assert {f"reference/api/{package}.md" for package in PACKAGES} <= made.keys()


def test_public_names_without_a_docstring_are_reported(
    api: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = '"""A module."""\nclass Told:\n    """It is."""\n    def bare(self): ...\ndef told(): ...\n'
    (tmp_path / "face_to_look_at.py").write_text(source, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    assert api.pages(("face_to_look_at",))[1] == [
        "face_to_look_at.Told.bare has no docstring", "face_to_look_at.told has no docstring",
    ]  # fmt: skip
