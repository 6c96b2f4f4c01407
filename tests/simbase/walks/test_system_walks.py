"""Files, classes and folders of users, connections, signals and installations, each met from every side, as approved."""

# ruff: noqa: E501  # rows of tables stand as they are

import contextlib
import ctypes
import errno
import io
import json
import logging
import os
import random
import re
import signal
import socket
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator, Mapping
from importlib.metadata import EntryPoint
from pathlib import Path
from types import SimpleNamespace
from typing import ClassVar, Protocol
from unittest.mock import patch

import typer

from simbase import entry_points, files, installation
from simbase.c_library import guarded, loaded
from simbase.command_line import program, refused_connections
from simbase.command_line.gdb_option import usual_port
from simbase.command_line.help_pages import Usual, VerbPage, dress
from simbase.command_line.signals import end_on_signals, end_on_suspension, ignore_signals, postponed, restored_signals
from simbase.errors import FileError, MissingDependencyError, P2osError, UsageError
from simbase.interrupts import FATAL, exit_on_signals, held_back, signal_numbers
from simbase.lazy import DeprecatedName, lazily
from simbase.listening import GuardedConnection, GuardedListener, listen_tcp
from simbase.terminal import ReadableBytes, ReadableStream, drawn, readable_stream
from simbase.trust import fingerprint, store
from simbase.trust.code import Code, is_in_file, located, own_code
from simbase.trust.decision import Trust
from simbase.trust.sources import _SourcesOf
from simbase.user_classes import broken, find_class, make, refuse_lacking, source_of, unforeseen
from simbase.user_classes import said as said_of
from tests.tools.suite.acted import Acted, taken
from tests.tools.suite.approved import Trace, judge_of, said, tried


def texts(draw: random.Random) -> Iterator[str]:
    """Read files that are there, are none, are too large, and are no text."""
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        kept = {
            "a": b"one\ntwo\r\nthree\rfour",
            "bom": b"\xef\xbb\xbfx",
            "latin": b"\xe4\n",
            "empty": b"",
            "long": b"x" * 30 + b"\n" + b"y\n",
        }
        for name, data in kept.items():
            (folder / name).write_bytes(data)
        for name in (*kept, "none", "", "a/b", "\0"):
            for most in (2, 4, 18, 19, 20, 33, 1 << 20):
                yield tried(files.read_bytes, folder / name, most=most, hint="try").replace(made, "…")
            yield tried(files.read_text, folder / name, UsageError, hint="try").replace(made, "…")
            yield tried(files.read_text, folder / name, errors="replace").replace(made, "…")
            yield tried(lambda name=name: files.sha256_of(folder / name)[:8]).replace(made, "…")
            for longest, most in ((29, None), (31, None), (100, 31), (100, 32), (100, 33), (3, 5)):
                yield tried(
                    lambda name=name, longest=longest, most=most: [
                        *files.lines_of(folder / name, longest=longest, most=most, hint="try", errors="strict")
                    ]
                ).replace(made, "…")
        for number in (
            errno.ENOENT,
            errno.EISDIR,
            errno.ENOTDIR,
            errno.EACCES,
            errno.ENOSPC,
            errno.EIO,
            errno.EMFILE,
            errno.EROFS,
        ):
            for block in (files.writing, files.reading):
                for hint in (None, "mine"):
                    yield tried(_failing, block, number, hint)
        yield tried(files.open_to_write, folder / "none" / "x").replace(made, "…")
        with files.open_to_write_text(folder / "out") as file:
            file.write("ä\n")
        yield said((folder / "out").read_bytes())
        yield tried(files.write_text, folder, "x").replace(made, "…")
        for name in ("a", "../x", "", "b/../c", "/etc", "b/../../x", "\0"):
            yield tried(lambda name=name: files.refuse_elsewhere(folder, name).name).replace(made, "…")
        yield said([files._size(count) for count in (0, (1 << 20) - 1, 1 << 20, 5 << 20)])


def _failing(block: Callable[..., contextlib.AbstractContextManager[None]], number: int, hint: str | None) -> None:
    with block("place", hint):
        raise OSError(number, "The Words")


class Wanted(Protocol):
    """What a class is to have."""

    size: int

    def go(self) -> None:
        """Go."""


class Sound:
    """Has it all."""

    size = 1

    def go(self) -> None:
        """Go."""


