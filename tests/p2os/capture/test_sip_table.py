"""A capture's SIPs by columns against the same by rows: names, order and every cell."""

import io
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import cast

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

pytest.importorskip("numpy")

from p2os.capture import Reading, read_file, rows_of
from p2os.capture.cells import Cell
from p2os.capture.chunks import Capture, Chunk, Direction, capture_of
from p2os.capture.columns.sip_table import _rounded, sip_tables
from p2os.capture.sip_columns import LEADING
from p2os.capture.sips import sips_of
from p2os.capture.table import CaptureTable, tables_of, tables_of_sips, write_csv
from p2os.cli.main import run
from p2os.protocol.packets import EncoderPacket, SerauxPacket, SonarReading, StandardSip, packet_frame
from p2os.protocol.profiles import Profile
from p2os.robots.parameters import load_parameters
from simbase.timing import NS_PER_MS, NS_PER_S
from tests.p2os.capture.blocks import blocks_of
from tests.p2os.protocol.drawn_packets import SEEDS, Draw, any_packet, any_sip

GOLDEN = Path(__file__).parents[2] / "golden"
P2DX = Reading(profile=Profile.P2OS, parameters=load_parameters("p2dx"))
ROBOT, CLIENT = Direction.FROM_ROBOT, Direction.TO_ROBOT


def joined(tables: Iterable[CaptureTable]) -> dict[str, list[Cell]]:
    cells: dict[str, list[Cell]] = {}
    rows = 0
    for table in tables:
        for name, column in table.columns.items():
            cells.setdefault(name, [None] * rows).extend(column)
        rows += table.rows
        assert {len(column) for column in cells.values()} == {rows}
    return cells


def lines(table: CaptureTable) -> str:
    file = io.StringIO()
    write_csv([table], file)
    return file.getvalue()


def plain(table: CaptureTable) -> CaptureTable:
    return CaptureTable({name: list(column) for name, column in table.columns.items()})


def same(
    capture: Capture, reading: Reading = P2DX, *, first_rows: int = 4096, block: int = 1 << 20, together: int = 3
) -> dict[str, list[Cell]]:
    blocks = blocks_of(capture.chunks, together)
    ours = joined(sip_tables(blocks, reading, first_rows=first_rows, block=block))
    rows = [row for row in rows_of(capture, reading) if row.direction is not CLIENT and row.is_sip]
    theirs = joined(tables_of(rows, reading, first_rows))
    tables = list(tables_of_sips(sips_of(blocks, reading), reading, first_rows))
    assert joined(tables) == theirs
    assert [lines(table) for table in tables] == [lines(plain(table)) for table in tables]
    for number, row in enumerate(rows if len(rows) <= first_rows else []):
        known = {**row.as_plain(), "t_s": row.at_ns / NS_PER_S, "dir": ROBOT.value}
        assert [theirs[name][number] for name in LEADING] == [known[name] for name in LEADING]
        said = {name: value for name, value in row.fields.items() if name not in {"x_m", "y_m", "sonar_m"}}
        said |= {f"sonar_m_{place}": value for place, value in cast("dict[str, float]", row.fields["sonar_m"]).items()}
        cells = {name: column[number] for name, column in theirs.items() if name not in {*LEADING, "x_m", "y_m"}}
        assert {name: cell for name, cell in cells.items() if cell is not None} == said
    assert list(ours) == list(theirs)
    assert ours == theirs
    assert [[type(cell) for cell in column] for column in ours.values()] == [
        [type(cell) for cell in column] for column in theirs.values()
    ]
    return ours


def sip_bytes(**fields: object) -> bytes:
    return packet_frame(StandardSip(**fields), Profile.P2OS).to_bytes()


WAITS_NS = (0, 1, 100 * NS_PER_MS, 249 * NS_PER_MS, 250 * NS_PER_MS, 400 * NS_PER_MS)


def packet_of(draw: Draw) -> bytes:
    return packet_frame(draw.one_of(any_sip, any_sip, any_packet)(draw), Profile.P2OS).to_bytes()


def part_of(draw: Draw) -> bytes:
    data, cut = packet_of(draw), draw.integer(0, 206)
    return data[cut : max(cut, draw.integer(0, 206))]


@pytest.mark.slow
@given(SEEDS)
@settings(max_examples=60)  # 15 ms each
def test_a_capture_gives_the_same_cells_either_way(seed: int) -> None:
    draw = Draw(seed)
    direction, now = draw.one_of(ROBOT, None), 0
    chunks = [Chunk(at_ns=0, direction=direction, data=sip_bytes())]
    for _ in range(draw.size(9)):
        now += draw.one_of(*WAITS_NS)
        data = draw.one_of(packet_of, part_of, lambda draw: draw.data(6), lambda _: b"\xfa\xfb\xc0")(draw)
        sender = draw.one_of(direction, direction, direction, CLIENT)
        if data:  # no source gives a chunk without bytes, and a block holds none
            chunks.append(Chunk(at_ns=now, direction=sender, data=data))
    reading = Reading(profile=draw.one_of(*Profile), parameters=P2DX.parameters)
    same(
        Capture(chunks=tuple(chunks)), reading, first_rows=draw.one_of(1, 2, 4096), block=draw.one_of(1, 300, 1 << 20),
        together=draw.one_of(1, 2, 3, 100),
    )  # fmt: skip


@pytest.mark.parametrize("name", ["aria_p2de.jsonl", "player_p2de.jsonl"])
def test_a_captured_session_gives_the_same_cells_either_way(name: str) -> None:
    table = same(read_file(GOLDEN / "captures" / name))
    assert len(table["t_s"]) > 20


