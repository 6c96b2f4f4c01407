"""Events written for other programs are all there, in order, and come back."""

import json
from dataclasses import fields
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from p2os.cli.main import run as p2os
from robot_bench.events.kinds import KINDS, Event, Note
from robot_bench.recording import event_files
from robot_bench.recording.event_files import write_named_events
from tests.robot_bench.events.test_stream import SAMPLES

events = st.lists(st.one_of(*SAMPLES.values()), max_size=12)
same_folder = settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
OF_NAME = {kind.__name__: kind for kind in KINDS}


def again(row: dict[str, object]) -> Event:
    """Return the event of a row."""
    kind = OF_NAME[str(row["kind"])]
    values = {field.name: row[field.name] for field in fields(kind)}
    for name, value in values.items():
        if name in {"data", "from_master", "from_slave"}:
            values[name] = bytes.fromhex(value) if isinstance(value, str) else value
        elif name == "mm":
            values[name] = tuple(value)  # type: ignore[arg-type] # a list
        elif name == "fields" and isinstance(value, str):
            values[name] = json.loads(value)
    return kind(**values)  # type: ignore[no-any-return] # of one of KINDS


@same_folder
@given(events)
def test_json_lines_hold_every_event(tmp_path: Path, reported: list[Event]) -> None:
    path = tmp_path / "all.jsonl"
    assert write_named_events([("", event) for event in reported], path) == len(reported)
    assert [again(json.loads(line)) for line in path.read_text(encoding="utf-8").splitlines()] == reported


@settings(same_folder, max_examples=40)  # 240 events; a table takes 10 ms
@given(events)
def test_a_parquet_table_holds_every_event(tmp_path: Path, reported: list[Event]) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    path = tmp_path / "all.parquet"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(event_files, "GROUP", 5)
        assert write_named_events([("", event) for event in reported], path) == len(reported)
    assert [again(row) for row in parquet.read_table(path).to_pylist()] == reported


def test_a_run_is_exported_by_a_verb(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lines = [
        '{"k":"meta","scenario":"s","trace":2}',
        '{"k":"event","t":5,"who":"a","what":"b","detail":""}',
        '{"k":"ev',
    ]
    (tmp_path / "trace.jsonl").write_text("\n".join(lines), encoding="utf-8")
    assert p2os(["report", str(tmp_path), "--events", str(tmp_path / "all.jsonl")]) == 0
    assert capsys.readouterr().out == f"{tmp_path / 'all.jsonl'}: 1 events\n"
    assert again(json.loads((tmp_path / "all.jsonl").read_text())) == Note(t=5, who="a", what="b")


@pytest.mark.parametrize(
    ("folder", "name", "says"),
    [(".", "all.csv", "cannot write events as .csv\nhint: .jsonl or .parquet"),
     (".", "none/all.jsonl", "no such file or directory"), ("none", "all.jsonl", "holds no trace.jsonl")],
)  # fmt: skip
def test_what_cannot_be_exported_is_one_line(
    folder: str, name: str, says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "trace.jsonl").write_text('{"k":"meta"}\n', encoding="utf-8")
    assert p2os(["report", str(tmp_path / folder), "--events", str(tmp_path / name)]) == 2
    assert says in capsys.readouterr().err
