"""Files of users are read within bounds, whatever a name leads to."""

import ast
import errno
import os
import re
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from simbase.errors import FileError, P2osError
from simbase.files import (
    lines_of,
    open_to_write,
    open_to_write_text,
    read_bytes,
    read_text,
    replacing,
    write_text,
    writing,
)
from tests.test_architecture import module_name, sources

READERS: dict[str, Callable[[Path, int], object]] = {
    "bytes": lambda path, most: read_bytes(path, most=most),
    "text": lambda path, most: read_text(path, most=most, errors="replace"),
    "one line": lambda path, most: list(lines_of(path, longest=most)),
    "lines": lambda path, most: list(lines_of(path, longest=64, most=most)),
}


class OtherError(P2osError):
    """One that a caller asks for."""


@pytest.mark.parametrize("reader", READERS)
def test_what_never_ends_is_refused_at_the_bound(reader: str) -> None:
    with pytest.raises(FileError, match="longer than 64 bytes" if reader == "lines" else "larger|longer than 1 MiB"):
        READERS[reader](Path("/dev/zero"), 1 << 20)


@pytest.mark.parametrize("size", [99, 100, 101])
@pytest.mark.parametrize("reader", READERS)
def test_the_bound_is_exact(tmp_path: Path, reader: str, size: int) -> None:
    path = tmp_path / "a"
    path.write_bytes((b"x" * 48 + b"\n" if reader == "lines" else b"").ljust(size, b"x"))
    if size <= 100:
        READERS[reader](path, 100)
    else:
        with pytest.raises(FileError, match="than 100 bytes"):
            READERS[reader](path, 100)


def test_a_sparse_file_is_refused_by_what_it_says_of_itself(tmp_path: Path) -> None:
    path = tmp_path / "sparse"
    with path.open("wb") as file:
        file.truncate(1 << 42)
    with pytest.raises(OtherError, match="larger than 64 MiB"):
        read_bytes(path, OtherError)


@pytest.mark.parametrize("count", [100, 101])
def test_a_fifo_is_read_to_its_end_and_no_further_than_the_bound(tmp_path: Path, count: int) -> None:
    path = tmp_path / "fifo"
    os.mkfifo(path)

    def write() -> None:
        with path.open("wb", buffering=0) as file:
            file.write(bytes(count))

    writer = threading.Thread(target=write)
    writer.start()
    try:
        if count == 100:
            assert read_bytes(path, most=100) == bytes(100)
        else:
            with pytest.raises(FileError, match="larger than 100 bytes"):
                read_bytes(path, most=100)
    finally:
        writer.join()


def test_what_cannot_be_read_is_reported_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "latin").write_bytes(b"caf\xe9")
    for read in (read_text, lambda path: list(lines_of(path, errors="strict"))):
        with pytest.raises(FileError, match="not a text file"):
            read(tmp_path / "latin")
        with pytest.raises(FileError, match="is a directory"):
            read(tmp_path)
        with pytest.raises(FileError, match="no such file"):
            read(tmp_path / "gone")
        with pytest.raises(FileError, match="null"):
            read(tmp_path / "a\0b")


def test_a_text_has_no_mark_and_plain_line_ends(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"\xef\xbb\xbfone\r\ntwo\rthree")
    assert read_text(tmp_path / "a") == "one\ntwo\nthree"
    assert list(lines_of(tmp_path / "a")) == ["one\n", "two\n", "three"]


#: Where else something is read, and why that has a bound of its own.
READ_ELSEWHERE = {
    "simbase.files": "the bounds themselves",
    "simbase.user_classes": "Python's own import has read it",
    "simbase.installation": "of an installed package",
    "simbase.entry_points": "of an installed package",
    "p2os.capture.formats.sources": "a block or a line at a time",
    "bluepill_sim.analysis.waveforms.reading": "its first bytes, to know a format by",
    "p2os.cli.links.ports": "of the kernel",
    "p2os.pioneer.body.bullet.body": "the engine has just written it",
    "robot_bench.adapter": "of this installation",
    "robot_bench.campaign.workers.processes": "of the kernel",
    "robot_bench.firmware.build": "of this installation",
    "robot_bench.cli.project.existing": "its first bytes, to know an ELF by",
    "robot_bench.experiments.drive_files": "one short line, to know a log by",
    "robot_bench.recording.trace": "what this run has written itself",
}
_READS = {"read_text", "read_bytes"}
_WRITING = set("wax+")


def calls(path: Path, names: str) -> list[ast.Call]:
    """Return the calls of a module; none where it has none of the names, so that few are parsed."""
    text = path.read_text(encoding="utf-8")
    nodes = ast.walk(ast.parse(text)) if re.search(names, text) else ()
    return [node for node in nodes if isinstance(node, ast.Call)]


def _reads(path: Path) -> list[str]:
    """Return the calls of a module that read a file whole, or open one to be read; not those of package resources."""
    found = []
    for node in calls(path, r"\b(read_text|read_bytes|open)\b"):
        if not isinstance(node.func, ast.Attribute):
            continue
        owner = ast.unparse(node.func.value)
        if node.func.attr in _READS and "files(" not in owner and "joinpath(" not in owner:
            found.append(f"{owner}.{node.func.attr}")
        modes = [each.value for each in [*node.args, *(key.value for key in node.keywords if key.arg == "mode")]
                 if isinstance(each, ast.Constant) and isinstance(each.value, str)]  # fmt: skip
        is_path = {"encoding", "buffering"} & {key.arg for key in node.keywords} or bool({"r", "rb"} & set(modes))
        if node.func.attr == "open" and is_path and not any(_WRITING & set(mode) for mode in modes):
            found.append(f"{owner}.open")
    return found


