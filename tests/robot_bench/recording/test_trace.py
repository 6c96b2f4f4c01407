"""The trace is sorted, canonical, hashed, and readable after the process was killed."""

import contextlib
import errno
import hashlib
import io
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from p2os.errors import RunFailedError
from robot_bench.events.codec import LAST_NS, TraceError, events_of
from robot_bench.events.kinds import Contact, Note, Verdict
from robot_bench.recording.run_record import read_run, record_of
from robot_bench.recording.trace import MOST_UNSPELLED, TraceWriter
from simbase.errors import FileError

S = 10**9


def chain(text: str) -> str:
    """Return the hash of a trace, by its definition."""
    digest = bytes(32)
    for line in text.splitlines(keepends=True):
        digest = hashlib.sha256(digest + line.encode()).digest()
    return digest.hex()


def note(t: int, what: str = "x") -> Note:
    return Note(t=t, who="adapter", what=what)


def test_first_and_last_line_and_verdicts_are_not_hashed(tmp_path: Path) -> None:
    path = tmp_path / "trace.jsonl"
    trace = TraceWriter(path)
    trace.meta({"version": "1"})
    trace.take([note(0), Verdict(t=0, goal="touches nothing", met=False, says="a wall"), note(0, "y")], 0)
    digest = trace.sha256
    trace.end({"passed": True})
    lines = path.read_text().splitlines(keepends=True)
    assert [json.loads(line)["k"] for line in lines] == ["meta", "event", "verdict", "event", "end"]
    assert digest == chain(lines[1] + lines[3])
    assert [type(event) for event in events_of(lines)] == [Note, Verdict, Note]
    trace.close()


