"""The command line as such: verbs found, errors told in one line and a hint, exit codes."""

import errno
import os
import re
import runpy
import subprocess
import sys
from collections.abc import Callable
from importlib.metadata import EntryPoint
from importlib.resources import files
from pathlib import Path

import pytest
import typer

from p2os.cli import main as cli
from p2os.errors import TransportError
from simbase.command_line.signals import restored_signals
from simbase.errors import FileError, UsageError

GROUP = "p2os.verbs"


def entry(name: str, value: str) -> EntryPoint:
    return EntryPoint(name=name, value=value, group=GROUP)


class Verb:
    """A verb that does what the test says."""

    def __init__(self, act: Callable[[], object]) -> None:
        self.act = act

    def register(self, app: typer.Typer) -> None:
        app.command("act", help="Act.")(self.run)

    def run(self) -> None:
        self.act()


@pytest.fixture
def offer(monkeypatch: pytest.MonkeyPatch) -> Callable[[Callable[[], object]], None]:
    """Offer a verb `act` that runs a function, beside the verb `ports`."""

    class Offered(EntryPoint):
        def load(self) -> object:
            return Verb(acts[0])

    acts: list[Callable[[], object]] = []

    def do(act: Callable[[], object]) -> None:
        acts.append(act)
        found = [Offered("act", "nowhere", GROUP), entry("ports", "p2os.cli.links.ports")]
        monkeypatch.setattr(cli, "verbs", lambda: found)

    return do


def raising(error: BaseException) -> Callable[[], None]:
    def act() -> None:
        raise error

    return act


def following(first: BaseException, error: Exception) -> Exception:
    """Return an error that arose while another was handled."""
    error.__context__ = first
    return error


def test_no_words_show_help_with_every_verb_and_examples(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run([]) == 0
    out = capsys.readouterr().out
    for text in ("serve", "info", "ports", "doctor", "p2os serve", "--trace"):
        assert text in out


def test_the_version_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["--version"]) == 0
    assert capsys.readouterr().out.count(".") == 2


def test_the_version_is_printed_without_loading_a_verb(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cli, "add_verbs", lambda *_: pytest.fail("verbs are loaded"))
    assert cli.run(["--version"]) == 0


@pytest.mark.parametrize(
    ("error", "code", "lines"),
    [
        (
            TransportError("cannot open x: gone", hint="p2os ports"),
            1,
            ["p2os: cannot open x: gone", "hint: p2os ports"],
        ),
        (TransportError("several\n  lines"), 1, ["p2os: several lines"]),
        (FileError("no such file"), 2, ["p2os: no such file"]),
        (OSError(errno.ENOSPC, "No space"), 1, ["p2os: cannot write standard output: no space", "hint: make room"]),
        (OSError(errno.EMFILE, "Many", "x.py"), 1, ["p2os: cannot open x.py: many", "hint: end other programs, or al"]),
        (OSError(errno.EIO, "An error"), 1, ["p2os: cannot read or write a file or standard output: an", "hint: is"]),
        (following(MemoryError(), ValueError("no end")), 1, ["p2os: there is not enough memory", "hint: end other p"]),
        (MemoryError(), 1, ["p2os: there is not enough memory", "hint: end other programs"]),
        (MemoryError("no memory for\n a log"), 1, ["p2os: no memory for a log", "hint: end other programs"]),
        (KeyError("oops"), 1, ["p2os: this is a bug: KeyError: 'oops'", "hint: run it again with --trace and report"]),
    ],
)
def test_an_error_is_one_line_and_one_hint(
    offer: Callable[[object], None], capsys: pytest.CaptureFixture[str], error: Exception, code: int, lines: list[str]
) -> None:
    offer(raising(error))
    assert cli.run(["act"]) == code
    captured = capsys.readouterr()
    assert captured.out == ""
    reported = captured.err.splitlines()
    assert len(reported) == len(lines)
    assert all(line.startswith(wanted) for line, wanted in zip(reported, lines, strict=True))


