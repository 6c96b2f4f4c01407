"""Write docs/api.md: what programs may import, with signatures and the first line of each docstring.

Usage: python tools/generate_api.py [--check]
"""

import inspect
import sys
from collections.abc import Iterator
from enum import Enum
from importlib import import_module
from pathlib import Path
from types import ModuleType

PAGE = Path(__file__).parents[1] / "docs" / "api.md"
#: Modules of the page, in its order, and what each is for.
MODULES = {
    "p2os.client.robot": "the client, blocking: `from p2os import Robot`",
    "p2os.client.aio": "the client, asyncio",
    "p2os.client": "what the client tells, and what it takes",
    "p2os.protocol.commands": "commands to the robot",
    "p2os.protocol.sip": "the standard packet",
    "p2os.protocol.packets": "every other packet",
    "p2os.protocol.config_packet": "CONFIGpac",
    "p2os.robots.parameters": "robot models",
    "p2os.protocol.odometry": "odometry over any wrap",
    "p2os.protocol.frames": "frames, and the decoder that re-scans",
    "p2os.protocol.connection": "both ends of a session, without a clock",
    "p2os.capture.columns": "captures as columns",
    "p2os.pioneer.serve": "a virtual Pioneer for a test",
    "p2os.gamepad": "the mapping of a game pad",
    "p2os.errors": "what may be raised",
    "bluepill_sim": "the emulated BluePill",
    "adapter_sim": "the adapter's model",
}
HEAD = """# API reference

Made by `tools/generate_api.py` from the docstrings, which say more: units, ranges,
what is raised. Times are nanoseconds unless a name says otherwise.
"""


def first_line(thing: object) -> str:
    """Return the first line of a docstring, fit for a table."""
    return (inspect.getdoc(thing) or "").split("\n", 1)[0].replace("|", "\\|")


def signature(thing: object) -> str:
    """Return the parameters as they are written, without types."""
    try:
        parameters = inspect.signature(thing).parameters.values()  # type: ignore[arg-type]  # classes and functions
    except (TypeError, ValueError):
        return ""
    shown = [p.replace(annotation=inspect.Parameter.empty) for p in parameters if p.name != "self"]
    bare = [p.replace(default=inspect.Parameter.empty) for p in shown]
    names = []
    for whole, name in zip(shown, bare, strict=True):
        simple = isinstance(whole.default, (int, float, str, bytes, bool, type(None)))
        names.append(str(whole) if simple and whole.default is not inspect.Parameter.empty else str(name))
    return f"({', '.join(names)})"


def public_names(module: ModuleType) -> list[str]:
    """Return what the module offers: its `__all__`, else what it defines itself."""
    named = getattr(module, "__all__", None)
    if named is not None:
        return sorted(named)
    return sorted(
        name
        for name, thing in vars(module).items()
        if not name.startswith("_") and getattr(thing, "__module__", None) == module.__name__ and callable(thing)
    )


def members(kind: type) -> Iterator[str]:
    """Yield a line for each public method and property of a class."""
    for name, thing in sorted(inspect.getmembers_static(kind)):
        if name.startswith("_") or isinstance(thing, (int, str, Enum)):
            continue
        if isinstance(thing, property):
            yield f"| `.{name}` | {first_line(thing)} |"
        elif isinstance(thing, (staticmethod, classmethod)):
            yield f"| `.{name}{signature(thing.__func__)}` | {first_line(thing.__func__)} |"
        elif inspect.isfunction(thing):
            yield f"| `.{name}{signature(thing)}` | {first_line(thing)} |"


def section(name: str, purpose: str) -> Iterator[str]:
    """Yield the lines of one module."""
    module = import_module(name)
    yield f"\n## `{name}`: {purpose}\n"
    yield first_line(module)
    for public in public_names(module):
        thing = getattr(module, public)
        if not (inspect.isclass(thing) or inspect.isfunction(thing)):
            continue
        is_enumeration = inspect.isclass(thing) and issubclass(thing, Enum)
        shown = "" if is_enumeration or (inspect.isclass(thing) and issubclass(thing, Exception)) else signature(thing)
        yield f"\n### `{public}{shown}`\n"
        yield first_line(thing)
        rows = [] if is_enumeration or inspect.isfunction(thing) else list(members(thing))
        if rows:
            yield "\n| | |\n|---|---|"
            yield from rows


def page() -> str:
    """Return the whole page."""
    lines = [HEAD]
    for name, purpose in MODULES.items():
        lines += section(name, purpose)
    return "\n".join(lines).rstrip() + "\n"


def main() -> int:
    """Write the page, or tell whether it is up to date."""
    text = page()
    if "--check" in sys.argv:
        if PAGE.read_text(encoding="utf-8") != text:
            print("docs/api.md is not up to date (hint: python tools/generate_api.py)")
            return 1
        return 0
    PAGE.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
