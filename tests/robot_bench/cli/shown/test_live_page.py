"""A run that is looked at: the same trace whoever looks, and the rows that its trace has."""

import re
import threading
import webbrowser
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from types import SimpleNamespace

import pytest

pytest.importorskip("uvicorn")
websockets = pytest.importorskip("websockets.sync.client")

from p2os.cli.captures.shown_page import shown  # noqa: E402
from p2os.cli.main import run as p2os  # noqa: E402
from p2os.cli.robots.command_queue import MOST_COMMANDS  # noqa: E402
from p2os.view import targets as view_targets  # noqa: E402
from p2os.view.header import PageHeader  # noqa: E402
from p2os.view.live import MOST_WAITING, StillRecording  # noqa: E402
from p2os.view.recording import ViewRecording  # noqa: E402
from p2os.view.run_control import RunCommand  # noqa: E402
from p2os.view.server.serving import ViewServer, serving  # noqa: E402
from robot_bench.cli.shown.live_run import LiveRun  # noqa: E402
from robot_bench.cli.shown.targets import run_target, scenario_target  # noqa: E402
from robot_bench.recording.run_record import read_run  # noqa: E402
from robot_bench.report.run_page import run_report  # noqa: E402
from robot_bench.run import run_scenario  # noqa: E402
from robot_bench.scenario.loading import load_scenario  # noqa: E402
from robot_bench.view.run_recording import recording_of  # noqa: E402
from simbase.errors import MissingDependencyError  # noqa: E402

