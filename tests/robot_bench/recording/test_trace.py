"""The trace is sorted, canonical, hashed, and readable after the process was killed."""

import hashlib
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from p2os.errors import LocalProtocolError, RunFailedError
from robot_bench.recording.run_record import TraceError, read_run, record_of
from robot_bench.recording.trace import RANKS, TraceWriter, canonical
from simbase.errors import FileError

S = 10**9


def chain(text: str) -> str:
    """Return the hash of a trace, by its definition."""
    digest = bytes(32)
    for line in text.splitlines(keepends=True):
        digest = hashlib.sha256(digest + line.encode()).digest()
    return digest.hex()


def test_a_line_has_one_spelling() -> None:
    assert canonical({"t": 1, "k": "pin", "net": "µ"}) == '{"k":"pin","net":"\\u00b5","t":1}'


@given(
    st.lists(st.tuples(st.integers(0, 40), st.sampled_from(sorted(RANKS)), st.integers(0, 3)), max_size=20), st.data()
)
def test_when_it_is_written_changes_nothing(entries: list[tuple[int, str, int]], data: st.DataObject) -> None:
    entries = sorted(entries, key=lambda entry: entry[0])
    at_once, in_pieces = TraceWriter(), TraceWriter()
    for at, kind, value in entries:
        at_once.add(kind, at, {"v": value})
        in_pieces.add(kind, at, {"v": value})
        if data.draw(st.booleans()):
            in_pieces.write_until(at - 1)
    for trace in (at_once, in_pieces):
        trace.write_until(50)
    assert in_pieces.text == at_once.text
    assert in_pieces.sha256 == at_once.sha256 == chain(at_once.text)
    times = [json.loads(line)["t"] for line in at_once.text.splitlines()]
    assert times == sorted(times)


def test_kinds_of_one_instant_have_a_fixed_order() -> None:
    trace = TraceWriter()
    for kind in sorted(RANKS, reverse=True):
        trace.add(kind, 5, {})
    trace.write_until(5)
    assert [json.loads(line)["k"] for line in trace.text.splitlines()] == sorted(RANKS, key=RANKS.__getitem__)


def test_what_comes_after_its_time_was_written_is_a_bug() -> None:
    trace = TraceWriter()
    trace.write_until(5)
    with pytest.raises(LocalProtocolError, match="at 5 ns comes after 5 ns"):
        trace.add("pins", 5, {})


def test_first_and_last_line_are_not_hashed(tmp_path: Path) -> None:
    path = tmp_path / "trace.jsonl"
    trace = TraceWriter(path)
    trace.meta({"version": "1"})
    trace.add("pins", 0, {"net": "DD1", "v": 0})
    trace.write_until(0)
    digest = trace.sha256
    trace.end({"passed": True})
    lines = path.read_text().splitlines(keepends=True)
    assert [json.loads(line)["k"] for line in lines] == ["meta", "pins", "end"]
    assert digest == chain(lines[1])
    trace.close()


def test_a_trace_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"cannot write .*No such file or directory"):
        TraceWriter(tmp_path / "nowhere" / "trace.jsonl")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full")
def test_a_full_disk_is_one_line() -> None:
    trace = TraceWriter(Path("/dev/full"))
    with pytest.raises(RunFailedError, match="cannot write /dev/full: No space left on device"):
        trace.meta({})
    trace.close()


def test_a_restored_writer_goes_on_alike() -> None:
    first, second = TraceWriter(), TraceWriter()
    first.add("pins", 3, {"v": 1})
    first.add("pins", 9, {"v": 2})
    first.write_until(5)
    second.restore(first.snapshot())
    for trace in (first, second):
        trace.add("pins", 7, {"v": 3})
        trace.write_until(10)
    assert (second.text, second.sha256) == (first.text, first.sha256)


def begun(path: Path | None) -> TraceWriter:
    trace = TraceWriter(path)
    trace.meta({"version": "1"})
    trace.add("pins", 3, {"v": 1})
    trace.add("pins", 9, {"v": 2})
    trace.write_until(5)
    return trace


def ended(trace: TraceWriter) -> str:
    trace.add("pins", 7, {"v": 3})
    trace.write_until(10)
    trace.end({"passed": True})
    return trace.sha256


def test_a_file_goes_on_where_it_stood_and_what_came_after_is_taken_back(tmp_path: Path) -> None:
    first = begun(tmp_path / "trace")
    saved = first.snapshot()
    digest = ended(first)
    whole = (tmp_path / "trace").read_bytes()
    for _ in range(2):
        again = TraceWriter(tmp_path / "trace", goes_on=True)
        again.restore(saved)
        assert ended(again) == digest
        assert (tmp_path / "trace").read_bytes() == whole


def test_a_trace_in_memory_goes_on_in_a_file(tmp_path: Path) -> None:
    first = begun(None)
    again = TraceWriter(tmp_path / "trace")
    again.restore(first.snapshot())
    assert ended(again) == ended(first)
    assert (tmp_path / "trace").read_text() == first.text