def test_lines_are_made_a_second_at_a_time_and_for_whoever_asks(tmp_path: Path) -> None:
    whole, pieces = TraceWriter(tmp_path / "whole"), TraceWriter(tmp_path / "pieces")
    events = [note(n * S // 1000) for n in range(MOST_UNSPELLED - 2)]
    for trace in (whole, pieces):
        trace.take([], 0)
        trace.take(events, S - 1)
    for number, ask in enumerate(("sha256", "length", "written")):
        pieces.take([note(S - 1, ask)], S - 1)
        reported, text = getattr(pieces, ask), "".join(pieces.lines())
        assert text.count("\n") == len(events) + number + 1
        assert reported == (chain(text) if ask == "sha256" else len(text))
    assert (tmp_path / "whole").read_bytes() == b""
    whole.take([note(S - 1), note(S - 1)], S - 1)  # so many are kept no longer
    assert (tmp_path / "whole").read_text().count("\n") > len(events) // 2  # the rest is in the file's own buffer
    whole.take([note(S, "last")], S)
    assert (tmp_path / "whole").read_text().endswith('"t":1000000000,"what":"last","who":"adapter"}\n')
    whole.take([note(S + 1, "left")], S + 1)
    whole.close()  # as for a run that failed
    assert "left" in (tmp_path / "whole").read_text()
    pieces.close()


def test_a_trace_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"cannot write .*no such file or directory"):
        TraceWriter(tmp_path / "nowhere" / "trace.jsonl")


def test_a_trace_that_cannot_be_read_again_is_one_line_with_a_hint(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    trace = TraceWriter(tmp_path / "t")

    def fail(*_: object, **__: object) -> None:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(Path, "open", fail)
    with pytest.raises(FileError, match=r"cannot read .*input/output error") as found:
        next(trace.lines())
    assert found.value.hint == "is the disk sound, and the terminal still there?"
    monkeypatch.undo()
    trace.close()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full")
def test_a_full_disk_is_one_line() -> None:
    trace = TraceWriter(Path("/dev/full"))
    with pytest.raises(RunFailedError, match="cannot write /dev/full: No space left on device"):
        trace.meta({})
    # From then on, whether there is anything to write or not, and room for it again.
    with contextlib.suppress(OSError):
        trace._file.close()
    trace._file = io.StringIO()
    for again in (partial(trace.take, [], 0), partial(trace.take, [note(3)], 5), partial(trace.meta, {}), trace.flush):
        with pytest.raises(RunFailedError, match="cannot write /dev/full"):
            again()
    trace.close()


def test_a_restored_writer_goes_on_alike() -> None:
    first, second = TraceWriter(), TraceWriter()
    first.take([note(3)], 5)
    second.restore(first.snapshot())
    for trace in (first, second):
        trace.take([note(7), note(9)], 10)
    assert (second.text, second.sha256) == (first.text, first.sha256)


def begun(path: Path | None) -> TraceWriter:
    trace = TraceWriter(path)
    trace.meta({"version": "1"})
    trace.take([note(3, "one"), Verdict(t=4, goal="x", met=True, says="")], 5)
    return trace


def ended(trace: TraceWriter) -> str:
    trace.take([note(7), note(9)], 10)
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


@pytest.mark.parametrize("is_file", [True, False])
def test_a_run_that_goes_back_and_ends_sooner_has_no_rows_of_the_longer_one(is_file: bool, tmp_path: Path) -> None:
    path = tmp_path / "trace" if is_file else None
    trace = begun(path)
    saved = trace.snapshot()
    trace.take([note(n, "of the longer one") for n in range(7, 40)], 40)
    trace.flush()
    trace.restore(saved)
    trace.take([note(7)], 10)
    assert trace.sha256 == chain("".join(line for line in trace.lines() if not line.startswith('{"k": ')))
    assert trace.length == len("".join(trace.lines()))
    assert "longer" not in "".join(trace.lines())
    trace.close()


def test_a_trace_in_memory_goes_on_in_a_file(tmp_path: Path) -> None:
    first = begun(None)
    again = TraceWriter(tmp_path / "trace")
    again.restore(first.snapshot())
    assert ended(again) == ended(first)
    assert (tmp_path / "trace").read_text() == first.text


@pytest.mark.parametrize("change", [lambda data: data[:-3], lambda data: data.replace(b"one", b"two"), lambda _: b""])
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
from robot_bench.events.kinds import Note
from robot_bench.recording.trace import MOST_UNSPELLED, TraceWriter
trace = TraceWriter(Path(sys.argv[1]))
trace.meta({})
for ms in range(0, 2600, 100):
    trace.take([Note(t=ms * 10**6, who="test", what="x")], ms * 10**6)
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


def test_the_largest_time_of_a_run_is_read(tmp_path: Path) -> None:
    for time_ns, is_read in ((0, True), (LAST_NS, True), (LAST_NS + 1, False), (-1, False), (2**63 - 1, False)):
        line = f'{{"k":"pin","net":"a","t":{time_ns},"v":1}}'
        (tmp_path / "trace.jsonl").write_text('{"k":"meta","scenario":"s"}\n' + line + "\n", encoding="utf-8")
        if is_read:
            assert read_run(tmp_path).last_ns == time_ns
        else:
            with pytest.raises(TraceError, match="a damaged line"):
                read_run(tmp_path)


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


def test_a_trace_of_a_later_version_is_refused_in_words(tmp_path: Path) -> None:
    (tmp_path / "trace.jsonl").write_text('{"k":"meta","trace":3}\n', encoding="utf-8")
    with pytest.raises(TraceError, match=r"trace\.jsonl:1: a trace of version 3, and this program reads up to 2"):
        read_run(tmp_path)


def test_a_collision_of_an_old_trace_is_a_contact() -> None:
    old = '{"k":"event","t":5,"who":"body","what":"collision","detail":"\'red box\' at x 1.250 m, y -0.500 m"}\n'
    assert list(events_of([old])) == [Contact(t=5, what="'red box'", x_m=1.25, y_m=-0.5)]
    assert record_of([old]).contacts[0].part == ""


def test_a_trace_of_single_edges_is_read_too() -> None:
    lines = [f'{{"k":"pin","net":"a","t":{t},"v":{v}}}\n' for t, v in ((0, 0), (7, 1), (9, 0))]
    assert record_of(lines).pins == {"a": [(0, 0), (7, 1), (9, 0)]}