class Lame:
    """Cannot go."""

    go = 5


SOURCES = {
    "good.py": "class A:\n    pass\nB = A\nfrom pathlib import Path\n", "bad.py": "raise ValueError('no')\n", "worse.py": "1 / 0\n", "odd.py": "class (:\n", "exits.py": "raise SystemExit(3)\n",
    "x.so": "", "x.txt": "", "sub/y.py": "", "no-package/z.py": "", "__pycache__/c.py": "", "sub/__pycache__/d.py": "",
}  # fmt: skip


def classes(draw: random.Random) -> Iterator[str]:
    """Load classes of files that are admitted, are not, have changed, and are broken."""
    with (
        tempfile.TemporaryDirectory() as made,
        patch.dict(os.environ, XDG_STATE_HOME=f"{made}/state", XDG_CONFIG_HOME=f"{made}/config"),
        patch.object(sys, "path_hooks", [*sys.path_hooks]),
    ):
        folder = Path(made, "mine")
        for name, text in SOURCES.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text(text)
        yield said([name for name, _ in sorted(fingerprint.importable(folder))])
        yield said(fingerprint.fingerprint_of(folder).sha256)
        for limit in ("MOST_FILES", "MOST_ENTRIES", "MOST_BYTES"):
            for most in (0, 5, 6, 7, 9, 10, 11, 90):
                with patch.object(fingerprint, limit, most):
                    yield tried(lambda: len(fingerprint.fingerprint_of(folder).files)).replace(made, "…")
        yield said([fingerprint.is_package_name(name) for name in ("a", "a-b", "__pycache__", "1a", "")])
        own = [own_code(f"good.py:{kind}", folder) for kind in ("A", "B", "Path", "none", "")]
        own += [own_code(f"{name}.py:A", folder) for name in ("bad", "worse", "odd", "none", "sub/y")]
        for name in (*own, Code(f"{folder}/good.py:A", where="w.toml:3", named="good.py:A"), "good.py:A", "none"):
            yield tried(
                lambda name=name: (
                    find_class(name, what="part", group="simbase.none", known=("one", "two"), absent="more").__name__
                )
            ).replace(made, "…")
        yield said([sys.modules["p2os_part_good"].__name__, "p2os_part_bad" in sys.modules])
        try:
            find_class(own_code("exits.py:A", folder), what="part", group="simbase.none", known=())
        except SystemExit as error:
            yield said(("exits", error.code, "p2os_part_exits" in sys.modules))
        changed = own_code("sub/y.py:A", folder)
        (folder / "sub" / "more.py").write_text("")
        (folder / "sub" / "zzz.py").write_text("")
        yield tried(find_class, changed, what="part", group="simbase.none", known=()).replace(made, "…")
        for name in ("a.py:B", "a.py", "a:b.py:C", ":", "", "tcp:1"):
            yield said((is_in_file(name), located(name, Path("/nowhere")), own_code(name, Path("/nowhere"))))
        code = own[0]
        assert isinstance(code, Code)
        yield said(
            [
                code.kind,
                code.is_there,
                code.is_unread,
                code.key[-9:],
                code.named,
                code.where,
                code.__getnewargs_ex__()[1]["named"],
                [*code.to_plain()],
                code.file.name,
            ]
        )
        bare = Code(f"{folder}/none.py:A")
        yield said([bare.is_there, bare.is_unread, bare.key, bare.to_plain()["files"], Code("\0.py:A").is_there])
        yield from _trusted(folder, code, made)
        finder = _SourcesOf(folder.resolve())
        yield said(
            [finder.holds(f"{folder}{below}") for below in ("", "/sub", "/no-package", "/__pycache__", "/..", "/sub/a")]
        )
    for one, name in ((Sound, "Sound"), (Sound(), "it"), (Lame, "Lame"), (Lame(), "it"), (object(), "it")):
        yield tried(refuse_lacking, one, Wanted, name, "part")
    for raised in (ValueError("v"), KeyError("k"), UsageError("u", hint="h")):
        yield tried(make, lambda raised=raised: (_ for _ in ()).throw(raised).__next__(), "name", "part")
        yield said_of(raised)
    yield said([make(dict, "n", "p", a=1), source_of(dict), len(source_of(Sound))])
    yield said([unforeseen(MemoryError()), unforeseen(MemoryError("NumPy wants more")), unforeseen(KeyError("x"))])
    point = EntryPoint("p", "nothing.at:all", "g")
    yield said((broken(point, KeyError("k")).hint, str(broken(point, KeyError("k")))))
    yield said(usual_port("3"))
    yield said([usual_port("x"), usual_port("")])