def test_positions_are_followed_over_the_wrap_and_sonar_has_a_column_a_number() -> None:
    sonar = (SonarReading(3, 2000), SonarReading(1, 1000), SonarReading(3, 2100))
    data = [sip_bytes(raw_x=32760), sip_bytes(raw_x=4, sonar=sonar), sip_bytes(raw_x=32761)]
    table = same(capture_of([(0, ROBOT, part) for part in data]))
    assert table["x_m"] == [-0.00672, 0.00336, -0.00588]
    assert table["sonar_m_3"] == [None, 0.5628, None]
    assert list(table)[-2:] == ["sonar_m_3", "sonar_m_1"]


def test_a_frame_behind_a_false_header_has_the_time_when_that_was_given_up() -> None:
    chunks = [(0, ROBOT, b"\xfa\xfb\xc0" + sip_bytes()), (300 * NS_PER_MS, CLIENT, b"\0")]
    assert same(capture_of(chunks))["t_s"] == [0.3]


def test_it_is_given_up_at_the_robots_own_next_byte() -> None:
    false = b"\xfa\xfb\xc0" + sip_bytes()
    chunks = [(0, ROBOT, false), (300 * NS_PER_MS, ROBOT, sip_bytes()), (NS_PER_S, ROBOT, sip_bytes())]
    assert same(capture_of(chunks))["t_s"] == [0.3, 0.3, 1.0]


@pytest.mark.slow
def test_a_sip_within_a_packet_is_none_wherever_a_block_of_the_capture_ends() -> None:
    within = packet_frame(SerauxPacket(data=bytes(9) + sip_bytes() + bytes(60)), Profile.P2OS).to_bytes()
    for first in range(len(within)):
        chunks = [(0, ROBOT, bytes(first)), *((place, ROBOT, within) for place in range(1, 9))]
        found = same(capture_of([*chunks[first == 0 :], (9, ROBOT, sip_bytes())]), block=1, together=1)
        assert found["t_s"] == [9 / NS_PER_S]


def test_it_is_given_up_at_the_first_byte_of_anyone_once_the_line_was_quiet_for_so_long() -> None:
    waits = (249 * NS_PER_MS, 250 * NS_PER_MS, 251 * NS_PER_MS, 400 * NS_PER_MS)
    chunks = [(0, ROBOT, b"\xfa\xfb\xc0" + sip_bytes()), *((wait, CLIENT, b"\0") for wait in waits)]
    for together in range(1, 6):
        assert same(capture_of(chunks), together=together)["t_s"] == [0.25]


def test_the_silence_begins_with_the_last_chunk_of_a_run() -> None:
    waits = (299 * NS_PER_MS, 349 * NS_PER_MS, 350 * NS_PER_MS)
    chunks = [(0, ROBOT, b"\xfa\xfb\xc0" + sip_bytes()), (100 * NS_PER_MS, ROBOT, b"\1")]
    assert same(capture_of([*chunks, *((wait, CLIENT, b"\0") for wait in waits)]))["t_s"] == [0.35]


@pytest.mark.parametrize(("wait_ns", "count"), [(249 * NS_PER_MS, 2), (250 * NS_PER_MS, 1)])
def test_a_sip_that_is_cut_in_two_is_found_unless_its_rest_comes_too_late(wait_ns: int, count: int) -> None:
    data, chunks, found = sip_bytes(raw_x=7, sonar=(SonarReading(2, 300),)), [], list[float]()
    for place in range(1, len(data)):
        begun_ns = place * NS_PER_S
        chunks += [(begun_ns, ROBOT, data[:place]), (begun_ns + wait_ns, ROBOT, data[place:] + data)]
        found += [(begun_ns + wait_ns) / NS_PER_S] * count
    for together in (1, 2, 3):
        assert same(capture_of(chunks), together=together)["t_s"] == found


@pytest.mark.parametrize("batteries", [(100, 100, 101), (101, 100, 100), (100, 100, 100)])
def test_a_column_whose_cells_are_nearly_alike_has_each_of_its_texts(batteries: tuple[int, ...]) -> None:
    same(capture_of([(0, ROBOT, sip_bytes(raw_battery=battery)) for battery in batteries]))


def test_a_capture_without_sips_has_no_table() -> None:
    packet = packet_frame(EncoderPacket(left_counts=1, right_counts=2), Profile.P2OS).to_bytes()
    assert same(capture_of([(0, ROBOT, packet)])) == {}


def exported(target: Path) -> str:
    source = GOLDEN / "captures" / "player_p2de.jsonl"
    assert run(["export", str(source), str(target)]) == 0
    return target.read_text(encoding="utf-8")


def test_export_writes_the_same_file_by_columns_and_by_rows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    by_hand = exported(tmp_path / "rows.csv")
    monkeypatch.setattr("p2os.cli.captures.export.LARGE_BYTES", 0)
    monkeypatch.setattr("p2os.cli.captures.export.tables_of_sips", None)
    assert exported(tmp_path / "columns.csv") == by_hand


def test_export_of_a_large_capture_works_without_numpy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("p2os.cli.captures.export.LARGE_BYTES", 0)
    monkeypatch.setitem(sys.modules, "p2os.capture.columns.sip_table", None)
    assert exported(tmp_path / "rows.csv").count("\n") > 20


@given(st.lists(st.integers(-(10**9), 10**9), max_size=40))
def test_a_column_is_rounded_as_a_cell_is_at_the_middle_between_two(halves: list[int]) -> None:
    import numpy as np

    values = [half / 2e6 for half in halves]
    assert _rounded(np.array(values, np.float64)).tolist() == [round(value, 6) for value in values]
