"""The version stands in one place, and what repeats it for people says the same."""

import re
import tomllib
from pathlib import Path

import pytest

from p2os.capture.formats.recording import RECORDING
from p2os.pioneer.world.file import WORLD
from robot_bench.campaign.campaign_file import CAMPAIGN
from robot_bench.events.codec import TRACE
from robot_bench.scenario.included_files import SCENARIO

yaml = pytest.importorskip("yaml")

ROOT = Path(__file__).resolve().parents[3]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
#: Keys of the Citation File Format 1.2.0: required ones, and others that may stand at the top.
REQUIRED = {"cff-version", "message", "title", "authors"}
MAY = {
    "abstract", "commit", "contact", "date-released", "doi", "identifiers", "keywords", "license", "license-url",
    "preferred-citation", "references", "repository", "repository-artifact", "repository-code", "type", "url",
    "version",
}  # fmt: skip
#: Of which each author is one kind.
ENTITY, PERSON = {"name"}, {"given-names", "family-names", "name-particle", "name-suffix", "orcid", "affiliation"}


def test_the_citation_has_the_keys_of_its_format_and_the_projects_version() -> None:
    found = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert REQUIRED <= found.keys() <= REQUIRED | MAY
    assert found["cff-version"] == "1.2.0"
    assert found["type"] in {"software", "dataset"}
    assert all(set(author) <= ENTITY or set(author) <= PERSON for author in found["authors"])
    assert found["authors"]
    assert str(found["version"]) == PROJECT["version"]
    assert found["license"] == PROJECT["license"]


def test_the_changelog_begins_with_the_version_and_dates_those_before() -> None:
    titles = re.findall(r"^## (.*)$", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    first, *rest = (re.fullmatch(r"(\d+\.\d+\.\d+) \((unreleased|\d{4}-\d\d-\d\d)\)", title) for title in titles)
    assert first is not None, titles[0]
    assert first[1] == PROJECT["version"]
    assert all(one is not None and one[2] != "unreleased" for one in rest)


def test_the_page_has_the_versions_of_formats() -> None:
    rows = re.findall(
        r"^\| (\w+)[^|]* \| (\d+) \|.*\| ([\d, ]+) \|$", (ROOT / "docs/releases.md").read_text("utf-8"), re.MULTILINE
    )
    found = {name: (int(newest), [int(one) for one in read.split(", ")]) for name, newest, read in rows}
    formats = {"scenario": SCENARIO, "world": WORLD, "campaign": CAMPAIGN, "trace": TRACE, "capture": RECORDING}
    assert found == {name: (one.newest, list(range(1, one.newest + 1))) for name, one in formats.items()}