def _trusted(folder: Path, code: Code, made: str) -> Iterator[str]:
    """Ask for code to be admitted by everybody who may, and by nobody."""
    name = "good.py:A"
    for trust in (Trust(), Trust(everything=True), Trust(paths=(folder,)), Trust(paths=(folder / "good.py",)), Trust(paths=(folder / "sub",)), Trust(keys=frozenset([code.key])),
                  Trust(only_reads=True), Trust(asks=True), Trust.of(True), Trust.of(False), Trust.of(Trust(everything=True))):  # fmt: skip
        yield tried(
            lambda trust=trust: (trust.admit(name, folder, "w.toml:3: part").rpartition("/")[2], trust.hint)
        ).replace(made, "…")
        yield tried(lambda trust=trust: [trust.admit(other, folder, "w") for other in ("tcp:1", "none.py:A")]).replace(
            made, "…"
        )
    for answer, others in (("y\n", 1), ("YES\n", 1), ("n\n", 1), ("\n", 1)):
        stdin, stderr = io.StringIO(answer), io.StringIO()
        stdin.isatty = stderr.isatty = lambda: True  # type: ignore[method-assign]
        with patch.object(sys, "stdin", stdin), patch.object(sys, "stderr", stderr):
            yield tried(lambda: Trust(asks=True).admit(name, folder, "w.toml:3").rpartition("/")[2]).replace(made, "…")
        yield stderr.getvalue().replace(made, "…")
        kept = Path(made, "state")
        yield said([len(store.answers()), others])
        for path in kept.rglob("*"):
            if path.is_file():
                path.unlink()
    for text in ("", 'trust = ["/a", "~/b"]', "trust = 5", 'trust = ["a"]', "trust = [1]", "trust = [", "other = 1"):
        place = store._place("XDG_CONFIG_HOME", ".config", store.CONFIGURATION)
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_text(text)
        yield (
            tried(lambda: [str(path) for path in store.configured()]).replace(made, "…").replace(str(Path.home()), "~")
        )
        place.unlink()
    answers = store._place("XDG_STATE_HOME", ".local/state", store.ANSWERS)
    answers.parent.mkdir(parents=True, exist_ok=True)
    answers.write_text('{"key": "a"}\nx\n[]\n{"file": "b"}\n{"key": ""}\n')
    yield said(sorted(store.answers()))
    yield said(
        [
            str(store._place("X", "d", Path("f"), {"X": value})).replace(str(Path.home()), "~")
            for value in ("/a", "a", "")
        ]
    )


def connections(draw: random.Random) -> Iterator[str]:
    """Read guarded connections in pieces, peeking and short, that browsers open and others."""
    log = logging.getLogger("p2os.listening")
    with (
        contextlib.redirect_stderr(io.StringIO()) as err,
        refused_connections.shown_refusals("p2os"),
        listen_tcp("127.0.0.1", 0) as listener,
        patch.object(refused_connections.time, "monotonic", lambda: 4.5),
    ):
        for data in (b"GET / HTTP", b"G", b"GEX", b"\xfa\xfb\3", b"", b"\x16\x03\x01", b"\x16\x04", b"PRI * H", b"+$"):
            for size, flags in ((1, 0), (2, 0), (64, 0), (64, socket.MSG_PEEK)):
                one, other = _pair(listener)
                with other:
                    other.sendall(data)
                    other.shutdown(socket.SHUT_WR)
                    with one as guarded_one:
                        guarded_one.settimeout(5.0)
                        yield said(
                            (
                                data,
                                size,
                                flags,
                                [_read(guarded_one, size, flags) for _ in range(5)],
                                guarded_one.gettimeout(),
                            )
                        )
        one, other = _pair(listener)
        with other, one as guarded_one:
            other.sendall(b"\xfaabc")
            buffer = bytearray(3)
            yield said((guarded_one.recv_into(buffer), bytes(buffer), guarded_one.recv_into(buffer, 1), bytes(buffer)))
        with patch.object(refused_connections.time, "monotonic", lambda: 5.5):
            for number in range(8):
                log.warning("one %d", number)
        with patch.object(refused_connections.time, "monotonic", lambda: 6.0):
            log.warning("next")
            log.info("no warning")
    yield re.sub(r"127\.0\.0\.1:\d+", "HERE", err.getvalue())
    with listen_tcp("127.0.0.1", 0, 3) as listener:
        yield said((listener.port > 0, listener.getsockname()[0], listener.family.name))
        yield tried(lambda: listen_tcp("127.0.0.1", 70000))


