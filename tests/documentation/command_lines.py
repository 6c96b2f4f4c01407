"""Command lines of pages held against the command line: verbs, options, and words to choose from."""

import importlib
import re
import shlex
import tomllib
from collections.abc import Iterator
from enum import EnumType

import typer
from typer.core import TyperCommand, TyperGroup, TyperOption

from tests.documentation.page import ROOT

EVERYWHERE = {"-h", "--help", "--trace", "--install-completion", "--show-completion"}
PLACEHOLDER = re.compile(r"…|[^a-z-]*[A-Z…]")


def command_line() -> TyperGroup:
    """Build `p2os` with all verbs that the project declares."""
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    app = typer.Typer(context_settings={"help_option_names": ["-h", "--help"]}, add_completion=False)
    app.callback()(importlib.import_module("p2os.cli.main")._options)
    for module in declared["entry-points"]["p2os.verbs"].values():
        importlib.import_module(module).register(app)
    group = typer.main.get_command(app)
    assert isinstance(group, TyperGroup)
    return group


def options(command: TyperCommand | TyperGroup) -> dict[str, TyperOption]:
    """Return the options of a command by each of their spellings."""
    return {
        spelling: option
        for option in command.params if isinstance(option, TyperOption)
        for spelling in (*option.opts, *option.secondary_opts)
    }  # fmt: skip


def all_options(group: TyperGroup) -> set[str]:
    """Return each spelling of each option of a group and of what stands below it."""
    found = EVERYWHERE | set(options(group))
    for command in group.commands.values():
        found |= all_options(command) if isinstance(command, TyperGroup) else set(options(command))
    return found


def faults(line: str, group: TyperGroup) -> Iterator[str]:
    """Yield what is wrong with a line that begins with `p2os`.

    `a · b`, `a | b` and `a, b` are several verbs; `…` and words in capitals stand for what a reader puts there.
    """
    words = shlex.split(line.partition(" # ")[0])[1:]
    separators = {"·", "|"}
    if separators & set(words):
        head = words[: next(n for n, word in enumerate(words) if word in separators) - 1]
        for verb in (word for word in words[len(head) :] if word not in separators):
            yield from faults(shlex.join(["p2os", *head, verb]), group)
        return
    command: TyperCommand | TyperGroup = group
    while isinstance(command, TyperGroup) and words and not words[0].startswith("-"):
        if PLACEHOLDER.match(words[0]):
            return
        verb = words.pop(0)
        if verb not in command.commands:
            yield f"`{line}`: no verb {verb}"
            return
        command = command.commands[verb]
    yield from option_faults(line, words, options(command))


def option_faults(line: str, words: list[str], known: dict[str, TyperOption]) -> Iterator[str]:
    """Yield what is wrong with the words of a line that follow its verb."""
    while words:
        word, equals, value = words.pop(0).partition("=")
        if not re.match(r"--?[a-z]", word):
            continue
        if word in EVERYWHERE:
            continue
        if word not in known:
            yield f"`{line}`: no option {word}"
            continue
        if not (known[word].is_flag or known[word].count or equals):
            value = words.pop(0) if words else ""  # `--robots` alone names the option
        kind = getattr(getattr(known[word], "type_descriptor", None), "annotation", None)
        choices = [str(member.value) for member in kind] if isinstance(kind, EnumType) else []
        if value and choices and value not in choices and not PLACEHOLDER.match(value):
            yield f"`{line}`: {word} takes {', '.join(choices)}"
