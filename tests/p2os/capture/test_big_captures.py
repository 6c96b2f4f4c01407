"""Captures of any length: read, decoded and written while they are read, with a bounded part of them in hand."""

import io
import sys
from collections.abc import Iterator
from typing import BinaryIO, cast

import pytest

from p2os.capture import Chunk, Direction, Reading, open_capture, rows_of, write_pcap
from p2os.capture.chunks import capture_of
from p2os.capture.formats.sources import BLOCK_BYTES
from p2os.capture.sips import sips_of
from p2os.capture.table import FIRST_ROWS, CaptureTable, tables_of_sips, write_csv
from p2os.cli.captures.reading import LOOKED_AT_BYTES, reading_of
from p2os.cli.main import run
from p2os.protocol.packets import SonarReading, StandardSip, packet_frame
from p2os.protocol.profiles import Profile
from p2os.robots.parameters import load_parameters
from tests.p2os.capture.blocks import block_of_chunks

P2DX = Reading(profile=Profile.P2OS, parameters=load_parameters("p2dx"))
SIP = packet_frame(StandardSip(raw_x=5, sonar=(SonarReading(1, 1000),)), Profile.P2OS).to_bytes()
LATE = packet_frame(StandardSip(raw_x=6, sonar=(SonarReading(9, 1000),)), Profile.P2OS).to_bytes()


class Endless(io.RawIOBase):
    """A file that begins somehow and goes on for ever; counts what was read."""

    def __init__(self, head: bytes, rest: bytes) -> None:
        self.read_bytes = 0
        self._parts = iter((head,))
        self._rest = rest * (BLOCK_BYTES // len(rest))

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]  # the base takes any buffer
        data = next(self._parts, self._rest)[: len(buffer)]
        if len(data) == len(buffer):
            data = data[: len(buffer) // len(self._rest) * len(self._rest)] or data
        buffer[: len(data)] = data
        self.read_bytes += len(data)
        return len(data)


RECORD = write_pcap([Chunk(at_ns=0, direction=Direction.FROM_ROBOT, data=SIP)])
LINE = f'{{"t": 0, "dir": "r2c", "hex": "{SIP.hex()}"}}\n'.encode()
KINDS = {
    "raw": (SIP, SIP),
    "pcap": (RECORD, RECORD[24:]),
    "recording": (LINE, LINE),
    "hex": (f"{SIP.hex()}\n".encode(), f"{SIP.hex()}\n".encode()),
}


@pytest.mark.parametrize("kind", KINDS)
def test_the_first_row_of_a_file_without_end_comes_before_more_than_two_blocks_are_read(kind: str) -> None:
    file = Endless(*KINDS[kind])
    row = next(rows_of(open_capture(cast("BinaryIO", file)).chunks, P2DX))
    assert (row.name, row.data) == ("SIP", SIP)
    assert file.read_bytes <= 2 * BLOCK_BYTES


def test_how_to_read_a_capture_is_told_by_its_beginning() -> None:
    file = Endless(SIP, SIP)
    reading, blocks = reading_of(open_capture(cast("BinaryIO", file)).blocks)
    assert reading.profile is Profile.P2OS
    assert file.read_bytes <= LOOKED_AT_BYTES + 3 * BLOCK_BYTES
    assert next(blocks).data.startswith(SIP)


def chunks_of(count: int, taken: list[int]) -> Iterator[Chunk]:
    for number in range(count):
        taken[0] = number
        yield Chunk(at_ns=number * 100_000_000, direction=Direction.FROM_ROBOT, data=SIP)


@pytest.mark.parametrize("by_columns", [False, True])
def test_tables_come_while_chunks_are_read(by_columns: bool) -> None:
    taken, count = [0], 4 * FIRST_ROWS
    if by_columns:
        pytest.importorskip("numpy")
        from p2os.capture.columns.sip_table import sip_tables

        blocks = (block_of_chunks([chunk]) for chunk in chunks_of(count, taken))
        tables = sip_tables(blocks, P2DX, block=FIRST_ROWS * len(SIP))
    else:
        tables = tables_of_sips(sips_of((block_of_chunks([chunk]) for chunk in chunks_of(count, taken)), P2DX), P2DX)
    seen = [(table.rows, taken[0]) for table in tables]
    # Never more than the table in hand, one behind it, and what is not decided yet.
    passed = 0
    for rows, ahead in seen:
        assert ahead - passed <= 2 * FIRST_ROWS + 20
        passed += rows
    assert passed == count


def late(first: bytes = SIP) -> list[CaptureTable]:
    chunks = capture_of([(0, Direction.FROM_ROBOT, data) for data in (first, SIP, LATE)])
    return list(tables_of_sips(sips_of([block_of_chunks(chunks)], P2DX), P2DX, 2))


def test_a_cell_whose_column_the_beginning_did_not_have_stands_in_one_more() -> None:
    file = io.StringIO()
    assert write_csv(late(), file) == 3
    names, *lines = file.getvalue().splitlines()
    assert "sonar_m_9" not in names
    assert names.endswith(",more")
    assert [line.endswith(",") for line in lines[:2]] == [True, True]
    assert lines[2].endswith(',"{""sonar_m_9"": 0.268}"')


def test_a_column_of_the_beginning_stays_where_it_is() -> None:
    tables = late(LATE)
    assert [list(table.columns["sonar_m_9"]) for table in tables] == [[0.268, None], [0.268]]
    assert {tuple(table.columns) for table in tables} == {tuple(tables[0].columns)}
    assert tables[1].columns["more"] == [None]


def test_decode_prints_the_first_line_before_its_input_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    printed: list[str] = []

    class Screen(io.StringIO):
        def write(self, text: str) -> int:
            printed.append(text)
            raise KeyboardInterrupt

    stdin = io.TextIOWrapper(io.BufferedReader(Endless(SIP, SIP)))
    monkeypatch.setattr(sys, "stdin", stdin)
    monkeypatch.setattr(sys, "stdout", Screen())
    assert run(["decode", "-"]) == 130
    assert "SIP" in printed[0]