SCENARIO = load_scenario("motors").with_options(body="kinematic", duration_s=2.5)


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a run at which nobody looks."""
    return run_scenario(SCENARIO, tmp_path_factory.mktemp("alone") / "run").folder


def hash_of(folder: Path) -> object:
    return read_run(folder).end["trace_sha256"]


def rows_of(found: ViewRecording) -> dict[str, str]:
    """Return the rows of each channel, but for those that the end of a trace alone tells; NaN is as NaN."""
    return {f"{track.kind.name} {track.header.name}": repr(track.columns)
            for track in found.tracks if track.kind.name != "goal"}  # fmt: skip


@contextmanager
def page(server: ViewServer, *, reads: bool) -> Iterator[None]:
    """A page that asks for all and reads what it is sent, or nothing of it."""
    token = server.url.partition("#")[2].replace("=", ".")
    with websockets.connect(
        f"ws://127.0.0.1:{server.port}/stream", subprotocols=["p2os.view.1", token], max_size=None, proxy=None
    ) as link:
        link.send(f'{{"want": {list(range(20))}, "to_ns": 99999999999, "id": 1}}')
        reader = threading.Thread(target=lambda: [0 for _ in link], daemon=True)
        if reads:
            reader.start()
        yield


def test_a_live_run_has_the_rows_of_its_trace(alone: Path, tmp_path: Path) -> None:
    live = LiveRun(SCENARIO)
    folder = run_scenario(SCENARIO, tmp_path / "run", drive=live.drive).folder
    assert hash_of(folder) == hash_of(alone)
    live.source.update()
    assert rows_of(live.source.recording) == rows_of(recording_of(read_run(alone)))
    assert live.source.recording.header.is_live is False
    report = run_report(read_run(folder)).header
    assert live.source.recording.header.lead == report.lead != ""
    live.source.end(report)
    live.source.update()
    header = live.source.recording.header
    assert (header.verdict, header.sections, header.is_live) == (report.verdict, report.sections, False)


@pytest.mark.slow
@pytest.mark.parametrize("pages", [
    pytest.param([], marks=pytest.mark.soak, id="none"), pytest.param([True], marks=pytest.mark.soak, id="one"),
    pytest.param([True, True, True], marks=pytest.mark.soak, id="three"),
    pytest.param([False], marks=pytest.mark.soak, id="a stalled one"),
    pytest.param([True, False], id="one and a stalled one"),
])  # fmt: skip
def test_the_trace_is_the_same_whoever_looks(pages: list[bool], alone: Path, tmp_path: Path) -> None:
    live = LiveRun(SCENARIO)
    with serving(live.source) as server, ExitStack() as opened:
        for reads in pages:
            opened.enter_context(page(server, reads=reads))
        folder = run_scenario(SCENARIO, tmp_path / "run", drive=live.drive).folder
    assert hash_of(folder) == hash_of(alone)


def test_a_viewer_that_takes_nothing_costs_a_bounded_memory_and_no_event_of_the_trace(
    alone: Path, tmp_path: Path
) -> None:
    live = LiveRun(SCENARIO)
    live.source._most = 10
    folder = run_scenario(SCENARIO, tmp_path / "run", drive=live.drive).folder
    assert hash_of(folder) == hash_of(alone)
    assert len(live.source._waiting) == 10 < MOST_WAITING
    live.source.update()
    assert "the program was faster than this page" in live.source.recording.header.left_out[0]


def test_what_a_page_asks_for_is_done_while_it_runs_and_a_fork_has_rows_of_its_own(alone: Path, tmp_path: Path) -> None:
    live = LiveRun(SCENARIO, speed=0.0)
    asked = [
        RunCommand(do="go", at_ns=1_020_000_000), RunCommand(do="fork", words="fault link-down"),
        RunCommand(do="go", at_ns=1_400_000_000), RunCommand(do="choose", future="run"), RunCommand(do="run"),
    ]  # fmt: skip
    assert all(live.offer(one) for one in asked)
    folder = run_scenario(SCENARIO, tmp_path / "run", drive=live.drive).folder
    assert hash_of(folder) == hash_of(alone)
    assert (live.state.done, live.state.trouble, live.state.why) == (len(asked), "", "the end of the run")
    live.source.update()
    shown = live.source.recording
    rows = {source: {f"{one.kind.name} {one.header.name}": one for one in shown.tracks if one.header.source == source}
            for source in ("", "fork 1")}  # fmt: skip
    own = rows["fork 1"]["pose pose"]
    assert own.times[-1] >= 1_400_000_000
    assert own.times == rows[""]["pose pose"].times[: len(own)]
    for name in ("events events", "packets P2OS"):
        times = rows["fork 1"][name].times
        until = [t for t in times if t < 1_000_000_000]
        assert until == [t for t in rows[""][name].times if t < 1_000_000_000]
        assert not any(rows["fork 1"]["packets P2OS"].column("is_bad")), "a fork begins between two packets"
    assert "link-down" in rows["fork 1"]["events events"].column("detail")
    assert "link-down" not in rows[""]["events events"].column("detail")
    assert [robot.name for robot in shown.header.robots] == ["", "fork 1"]
    live.offer(RunCommand(do="pause"))
    assert not all(live.offer(RunCommand(do="pause")) for _ in range(MOST_COMMANDS))


def test_run_folders_and_scenarios_are_targets_by_what_they_are(alone: Path, tmp_path: Path) -> None:
    found = run_target(str(alone))
    assert found is not None
    assert found.run is not None
    titles = [[section.title for section in found.source.recording.header.sections]]
    found.run()
    found.source.update()
    titles.append([section.title for section in found.source.recording.header.sections])
    assert "Drive" not in titles[0]
    assert titles[1] == [section.title for section in run_report(read_run(alone)).header.sections]
    assert "Drive" in titles[1]
    assert run_target(str(tmp_path)) is None
    assert scenario_target("nothing-of-that-name") is None
    live = scenario_target("motors")
    assert live is not None
    assert live.run is not None


def test_run_view_is_the_run_without_and_prints_the_link(
    alone: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["run", "motors", "--body", "kinematic", "--duration", "0.4s", "--realtime", "8", "--out"]
    assert p2os([*words, str(tmp_path / "without")]) == 0
    capsys.readouterr()
    assert p2os([*words, str(tmp_path / "with"), "--view", "--no-browser"]) == 0
    said = capsys.readouterr()
    assert re.match(r"page: http://127\.0\.0\.1:\d+/#token=[\w-]{43}\n", said.err)
    assert "token" not in said.out
    assert hash_of(tmp_path / "with") == hash_of(tmp_path / "without")


@pytest.mark.parametrize("beside", [["--foxglove"], ["--seeds", "1-2"], ["--port", "tcp:127.0.0.1:9"]])
def test_what_cannot_stand_beside_a_page_is_said(beside: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert p2os(["run", "motors", "--view", *beside]) == 2
    said = capsys.readouterr().err
    assert said.startswith("p2os: --view cannot stand beside ")
    assert "hint: " in said


def test_gdb_is_for_a_scenario_that_runs(alone: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert p2os(["view", str(alone), "--no-browser", "--gdb"]) == 2
    said = capsys.readouterr().err
    assert said.startswith("p2os: --gdb is for a scenario that runs, and ")
    assert "hint: p2os view dodge --gdb" in said


def test_a_browser_is_opened_unless_told_otherwise(monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    for is_opened in (False, True):
        with shown(StillRecording(ViewRecording(PageHeader(title="x"))), is_opened=is_opened) as page:
            url = page.url
    assert opened == [url]


def test_a_scenario_that_is_shown_ends_with_its_report_and_ctrl_c_ends_it(
    alone: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    done = SimpleNamespace(folder=alone, was_interrupted=False)
    monkeypatch.setattr("robot_bench.cli.shown.live_target.run_scenario", lambda *_args, **_more: done)
    target = scenario_target("motors")
    assert target is not None
    assert target.run is not None
    stayed: list[LiveRun] = []

    def stay(live: LiveRun) -> None:
        stayed.append(live)

    monkeypatch.setattr(LiveRun, "stay", stay)
    target.run()
    target.source.update()
    assert len(stayed) == 1
    assert target.source.recording.header.verdict == run_report(read_run(alone)).header.verdict != ""
    done.was_interrupted = True
    with pytest.raises(KeyboardInterrupt):
        target.run()
    assert len(stayed) == 1


def test_what_the_server_needs_is_named_where_it_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(_point: object) -> object:
        raise ModuleNotFoundError("no", name="uvicorn")

    monkeypatch.setattr(view_targets, "loaded", missing)
    with pytest.raises(MissingDependencyError, match="the page needs uvicorn"):
        view_targets.served(StillRecording(ViewRecording(PageHeader(title="x"))), "127.0.0.1", 0)
