"""`p2os run`, `report` and `demo`: what they print, what they leave behind, how they end."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from bluepill_sim.program.last_blocks import TITLE
from p2os.cli.main import run as p2os
from robot_bench.cli.run import capped
from robot_bench.drives.of_run import drive_of_record
from robot_bench.recording.run_folder import make_next_folder
from robot_bench.recording.run_record import read_run
from robot_bench.scenario.loading import load_scenario
from tests.p2os.view.pages import ReadPage
from tests.robot_bench.firmware import thumb
from tests.tools.forked_python import forked_p2os

QUICK = ["--mode", "direct", "--body", "kinematic", "--duration", "0.2s"]
#: What `run --json` prints at the least.
KEYS = {
    "firmware_sha256", "scenario", "mode", "body", "seed", "virtual_s", "wall_s", "real_time_factor", "distance_m",
    "collisions", "min_clearance_m", "trace_sha256", "passed", "failures",
}  # fmt: skip

LEAST = 'firmware = "x.bin"\nworld = "room"\nduration_s = 0.2\nthreshold_m = 0.6\nbody = "kinematic"\nmode = "direct"\n'


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def make(firmware: bytes, text: str = LEAST) -> str:
    Path("x.bin").write_bytes(firmware)
    Path("mine.toml").write_text(text, encoding="utf-8")
    return "mine.toml"


def test_a_run_that_meets_its_goals_ends_with_0_and_its_report(capsys: pytest.CaptureFixture[str]) -> None:
    assert p2os(["run", make(thumb.SLEEP)]) == 0
    out, err = capsys.readouterr()
    assert out.splitlines()[-1] == "ended well, no goals were set; report: runs/mine-001/report.html"
    assert "virtual time" in out
    assert err == ""
    assert Path("runs/mine-001/report.html").is_file()


def test_json_is_one_object_with_all_that_was_promised(capsys: pytest.CaptureFixture[str]) -> None:
    assert p2os(["run", make(thumb.SLEEP), "--json", "--out", "there"]) == 0
    outcome = json.loads(capsys.readouterr().out)
    assert outcome.keys() >= KEYS
    assert (outcome["virtual_s"], outcome["collisions"], outcome["passed"]) == (0.2, 0, True)
    assert read_run(Path("there")).end["trace_sha256"] == outcome["trace_sha256"]


def test_the_speed_of_the_usarts_far_end_is_a_key_and_an_option(capsys: pytest.CaptureFixture[str]) -> None:
    Path("slow.toml").write_text(
        LEAST.replace("x.bin", "motors.elf")
        + 'usart_baud = 9600\n[[goal]]\nkind = "usart_contains"\ntext = "motors"\n',
        encoding="utf-8",
    )
    assert p2os(["run", "slow.toml", "--json"]) == 1
    outcome = json.loads(capsys.readouterr().out)
    assert outcome["usart_baud"] == 115200  # the firmware's own; the far end is at 9600
    assert [note for note in outcome["notes"] if "and the far end at 9600: characters arrive damaged" in note]
    assert outcome["failures"][0].startswith("usart_contains: 'motors' was not printed")
    assert p2os(["run", "slow.toml", "--usart-baud", "115200"]) == 0


def test_a_goal_that_is_missed_ends_with_1_and_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    scenario = make(thumb.SLEEP, LEAST + '[[goal]]\nkind = "min_distance"\ndistance_m = 1\n')
    assert p2os(["run", scenario]) == 1
    out = capsys.readouterr().out
    assert "failed  min_distance: 0.00 m were driven, 1.00 m are wanted" in out
    assert "FAILED" in out


def test_a_program_that_spins_is_legal_and_is_told_of(capsys: pytest.CaptureFixture[str]) -> None:
    text = LEAST.replace("0.2", "1.2")
    assert p2os(["run", make(thumb.SPIN, text), "--json"]) == 0
    outcome = json.loads(capsys.readouterr().out)
    assert outcome["virtual_s"] == 1.2
    assert any("no pin, USART or WFI was seen since 0.000 s; the program is at" in note for note in outcome["notes"])
    assert "0x08000042" in str(outcome["notes"])
    assert outcome["last_blocks"] == [], "it has passed: there is nothing to explain"
    goal = '[[goal]]\nkind = "usart_contains"\ntext = "ready"\n'
    assert p2os(["run", make(thumb.SPIN, text + goal), "--json"]) == 1
    assert "0x08000042" in json.loads(capsys.readouterr().out)["last_blocks"][-1]


def test_a_program_that_is_alive_needs_no_last_blocks(capsys: pytest.CaptureFixture[str]) -> None:
    assert p2os(["run", make(thumb.SLEEP), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["last_blocks"] == []


@pytest.mark.parametrize(
    ("firmware", "says"),
    [(thumb.NOWHERE, "0x60000000"), (thumb.DIVIDE, "divi"), (thumb.OVERFLOW, "0x1fff")],
    ids=["nowhere", "divide", "overflow"],
)
def test_a_firmware_that_dies_ends_with_1_and_says_where(
    firmware: bytes, says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert p2os(["run", make(firmware), "--json"]) == 1
    outcome = json.loads(capsys.readouterr().out)
    assert outcome["failures"][0].startswith("firmware fault: ")
    assert says in outcome["failures"][0]
    assert 1 <= len(outcome["last_blocks"]) <= 32


def test_what_a_dead_program_ran_last_is_in_the_table_and_in_the_report(capsys: pytest.CaptureFixture[str]) -> None:
    assert p2os(["run", make(thumb.NOWHERE), "--out", "dead"]) == 1
    out = capsys.readouterr().out.splitlines()
    block = out[out.index(TITLE) + 1]
    assert block.split() == ["0", "0x08000042"]
    page = ReadPage(Path("dead/report.html").read_text(encoding="utf-8"))
    assert block in page.section("What ran last, by cycle")["blocks"][0]["text"]


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("missing.elf", None),
        ("empty.bin", b""),
        ("random.elf", bytes(range(256))),
        ("cut.elf", Path(__file__).parents[3].joinpath("robot_bench/firmware/motors.elf").read_bytes()[:700]),
        ("x86.elf", Path(sys.executable).resolve().read_bytes()[:4096]),
        ("no_flash.hex", b":020000042000DA\n:0400000001020304F2\n:00000001FF\n"),
    ],
)
def test_a_firmware_that_is_none_is_one_line_and_2(
    name: str, content: bytes | None, capsys: pytest.CaptureFixture[str]
) -> None:
    if content is not None:
        Path(name).write_bytes(content)
    assert p2os(["run", "motors", *QUICK, "--firmware", name]) == 2
    err = capsys.readouterr().err.splitlines()
    assert err[0].startswith("p2os: ")
    assert name in err[0]
    assert len(err) <= 2
    assert "Error" not in err[0]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["run", "doge"], "there is no scenario 'doge'"),
        (["run", "dodge", "--mode", "dirct"], "there is no mode 'dirct'"),
        (["run", "dodge", "--body", "box"], "there is no body 'box'"),
        (["run", "dodge", "--world", "moon"], "there is no world 'moon'"),
        (["run", "dodge", "--duration", "0s"], "--duration '0s' is out of range: more than 0"),
        (["run", "dodge", "--duration", "nan"], "--duration 'nan' is no time: more than 0"),
        (["run", "dodge", "--realtime", "-1"], "--realtime '-1' is out of range: more than 0"),
        (["run", "dodge", "--yes"], "--yes goes with --port only"),
        (["run", "dodge", "--max-speed", "300mm/s"], "--max-speed goes with --port only"),
        (["run", "dodge", "--port", "tcp:127.0.0.1:1", "--mode", "direct"], "--mode cannot stand beside --port"),
        (["run", "dodge", "--port", "tcp:127.0.0.1:1", "--body", "bullet"], "--body cannot stand beside --port"),
        (["run", "dodge", "--port", "tcp:127.0.0.1:1", "--world", "room"], "--world cannot stand beside --port"),
        (["run", "dodge", "--port", "tcp:127.0.0.1:1", "--seed", "1"], "--seed cannot stand beside --port"),
        (["run", "dodge", "--out", "."], "holds something that is no run"),
        (["run", "dodge", "--fail-under", "80"], "--fail-under goes with --coverage only"),
        (["report", "nowhere"], "holds no trace.jsonl"),
    ],
)
def test_wrong_usage_is_one_line_with_a_hint_and_2(
    words: list[str], says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("something").touch()
    assert p2os(words) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.splitlines()[0].startswith("p2os: ")
    assert says in err.splitlines()[0]
    assert [line.startswith("hint: ") for line in err.splitlines()[1:]] in ([True], [])


def test_realtime_takes_the_clocks_time_with_or_without_a_number(capsys: pytest.CaptureFixture[str]) -> None:
    scenario = make(thumb.SLEEP, LEAST.replace("0.2", "0.4"))
    for words, least_s in ((["--realtime"], 0.4), (["--realtime", "4", "--json"], 0.1)):
        began = time.monotonic()
        assert p2os(["run", scenario, *words]) == 0
        assert time.monotonic() - began >= least_s
    assert json.loads(capsys.readouterr().out.splitlines()[-1])["real_time_factor"] <= 4.05


def test_a_report_is_made_anew_from_the_trace_alone(capsys: pytest.CaptureFixture[str]) -> None:
    p2os(["run", make(thumb.SLEEP), "--out", "there"])
    before = {path.name: path.read_bytes() for path in Path("there").iterdir()}
    for path in Path("there").iterdir():
        if path.name != "trace.jsonl":
            path.unlink()
    capsys.readouterr()
    assert p2os(["report", "there"]) == 0
    assert capsys.readouterr().out == "report: there/report.html\n"
    for name in ("summary.json", "pins.vcd", "pins.sr", "usart.txt", "wire.jsonl", "report.html"):
        assert Path("there", name).read_bytes() == before[name]


def test_a_run_is_overwritten_by_force_alone_and_numbers_go_on(capsys: pytest.CaptureFixture[str]) -> None:
    scenario = make(thumb.SLEEP)
    for words, code in (([], 0), ([], 2), (["--force"], 0)):
        assert p2os(["run", scenario, "--out", "there", *words]) == code
    assert "p2os: there holds a run already\nhint: --force overwrites it" in capsys.readouterr().err
    assert p2os(["run", scenario]) == 0
    assert make_next_folder("mine").name == "mine-002"
    Path("runs/mine-041").mkdir()
    assert make_next_folder("mine").name == "mine-042"
    assert make_next_folder("min").name == "min-001"


def started(duration_s: float, *words: str) -> subprocess.Popen[str]:
    """A run in a process of its own that has begun to write."""
    scenario = make(thumb.SLEEP, LEAST.replace("0.2", str(duration_s)))
    process = subprocess.Popen(
        forked_p2os("run", scenario, "--out", "there", *words),
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline:
        if Path("there/trace.jsonl").is_file() and Path("there/trace.jsonl").read_bytes().count(b"\n") > 60:
            return process
        time.sleep(0.02)
    process.kill()
    raise AssertionError(process.communicate()[1])


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_leaves_a_complete_folder_and_130(number: signal.Signals) -> None:
    process = started(10_000, "--json")
    process.send_signal(number)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    outcome = json.loads(out)
    assert outcome["failures"] == [f"interrupted ({number.name})"]
    assert Path("there/report.html").is_file()
    record = read_run(Path("there"))
    assert not record.is_cut
    assert record.last_ns / 1e9 == pytest.approx(outcome["virtual_s"])


def test_an_interrupted_run_says_so_once_in_its_result_and_once_beside_it() -> None:
    process = started(10_000)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert out.splitlines()[-1] == "INTERRUPTED (SIGINT); report: there/report.html"
    assert out.lower().count("interrupted") == 1
    assert err.endswith("p2os: interrupted\n")


def test_kill_9_leaves_a_trace_that_makes_a_report(capsys: pytest.CaptureFixture[str]) -> None:
    process = started(10_000)
    os.kill(process.pid, signal.SIGKILL)
    process.communicate(timeout=60)
    record = read_run(Path("there"))
    assert record.is_cut
    assert record.last_ns >= 10**9
    assert p2os(["report", "there", "--json"]) == 0
    outcome = json.loads(capsys.readouterr().out)
    assert outcome["passed"] is False
    assert outcome["failures"][0].startswith("the run was cut at")


def test_a_second_run_with_the_same_out_is_refused_while_the_first_lasts(capsys: pytest.CaptureFixture[str]) -> None:
    process = started(10_000, "--json")
    for words in ([], ["--force"]):
        assert p2os(["run", "motors", *QUICK, "--out", "there", *words]) == 2
        assert "p2os: another run is writing into there\nhint: " in capsys.readouterr().err
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert read_run(Path("there")).end["trace_sha256"] == json.loads(out)["trace_sha256"]
    assert read_run(Path("there")).meta["scenario"] == "mine"


def test_demo_runs_dodge_in_the_room(capsys: pytest.CaptureFixture[str]) -> None:
    assert p2os(["demo", "--duration", "0.1s", "--json"]) == 0, "nothing can be missed in 0.1 s"
    outcome = json.loads(capsys.readouterr().out)
    assert outcome["goals_met"] == []
    open_goals = [goal.rpartition(": ")[2] for goal in outcome["goals_not_judged"]]
    assert open_goals == ["not judged before 120 s"] * len(load_scenario("dodge").goals)
    assert (outcome["scenario"], outcome["mode"], outcome["world"]) == ("dodge", "adapter", "room")
    assert Path("runs/demo-001/report.html").is_file()
    assert {path.name for path in Path("runs/demo-001").glob("*.png")} == {"path.png", "speeds.png", "pins.png"}


def test_a_run_shorter_than_its_scenario_names_what_it_left_open(capsys: pytest.CaptureFixture[str]) -> None:
    scenario = make(thumb.SLEEP, LEAST + '[[goal]]\nkind = "min_distance"\ndistance_m = 1\n')
    assert p2os(["run", scenario, "--duration", "0.1s", "--out", "short"]) == 0
    out = capsys.readouterr().out.splitlines()
    assert out[-2:] == [
        "open    drives at least 1 m: not judged before 0.2 s",
        "passed, 1 goal not judged; report: short/report.html",
    ]
    assert "drives at least 1 m: not judged before 0.2 s" in Path("short/report.html").read_text(encoding="utf-8")


def test_of_many_goals_that_are_met_or_open_the_first_are_listed_and_each_that_is_missed(
    capsys: pytest.CaptureFixture[str],
) -> None:
    open_ones = "".join(f'[[goal]]\nkind = "min_distance"\ndistance_m = {n}\n' for n in range(1, 9))
    missed = "".join(f'[[goal]]\nkind = "usart_contains"\ntext = "never {n}"\n' for n in range(8))
    goals = f'[[goal]]\nkind = "no_collision"\n{open_ones}'
    assert p2os(["run", make(thumb.SLEEP, LEAST + goals), "--duration", "0.1s", "--out", "many"]) == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("open ")]
    assert (len(lines), lines[-1]) == (7, "open    3 more, in the report")
    assert p2os(["run", make(thumb.SLEEP, LEAST + missed), "--out", "missed"]) == 1
    assert sum(line.startswith("failed  ") for line in capsys.readouterr().out.splitlines()) == 8
    assert p2os(["run", make(thumb.SLEEP, LEAST + '[[goal]]\nkind = "no_collision"\n' * 6), "--out", "six"]) == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("met ")]
    assert lines == ["met     touches nothing"] * 6


def test_why_a_run_failed_stands_right_above_its_last_line(capsys: pytest.CaptureFixture[str]) -> None:
    goals = '[[goal]]\nkind = "min_distance"\ndistance_m = 1\n[[goal]]\nkind = "no_collision"\n'
    assert p2os(["run", make(thumb.NOWHERE, LEAST.replace("0.2", "5.0") + goals), "--out", "dead"]) == 1
    *_, is_open, untouched, cause, last = capsys.readouterr().out.splitlines()
    assert cause.startswith("failed  firmware fault: ")
    assert last == "FAILED; report: dead/report.html"
    assert is_open.startswith("open    drives at least 1 m"), "what the fault has prevented is no second cause"
    assert untouched == "open    touches nothing: not judged before 5 s", "the rest of the time nobody knows"
    record = read_run(Path("dead"))
    reported = json.loads(Path("dead/summary.json").read_text(encoding="utf-8"))
    assert reported["goals_met"] == record.end["goals_met"] == record.verdicts == []
    assert len(reported["goals_not_judged"]) == 2
    goals = ReadPage(Path("dead/report.html").read_text(encoding="utf-8")).section("Goals")["blocks"][0]["items"]
    assert {"open"} == {goal["standing"] for goal in goals if goal["text"] == untouched[8:]}
    assert drive_of_record("dead", record).open_goals == reported["goals_not_judged"]
    assert p2os(["metrics", "dead"]) == 0
    assert "  open               touches nothing: not judged before 5 s" in capsys.readouterr().out.splitlines()


def test_an_untried_program_is_capped_unless_told() -> None:
    scenario = load_scenario("dodge")
    assert capped(scenario, None).adapter.max_velocity_mm_s == 200
    assert capped(scenario, None).adapter.max_rotation_deg_s == 45
    assert capped(scenario, 0.35).adapter.max_velocity_mm_s == 350


def test_a_run_in_which_too_few_lines_ran_has_failed(capsys: pytest.CaptureFixture[str]) -> None:
    assert p2os(["run", "motors", *QUICK, "--coverage", "--fail-under", "100%"]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert re.fullmatch(r"failed  coverage: [0-9.]+ % of the lines are less than 100 %", lines[-2])
    assert lines[-1].startswith("FAILED; ")
    assert p2os(["run", "motors", *QUICK, "--coverage", "--fail-under", "1%", "--json"]) == 0


def test_a_working_folder_in_which_nothing_can_be_made_has_a_way_out(capsys: pytest.CaptureFixture[str]) -> None:
    Path("runs").write_text("a file where the run folders would be")
    assert p2os(["run", "motors", *QUICK]) == 2
    assert capsys.readouterr().err.splitlines()[1] == "hint: --out FOLDER makes it elsewhere"


def test_a_program_without_lines_has_no_share_of_them(capsys: pytest.CaptureFixture[str]) -> None:
    assert p2os(["run", make(thumb.SLEEP), "--coverage", "--fail-under", "80"]) == 2
    assert "no debug information in it" in capsys.readouterr().err


def test_a_run_in_a_world_with_nothing_in_it_can_be_reported(capsys: pytest.CaptureFixture[str]) -> None:
    Path("empty.toml").write_text(
        'name = "empty"\nextent_m = [-2, -2, 2, 2]\n[start]\nx_m = 0\ny_m = 0\nheading_deg = 0\n', encoding="utf-8"
    )
    scenario = make(thumb.SLEEP, LEAST.replace("room", "empty.toml"))
    assert p2os(["run", scenario, "--json", "--out", "there"]) == 0
    assert json.loads(capsys.readouterr().out)["min_clearance_m"] is None
    assert p2os(["report", "there"]) == 0
