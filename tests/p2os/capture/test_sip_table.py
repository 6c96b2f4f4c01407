"""A capture's SIPs by columns against the same by rows: names, order and every cell."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

pytest.importorskip("numpy")

from p2os.capture import Reading, read_file, rows_of
from p2os.capture.chunks import Capture, Chunk, Direction, capture_of
from p2os.capture.columns.sip_table import sip_table
from p2os.capture.table import Table, from_robot, table_of
from p2os.cli.main import run
from p2os.protocol.packets import EncoderPacket, SonarReading, StandardSip, packet_frame
from p2os.protocol.profiles import Profile
from p2os.robots.parameters import load_parameters
from simbase.timing import NS_PER_MS, Nanos
from tests.p2os.protocol.packet_strategies import PACKETS, SIPS

GOLDEN = Path(__file__).parents[2] / "golden"
P2DX = Reading(profile=Profile.P2OS, parameters=load_parameters("p2dx"))
ROBOT, CLIENT = Direction.FROM_ROBOT, Direction.TO_ROBOT


def by_rows(capture: Capture, reading: Reading) -> Table:
    return table_of(from_robot(rows_of(capture, reading)), reading.parameters)


def same(capture: Capture, reading: Reading = P2DX) -> Table:
    ours, theirs = sip_table(capture, reading), by_rows(capture, reading)
    assert ours is not None
    assert list(ours.columns) == list(theirs.columns)
    assert dict(ours.columns) == dict(theirs.columns)
    assert [[type(cell) for cell in column] for column in ours.columns.values()] == [
        [type(cell) for cell in column] for column in theirs.columns.values()
    ]
    return ours


def sip_bytes(**fields: object) -> bytes:
    return packet_frame(StandardSip(**fields), Profile.P2OS).to_bytes()


packets = st.one_of(SIPS, SIPS, PACKETS).map(lambda packet: packet_frame(packet, Profile.P2OS).to_bytes())
cuts = st.tuples(st.integers(0, 206), st.integers(0, 206))
bytes_of_a_chunk = st.one_of(packets, st.builds(lambda data, cut: data[cut[0] : max(cut)], packets, cuts),
                             st.binary(max_size=6), st.just(b"\xfa\xfb\xc0"))  # fmt: skip
waits = st.sampled_from((0, 1, 100 * NS_PER_MS, 249 * NS_PER_MS, 250 * NS_PER_MS, 400 * NS_PER_MS))


@given(st.lists(st.tuples(waits, st.sampled_from((True, True, True, False)), bytes_of_a_chunk), max_size=9),
       st.sampled_from((ROBOT, None)), st.sampled_from(Profile))  # fmt: skip
@settings(deadline=None, max_examples=50)
def test_a_capture_gives_the_same_cells_either_way(
    parts: list[tuple[Nanos, bool, bytes]], direction: Direction | None, profile: Profile
) -> None:
    chunks, now = [Chunk(at_ns=0, direction=direction, data=sip_bytes())], 0
    for wait, is_robot, data in parts:
        now += wait
        chunks.append(Chunk(at_ns=now, direction=direction if is_robot else CLIENT, data=data))
    same(Capture(chunks=tuple(chunks)), Reading(profile=profile, parameters=P2DX.parameters))


@pytest.mark.parametrize("name", ["aria_p2de.jsonl", "player_p2de.jsonl"])
def test_a_captured_session_gives_the_same_cells_either_way(name: str) -> None:
    table = same(read_file(GOLDEN / "captures" / name))
    assert table.rows > 20


def test_positions_are_followed_over_the_wrap_and_sonar_has_a_column_a_number() -> None:
    sonar = (SonarReading(3, 2000), SonarReading(1, 1000), SonarReading(3, 2100))
    data = [sip_bytes(raw_x=32760), sip_bytes(raw_x=4, sonar=sonar), sip_bytes(raw_x=32761)]
    table = same(capture_of([(0, ROBOT, part) for part in data]))
    assert table.columns["x_m"] == [-0.00672, 0.00336, -0.00588]
    assert table.columns["sonar_m_3"] == [None, 0.5628, None]
    assert list(table.columns)[-2:] == ["sonar_m_3", "sonar_m_1"]


def test_a_frame_behind_a_false_header_has_the_time_when_that_was_given_up() -> None:
    chunks = [(0, ROBOT, b"\xfa\xfb\xc0" + sip_bytes()), (300 * NS_PER_MS, CLIENT, b"\0")]
    assert same(capture_of(chunks)).columns["t_s"] == [0.3]


def test_a_capture_without_sips_is_an_empty_table() -> None:
    packet = packet_frame(EncoderPacket(left_counts=1, right_counts=2), Profile.P2OS).to_bytes()
    assert same(capture_of([(0, ROBOT, packet)])).rows == 0


def test_a_capture_with_two_kinds_of_origin_is_left_to_the_rows() -> None:
    assert sip_table(capture_of([(0, ROBOT, sip_bytes()), (0, None, sip_bytes())]), P2DX) is None
    assert sip_table(capture_of([(0, CLIENT, b"\0")]), P2DX) is None


@pytest.mark.no_cover  # it takes times
def test_a_row_takes_as_long_in_a_large_table_as_in_a_small_one() -> None:
    (row,) = from_robot(rows_of(capture_of([(0, ROBOT, sip_bytes())]), P2DX))

    def seconds_a_row(rows: int) -> float:
        began = time.process_time()
        assert table_of([row] * rows, P2DX.parameters).rows == rows
        return (time.process_time() - began) / rows

    assert min(seconds_a_row(8000) for _ in range(2)) < 3 * min(seconds_a_row(500) for _ in range(5))


def exported(target: Path) -> str:
    source = GOLDEN / "captures" / "player_p2de.jsonl"
    assert run(["export", str(source), str(target)]) == 0
    return target.read_text(encoding="utf-8")


def test_export_writes_the_same_file_by_columns_and_by_rows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    by_hand = exported(tmp_path / "rows.csv")
    monkeypatch.setattr("p2os.cli.captures.export.LARGE_BYTES", 0)
    monkeypatch.setattr("p2os.cli.captures.export.table_of", None)
    assert exported(tmp_path / "columns.csv") == by_hand


def test_export_of_a_large_capture_works_without_numpy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("p2os.cli.captures.export.LARGE_BYTES", 0)
    monkeypatch.setitem(sys.modules, "p2os.capture.columns.sip_table", None)
    assert exported(tmp_path / "rows.csv").count("\n") > 20


@pytest.mark.slow
def test_the_benchmark_compares_what_it_times() -> None:
    tool = GOLDEN.parent.parent / "tools" / "bench" / "columns.py"
    done = subprocess.run([sys.executable, str(tool), "--quick", "--json"], capture_output=True, text=True, check=False,
                          timeout=300, env={**os.environ, "PYTHONPATH": str(tool.parent.parent)})  # fmt: skip
    assert done.returncode == 0, done.stderr
    figures = json.loads(done.stdout)
    assert len(figures) == 3
    assert all(row["packets"] > 9_000 and row["columns_packets_a_second"] > 0 for row in figures.values())