@pytest.mark.parametrize(
    "change", [lambda data: data[:-3], lambda data: data.replace(b'"v":1', b'"v":2'), lambda _: b""]
)
def test_a_file_that_is_not_the_one_that_was_begun_is_left_alone(
    tmp_path: Path, change: Callable[[bytes], bytes]
) -> None:
    path = tmp_path / "trace"
    first = begun(path)
    saved = first.snapshot()
    first.flush()
    path.write_bytes(change(path.read_bytes()))
    kept = path.read_bytes()
    with pytest.raises(FileError, match="is not the trace that this run has begun"):
        TraceWriter(path, goes_on=True).restore(saved)
    with pytest.raises(FileError, match="this writer has none"):
        TraceWriter().restore(saved)
    assert path.read_bytes() == kept


KILLED = """
import os, sys
from pathlib import Path
from robot_bench.recording.trace import TraceWriter
trace = TraceWriter(Path(sys.argv[1]))
trace.meta({})
for ms in range(0, 2600, 100):
    trace.add("pose", ms * 10**6, {"x": ms})
    trace.write_until(ms * 10**6)
print("ready", flush=True)
sys.stdin.read()
"""


def test_a_killed_process_leaves_everything_up_to_its_last_whole_second(tmp_path: Path) -> None:
    path = tmp_path / "trace.jsonl"
    process = subprocess.Popen(
        [sys.executable, "-c", KILLED, str(path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    os.kill(process.pid, signal.SIGKILL)
    process.communicate(timeout=60)
    times = [json.loads(line).get("t", -1) for line in path.read_text().splitlines()]
    assert max(times) >= 2 * S


def test_the_largest_time_that_64_bits_hold_is_read(tmp_path: Path) -> None:
    line = f'{{"k":"pin","net":"a","t":{2**63 - 1},"v":1}}'
    (tmp_path / "trace.jsonl").write_text('{"k":"meta","scenario":"s"}\n' + line + "\n", encoding="utf-8")
    assert read_run(tmp_path).last_ns == 2**63 - 1


@pytest.mark.parametrize(
    "line",
    [
        '{"k":"sonar","t":1}',
        '{"k":"wire","t":1,"hex":"zz","dir":"c2r"}',
        '{"k":"obstacle","t":1,"op":"place"}',
        f'{{"k":"pin","net":"a","t":{2**63},"v":1}}',
        f'{{"k":"sonar","t":1,"mm":[{10**400}]}}',
        '{"k":"pin","net":"a","t":0,"v":300}',
        '{"k":"pins","nets":["a","b"],"levels":"0","t":0,"v":1}',
        '{"k":"pins","nets":["a"],"levels":"x","t":0,"v":1}',
        '{"d":"AA==","k":"pins","n":1,"t":5}',
    ],
)
def test_a_damaged_line_is_named_by_its_number(tmp_path: Path, line: str) -> None:
    (tmp_path / "trace.jsonl").write_text('{"k":"meta","scenario":"s"}\n' + line + "\n", encoding="utf-8")
    with pytest.raises(TraceError, match=r"trace\.jsonl:2: a damaged line"):
        read_run(tmp_path)


HEAD = '{"k":"pins","levels":"01","nets":["a","b"],"t":0,"v":1}\n'
#: 100 ns: a; 100 ns: b; 103 ns: a. Two wires: 0 * 2 + 0, 0 * 2 + 1, 3 * 2 + 0.
BLOCK = '{"d":"AAEG","k":"pins","n":3,"t":100}\n'


def test_blocks_are_read_and_toggle_each_wire_from_its_level() -> None:
    record = record_of([HEAD, BLOCK, BLOCK.replace("100", "500")])
    assert record.pins == {"a": [(0, 0), (100, 1), (103, 0), (500, 1), (503, 0)], "b": [(0, 1), (100, 0), (500, 1)]}
    assert record.last_ns == 503


@pytest.mark.parametrize(
    "block",
    [
        BLOCK.replace('"n":3', '"n":2'),
        BLOCK.replace("AAEG", "AAGG"),  # cut within a number
        BLOCK.replace("AAEG", "A"),  # no base64
        BLOCK.replace('"t":100', '"t":-1'),
        BLOCK.replace('"t":100', f'"t":{2**63 - 1}'),
    ],
)
def test_a_damaged_block_is_named_by_its_number(block: str) -> None:
    with pytest.raises(TraceError, match="the trace:2: a damaged line"):
        record_of([HEAD, block])


def test_blocks_of_a_later_version_are_refused_in_words() -> None:
    with pytest.raises(TraceError, match="the trace:1: edges as a later version writes them"):
        record_of([HEAD.replace('"v":1', '"v":2')])


def test_a_trace_that_was_cut_anywhere_within_a_block_is_read_up_to_the_line_before() -> None:
    whole = record_of([HEAD])
    for end in range(len(BLOCK)):
        assert record_of([HEAD, BLOCK[:end]]) == whole


def test_a_trace_of_single_edges_is_read_too() -> None:
    lines = [f'{{"k":"pin","net":"a","t":{t},"v":{v}}}\n' for t, v in ((0, 0), (7, 1), (9, 0))]
    assert record_of(lines).pins == {"a": [(0, 0), (7, 1), (9, 0)]}
