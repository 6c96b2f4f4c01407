"""The help of every verb has one form: what it does, as an order to it, and an example that its command line takes.

The verbs are those that the project declares, groups and what stands below them included.
"""

import re
import shlex
from collections.abc import Iterator

import pytest
import typer
from typer.core import TyperCommand, TyperGroup

from simbase.command_line.help_pages import PROGRAM, first_sentence
from simbase.errors import P2osError
from tests.documentation.command_lines import command_line

#: Orders with which a help text may begin; a new one is added here, a noun or a claim is not.
ORDERS = re.compile(
    "Check|Compare|Decode|Draw|Drive|Estimate|Export|Generate|List|Measure|Play|Print|Profile|Rebuild|Record|Reduce|"
    "Run|Search|Send|Serve|Show|Test|Trace|Validate|View|Watch|Write"
)
GROUP = command_line()
Verb = TyperCommand | TyperGroup


def verbs(group: TyperGroup, *path: str) -> Iterator[tuple[tuple[str, ...], Verb]]:
    for name, command in sorted(group.commands.items()):
        assert isinstance(command, Verb)
        yield (*path, name), command
        if isinstance(command, TyperGroup):
            yield from verbs(command, *path, name)


def examples(path: tuple[str, ...], command: Verb) -> list[list[str]]:
    """Return the words of each command line of a help text, without what is said of it."""
    text = f"{command.help}\n{command.epilog}".replace(PROGRAM, f"p2os {path[0]}")
    return [shlex.split(line) for line in re.findall(r"(?m)^ *p2os (.*?)(?: {2,}|$)", text)]


def is_taken(words: list[str], path: tuple[str, ...]) -> bool:
    """Return whether words are of that verb, or one below it, and are such as its arguments and options take."""
    command: Verb = GROUP
    parent, name, rest = None, "p2os", list(words)
    while isinstance(command, TyperGroup) and rest and rest[0] in command.commands:
        parent, name = typer.Context(command, info_name=name, parent=parent), rest.pop(0)
        below = command.commands[name]
        assert isinstance(below, Verb)
        command = below
    try:
        command.make_context(name, rest, parent=parent)
    except Exception as error:
        # typer's own errors of usage have no public name but that of one of them.
        if isinstance(error, (typer.BadParameter.__base__ or typer.BadParameter, P2osError)):
            return False
        raise
    return words[: len(path)] == list(path)


VERBS = [pytest.param(path, command, id=" ".join(path)) for path, command in verbs(GROUP)]


@pytest.mark.parametrize(("path", "command"), VERBS)
def test_help_begins_with_an_order_of_a_line(path: tuple[str, ...], command: Verb) -> None:
    first = first_sentence(command.help)
    assert ORDERS.fullmatch(re.split(r"[ ,:]", first)[0]), first
    assert len(first) <= 66, path
    assert (command.help or "").strip().splitlines()[0] == f"{first}.", path


@pytest.mark.parametrize(("path", "command"), VERBS)
def test_help_has_an_example_that_the_command_line_takes(path: tuple[str, ...], command: Verb) -> None:
    lines = examples(path, command)
    assert any(is_taken(words, path) for words in lines), lines


@pytest.mark.parametrize(
    ("line", "is_good"),
    [
        ("drive tcp:127.0.0.1:8101 --forward 0.5m", True),
        ("drive tcp:127.0.0.1:8101 --forward 0.5", False),  # of what?
        ("drive tcp:127.0.0.1:8101 --backward 0.5m", False),
        ("drive --forward 0.5m", False),
        ("info tcp:127.0.0.1:8101", False),  # another verb
        ("", False),
    ],
)
def test_what_the_command_line_does_not_take_is_no_example(line: str, is_good: bool) -> None:
    assert is_taken(shlex.split(line), ("drive",)) is is_good