def _pair(listener: GuardedListener) -> tuple[GuardedConnection, socket.socket]:
    """Return both ends of a connection of this machine."""
    other = socket.create_connection(("127.0.0.1", listener.port), timeout=5.0)
    return listener.accept()[0], other


def _read(connection: GuardedConnection, size: int, flags: int) -> object:
    try:
        return connection.recv(size, flags)
    except OSError as error:
        return f"{type(error).__name__}: {error}"


def signals(draw: random.Random) -> Iterator[str]:
    """End by signals, at once, behind what is postponed, and not again while it ends."""
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        with restored_signals():
            signal.signal(signal.SIGHUP, signal.SIG_IGN if number == signal.SIGTERM else signal.SIG_DFL)
            end_on_signals()
            end_on_signals()
            heard = list[str]()
            with patch("simbase.command_line.signals.monotonic_ns", lambda: 10**9):
                heard.append(_raised(lambda number=number: signal.raise_signal(number)))
                heard.append(_raised(lambda: signal.raise_signal(signal.SIGTERM)))
            for now in (10**9 + 3 * 10**9 - 1, 10**9 + 3 * 10**9):
                with patch("simbase.command_line.signals.monotonic_ns", lambda now=now: now):
                    heard.append(_raised(lambda: signal.raise_signal(signal.SIGTERM)))
            yield said((heard, signal.getsignal(signal.SIGHUP) == signal.SIG_IGN))
    with restored_signals():
        end_on_signals()
        end_on_suspension()
        yield said([signal.getsignal(signal.SIGTTOU) == signal.SIG_IGN, callable(signal.getsignal(signal.SIGTSTP))])
        heard = list[str]()

        def postponing() -> None:
            with postponed() as outer:
                with postponed():
                    signal.raise_signal(signal.SIGTERM)
                    heard.append("inner")
                heard.append("outer")
                outer.raise_due()
                heard.append("never")

        heard.append(_raised(postponing))
        heard.append(_raised(lambda: signal.raise_signal(signal.SIGTERM)))
        yield said(heard)
    with restored_signals():
        ignore_signals()
        yield said([signal.getsignal(number) == signal.SIG_IGN for number in signal_numbers(FATAL)])
    with restored_signals():
        signal.signal(signal.SIGINT, signal.default_int_handler)
        end_on_suspension()
        with postponed() as block:
            block.raise_due()
        yield said([signal.getsignal(signal.SIGTSTP) == signal.SIG_DFL])
    yield said([number.name for number in signal_numbers((*FATAL, "SIGNONE"))])


def _raised(action: Callable[[], object]) -> str:
    try:
        action()
    except KeyboardInterrupt as error:
        return f"ends by {error}"
    return "goes on"


def interrupts(draw: random.Random) -> Iterator[str]:
    """Hold interrupts back until work is done, and exit by signals that nobody handles."""
    for raised in (None, KeyboardInterrupt("a"), SystemExit(7), ValueError("v")):
        begun = list[int]()

        def work(raised: BaseException | None = raised, begun: list[int] = begun) -> None:
            begun.append(len(begun))
            if raised is not None and len(begun) < 3:
                raise raised

        try:
            held_back(work)
            ended = "done"
        except BaseException as error:  # noqa: BLE001  # what is raised is shown
            ended = f"{type(error).__name__} {error}"
        yield said((begun, ended))
    with restored_signals():
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
        exit_on_signals()
        yield said([signal.getsignal(signal.SIGHUP) == signal.SIG_IGN])
        try:
            signal.raise_signal(signal.SIGTERM)
        except SystemExit as error:
            yield said(error.code)
    with restored_signals():  # not in a thread
        before = [signal.getsignal(number) for number in signal_numbers(FATAL)]
        thread = threading.Thread(target=lambda: [each() for each in (exit_on_signals, end_on_signals, ignore_signals)])
        thread.start()
        thread.join(5.0)
        yield said([before == [signal.getsignal(number) for number in signal_numbers(FATAL)]])


