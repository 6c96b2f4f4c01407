"""NOTICE: every package that an extra brings, with its licence."""

import re
import tomllib
from importlib.metadata import Distribution, distributions
from pathlib import Path

from packaging.requirements import Requirement

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
CONSTRAINTS = ROOT / "constraints.txt"


def normal(name: str) -> str:
    """Return a package's name as indexes compare it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def licences() -> dict[str, tuple[str, set[str]]]:
    """Return the tables of NOTICE: a package's licence, and the extras or the package that bring it."""
    rows = [re.split(r" {2,}", line) for line in (ROOT / "NOTICE").read_text(encoding="utf-8").splitlines()]
    return {normal(row[0]): (row[1], set(row[2].split(", "))) for row in rows if len(row) == 3 and row[0] != "package"}


def required() -> dict[str, set[str]]:
    """Return what pyproject.toml requires, with the extras that name it."""
    lists = {"every use": PROJECT["project"]["dependencies"], "build": PROJECT["build-system"]["requires"]}
    lists |= {name: lines for name, lines in PROJECT["project"]["optional-dependencies"].items() if name != "all"}
    found: dict[str, set[str]] = {}
    for extra, lines in lists.items():
        for line in lines:
            found.setdefault(normal(Requirement(line).name), set()).add(extra)
    return found


def test_notice_names_every_package_that_an_extra_brings() -> None:
    named = {name: extras for name, (_, extras) in licences().items()}
    assert {name: extras for name, extras in named.items() if name in required()} == required()
    pinned = {normal(line.split("==")[0]) for line in CONSTRAINTS.read_text(encoding="utf-8").splitlines()[1:]}
    assert named.keys() == pinned | required().keys()
    assert {next(iter(named[name])) for name in named.keys() - required().keys()} <= required().keys()


def test_notice_names_what_those_packages_bring_in_their_turn() -> None:
    brought = {normal(requirement.name)
               for one in distributions() if normal(one.name) in licences()
               for requirement in map(Requirement, one.requires or ())
               if not requirement.marker or requirement.marker.evaluate({"extra": ""})}  # fmt: skip
    assert sorted(brought - licences().keys()) == []


def test_notice_says_what_a_package_says_of_its_licence() -> None:
    reported = {normal(one.name): stated_licence(one) for one in distributions()}
    assert "bsd" in reported.pop("unicorn", "bsd"), "its metadata tells of the binding; the engine is GPL-2.0"
    named = {name: words(licence) for name, (licence, _) in licences().items() if reported.get(name)}
    assert [
        (name, reported[name]) for name, every in named.items() if any(word not in reported[name] for word in every)
    ] == []


def stated_licence(package: Distribution) -> str:
    """Return what a package's metadata says of its licence, in small letters; "" where it says nothing."""
    classes = [line for line in package.metadata.get_all("Classifier") or () if line.startswith("License")]
    fields = [package.metadata.get(field, "")[:300] for field in ("License-Expression", "License")]
    return " ".join([*fields, *classes]).strip().lower()


def words(licence: str) -> list[str]:
    """Return the words of a licence in NOTICE that metadata has too, however it writes the version."""
    return [re.sub(r"-[\d.]+(-clause)?$", "", word) for word in licence.lower().split(" or ")]
