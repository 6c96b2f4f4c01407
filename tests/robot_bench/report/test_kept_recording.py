"""A long run that was kept beside its trace: shown as its trace shows it, or not at all."""

import ast
import json
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import pytest

from p2os.view.channels import WHOLE_PIXELS
from p2os.view.header import (
    PageBlock,
    PageCell,
    PageCurve,
    PageDrawing,
    PageHeader,
    PageList,
    PagePicture,
    PagePlan,
    PagePlot,
    PageSection,
    PageTable,
    PageText,
    PanelHeader,
    PictureShape,
    WorldHeader,
    WorldThing,
)
from p2os.view.recording import ChannelTrack, ViewRecording
from robot_bench.cli.shown.targets import run_target
from robot_bench.recording.run_folder import KEPT_NAME
from robot_bench.recording.run_record import read_run
from robot_bench.report.run_page import run_report
from robot_bench.run import run_scenario
from robot_bench.scenario.loading import load_scenario
from robot_bench.view.kept_recording import LEAST_BYTES, is_long, keep, kept

ROOT = Path(__file__).resolve().parents[3]
FENCE = WorldThing(name="k", kind="wall", shape="polygon", x_m=0.0, y_m=0.0, points=((0.0, 1.0), (2.0, 3.0)))
BLOCKS: list[PageBlock] = [
    PageTable(title="t", head=("a", "b"), rows=[[PageCell(text="1", is_number=True, at_ns=5)]]),
    PageText(text="x"),
    PageList(items=[PageCell(text="y", standing="failed")]),
    PagePicture(png="eA=="),
    PagePlot(curves=[PageCurve(name="c", x=(1.0, 2.0), y=(3.0, 4.0))], marks=(0.5,)),
    PagePlan(world=WorldHeader(name="w", extent_m=(0.0, 0.0, 1.0, 1.0), things=[FENCE]), hits=((1.0, 2.0),),
             places=((1.0, 2.0, "here"),)),
    PageDrawing(shapes=[PictureShape(kind="box", x=1.0, y=2.0)]),
]  # fmt: skip
SECTIONS = [PageSection(title="s", blocks=BLOCKS)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a run of some seconds, through adapter and P2OS."""
    scenario = load_scenario("motors").with_options(body="kinematic", mode="adapter", duration_s=3.0)
    return run_scenario(scenario, tmp_path_factory.mktemp("run") / "run").folder


def is_kept(recording: ViewRecording) -> bool:
    """Tell whether no row of a recording was read yet."""
    return all(track.later is not None and track.packed_whole is not None for track in recording.tracks)


def rows_of(recording: ViewRecording) -> dict[int, str]:
    return {track.header.id: str([[*map(str, values)] for values in track.columns]) for track in recording.tracks}


def test_what_is_kept_of_a_run_is_what_its_trace_shows(folder: Path) -> None:
    whole = run_report(read_run(folder))
    assert any(track.kind.name == "packets" and len(track) > 20 for track in whole.tracks)
    assert keep(whole, folder, SECTIONS)
    found = kept(folder)
    assert found is not None
    assert rows_of(found) == rows_of(whole)
    wanted = replace(whole.full_header, sections=SECTIONS).as_json()
    assert json.dumps(found.full_header.as_json()) == json.dumps(wanted)
    target = run_target(str(folder))
    assert target is not None
    assert is_kept(target.source.recording)
    assert target.run is not None
    target.run()
    assert is_kept(target.source.recording), "nothing is read before somebody looks"
    assert target.source.recording.header == found.header


def test_what_a_page_shows_first_is_sent_as_it_was_packed_and_all_else_is_made(folder: Path) -> None:
    whole = run_report(read_run(folder))
    keep(whole, folder)
    found = kept(folder)
    assert found is not None
    start, end = whole.header.start_ns, whole.header.end_ns
    for track, same in zip(found.tracks, whole.tracks, strict=True):
        assert bytes(track.packed(start, end, WHOLE_PIXELS)) == same.packed(start, end, WHOLE_PIXELS)
        assert track.later is not None  # its rows were not read for it
        for other in ((start, end, WHOLE_PIXELS - 1), (start, end - 1, WHOLE_PIXELS), (start + 1, end, WHOLE_PIXELS)):
            assert track.packed(*other) == same.packed(*other)
        assert track.later is None


def test_frames_of_other_channels_are_not_shown(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = run_report(read_run(folder))
    kinds = [track.kind.name for track in whole.tracks]
    other = whole.tracks[next(n for n, kind in enumerate(kinds) if kind != kinds[0])].frame(0, 1, 1)
    monkeypatch.setattr(ChannelTrack, "frame", lambda *_: other)
    keep(whole, folder)
    assert kept(folder) is None


#: What `p2os view` loads for a run that was kept, and what takes so long that it may not be among it.
LOADED = (
    "p2os.cli.captures.view", "p2os.cli.robots.viewed_robot", "robot_bench.cli.shown.targets",
    "p2os.view.server.serving",
)  # fmt: skip
HEAVY = ("bluepill_sim", "p2os.capture", "p2os.client", "p2os.pioneer", "robot_bench.events")


def loaded_with(names: Iterable[str]) -> set[str]:
    """Return the modules of the project that are loaded with some, by what stands outside of functions."""
    found: set[str] = set()
    waiting = [*names]
    while waiting:
        name = waiting.pop()
        spec = None if name in found else ROOT.joinpath(*name.split("."))
        files = (
            [] if spec is None else [one for one in (spec.with_suffix(".py"), spec / "__init__.py") if one.is_file()]
        )
        if files:
            found.add(name)
            waiting.append(name.rpartition(".")[0] or name)
            for node in ast.parse(files[0].read_text()).body:
                if isinstance(node, ast.ImportFrom) and node.module:
                    waiting += [node.module, *(f"{node.module}.{one.name}" for one in node.names)]
    return found


def test_a_run_that_was_kept_opens_without_bench_emulator_and_client() -> None:
    found = loaded_with(LOADED)
    assert {*LOADED, "robot_bench.view.kept_recording", "p2os.view.recording"} <= found
    assert [name for name in sorted(found) if name.startswith(HEAVY)] == []


@pytest.mark.parametrize("what", ["byte", "end", "trace", "version", "head"])
def test_what_was_kept_of_another_run_or_is_damaged_is_not_shown(
    folder: Path, tmp_path: Path, what: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    keep(run_report(read_run(folder)), folder)
    for name in ("trace.jsonl", KEPT_NAME):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    assert kept(tmp_path) is not None
    path = tmp_path / KEPT_NAME
    data = bytearray(path.read_bytes())
    if what == "byte":
        data[len(data) // 2] ^= 1
    elif what == "end":
        del data[-8:]
    elif what == "trace":
        with (tmp_path / "trace.jsonl").open("a") as trace:
            trace.write('{"k": "later"}\n')
    elif what == "version":
        monkeypatch.setattr("simbase.__version__", "0.0.1")
    else:
        del data[data.index(b"\n") :]
    path.write_bytes(data)
    assert kept(tmp_path) is None
    target = run_target(str(tmp_path))
    assert target is not None
    assert not is_kept(target.source.recording)


def test_a_run_that_was_read_is_kept_for_the_next_time(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (folder / KEPT_NAME).unlink(missing_ok=True)
    monkeypatch.setattr("robot_bench.view.kept_recording.LEAST_BYTES", 0)
    target = run_target(str(folder))
    assert target is not None
    assert target.run is not None
    target.run()
    target.source.update()
    found = kept(folder)
    assert found is not None
    assert len(found.header.sections) == len(target.source.recording.header.sections) > 1


def test_a_short_run_is_not_worth_it_and_a_folder_that_cannot_be_written_stays_as_it_is(tmp_path: Path) -> None:
    recording = ViewRecording(PageHeader(title="x", panels=[PanelHeader(name="p", title="P")]))
    trace = tmp_path / "trace.jsonl"
    trace.write_bytes(bytes(LEAST_BYTES - 1))
    assert not is_long(tmp_path)
    trace.write_bytes(bytes(LEAST_BYTES))
    assert is_long(tmp_path)
    assert keep(recording, tmp_path)
    found = kept(tmp_path)
    assert found is not None
    assert (found.header, found.tracks) == (replace(recording.header, panels=(PanelHeader(name="p", title="P"),)), [])
    (tmp_path / KEPT_NAME).unlink()
    (tmp_path / KEPT_NAME).mkdir()
    assert not keep(recording, tmp_path)
    assert kept(tmp_path) is None
