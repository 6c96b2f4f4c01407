"""The page in Chromium: what it shows of hostile texts, by which keys it is used, and what axe says of it.

Needs Node, Chromium, and `make page` once (it installs what the page is built and tested with).
"""

import json
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

from p2os.view.header import (
    ChannelHeader,
    PageCell,
    PageHeader,
    PageList,
    PageSection,
    PageSource,
    PageTable,
    PanelHeader,
    RobotHeader,
    SensorPlace,
    StateTransition,
    WorldHeader,
    WorldThing,
)
from p2os.view.page import page_of
from p2os.view.recording import ViewRecording
from tools.generators.page_frames import TARGET, text

CAPTURE = Path(__file__).resolve().parents[2] / "golden" / "captures" / "aria_p2de.jsonl"
TOOLS = Path(__file__).resolve().parents[3] / "tools" / "page"
SCRIPTS = TOOLS / "test" / "browser"
HOSTILE = (
    "<img src=x onerror=\"window.ran=1;alert(1)\"><script>window.ran=1</script><b onmouseover='window.ran=1'>x</b>"
)
S = 1_000_000_000
SECONDS = 2


def recording() -> ViewRecording:
    """Return a run of two seconds with rows of every kind, each of whose texts is hostile."""
    header = PageHeader(
        title=f"run {HOSTILE}", verdict="failed", standing="failed", lead=HOSTILE, why=f"{HOSTILE} at 0.250 s",
        footer=HOSTILE,
        end_ns=SECONDS * S, left_out=[HOSTILE],
        robots=[RobotHeader(name="", model=HOSTILE, front_m=0.2, rear_m=0.2, width_m=0.4)],
        panels=[PanelHeader(name="program", title="Program", sections=[PageSection(title=HOSTILE, blocks=[
            PageSource(title=HOSTILE, lines=[HOSTILE, "b", "c", "d"], first=7, ran_ns=[0, S, -1, -2], one_way=[7]),
        ])])],
        world=WorldHeader(name=HOSTILE, extent_m=(-2.0, -2.0, 2.0, 2.0), things=[
            WorldThing(name=HOSTILE, kind="obstacle", shape="box", x_m=1.0, y_m=1.0, length_m=0.5, width_m=0.5),
            WorldThing(name="pole", kind="obstacle", shape="cylinder", x_m=-1.0, y_m=1.0, radius_m=0.2),
        ]),
        sections=[PageSection(title=HOSTILE, note=HOSTILE, blocks=[
            PageTable(title=HOSTILE, rows=[
                [PageCell(text=HOSTILE, href=f"javascript:window.ran=1;//{HOSTILE}"), PageCell(text="1")],
            ]),
            PageList(title="Goals", items=[PageCell(text=HOSTILE, standing="failed", at_ns=S)]),
        ])],
    )  # fmt: skip
    made = ViewRecording(header)
    wire = made.add(ChannelHeader(name=f"PA0 {HOSTILE}", kind="levels", group=HOSTILE))
    bus = made.add(ChannelHeader(name="bus", kind="levels", group=HOSTILE, width=8))
    analog = made.add(ChannelHeader(name="VBAT", kind="samples", unit="V", group="analog"))
    speed = made.add(ChannelHeader(name=HOSTILE, kind="samples", unit="m/s", group=HOSTILE, mark=0.5))
    pose = made.add(ChannelHeader(name="pose", kind="pose"))
    sensors = [SensorPlace(name=HOSTILE, x_m=0.1, y_m=0.0, bearing_rad=0.0)]
    ranges = made.add(ChannelHeader(name="sonar", kind="ranges", sensors=sensors, cone_rad=0.4, range_m=5.0))
    packets = made.add(ChannelHeader(name=HOSTILE, kind="packets"))
    console = made.add(ChannelHeader(name=HOSTILE, kind="text"))
    events = made.add(ChannelHeader(name="events", kind="events"))
    goal = made.add(ChannelHeader(name=HOSTILE, kind="goal", unit="m"))
    machine = made.add(ChannelHeader(name=HOSTILE, kind="state", states=["idle", HOSTILE],
                                     transitions=[StateTransition(source=0, target=1, cause=HOSTILE)]))  # fmt: skip
    for n in range(10 * SECONDS):
        t = n * S // 10
        wire.append(t, n % 2, 1)
        bus.append(t, n, 1)
        analog.append(t, 12.0 - n / 100)
        speed.append(t, n / 20)
        pose.append(t, n / 20, 0.0, 0.0, 0.0, 0.0)
        ranges.append(t, [1.0 + n / 20])
        packets.append(t, n % 2, b"\xfa\xfb\x03\x00\x00\x00", HOSTILE, HOSTILE,
                       json.dumps([[0, 2, HOSTILE, HOSTILE], [2, 6, "rest", "0"]]), 0)  # fmt: skip
        console.append(t, n % 2, HOSTILE)
        events.append(t, n % 4, HOSTILE, HOSTILE, HOSTILE, n / 20, 0.0)
        goal.append(t, 0 if n < 15 else 2, 1.0 - n / 10, HOSTILE)
        machine.append(t, n % 2, HOSTILE)
    return made


