"""A campaign's page, served: a failing point is run again, its hash compared, and shown; what cannot be is said."""

import contextlib
import json
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from p2os.view.header import PageHeader, PagePlan, PageSection
from p2os.view.live import ShownSource
from p2os.view.page import document, header_in
from p2os.view.run_control import RunCommand, RunState
from robot_bench.campaign import journal
from robot_bench.cli.campaigns import campaign_page
from robot_bench.cli.campaigns.campaign_page import MOST_OPENED, CampaignPage
from robot_bench.cli.campaigns.viewed_campaign import JOURNAL, campaign_target
from robot_bench.report.make import Files
from robot_bench.run import run_scenario
from robot_bench.scenario.loading import load_scenario
from simbase.errors import FileError

POINT = 'extends = "motors"\nmode = "direct"\nbody = "kinematic"\nduration_s = 0.05\n'
CODED = f'{POINT}[[part]]\nkind = "mine.py:Part"\n'
PLAN = PagePlan(title="point 6", listing="p2os run x", opens=6)
HEADER = PageHeader(title="blind </script><b>", sections=(PageSection(title="Failures", blocks=(PLAN,)),))


@pytest.fixture(scope="module")
def sha256(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Return the hash of the point's run."""
    folder = tmp_path_factory.mktemp("point")
    (folder / "tiny.toml").write_text(POINT, encoding="utf-8")
    done = run_scenario(load_scenario(str(folder / "tiny.toml")), folder / "run", files=Files.SUMMARY)
    return str(done.outcome["trace_sha256"])


@pytest.fixture
def folder(tmp_path: Path, sha256: str, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a campaign with point 6, which is as it was, point 7, which is not, 8 with code of its own, and 9."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(campaign_page, "served", served)
    made = tmp_path / "blind"
    for number, text in ((6, POINT), (7, POINT), (8, CODED)):
        kept = made / "failures" / f"{number:04d}"
        kept.mkdir(parents=True)
        (kept / "tiny.toml").write_text(text, encoding="utf-8")
    (made / "journal.jsonl").touch()
    (made / "report.html").write_text(document(HEADER), encoding="utf-8")
    hashes = {6: sha256, 7: "0" * 64, 8: sha256, 9: sha256}
    failures = [
        {"number": number, "trace_sha256": one, "replay": f"p2os run '../{number} x/tiny.toml' --trust"}
        for number, one in hashes.items()
    ]
    (made / "summary.json").write_text(json.dumps({"failures": failures}), encoding="utf-8")
    return made


@contextlib.contextmanager
def served(source: ShownSource, host: str, port: int) -> Iterator[SimpleNamespace]:
    assert (host, port) == ("127.0.0.1", 0)
    yield SimpleNamespace(url=f"http://127.0.0.1:1/#token={len(source.recording.tracks) > 0}")


def control_of(folder: Path) -> CampaignPage:
    target = campaign_target(str(folder))
    assert target is not None
    assert target.source.recording.header == HEADER
    assert isinstance(target.source.control, CampaignPage)
    return target.source.control


def opened(control: CampaignPage, number: int) -> RunState:
    assert control.offer(RunCommand(do="open", number=number))
    control.turn()
    return control.state


def test_a_point_is_run_again_once_and_its_hash_compared(folder: Path) -> None:
    control = control_of(folder)
    for _ in range(2):
        (same,) = opened(control, 6).opened
        assert same.words == "the same hash; in runs/tiny-001"
    assert same.url.endswith("#token=True")
    assert control.state.done == 2
    *_, other = opened(control, 7).opened
    assert other.words.startswith("ANOTHER hash: ")
    assert other.words.endswith(", in the campaign 00000000; in runs/tiny-002")
    assert other.url


def test_code_that_nobody_trusted_does_not_run_and_what_cannot_be_opened_is_said(folder: Path) -> None:
    control = control_of(folder)
    (folder / "failures/0008/mine.py").write_text("raise SystemExit(3)\n", encoding="utf-8")
    for number, word in ((8, "trust"), (9, "tiny.toml"), (5, "no failure of this campaign")):
        found = opened(control, number).opened[-1]
        assert (found.number, found.url) == (number, "")
        assert word in found.words
    assert not Path("runs").exists()
    assert control.offer(RunCommand(do="run"))
    control.turn()
    assert control.state.done == 3, "it knows nothing else"


def test_no_more_runs_are_served_than_there_may_be(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    control = control_of(folder)
    monkeypatch.setattr(campaign_page, "MOST_OPENED", 1)
    assert MOST_OPENED > 1
    assert opened(control, 6).opened[-1].url
    assert opened(control, 7).opened[-1].words.startswith("1 runs are open")


def test_a_campaign_without_a_report_or_with_a_damaged_one_says_what_to_do(folder: Path) -> None:
    assert header_in(document(HEADER)) == HEADER
    assert journal.NAME == JOURNAL
    (folder / "summary.json").write_text("{}", encoding="utf-8")
    with pytest.raises(FileError, match="damaged report"):
        campaign_target(str(folder))
    (folder / "report.html").unlink()
    with pytest.raises(FileError, match="no report yet"):
        campaign_target(str(folder))
    (folder / "journal.jsonl").unlink()
    assert campaign_target(str(folder)) is None