def test_trace_shows_where_an_error_arose(offer: Callable[[object], None], capsys: pytest.CaptureFixture[str]) -> None:
    offer(raising(TransportError("gone")))
    assert cli.run(["act"], trace=True) == 1
    err = capsys.readouterr().err
    assert "Traceback" in err
    assert err.endswith("p2os: gone\n")


@pytest.mark.parametrize("interruption", [KeyboardInterrupt(), typer.Abort()])
def test_an_interruption_ends_with_130_and_says_so(
    offer: Callable[[object], None], interruption: BaseException, capsys: pytest.CaptureFixture[str]
) -> None:
    offer(raising(interruption))
    assert cli.run(["act"]) == 130
    assert capsys.readouterr().err.endswith("p2os: interrupted\n")


def test_a_verb_can_choose_its_exit_code(offer: Callable[[object], None]) -> None:
    offer(raising(typer.Exit(1)))
    assert cli.run(["act"]) == 1
    offer(lambda: None)


@pytest.mark.parametrize(
    ("words", "message", "hint"),
    [
        (["frob"], "p2os: No such command 'frob'", "hint: p2os --help"),
        (["monitr"], "p2os: No such command 'monitr'. Did you mean 'monitor'?", "hint: p2os --help"),
        (
            ["drive", "tcp:x", "--forwrd", "1m"],
            "p2os: No such option: --forwrd. Did you mean --forward?",
            "hint: p2os drive --help",
        ),
        (["world", "check", "--frob"], "p2os: No such option: --frob", "hint: p2os world check --help"),
        (["--frob"], "p2os: No such option: --frob", "hint: p2os --help"),
        (["ports", "--frob"], "p2os: No such option: --frob", "hint: p2os ports --help"),
        (["info"], "p2os: Missing argument 'URL'", "hint: p2os info --help"),
    ],
)
def test_wrong_usage_ends_with_2(capsys: pytest.CaptureFixture[str], words: list[str], message: str, hint: str) -> None:
    assert cli.run(words) == 2
    reported = capsys.readouterr().err.splitlines()
    assert reported[0].startswith(message)
    assert reported[1] == hint


def test_only_the_verb_that_is_named_is_imported() -> None:
    code = """
import sys
from p2os.cli.main import run
run(["ports", "--json"])
sys.exit("p2os.cli.virtual.serve" in sys.modules)
"""
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, timeout=60)


@pytest.mark.parametrize(
    ("module", "lacking"),
    [("p2os.no_such_module", "p2os.no_such_module"), ("lacks_unicorn", "unicorn_engine_missing")],
)
def test_a_verb_that_cannot_be_imported_says_what_it_lacks_and_others_work(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path, module: str, lacking: str
) -> None:
    (tmp_path / "lacks_unicorn.py").write_text("import unicorn_engine_missing")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(cli, "verbs", lambda: [entry("run", module), entry("ports", "p2os.cli.links.ports")])
    assert cli.run(["--help"]) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert f"run (missing: needs {lacking}" in out
    assert "ports List the serial ports" in out
    assert cli.run(["run", "dodge", "--world", "arena"]) == 2
    assert capsys.readouterr().err == f"p2os: `p2os run` needs {lacking}\nhint: p2os doctor\n"
    assert cli.run(["ports", "--json"]) == 0


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("raise ValueError('no lamp')", "no lamp"),
        ("from p2os import no_such_name", "ImportError: cannot import name 'no_such_name' from 'p2os'"),
        ("x = 1", "AttributeError: module 'broken_verb' has no attribute 'register'"),
        ("def register(app):\n    app.command('half')(print)\n    1 / 0", "ZeroDivisionError: division by zero"),
    ],
)
def test_a_broken_verb_names_its_package_and_others_work(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path, text: str, why: str
) -> None:
    (tmp_path / "broken_verb.py").write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "broken_verb", raising=False)
    monkeypatch.setattr(cli, "verbs", lambda: [entry("lamp", "broken_verb"), entry("ports", "p2os.cli.links.ports")])
    said = "lamp (p2os.verbs) of the package broken_verb cannot be loaded: "
    assert cli.run(["--help"]) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert f"lamp ({said}" in out
    assert "half" not in out
    assert "ports List the serial ports" in out
    assert cli.run(["lamp", "--on"]) == 1
    error = capsys.readouterr().err
    assert error.startswith(f"p2os: {said}{why}")
    assert error.endswith("hint: pip uninstall broken_verb does without it; --trace shows where it fails\n")
    assert cli.run(["ports", "--json"]) == 0