def pages(draw: random.Random) -> Iterator[str]:
    """Show the pages of a program with verbs in groups, what its words become, and how its process is tuned and ends."""
    heard = list[str]()

    class Filling(VerbPage):
        usual: ClassVar[Mapping[str, Usual]] = {"--gdb": usual_port}

    some = typer.Argument(None, metavar="[ONE TWO]", help="More.")

    def far(
        first: str,
        second: list[str] = some,
        gdb: int = typer.Option(0, "--gdb", help="A port."),
        hidden: bool = typer.Option(False, hidden=True),
    ) -> None:
        """Drive far. And on.

        {program} far x      goes to x and says so, in a line that is longer than a page is wide, of course
        """
        heard.append(said((first, [*(second or ())], gdb, hidden)))

    def near(place: str = typer.Argument("here", help="Where."), other: str = typer.Argument(...)) -> None:
        """Stay near."""
        heard.append(said((place, other)))

    app, below = (
        typer.Typer(help=words, epilog="Ends {program}.", rich_markup_mode=None, add_completion=False)
        for words in ("Of {program}: much.", "Below.")
    )
    app.command(cls=Filling, rich_help_panel="Driving", epilog="See {program}.")(far)
    app.command()(near)
    app.command(hidden=True)(lambda: None)
    below.command("one")(lambda: heard.append("one"))
    below.command("two", rich_help_panel="Driving")(lambda: heard.append("two"))
    app.add_typer(below, name="below")
    dress(app)
    for words in (["--help"], [], ["far", "--help"], ["near", "--help"], ["below"], ["below", "one", "--help"], ["far", "x", "--gdb"], ["far", "x", "--gdb", "7"],
                  ["far", "--gdb", "x"], ["far", "x", "y", "z"], ["near", "a"], ["near", "a", "b"], ["below", "two"], ["far", "x", "--no"]):  # fmt: skip
        with (
            contextlib.redirect_stdout(io.StringIO()) as out,
            contextlib.redirect_stderr(io.StringIO()) as err,
            patch.dict(os.environ, COLUMNS="80"),
        ):
            code = program.run("prog", lambda _: app, words)
        yield said((words, code, heard, out.getvalue(), err.getvalue()))
        heard.clear()
    for is_enabled in (True, False):
        with patch.object(program, "gc", Acted(heard, "gc", isenabled=[is_enabled])):
            program.run("prog", lambda _: app, ["below", "one"])
        yield taken(heard)
    names = ("end_on_signals", "ignore_signals")
    for words in (["a"], ["--trace", "b"], ["b", "--trace"]):
        calls = Acted(heard, "", run=[3])
        with contextlib.ExitStack() as stack:
            for name in names:
                stack.enter_context(patch.object(program, name, getattr(calls, name)))
            try:
                program.main(calls.run, words)
            except SystemExit as error:
                yield said((taken(heard), error.code))
    with contextlib.redirect_stderr(io.StringIO()) as err:
        code = program.report("prog", ValueError("v"), trace=True)
    yield said((code, err.getvalue().splitlines()[:1]))


class OddError(Exception):
    """An error of nobody."""


