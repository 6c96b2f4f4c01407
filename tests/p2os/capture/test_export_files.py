"""Tables and files that other programs read."""

import io
import json
import sys
from pathlib import Path

import pytest

from p2os.capture import Direction, Reading, capture_of, read_file, rows_of, write_recording
from p2os.capture.sips import Sips
from p2os.capture.table import table_of, write_csv
from p2os.cli.main import run
from p2os.protocol.packets import packet_frame
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import SonarReading, StandardSip
from p2os.robots.parameters import load_parameters
from simbase.installation import install_command
from simbase.timing import NS_PER_S

GOLDEN = Path(__file__).resolve().parents[2] / "golden" / "captures" / "player_p2de.jsonl"
P2OS = Reading(profile=Profile.P2OS, parameters=load_parameters("p2dx"))
Capture = pytest.CaptureFixture[str]


def drive(*raw_x: int) -> list[tuple[int, Direction, bytes]]:
    sips = [StandardSip(raw_x=x, raw_y=32760, sonar=(SonarReading(place % 2, 1000),)) for place, x in enumerate(raw_x)]
    return [
        (place * NS_PER_S, Direction.FROM_ROBOT, packet_frame(sip, Profile.P2OS).to_bytes())
        for place, sip in enumerate(sips)
    ]


def test_positions_go_on_where_the_counters_wrap() -> None:
    rows = rows_of(capture_of(drive(32000, 100, 16000, 31000, 14000)), P2OS)
    table = table_of(rows, P2OS)
    counts = [-768, 100, 16000, 31000, 46768]
    assert table.columns["x_m"] == [round(count * 0.00084, 6) for count in counts]
    assert table.columns["y_m"] == [round(-8 * 0.00084, 6)] * 5
    assert list(table.columns["sonar_m_1"]) == [None, 0.268, None, 0.268, None]
    assert table.rows == 5


def test_csv_has_a_line_of_names_and_empty_cells() -> None:
    file = io.StringIO()
    write_csv([table_of(rows_of(capture_of(drive(0)), P2OS), P2OS)], file)
    names, cells = (line.split(",") for line in file.getvalue().splitlines())
    assert names[:7] == ["t_s", "dir", "type", "name", "valid", "moving", "x_m"]
    assert cells[:7] == ["0.0", "r2c", "50", "SIP", "True", "False", "0.0"]


def test_only_sips_are_chosen_unless_told() -> None:
    rows = list(rows_of(read_file(GOLDEN), P2OS))
    sips = Sips()
    sips.add(rows)
    assert sips.at_ns == [row.at_ns for row in rows if row.name == "SIP" and row.is_sip]
    assert len(sips.payloads) == len(sips.at_ns)


def test_parquet_arrow_and_csv_hold_the_same(tmp_path: Path, capsys: Capture) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    feather = pytest.importorskip("pyarrow.feather")
    for ending in ("csv", "parquet", "arrow", "feather"):
        assert run(["export", str(GOLDEN), str(tmp_path / f"talk.{ending}")]) == 0
    assert capsys.readouterr().err == "76 packets\n" * 4
    table = parquet.read_table(tmp_path / "talk.parquet")
    assert table == feather.read_table(tmp_path / "talk.arrow")
    lines = (tmp_path / "talk.csv").read_text().splitlines()
    assert lines[0].split(",") == table.column_names
    assert len(lines) == 1 + table.num_rows
    assert (tmp_path / "talk.feather").read_bytes() == (tmp_path / "talk.arrow").read_bytes()


@pytest.mark.parametrize("ending", ["csv", "mcap"])
def test_an_export_is_overwritten_by_force_alone(
    tmp_path: Path, ending: str, capsys: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / f"notes.{ending}"
    target.write_text("what a person wrote\n")
    assert run(["export", str(GOLDEN), str(target)]) == 2
    assert capsys.readouterr().err.startswith(f"p2os: {target} is there already\nhint: another name, or --force")
    assert target.read_text() == "what a person wrote\n"
    pytest.importorskip("mcap")
    assert run(["export", str(GOLDEN), str(target), "--force"]) == 0
    assert target.stat().st_size > 100


def test_mcap_has_a_channel_for_each_name(tmp_path: Path) -> None:
    reader = pytest.importorskip("mcap.reader")
    target = tmp_path / "talk.mcap"
    assert run(["export", str(GOLDEN), str(target)]) == 0
    rows = list(rows_of(read_file(GOLDEN), Reading(profile=Profile.ARCOS, parameters=load_parameters("p2de"))))
    with target.open("rb") as file:
        messages = list(reader.make_reader(file).iter_messages())
    assert len(messages) == len(rows)
    assert {channel.topic for _, channel, _ in messages} >= {"/client/SYNC0", "/robot/SIP", "/client/OPEN"}
    schema, _, message = next(item for item in messages if item[1].topic == "/robot/SIP")
    first = next(row for row in rows if row.name == "SIP")
    assert json.loads(message.data) == {**first.fields, "valid": True}
    assert message.log_time == first.at_ns
    assert json.loads(schema.data)["properties"]["x_m"] == {"type": "number"}


@pytest.mark.parametrize(("ending", "package"), [("parquet", "pyarrow"), ("arrow", "pyarrow"), ("mcap", "mcap.writer")])
def test_a_missing_package_is_one_line_with_the_way_to_get_it(
    ending: str, package: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    assert run(["export", str(GOLDEN), str(tmp_path / f"talk.{ending}")]) == 2
    said = capsys.readouterr().err.splitlines()
    assert said[0] == f"p2os: .{ending} files need {package.split('.', maxsplit=1)[0]}"
    assert said[1] == f"hint: {install_command('export')}, or export to .csv"


def test_csv_goes_to_stdout_and_names_choose_packets(capsys: Capture) -> None:
    assert run(["export", str(GOLDEN), "-", "--only", "vel2,sonar"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "t_s,dir,type,name,valid,argument,unit,right,left"
    assert {line.split(",")[3] for line in lines[1:]} == {"VEL2", "SONAR"}


def test_bad_input_is_one_line_and_a_hint(tmp_path: Path, capsys: Capture) -> None:
    empty = tmp_path / "empty.jsonl"
    empty.write_text(write_recording(capture_of([])))
    for words, said in (
        ([str(GOLDEN), "talk.txt"], "talk.txt: cannot tell the format from '.txt'"),
        ([str(GOLDEN), "talk"], "talk: cannot tell the format from 'no ending'"),
        ([str(GOLDEN), str(tmp_path / "no" / "talk.csv")], "cannot write"),
        ([str(tmp_path / "gone"), "talk.csv"], "cannot read"),
        ([str(empty), "-"], f"{empty} holds no SIP"),
    ):
        assert run(["export", *words]) == 2
        captured = capsys.readouterr()
        assert captured.err.startswith(f"p2os: {said}")
        assert (captured.out, "Traceback" in captured.err) == ("", False)
