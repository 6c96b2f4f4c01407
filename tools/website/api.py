"""Pages of the API, from the docstrings, by pdoc's reading of them."""

import warnings
from collections.abc import Iterator
from importlib import import_module

from pdoc import doc, docstrings

#: The face of each package, then the modules that a program may import beside.
MODULES = (
    "robot_bench", "robot_bench.bench.expectations", "robot_bench.bench.interventions",
    "bluepill_sim", "p2os", "adapter_sim", "simbase",
    "p2os.client", "p2os.client.aio", "p2os.protocol.commands", "p2os.protocol.sip", "p2os.protocol.packets",
    "p2os.protocol.config_packet", "p2os.protocol.odometry", "p2os.protocol.frames", "p2os.protocol.connection",
    "p2os.robots.parameters", "p2os.capture.columns", "p2os.pioneer.serve", "p2os.gamepad", "p2os.errors",
    "p2os.event_log",
)  # fmt: skip
FOLDER = "reference/api"


def undocumented(namespace: doc.Namespace[object]) -> Iterator[str]:
    """Yield the full names of public modules, classes and functions without a docstring."""
    if not namespace.docstring:
        yield namespace.fullname
    for member in public(namespace):
        if isinstance(member, doc.Class):
            yield from undocumented(member)
        elif isinstance(member, doc.Function) and not member.docstring:
            yield member.fullname


def public(namespace: doc.Namespace[object]) -> list[doc.Doc[object]]:
    """Return the members that a program may use."""
    return [member for member in namespace.own_members if not member.name.startswith("_")]


def pages(names: tuple[str, ...] = MODULES) -> tuple[dict[str, str], list[str]]:
    """Return a page for each module by its place, with one that lists them, and what is wrong with the docstrings."""
    made, wrong = {}, []
    about = "What a program may import, made of the docstrings. [Releases](../../releases.md) says what is public."
    lines = ["# The API", "", about, ""]
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        for name in names:
            module = import_module(name)
            for each in getattr(module, "__all__", ()):  # pdoc looks at what is imported already
                getattr(module, each)
            described = doc.Module(module)
            wrong += [f"{one} has no docstring" for one in undocumented(described)]
            made[f"{FOLDER}/{name}.md"] = page(described)
            lines.append(f"- [`{name}`]({name}.md): {described.docstring.partition(chr(10))[0]}")
    made[f"{FOLDER}/index.md"] = "\n".join(lines) + "\n"
    return made, sorted({*wrong, *(str(warning.message) for warning in caught)})


def page(module: doc.Module) -> str:
    """Return the page of a module."""
    parts = [f"# {module.fullname}", _text(module)]
    for member in public(module):
        parts += _described(member, 2)
    return "\n\n".join(parts) + "\n"


def _described(member: doc.Doc[object], level: int) -> Iterator[str]:
    yield f"{'#' * level} {member.name} {{ #{_anchor(member)} }}"
    yield f"```python\n{_declared(member)}\n```"
    if member.docstring:
        yield _text(member)
    if isinstance(member, doc.Class):
        for below in public(member):
            yield from _described(below, level + 1)


def _anchor(member: doc.Doc[object]) -> str:
    return member.qualname


def _declared(member: doc.Doc[object]) -> str:
    if isinstance(member, doc.Class):
        bases = ", ".join(base[2] for base in member.bases)
        return f"class {member.name}({bases})" if bases else f"class {member.name}"
    if isinstance(member, doc.Function):
        return f"{member.funcdef} {member.name}{member.signature}"
    if isinstance(member, doc.Variable):
        return f"{member.name}{member.annotation_str}{member.default_value_str and ' = ' + member.default_value_str}"
    return member.name


def _text(member: doc.Doc[object]) -> str:
    """Return a docstring as Markdown, the headings of its sections as lines in bold: contents stay short."""
    text = docstrings.convert(member.docstring, "google", member.source_file)
    return "\n".join(f"**{line.lstrip('#').strip()}**" if line.startswith("#") else line for line in text.splitlines())