def test_help_shows_each_example_beside_what_it_does_and_each_verb_in_a_group(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    assert cli.run(["--help"]) == 0
    out = capsys.readouterr().out
    examples = [line for line in cli.EPILOG.splitlines() if line.startswith("  p2os ")]
    assert len(examples) > 5
    assert [line for line in examples if not re.search(r"\S {2,}\S", line) or line not in out] == []
    assert "Others:" not in out, "a verb has no group: app.command(rich_help_panel=...), p2os/cli/groups.py"


def test_main_ends_the_process_and_understands_trace_anywhere(
    offer: Callable[[object], None], capsys: pytest.CaptureFixture[str]
) -> None:
    offer(raising(TransportError("gone")))
    with restored_signals(), pytest.raises(SystemExit) as caught:
        cli.main(["act", "--trace"])
    assert caught.value.code == 1
    assert "Traceback" in capsys.readouterr().err


@pytest.mark.skipif(os.name != "posix", reason="pipes close differently elsewhere")
def test_a_reader_that_leaves_early_gets_no_traceback() -> None:
    reader, writer = os.pipe()
    os.close(reader)
    command = [sys.executable, "-m", "p2os", "world", "list"]
    done = subprocess.run(command, stdout=writer, stderr=subprocess.PIPE, timeout=60, check=False)
    os.close(writer)
    assert (done.returncode, done.stderr) == (1, b"")


def test_the_package_runs_as_a_module(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(sys, "argv", ["p2os", "--version"])
    with restored_signals(), pytest.raises(SystemExit) as end:
        runpy.run_path(str(files("p2os") / "__main__.py"), run_name="__main__")
    assert end.value.code in (None, 0)
    assert capsys.readouterr().out.strip()


@pytest.mark.parametrize(("error", "is_in_a_line"), [(OSError(errno.EIO, "An error"), True), (KeyError("x"), False)])
def test_what_is_refused_to_a_callback_in_c_is_one_line(
    offer: Callable[[object], None], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch,
    error: Exception, is_in_a_line: bool,
) -> None:  # fmt: skip
    others: list[object] = []
    monkeypatch.setattr(sys, "unraisablehook", others.append)

    class Falling:
        def __del__(self) -> None:
            raise error

    def act() -> None:
        Falling()

    offer(act)
    assert cli.run(["act"]) == 0
    said = capsys.readouterr().err.splitlines()[:1]
    assert said == (["p2os: cannot read or write a file or standard output: an error"] if is_in_a_line else [])
    assert len(others) == (not is_in_a_line)
    assert sys.unraisablehook == others.append


@pytest.mark.parametrize(
    ("error", "follows", "code", "last"),
    [
        (OSError(errno.EIO, "An error"), RuntimeError("no glyph"), 1, "hint: is the disk sound"),
        (OSError(errno.EIO, "An error"), UsageError("not so"), 2, "p2os: not so"),
        (KeyError("x"), RuntimeError("no glyph"), 1, "hint: run it again with --trace"),
    ],
)
def test_what_a_library_in_c_raises_after_a_refusal_to_its_callback_says_no_more(
    offer: Callable[[object], None], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch,
    error: Exception, follows: Exception, code: int, last: str,
) -> None:  # fmt: skip
    monkeypatch.setattr(sys, "unraisablehook", lambda _: None)

    class Falling:
        def __del__(self) -> None:
            raise error

    def act() -> None:
        Falling()
        raise follows

    offer(act)
    assert cli.run(["act"]) == code
    assert capsys.readouterr().err.splitlines()[-1].startswith(last)
    assert cli.run(["act"], trace=True) == code
    shown = capsys.readouterr().err.splitlines()
    assert "Traceback (most recent call last):" in shown
    assert any(line.endswith(f"{type(follows).__name__}: {follows}") for line in shown)