def tools() -> tuple[str, str]:
    """Return Node and Chromium; skips where they are not there."""
    node, chromium = shutil.which("node"), shutil.which("chromium") or shutil.which("chromium-browser")
    if node is None or chromium is None:
        pytest.skip("node or chromium is not installed: the page is not looked at in a browser")
    if not (TOOLS / "node_modules" / "playwright-core").is_dir():
        pytest.skip("tools/page/node_modules is not there: the page is not looked at in a browser (hint: make page)")
    return node, chromium


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Return what came of the page in the browser: opened once, looked at by all tests here."""
    node, chromium = tools()
    page = tmp_path_factory.mktemp("page") / "report.html"
    page.write_text(page_of(recording()), encoding="utf-8")
    done = subprocess.run([node, str(SCRIPTS / "browser.mjs"), chromium, page.as_uri()],
                          capture_output=True, text=True, timeout=170, check=False)  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def test_the_frames_of_the_decoders_tests_are_those_that_python_packs() -> None:
    assert TARGET.read_text(encoding="utf-8") == text(), "make generated"


@pytest.mark.slow
def test_a_served_page_takes_its_token_out_of_the_address_and_says_when_nobody_answers() -> None:
    pytest.importorskip("uvicorn", reason="the extra view is not installed")
    node, chromium = tools()
    server = [sys.executable, "-m", "p2os", "view", str(CAPTURE), "--no-browser"]
    with (
        subprocess.Popen(server, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as serving,
        subprocess.Popen([node, str(SCRIPTS / "served.mjs"), chromium, _address(serving)], stdin=subprocess.PIPE,
                         stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as browser,
    ):  # fmt: skip
        assert browser.stdout is not None
        line = browser.stdout.readline()
        serving.send_signal(signal.SIGINT)
        rest, errors = browser.communicate("ended\n", timeout=30)
        assert browser.returncode == 0, errors[-3000:]
    found = json.loads(line)
    assert "token" not in found["address"]
    assert found["title"] == found["afterReload"] == json.loads(rest)["title"]
    assert {urlsplit(url).path.split("/")[-1] for url in found["requests"]} <= {"", "page.js", "page.css"}
    assert found["errors"] == []
    assert found["askedAtRest"] == 0
    assert found["asked"]
    assert "token" in found["stranger"]
    assert "trying again" in json.loads(rest)["trouble"]


def _address(serving: subprocess.Popen[str]) -> str:
    assert serving.stdout is not None
    line = serving.stdout.readline()
    assert line.startswith("page: "), line
    return line.removeprefix("page: ").strip()


@pytest.mark.slow
def test_a_page_from_a_file_paints_and_asks_nobody(seen: dict[str, Any]) -> None:
    assert 0 < seen["firstPaintMs"] < 20_000  # it does paint; how soon, a busy machine decides
    assert [url for url in seen["requests"] if not url.endswith("report.html")] == []
    assert seen["errors"] == []


@pytest.mark.slow
def test_hostile_texts_are_shown_as_texts_and_nothing_runs(seen: dict[str, Any]) -> None:
    assert (seen["ran"], seen["dialogs"], seen["elements"]) == (0, [], [])
    assert seen["title"] == f"run {HOSTILE}"
    assert seen["shown"].count("<script>window.ran=1</script>") >= 5
    assert "<b onmouseover" in seen["explanation"]


@pytest.mark.slow
def test_views_stand_by_what_the_run_has_in_landmarks(seen: dict[str, Any]) -> None:
    assert sorted(seen["tabs"]) == sorted([
        "Plan", "3D", "Plots", "Logic analyser", "Report", "Goals", "State machine", "Events", "Consoles", "Packets",
        "Program",
    ])  # fmt: skip
    assert seen["landmarks"] == ["header", "main", "section"]


@pytest.mark.slow
def test_keys_move_time_cursors_and_window(seen: dict[str, Any]) -> None:
    state = {key.split(" ", 1)[-1]: value for key, value in seen["keys"].items() if key != "6 End"}
    end = SECONDS * S
    assert seen["opened"]["now"] == S
    assert state["ArrowRight"]["now"] == S + end // 100
    assert state["Shift+ArrowLeft"]["now"] == S + end // 100 - end // 10
    assert (state["End"]["now"], state["Home"]["now"]) == (end, 0)
    assert state["+"]["to"] - state["+"]["from"] == pytest.approx(end / 2)
    assert (state["a"]["a"], state["b"]["b"]) == (0, end)
    assert state["]"]["now"] == end
    assert state["["]["now"] == end - S // 10
    assert state[">"]["rate"] == 2
    assert (state["0"]["from"], state["0"]["to"]) == (0, end)
    assert (state["play"]["playing"], state["pause"]["playing"]) == (True, False)
    assert state["play"]["now"] > 0


@pytest.mark.slow
def test_lines_of_the_program_have_run_by_the_pages_time(seen: dict[str, Any]) -> None:
    assert seen["lines"] == ["part not not none", "part ran not none"]


@pytest.mark.slow
def test_the_cause_leads_to_its_moment(seen: dict[str, Any]) -> None:
    assert seen["cause"] == S // 4


@pytest.mark.slow
def test_tab_reaches_layout_link_help_and_the_views(seen: dict[str, Any]) -> None:
    reached = " | ".join(seen["reached"])
    for what in ("select Layout", "Copy a link", "Keys and views", "tab ", "Show the whole world"):
        assert what in reached


@pytest.mark.slow
def test_a_packet_is_chosen_by_keys_and_explained_byte_by_byte(seen: dict[str, Any]) -> None:
    assert seen["explained"] == 2
    assert "fa fb" in seen["explanation"]
    assert seen["filtered"] == 0


@pytest.mark.slow
def test_a_link_brings_back_time_window_and_cursor(seen: dict[str, Any]) -> None:
    linked = seen["linked"]
    assert (linked["now"], linked["a"], linked["from"], linked["to"]) == (5e8, 3e8, 2e8, 9e8)


@pytest.mark.slow
def test_a_click_near_an_edge_goes_to_it_and_the_wheel_looks_closer(seen: dict[str, Any]) -> None:
    assert seen["clicked"]["now"] == S
    assert seen["zoomed"]["to"] - seen["zoomed"]["from"] < SECONDS * S


@pytest.mark.slow
def test_the_help_names_every_key(seen: dict[str, Any]) -> None:
    for keys in ("Space", "Home End", "a b", "[ ]"):
        assert keys in seen["help"]


@pytest.mark.slow
def test_axe_and_a_narrow_screen_have_no_complaints(seen: dict[str, Any]) -> None:
    assert seen["complaints"] == []
