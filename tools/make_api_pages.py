"""Make the pages of the API from the docstrings, with pdoc: `make docs`.

Exit code 1 where pdoc warns or a public name has no docstring.
"""

import argparse
import sys
import warnings
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

from pdoc import doc, pdoc, render

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "build" / "api"
#: The face of each package, then the modules that a program may import beside.
MODULES = (
    "robot_bench", "robot_bench.bench.expectations", "robot_bench.bench.interventions",
    "bluepill_sim", "p2os", "adapter_sim", "simbase",
    "p2os.client", "p2os.client.aio", "p2os.protocol.commands", "p2os.protocol.sip", "p2os.protocol.packets",
    "p2os.protocol.config_packet", "p2os.protocol.odometry", "p2os.protocol.frames", "p2os.protocol.connection",
    "p2os.robots.parameters", "p2os.capture.columns", "p2os.pioneer.serve", "p2os.gamepad", "p2os.errors",
    "p2os.event_log",
)  # fmt: skip


def undocumented(namespace: doc.Namespace[object]) -> Iterator[str]:
    """Yield the full names of public modules, classes and functions without a docstring."""
    if not namespace.docstring:
        yield namespace.fullname
    for member in namespace.own_members:
        if member.name.startswith("_"):
            continue
        if isinstance(member, doc.Class):
            yield from undocumented(member)
        elif isinstance(member, doc.Function) and not member.docstring:
            yield member.fullname


def make(folder: Path, names: tuple[str, ...] = MODULES) -> list[str]:
    """Write the pages of some modules into a folder; return what is wrong with them, a line each."""
    for name in names:
        module = import_module(name)
        for public in getattr(module, "__all__", ()):  # pdoc looks at what is imported already
            getattr(module, public)
    render.configure(docformat="google", show_source=False)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        pdoc(*names, output_directory=folder)
        missing = [f"{one} has no docstring" for name in names for one in undocumented(doc.Module(import_module(name)))]
    return sorted({*missing, *(str(warning.message) for warning in caught)})


def main() -> int:
    """Make the pages, and tell what is wrong."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path, nargs="?", default=FOLDER, help="where to (default: build/api)")
    folder: Path = parser.parse_args().folder
    wrong = make(folder)
    print(*wrong, f"open {folder / 'index.html'}", sep="\n")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