def reports(draw: random.Random) -> Iterator[str]:
    """Report what may go wrong in a line, and run a small command line."""
    with patch.object(installation, "_pip_install", lambda: "pip install"):
        missing = MissingDependencyError("m", extra="e")
    following = ValueError("a ZIP")
    following.__context__ = MemoryError()
    for error in (UsageError("u\n v", hint="h\n i"), P2osError("p"), FileError("f"), OddError("odd"), ValueError("v"), MemoryError(), MemoryError("more"), following, OSError(errno.ENOSPC, "No Space"),
                  OSError(errno.EIO, "Input/output", "file"), OSError(errno.EMFILE, "Too many"), OSError(errno.ENFILE, "Too many", "x"), OSError(errno.ENOENT, "None", "x"), missing):  # fmt: skip
        with contextlib.redirect_stderr(io.StringIO()) as err:
            code = program.report("prog", error)
        yield said((code, err.getvalue().partition("pip")[0]))
    app = typer.Typer()

    @app.command()
    def go(name: str, count: int = typer.Option(1, "--count", min=1), fails: str = "") -> None:
        if fails:
            raise {
                "user": UsageError("u", hint="h"),
                "bug": OddError("b"),
                "stop": KeyboardInterrupt("SIGTERM"),
                "abort": typer.Abort(),
                "exit": typer.Exit(7),
            }[fails]
        typer.echo(f"{name} {count}")

    @app.command()
    def other() -> None:
        """Do nothing."""

    for words in (["go", "x"], ["go", "x", "--count", "0"], ["go", "x", "--count", "y"], ["go"], ["go", "x", "--cuont", "3"], ["go", "x", "y"], ["gone"], ["other", "--zzz"],
                  *(["go", "x", "--fails", fails] for fails in ("user", "bug", "stop", "abort", "exit"))):  # fmt: skip
        with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:
            code = program.run("prog", lambda _: app, words)
        yield said((words, code, out.getvalue(), err.getvalue()))
    for error in (OSError(errno.ENOSPC, "No Space"), MemoryError(), OddError("o"), OSError(errno.ENOENT, "None")):
        seen = list[str]()
        with (
            patch.object(sys, "unraisablehook", lambda _, seen=seen: seen.append("before")),
            contextlib.redirect_stderr(io.StringIO()) as err,
        ):
            with program._in_a_line("prog"):
                sys.unraisablehook(SimpleNamespace(exc_value=error))  # type: ignore[arg-type]
            yield said((seen, err.getvalue()))