def test_no_module_reads_a_file_of_a_users_but_within_the_bounds() -> None:
    found = {module_name(path): reads for path in sources() if (reads := _reads(path))}
    assert {name: reads for name, reads in found.items() if name not in READ_ELSEWHERE} == {}
    assert READ_ELSEWHERE.keys() - found.keys() - {"simbase.files"} == set(), "a row that is not needed"


#: Where else a file is opened to be written, and who tells of what the system has against it.
WRITTEN_ELSEWHERE = {
    "simbase.trust.store": "a line, within `writing`",
    "p2os.cli.captures.capture_files": "tells of it itself, and takes back half a piece",
    "robot_bench.campaign.journal": "each line within `writing`",
    "robot_bench.cli.campaigns.campaign": "must not be there; tells of it itself",
    "robot_bench.cli.sweep": "opened only, within `writing`",
    "robot_bench.cli.project.files": "must not be there; takes back what was written",
    "robot_bench.recording.waveforms": "whole, within its caller's `writing`",
    "bluepill_sim.analysis.waveforms.vcd_writer": "whole, within its caller's `writing`",
    "bluepill_sim.analysis.waveforms.sigrok_writer": "an entry of an archive, within its caller's `writing`",
    "robot_bench.experiments.drive_files": "whole, within `writing`",
    "robot_bench.campaign.variants.mutation.suite": "nothing is kept of it",
}


def _opens_to_write(path: Path) -> bool:
    """Tell whether a module opens a file to write it by itself."""
    for node in calls(path, r"\bopen\b"):
        if getattr(node.func, "attr", "") == "open":
            modes = [each.value for each in node.args if isinstance(each, ast.Constant) and isinstance(each.value, str)]
            if any(len(mode) <= len("w+b") and _WRITING & set(mode) for mode in modes):
                return True
    return False


def test_no_module_opens_a_file_to_write_whose_later_writes_nobody_tells_of() -> None:
    found = {module_name(path) for path in sources() if _opens_to_write(path)}
    assert found - WRITTEN_ELSEWHERE.keys() == set()
    assert WRITTEN_ELSEWHERE.keys() - found == set(), "a row that is not needed"


def test_a_file_that_is_written_for_long_tells_of_a_full_disk_whenever_it_meets_it() -> None:
    file = open_to_write(Path("/dev/full"))
    with pytest.raises(FileError, match="cannot write /dev/full: no space left on device"):
        file.write(bytes(1 << 20))
    file.close()
    text = open_to_write_text(Path("/dev/full"))
    text.write("a line\n")
    with pytest.raises(FileError, match="cannot write /dev/full"):
        text.close()


@pytest.mark.parametrize("kind", [OSError, KeyboardInterrupt, None])
@pytest.mark.parametrize("was_there", [True, False])
def test_a_file_takes_the_place_of_another_only_once_it_is_whole(
    tmp_path: Path, kind: type[BaseException] | None, *, was_there: bool
) -> None:
    path = tmp_path / "a.txt"
    if was_there:
        path.write_text("old", encoding="utf-8")

    def write() -> None:
        with replacing(path) as part:
            part.write_text("ne", encoding="utf-8")
            assert path.exists() is was_there
            if kind is not None:
                raise kind
            part.write_text("new", encoding="utf-8")

    if kind is None:
        write()
    else:
        with pytest.raises(kind):
            write()
    kept = {"a.txt": "old"} if was_there else {}
    assert {each.name: each.read_text() for each in tmp_path.iterdir()} == (kept if kind else {"a.txt": "new"})


def test_what_is_no_plain_file_is_written_itself(tmp_path: Path) -> None:
    link, file = tmp_path / "link", tmp_path / "file"
    link.symlink_to(file)
    with replacing(link) as part:
        part.write_text("new", encoding="utf-8")
    assert link.is_symlink()
    assert file.read_text() == "new"
    with replacing(Path("/dev/null")) as part:
        assert part == Path("/dev/null")


def test_a_place_that_one_may_not_write_to_has_a_hint() -> None:
    with pytest.raises(FileError, match="cannot write x: permission denied") as caught, writing("x"):
        raise OSError(errno.EACCES, os.strerror(errno.EACCES))
    assert caught.value.hint == "name a place that you may write to"
    with pytest.raises(FileError) as caught, writing("x", hint="another"):
        raise OSError(errno.EACCES, os.strerror(errno.EACCES))
    assert caught.value.hint == "another"


@pytest.mark.parametrize("kind", [OSError, KeyboardInterrupt])
def test_a_part_that_cannot_be_removed_hides_no_error(tmp_path: Path, kind: type[BaseException]) -> None:
    def fail(path: Path) -> None:
        with replacing(path) as part:
            part.mkdir()
            raise kind("why")

    with pytest.raises(kind, match="why"):
        fail(tmp_path / "a")


@pytest.mark.parametrize(
    ("number", "hint"), [(errno.EMFILE, "end other programs"), (errno.EIO, "is the disk sound"), (errno.ENOENT, None)]
)
def test_what_keeps_a_file_from_being_read_or_written_has_its_own_hint(
    number: int, hint: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(Path, "open", refuse)
    for act in (read_text, lambda path: list(lines_of(path)), lambda path: write_text(path, "x")):
        with pytest.raises(FileError) as caught:
            act(Path("it"))
        if hint is not None:
            assert str(caught.value.hint).startswith(hint)
        elif act is read_text:
            assert caught.value.hint is None
