"""How help looks: verbs in groups, each in a line, and metavariables in one style, plain in 80 columns.

`dress` gives every command of an application its page; a verb names its group by
`rich_help_panel` when it is registered.
"""

import inspect
import re
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import ClassVar

import typer
from typer.core import TyperCommand, TyperGroup

#: Stands in help for the words before the verb: the same verbs may be those of several programs.
PROGRAM = "{program}"
#: Of verbs that name no group.
OTHERS = "Others"
#: An example, a gap, and what it does.
_COLUMNS = re.compile(r"^(?P<left> *\S+(?: \S+)*)  +(?P<right>\S.*)$")


#: What an option is given that stands without a value, seen from the word behind it; nothing where that is its value.
Usual = Callable[[str], Sequence[str]]


class VerbPage(TyperCommand):
    """The page of a verb."""

    #: Options that may stand without a value.
    usual: ClassVar[Mapping[str, Usual]] = {}

    def parse_args(self, ctx: typer.Context, args: list[str]) -> list[str]:  # type: ignore[override]  # typer's own class
        """Insert values that are usual."""
        filled = []
        for word, following in pairwise([*args, ""]):
            filled.append(word)
            if word in self.usual:
                filled += self.usual[word](following)
        return super().parse_args(ctx, filled)

    def format_help_text(self, ctx: typer.Context, formatter) -> None:  # type: ignore[no-untyped-def, override]  # noqa: ANN001 - click's or typer's own
        """Write what the help says, no line wider than the page."""
        _write_text(formatter, _called(self.help, (ctx.parent or ctx).command_path))

    def format_epilog(self, ctx: typer.Context, formatter) -> None:  # type: ignore[no-untyped-def, override]  # noqa: ANN001 - click's or typer's own
        """Write what stands at the end, likewise."""
        _write_text(formatter, _called(self.epilog, (ctx.parent or ctx).command_path))

    def collect_usage_pieces(self, ctx: typer.Context) -> list[str]:  # type: ignore[override]  # noqa: ARG002 - typer's own
        """Return what follows the verb: arguments by their metavariables, in brackets where they may be left out."""
        return [*(_usage(argument) for argument in self._arguments()), "[OPTIONS]"]

    def format_options(self, ctx: typer.Context, formatter) -> None:  # type: ignore[no-untyped-def, override]  # noqa: ANN001 - click's or typer's own
        """Write arguments and options."""
        arguments = [(_metavar(argument), _help(argument)) for argument in self._arguments()]
        options = [
            record
            for parameter in self.get_params(ctx)
            if parameter.param_type_name == "option" and (record := parameter.get_help_record(ctx)) is not None
        ]
        for title, rows in (("Arguments", arguments), ("Options", options)):
            if rows:
                with formatter.section(title):
                    formatter.write_dl(rows)

    def _arguments(self) -> list:  # type: ignore[type-arg]  # of click's or typer's own class
        return [parameter for parameter in self.params if parameter.param_type_name == "argument"]


class VerbList(TyperGroup):
    """The page of a command that has others below it, which is what it shows where none of them is named."""

    #: Groups that are listed first, in this order.
    groups: tuple[str, ...] = ()

    def parse_args(self, ctx: typer.Context, args: list[str]) -> list[str]:  # type: ignore[override]
        """Show the page in place of an error where there are no words."""
        bare = not args and not self.invoke_without_command and not ctx.resilient_parsing
        return super().parse_args(ctx, ["--help"] if bare else args)

    def format_help_text(self, ctx: typer.Context, formatter) -> None:  # type: ignore[no-untyped-def, override]  # noqa: ANN001 - click's or typer's own
        """Write what the help says, no line wider than the page."""
        _write_text(formatter, _called(self.help, ctx.command_path))

    def format_epilog(self, ctx: typer.Context, formatter) -> None:  # type: ignore[no-untyped-def, override]  # noqa: ANN001 - click's or typer's own
        """Write what stands at the end, likewise."""
        _write_text(formatter, _called(self.epilog, ctx.command_path))

    def format_commands(self, ctx: typer.Context, formatter) -> None:  # type: ignore[no-untyped-def, override]  # noqa: ANN001 - click's or typer's own
        """Write the verbs, group by group, each with its first sentence."""
        groups: dict[str, list[tuple[str, str]]] = {name: [] for name in self.groups}
        for name in self.list_commands(ctx):
            command = self.get_command(ctx, name)
            if command is not None and not command.hidden:
                panel = getattr(command, "rich_help_panel", None)
                groups.setdefault(panel if isinstance(panel, str) else OTHERS, []).append(
                    (name, first_sentence(command.help))
                )
        groups[OTHERS] = groups.pop(OTHERS, [])  # last
        width = max((len(name) for rows in groups.values() for name, _ in rows), default=0)
        shown = {title: rows for title, rows in groups.items() if rows}
        for title, rows in shown.items():
            with formatter.section("Commands" if len(shown) == 1 else title):
                formatter.write_dl([(f"{name:<{width}}", words) for name, words in rows])


def dress(app: typer.Typer) -> None:
    """Give every command of an application its page, those of packages above as well."""
    if not (isinstance(app.info.cls, type) and issubclass(app.info.cls, VerbList)):
        app.info.cls = VerbList
    for command in app.registered_commands:
        command.cls = VerbPage if command.cls in {None, TyperCommand} else command.cls
    for group in app.registered_groups:
        group.cls = VerbList
        if group.typer_instance is not None:
            dress(group.typer_instance)


def folded(text: str, width: int) -> str:
    """Return a text whose blocks of two columns, examples and what they do, fit: what they do goes below where not."""
    paragraphs = []
    for paragraph in text.split("\n\n"):
        lines = paragraph.splitlines()
        if any(len(line) > width for line in lines):
            lines = [_COLUMNS.sub(r"\g<left>\n      \g<right>", line) for line in lines]
        paragraphs.append("\n".join(lines))
    return "\n\n".join(paragraphs)


def first_sentence(text: str | None) -> str:
    """Return what a verb does, in one line."""
    words = " ".join((text or "").split("\n\n", maxsplit=1)[0].split())
    return words.split(". ", maxsplit=1)[0].removesuffix(".")


def _called(text: str | None, program: str) -> str | None:
    """Return a text in which `{program}` is how the list of its verbs was called."""
    return text and text.replace(PROGRAM, program)


def _write_text(formatter, text: str | None) -> None:  # type: ignore[no-untyped-def]  # noqa: ANN001 - as above
    if text:
        formatter.write_paragraph()
        with formatter.indentation():
            formatter.write_text(folded(inspect.cleandoc(text), formatter.width - formatter.current_indent))


def _usage(argument) -> str:  # type: ignore[no-untyped-def]  # noqa: ANN001 - click's or typer's own class
    words = _metavar(argument)
    if " " in words:  # several words, which say themselves what may be left out
        return words
    words = words if argument.required else f"[{words}]"
    return words if argument.nargs == 1 else f"{words}..."


def _metavar(argument) -> str:  # type: ignore[no-untyped-def]  # noqa: ANN001 - click's or typer's own class
    return str(argument.metavar or argument.name.upper())


def _help(argument) -> str:  # type: ignore[no-untyped-def]  # noqa: ANN001 - click's or typer's own class
    text, default = argument.help or "", argument.default
    return text if default in (None, [], ()) else f"{text}  [default: {default}]"
