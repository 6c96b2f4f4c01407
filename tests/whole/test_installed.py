"""An install older than pyproject.toml is told, and a plug-in of somebody else is not found by the tests."""

from importlib.metadata import Distribution, distributions
from pathlib import Path

import pytest

from simbase import entry_points
from tests.tools.installed import hide, plug_ins_of_others, stale_points

PROJECT = '[project]\nname = "chk-whole"\n[project.entry-points."p2os.verbs"]\nhello = "a.b"\nscan = "a.scan"\n'


def install(site: Path, name: str, points: str, url: str = "") -> None:
    """Make a distribution in a folder for packages; of a URL an editable one."""
    folder = site / f"{name.replace('-', '_')}-1.dist-info"
    folder.mkdir(parents=True)
    (folder / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1\n")
    (folder / "entry_points.txt").write_text(points)
    if url:
        (folder / "direct_url.json").write_text(f'{{"url": "{url}", "dir_info": {{"editable": true}}}}')


@pytest.mark.parametrize(
    ("points", "stale"),
    [
        ("[console_scripts]\nx = a:b\n[p2os.verbs]\nhello = a.b\nscan = a.scan\n", []),
        ("[p2os.verbs]\nscan = a.scan\n", ["hello (p2os.verbs)"]),
        ("[p2os.verbs]\nhello = a.other\nscan = a.scan\n", ["hello (p2os.verbs)"]),
        ("[p2os.verbs]\nhello = a.b\nscan = a.scan\ngone = a.gone\n", ["gone (p2os.verbs)"]),
    ],
)
def test_what_pyproject_declares_and_the_install_does_not_know_is_told(
    points: str, stale: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    root = tmp_path / "a checkout"
    root.mkdir()
    (root / "pyproject.toml").write_text(PROJECT)
    assert stale_points(root) == []
    install(tmp_path / "site", "chk-whole", points, root.as_uri())
    monkeypatch.syspath_prepend(str(tmp_path / "site"))
    monkeypatch.setattr(Distribution, "entry_points", ())  # as a run of one house hides those of others
    assert stale_points(root) == stale
    other = tmp_path / "other"
    other.mkdir()
    (other / "pyproject.toml").write_text(PROJECT)
    assert stale_points(other) == []


def test_a_plug_in_of_somebody_else_is_hidden_and_one_that_comes_later_is_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(tmp_path / "one", "chk-theirs", "[robot_bench.goals]\nchk_theirs = json:loads\n")
    install(tmp_path / "one", "chk-ours", "[simbase.packages]\nx = json:loads\n[p2os.verbs]\nchk_ours = json:loads\n")
    install(tmp_path / "one", "chk-nobody", "[other.group]\nx = json:loads\n")
    monkeypatch.syspath_prepend(str(tmp_path / "one"))
    hidden = plug_ins_of_others()
    assert {name for name, _ in hidden if name.startswith("chk-")} == {"chk-theirs"}
    monkeypatch.setattr(entry_points, "distributions", distributions)
    found = [one.name for one in entry_points.distributions() if one.name.startswith("chk-")]
    assert sorted(found) == ["chk-nobody", "chk-ours", "chk-theirs"]
    hide(hidden)
    install(tmp_path / "two", "chk-theirs", "[robot_bench.goals]\nchk_theirs = json:loads\n")
    monkeypatch.syspath_prepend(str(tmp_path / "two"))
    places = [str(one.locate_file("")) for one in entry_points.distributions() if one.name == "chk-theirs"]
    assert places == [str(tmp_path / "two")]
