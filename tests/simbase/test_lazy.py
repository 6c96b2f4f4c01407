"""What a package offers besides its names: its version, and names that are on their way out."""

import sys
import tomllib
import types
import warnings
from importlib import import_module
from importlib.metadata import PackageNotFoundError
from pathlib import Path

import pytest

from simbase.installation import package_version
from simbase.lazy import DeprecatedName, lazily

PROJECT = tomllib.loads((Path(__file__).resolve().parents[2] / "pyproject.toml").read_text(encoding="utf-8"))["project"]


@pytest.fixture
def package(monkeypatch: pytest.MonkeyPatch) -> types.ModuleType:
    """A package with a name of today and one of yesterday."""
    made = types.ModuleType("toolbox")
    old = {"OldReason": DeprecatedName(home="simbase.timing:Reason", use="toolbox.Reason", gone_in="0.3")}
    made.__getattr__, made.__dir__ = lazily("toolbox", {"simbase.timing": ("Reason",)}, old)  # type: ignore[method-assign]
    monkeypatch.setitem(sys.modules, "toolbox", made)
    return made


def test_a_deprecated_name_works_and_warns_each_who_uses_it_at_his_own_line(package: types.ModuleType) -> None:
    said = "toolbox.OldReason is deprecated, and gone in 0.3: use toolbox.Reason"
    for _ in range(2):
        with pytest.warns(DeprecationWarning, match=f"^{said}$") as seen:
            assert package.OldReason is import_module("simbase.timing").Reason
        assert [Path(one.filename).name for one in seen] == [Path(__file__).name]
    with pytest.warns(DeprecationWarning, match=said):
        from toolbox import OldReason  # type: ignore[import-not-found]  # noqa: F401


def test_a_name_of_today_does_not_warn_and_only_that_is_offered(package: types.ModuleType) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert package.Reason is import_module("simbase.timing").Reason
    assert "Reason" in dir(package)
    assert "OldReason" not in dir(package)


@pytest.mark.parametrize("name", sorted(PROJECT["entry-points"]["simbase.packages"]))
def test_each_package_that_is_installed_has_the_version_of_the_project(name: str) -> None:
    try:
        there = package_version(name)
    except PackageNotFoundError:
        pytest.skip(f"{name} is not installed here")
    assert import_module(name).__version__ == there == PROJECT["version"]
    assert "__version__" in dir(import_module(name))


def test_a_package_of_others_has_no_version_here(package: types.ModuleType) -> None:
    with pytest.raises(PackageNotFoundError, match="toolbox"):
        _ = package.__version__
