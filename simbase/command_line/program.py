"""A command line: its words run, what went wrong in one line and one hint, an exit code.

Results go to stdout, all else to stderr. An error is one line and one hint.
Exit codes: 0 done, 1 the operation failed, 2 wrong usage, 130 interrupted, by whatever signal.
"""

import contextlib
import difflib
import gc
import os
import sys
import traceback
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import typer

from simbase.command_line.refused_connections import shown_refusals
from simbase.command_line.signals import end_on_signals, ignore_signals, restored_signals
from simbase.files import hint_of, open_to_write, open_to_write_text
from simbase.user_classes import unforeseen

EXIT_FAILED = 1
EXIT_INTERRUPTED = 130

#: Where output goes that nobody takes.
NOWHERE = Path(os.devnull)

#: chosen: objects made between two searches for garbage; a capture's are tuples by the thousand, and none is garbage.
COLLECTED_AFTER = 20_000

MAKE_MEMORY = "end other programs, or ask for less at a time"

#: Makes the application that words are for.
Maker = Callable[[Sequence[str]], typer.Typer]


def main(run_words: Callable[..., int], arguments: Sequence[str] | None = None) -> None:
    """Run a command line and end the process with its exit code.

    Args:
        run_words: Takes the words and `trace`: whether an error shows where in the program it arose. Returns the code.
        arguments: The words; None for the process's own.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    trace = "--trace" in words
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # closed by who called: `p2os world list >&-`
            setattr(sys, name, open_to_write_text(NOWHERE))
    end_on_signals()
    try:
        code = run_words([word for word in words if word != "--trace"], trace=trace)
        ignore_signals()  # a robot that was not released before is when Python ends, and the exit code stands
        sys.exit(code)
    finally:
        _leave_unwritten()


def _leave_unwritten() -> None:
    """Have Python not write once more, as it ends, what could not be written: its exit code would be 120."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (OSError, ValueError):
            with contextlib.suppress(OSError, ValueError), open_to_write(NOWHERE) as nowhere:
                os.dup2(nowhere.fileno(), stream.fileno())


def run(program: str, make_app: Maker, words: Sequence[str], *, trace: bool = False) -> int:
    """Run a command line and return its exit code; signals end it, and are handled as before afterwards.

    Args:
        program: How it was called, which errors begin with.
        make_app: Makes the application.
        words: What follows the program's name.
        trace: Show where in the program an error arose.
    """
    try:
        with restored_signals(), shown_refusals(program), _in_a_line(program) as shown:
            end_on_signals()
            return _run(program, make_app, list(words), shown, trace=trace)
    except KeyboardInterrupt:  # while the last lines were being written
        return EXIT_INTERRUPTED


def report(program: str, error: Exception, *, trace: bool = False, follows: bool = False) -> int:
    """Print on stderr what went wrong and what to try, and return the exit code.

    Our own errors, those of the emulator and those of the option parser carry
    `exit_code`, and a `hint` or a way to get help; anything else is a bug, or
    what a library makes of a refusal that was shown before (`follows`).
    """
    if trace:
        traceback.print_exception(error)
    code = getattr(error, "exit_code", None)
    if isinstance(error, OSError) and (hint := hint_of(error)) is not None:
        _print_error(f"{program}: {_one_line(unforeseen(error))}")
        _print_error(f"hint: {hint}")
        return EXIT_FAILED
    if (memory := _without_memory(error)) is not None:
        _print_error(f"{program}: {_one_line(unforeseen(memory))}")
        _print_error(f"hint: {MAKE_MEMORY}")
        return EXIT_FAILED
    if not isinstance(code, int):
        if follows:
            return EXIT_FAILED
        says = unforeseen(error)
        _print_error(f"{program}: {_one_line(says)}")
        is_bug = says.startswith("this is a bug")
        _print_error(f"hint: run it again with --trace{' and report the output' if is_bug else ''}")
        return EXIT_FAILED
    format_message = getattr(error, "format_message", None)
    if callable(format_message):  # the option parser's
        _print_error(f"{program}: {_usage_message(error, _one_line(format_message())).removesuffix('.')}")
        path = getattr(getattr(error, "ctx", None), "command_path", None)
        _print_error(f"hint: {path or program} --help")
        return code
    _print_error(f"{program}: {_one_line(str(error))}")
    if hint := getattr(error, "hint", None):
        _print_error(f"hint: {_one_line(hint)}")
    return code


@contextlib.contextmanager
def _in_a_line(program: str) -> Iterator[list[BaseException]]:
    """Show what the system refuses to a callback of a library in C, which nobody can catch, as any other such error.

    Yields what was shown so far: the library may then raise an error of its own, which says less.
    """
    before = sys.unraisablehook
    shown: list[BaseException] = []

    def show(unraisable: "sys.UnraisableHookArgs") -> None:
        error = unraisable.exc_value
        if isinstance(error, MemoryError) or (isinstance(error, OSError) and hint_of(error) is not None):
            report(program, error)
            shown.append(error)
        else:
            before(unraisable)

    sys.unraisablehook = show
    try:
        yield shown
    finally:
        sys.unraisablehook = before


def _without_memory(error: BaseException | None) -> MemoryError | None:
    """Return what says that memory was short; other errors may follow from it, as of a ZIP file that cannot end."""
    while error is not None and not isinstance(error, MemoryError):
        error = error.__context__
    return error


def _run(program: str, make_app: Maker, words: list[str], shown: list[BaseException], *, trace: bool) -> int:
    try:
        command = typer.main.get_command(make_app(words))
        if not gc.isenabled():
            gc.freeze()
            gc.set_threshold(COLLECTED_AFTER, 10, 10)
            gc.enable()
        result = command.main(words, prog_name=program, standalone_mode=False)
        sys.stdout.flush()
    except BrokenPipeError:  # nobody reads it any more
        return EXIT_FAILED
    except (KeyboardInterrupt, typer.Abort):
        result = EXIT_INTERRUPTED
    except Exception as error:  # noqa: BLE001 - the one place where every error becomes a line
        return report(program, error, trace=trace, follows=bool(shown))
    if result == EXIT_INTERRUPTED:  # the option parser makes it of a KeyboardInterrupt, too
        _print_error(f"{program}: interrupted")
    return result if isinstance(result, int) else 0


def _usage_message(error: Exception, message: str) -> str:
    """Return what the option parser complains of, beginning with the option or argument that it is about."""
    name = getattr(error, "option_name", None)
    context = getattr(error, "ctx", None)
    if name is not None and context is not None and message.startswith("No such option"):
        options = [
            option for parameter in context.command.params for option in (*parameter.opts, *parameter.secondary_opts)
        ]
        near = difflib.get_close_matches(name, [option for option in options if option.startswith("--")], n=1)
        return f"No such option: {name}" + (f". Did you mean {near[0]}?" if near else "")
    parameter = getattr(error, "param", None)
    if parameter is None or not isinstance(error, typer.BadParameter) or message.startswith("Missing"):
        return message
    is_option = parameter.param_type_name == "option"
    name = max(parameter.opts, key=len) if is_option else parameter.metavar or parameter.name.upper()
    return f"{name} {_one_line(error.message).removeprefix('Value error, ')}"


def _one_line(text: str) -> str:
    return " ".join(text.split())


def _print_error(line: str) -> None:
    with contextlib.suppress(OSError):  # nobody reads it: the exit code remains
        sys.stderr.write(f"{line}\n")