def streams(draw: random.Random) -> Iterator[str]:
    """Write what acts on a terminal, in pieces, drawn over, and of bytes."""
    below = io.StringIO()
    stream = ReadableStream(below)
    for text in ("plain\n", "\x1b[31mred", "\r\x1b[Kdrawn \x1b over", "\r\x1b[2K", "tab\t\r\n", "\u202eback", ""):
        yield said((stream.write(text), below.getvalue()))
    stream.writelines(["a\n", "\x07"])
    again = readable_stream(stream)  # type: ignore[arg-type]
    yield said((below.getvalue(), drawn(stream) is below, drawn(below) is below, drawn(again) is below, stream.closed))  # type: ignore[arg-type]
    pieces = ReadableBytes()
    yield said(
        [
            pieces.take(data, is_end=is_end)
            for data, is_end in ((b"a\xc3", False), (b"\xa4\x1b", False), (b"\xff\xe2\x82", False), (b"", True))
        ]
    )
    for names in ({"json": ("dumps", "loads")}, {}):
        fetch, directory = lazily("simbase", names, {"old": DeprecatedName("json:dumps", "dumps", "9.0")})
        for name in ("dumps", "none", "__version__x"):
            yield tried_any(lambda fetch=fetch, name=name: fetch(name).__name__)  # type: ignore[attr-defined,misc]
        with contextlib.suppress(DeprecationWarning), patch("warnings.warn", lambda *_, **__: None):
            yield said((fetch("old") is json.dumps, sorted(set(directory()) & {"dumps", "old", "__version__"})))
    held = list[object]()
    call = guarded(lambda x: 10 // x, 7, held.append)
    yield said((call(5), call(0), [type(each).__name__ for each in held]))
    library = loaded("libc.so.6", {"abs": "ii", "atoi": "is"}, "the C library", "none")
    yield said(
        (
            library.abs(-5),
            library.atoi(b"42"),
            library.abs.restype is ctypes.c_int32,
            library.atoi.argtypes == [ctypes.c_char_p],
        )
    )


def tried_any(action: Callable[[], object]) -> str:
    try:
        return said(action())
    except AttributeError as error:
        return f"AttributeError: {error}"


class Installed:
    """A distribution, as importlib.metadata gives one."""

    def __init__(
        self,
        name: str,
        version: str,
        home: str,
        *,
        extras: tuple[str, ...] = (),
        requires: tuple[str, ...] = (),
        origin: str | None = None,
    ) -> None:
        self.name, self.version, self.home, self.requires, self.origin = name, version, home, requires, origin
        self.metadata = SimpleNamespace(get_all=lambda key: list(extras) if key == "Provides-Extra" else None)

    def locate_file(self, _path: str) -> str:
        return self.home

    def read_text(self, _name: str) -> str | None:
        return self.origin


#: What pip notes of a checkout that is installed in place.
EDITABLE = '{"url": "file:///checkout", "dir_info": {"editable": true}}'


def installations(draw: random.Random) -> Iterator[str]:
    """Say what is installed, what lacks, and how it is got, of distributions of each sort."""
    one = Installed(
        "p2os",
        "1.2",
        "/site",
        extras=("view", "pad"),
        requires=(
            "typer",
            'pillow; extra == "view"',
            'pygame-ce; python_version < "3.13" and extra == "pad"',
            'robot-bench==1.2; extra == "bench"',
            'robot-bench==1.2; extra == "view"',
        ),
    )
    two = Installed("simbase", "1.1", "/site", requires=("rich",))
    needs = (installation.Need(name="x", kind="plug-in", feature="it", points=("simbase.none",), point="x"), installation.Need(name="typer", kind="package", feature="this"), installation.Need(name="p", kind="package", feature="f", extra="view"),
             installation.Need(name="b", kind="built", feature="b"), installation.Need(name="g", kind="program", feature="g"))  # fmt: skip
    for there in ((), (one,), (two, one)):
        points = [
            SimpleNamespace(name=package, dist=dist, load=lambda: needs)
            for dist in there
            for package in (("p2os", "simbase") if dist is one else ("simbase",))
        ]
        for clear in (installation.installed_distributions, installation.installed_version):
            clear.cache_clear()
        with (
            patch.object(installation, "every_installed_point", lambda _group, points=points: iter(points)),
            patch.object(installation, "_pip_install", lambda: "pip install"),
            patch.object(installation, "_origin", lambda _name: EDITABLE),
        ):
            yield said([dist.name for dist in installation.installed_distributions()])
            yield said(
                [
                    installation.installed_needs(),
                    installation.way_to_plug_in("simbase.none"),
                    installation.way_to_plug_in("other"),
                ]
            )
            yield said((installation.missing_distributions(), installation.doubled_packages()))
            for action in (
                installation.installed_version,
                lambda: installation.package_version("p2os"),
                lambda: installation.package_version("none"),
            ):
                yield tried_missing(action)
            for extra, python in (("", ""), ("view", ""), ("pad", "3.12"), ("pad", "3.13"), ("none", "")):
                yield installation.install_command(extra, python=python).replace(
                    str(Path(installation.__file__).resolve().parents[1]), "CHECKOUT"
                )
            for origin in (
                None,
                "{}",
                '{"url": "file:///a%20b", "dir_info": {}}',
                '{"url": "file:///a", "dir_info": {"editable": true}}',
            ):
                with patch.object(installation, "_origin", lambda _name, origin=origin: origin):
                    yield said([installation.reinstall_command(package) for package in ("", "simbase", "none")])
            with (
                patch.object(installation, "reinstall_command", lambda package="": f"again {package}"),
                patch.object(installation.shutil, "which", lambda _: None),
            ):
                yield said(
                    [installation.way_to_build("simbase.none"), installation.way_to_build("simbase.none", "g++")]
                )
    for clear in (installation.installed_distributions, installation.installed_version):
        clear.cache_clear()
    for origin in (
        "{}",
        "x",
        "[]",
        '{"dir_info": {"editable": true}, "url": "file:///a%20b"}',
        '{"dir_info": {}, "url": "file:///a"}',
        '{"dir_info": {"editable": true}}',
        None,
    ):
        yield said([str(path) for path in entry_points._editable(Installed("a", "1", "/x", origin=origin))])  # type: ignore[arg-type]
    for home in ("/site", "site", "/site/../other"):
        yield said(str(entry_points._home_of(Installed("a", "1", home))))  # type: ignore[arg-type]
    root = Path(installation.__file__).resolve().parents[1]
    for module, folders in (
        ("simbase.files", [root]),
        ("simbase.files", [root / "p2os"]),
        ("none.at.all", [root]),
        ("sys", [root]),
        ("json", [root]),
        ("tests.simbase", [root]),
        ("tests.simbase", [root / "p2os"]),
    ):
        yield said((module, entry_points._package(module), entry_points._is_in(module, folders)))


def tried_missing(action: Callable[[], object]) -> str:
    try:
        return said(action())
    except ImportError as error:
        return f"{type(error).__name__}: {error}"


TRACES: dict[str, Trace] = {
    each.__name__: each
    for each in (texts, classes, connections, signals, interrupts, reports, pages, streams, installations)
}
test_what_was_approved_is_shown = judge_of(__file__, TRACES)
