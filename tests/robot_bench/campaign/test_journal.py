"""The journal of a campaign: what is damaged, forged or of an earlier version is named, left out and done again."""

import json
import resource
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_bench.campaign import journal as journal_module
from robot_bench.campaign.journal import NAME, Journal, plain_of
from robot_bench.campaign.trial import GoalResult, HullContact, Outcome, TrialVerdict
from simbase.errors import FileError

GOAL = GoalResult(kind="no_collision", wanted="touches nothing", met=False, says="it did", robustness=-0.5, unit="m")
OUTCOME = Outcome(
    verdict=TrialVerdict.FAILED, goals=(GOAL,), blocks=frozenset({0x0800_0100, 0x0800_0200}), way_mm=((0, 0), (5, 7)),
    lines=frozenset({"turn"}), hits=(), failures=("touched",), sha256="ab" * 32, virtual_ns=4_000_000_000,
)  # fmt: skip
KEYS = ("cheap:1", "cheap:2", "full:2")


def written(folder: Path) -> bytes:
    """Write a journal of three lines and return it."""
    kept = Journal(folder)
    add_all(kept)
    kept.close()
    return (folder / NAME).read_bytes()


def add_all(kept: Journal) -> None:
    """Add an outcome for each key."""
    for key in KEYS:
        kept.add(key, OUTCOME, 0.5)


def opened(folder: Path, content: bytes) -> Journal:
    """Return the journal of which this is the file."""
    (folder / NAME).write_bytes(content)
    found = Journal(folder)
    found.close()
    return found


def test_what_was_written_is_read_back(tmp_path: Path) -> None:
    found = opened(tmp_path, written(tmp_path))
    assert [found.get(key) for key in KEYS] == [(OUTCOME, 0.5)] * 3
    assert found.left_out == {}


def forged(line: bytes) -> bytes:
    return line.replace(b'"failed"', b'"passed"')


def older(line: bytes) -> bytes:
    entry = json.loads(line)
    del entry["sum"]
    return json.dumps(entry, separators=(",", ":")).encode()


def of_another_kind(line: bytes, outcome: object = None) -> bytes:
    """Give a line whose checksum holds other content: an outcome that this version does not know."""
    entry = json.loads(line)
    changed = outcome or entry["outcome"] | {"blocks": "AAAA"}
    body = json.dumps({"key": entry["key"], "outcome": changed, "cpu_s": 1}, separators=(",", ":")).encode()
    return journal_module._summed(body)


#: What becomes of a line, and what is said of it.
DAMAGES: dict[str, tuple[Callable[[bytes], bytes], str]] = {
    "forged": (forged, "damaged or changed: its checksum does not hold"),
    "older": (older, "no checksum, as an earlier p2os wrote it"),
    "another kind": (of_another_kind, "what it holds is no outcome"),
    "another type": (lambda line: of_another_kind(line, [1]), "what it holds is no outcome"),
    "no text": (lambda line: line[:20] + b"\xff\x00" + line[22:], "damaged or changed: its checksum does not hold"),
    "empty": (lambda _: b"", "damaged"),
    "cut at its end": (lambda line: line[:-5], "damaged or changed: its checksum does not hold"),
    "cut in its middle": (lambda line: line[: len(line) // 2], "damaged"),
    "nested": (lambda _: b"[" * 100_000, "damaged"),
}


@pytest.mark.parametrize("number", [1, 2, 3])
@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_line_is_named_and_left_out(tmp_path: Path, damage: str, number: int) -> None:
    lines = written(tmp_path).splitlines()
    how, why = DAMAGES[damage]
    lines[number - 1] = how(lines[number - 1])
    found = opened(tmp_path, b"\n".join(lines) + b"\n")
    assert found.left_out == {number: why}
    assert [found.get(key) is None for key in KEYS] == [place == number - 1 for place in range(3)]


@settings(max_examples=100)
@given(st.data())
def test_no_changed_byte_is_believed(tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    folder = tmp_path_factory.getbasetemp()
    whole = _whole(folder)
    place = data.draw(st.integers(0, len(whole) - 1))
    byte = data.draw(st.integers(0, 255))
    found = opened(folder, whole[:place] + bytes([byte]) + whole[place + 1 :])
    for key in KEYS:
        assert found.get(key) in {None, (OUTCOME, 0.5)}
    assert len(found) == 3 - (byte != whole[place]) or byte == ord("\n") or whole[place] == ord("\n")


_WRITTEN: list[bytes] = []


def _whole(folder: Path) -> bytes:
    if not _WRITTEN:
        (folder / "whole").mkdir()
        _WRITTEN.append(written(folder / "whole"))
    return _WRITTEN[0]


@contextmanager
def file_limit(size: int) -> Iterator[None]:
    """Let no file of this process become larger."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_line_that_the_disk_had_no_room_for_is_told_of_and_taken_off(tmp_path: Path) -> None:
    whole = written(tmp_path)
    first = whole.index(b"\n") + 1
    for size in (first - 1, first, first + 1, first + 100, len(whole) - 1):
        (tmp_path / NAME).write_bytes(b"")
        kept = Journal(tmp_path)
        with file_limit(size):
            with pytest.raises(FileError, match=r"cannot write .*: file too large"):
                add_all(kept)
            kept.close()
        assert (tmp_path / NAME).stat().st_size <= size
        found = Journal(tmp_path)
        assert len(found) == whole[:size].count(b"\n")
        assert found.left_out == {}
        found.add(
            "cheap:9", replace(OUTCOME, hits=(HullContact(t=1, what="a post", part="front", x_m=1.0, y_m=2.0),)), 1.0
        )
        found.close()
        assert len(Journal(tmp_path)) == whole[:size].count(b"\n") + 1


def test_what_is_no_journal_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(journal_module, "LONGEST_LINE", 4096)
    (tmp_path / NAME).symlink_to("/dev/zero")
    with pytest.raises(FileError, match="no line of a journal"):
        Journal(tmp_path)


def test_plain_values_are_json() -> None:
    assert json.loads(json.dumps(plain_of(OUTCOME)))["verdict"] == "failed"
