"""Who may import whom, read from the source itself.

The rules are those of ARCHITECTURE.md. A package or module that is not named
here may import only what its package's row allows.
"""

import ast
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("p2os", "bluepill_sim", "adapter_sim", "testbench")
LONGEST_FILE_LINES = 500

#: Modules that no model below the skin may touch: time, ports and threads are passed in.
FORBIDDEN_IN_CORE = {
    "time", "datetime", "socket", "select", "serial", "threading", "asyncio", "subprocess",
    "multiprocessing", "signal", "termios", "pty", "secrets", "uuid",
}  # fmt: skip

#: Longest matching prefix wins. Values: what may be imported beside the standard library and the package itself.
ALLOWED = {
    "p2os": {"construct"},
    "p2os.transport": {"construct", "serial"},
    "p2os.cli": {"construct", "typer", "rich", "click", "serial"},
    "p2os.trace.arrow_files": {"pyarrow"},
    "p2os.trace.mcap_files": {"mcap"},
    "p2os.columns": {"construct", "numpy"},
    "p2os.columns.arrow": {"numpy", "pyarrow"},
    "p2os.pioneer": set(),
    "p2os.pioneer.bullet": {"pybullet", "numpy"},
    "p2os.pioneer.importers": {"yaml", "PIL"},
    "p2os.pioneer.mujoco": {"mujoco", "numpy"},
    "p2os.cli.world_picture": {"matplotlib"},
    "p2os.cli.pad_source": {"pygame"},
    "bluepill_sim": set(),
    "bluepill_sim.cpu": {"unicorn"},
    "bluepill_sim.image": {"elftools", "intelhex"},
    "bluepill_sim.sight.elf_file": {"elftools"},
    "bluepill_sim.sight.line_table": {"elftools"},
    "bluepill_sim.cli": {"typer", "rich", "click"},
    "adapter_sim": {"p2os"},
    "testbench": {"p2os", "bluepill_sim", "adapter_sim", "typer", "rich", "click"},
    "testbench.report": {"p2os", "matplotlib"},
}

#: The skin: what may read a clock, open a port or start a thread.
SKIN = (
    "p2os.transport", "p2os.cli", "p2os.pioneer.host", "p2os.pioneer.served", "p2os.pioneer.fleet",
    "p2os.pioneer.control_line", "p2os.client.engine", "p2os.client.aio", "p2os.client.interrupts",
    "bluepill_sim.cli", "bluepill_sim.console",
    "testbench.cli", "testbench.pacer", "testbench.live", "testbench.report", "testbench.firmware.build",
)  # fmt: skip

#: Within p2os, packages above the core that the core must not import.
ABOVE_CORE = (
    "p2os.__main__",
    "p2os.transport",
    "p2os.cli",
    "p2os.pioneer",
    "p2os.client",
    "p2os.trace",
    "p2os.columns",
)

#: `from p2os import Robot` is fetched on first use: the one look upwards.
FRONT_DOOR = "p2os"


def module_name(path: Path) -> str:
    """Return the dotted name of a source file."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def sources() -> list[Path]:
    """Return every source file of the packages."""
    return sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))


def imports(path: Path) -> set[str]:
    """Return the dotted names that a file imports, wherever in it."""
    return imports_of(module_name(path), path.read_text(encoding="utf-8"), is_package=path.name == "__init__.py")


def imports_of(name: str, text: str, *, is_package: bool = False) -> set[str]:
    """Return the dotted names that a module's text imports."""
    found = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                parent = name.split(".") if is_package else name.split(".")[:-1]
                parent = parent[: len(parent) - node.level + 1]
                base = ".".join([*parent, *([base] if base else [])])
            found |= {base} | {f"{base}.{alias.name}" for alias in node.names if base in PACKAGES}
    return found


def within(name: str, prefix: str) -> bool:
    """Tell whether a module is `prefix` or stands below it."""
    return name == prefix or name.startswith(f"{prefix}.")


def allowed_for(name: str) -> set[str]:
    """Return the row of ALLOWED that judges a module."""
    return ALLOWED[max((prefix for prefix in ALLOWED if within(name, prefix)), key=len)]


def is_skin(name: str) -> bool:
    """Tell whether a module stands above the passive models."""
    return any(within(name, prefix) for prefix in SKIN)


def faults(name: str, targets: set[str]) -> list[str]:
    """Return every import of a module that breaks a rule."""
    package = name.split(".", maxsplit=1)[0]
    result = []
    for target in sorted(targets):
        top = target.split(".")[0]
        if top in FORBIDDEN_IN_CORE and not is_skin(name):
            result.append(f"{name} imports {target}: only the skin may")
        elif top not in sys.stdlib_module_names and top != package and top not in allowed_for(name):
            result.append(f"{name} imports {target}: its row in ALLOWED does not have it")
        in_core = package == "p2os" and name != FRONT_DOOR and not any(within(name, above) for above in ABOVE_CORE)
        if in_core and any(within(target, above) for above in ABOVE_CORE):
            result.append(f"{name} imports {target}: the core stands below it")
    return result


@pytest.mark.parametrize("path", sources(), ids=module_name)
def test_a_module_imports_only_what_its_place_allows(path: Path) -> None:
    assert faults(module_name(path), imports(path)) == []


@pytest.mark.parametrize("path", sources(), ids=module_name)
def test_a_file_is_one_idea_and_opens_with_what_it_is(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert text.count("\n") <= LONGEST_FILE_LINES
    assert not text.strip() or ast.get_docstring(ast.parse(text)), "a module opens with a docstring"


@pytest.mark.parametrize("path", sources(), ids=module_name)
def test_models_print_nothing(path: Path) -> None:
    if is_skin(module_name(path)):
        return
    calls = [node.func.id for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
             if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)]  # fmt: skip
    assert "print" not in calls


def test_nothing_has_a_name_that_says_nothing() -> None:
    assert [path for path in sources() if path.stem in {"utils", "util", "common", "misc", "helpers"}] == []


def test_one_peripheral_never_imports_another() -> None:
    peripherals = {"rcc", "flash", "gpio", "afio", "exti", "usart"}
    for path in (ROOT / "bluepill_sim").rglob("*.py"):
        if path.stem in peripherals:
            others = {target.split(".")[-1] for target in imports(path)} & (peripherals - {path.stem})
            assert others == set(), f"{path.stem} imports {others}: they meet through pins, IRQ lines and the clock"


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("p2os.wire.decoder", "import time"),
        ("p2os.connection", "from p2os.transport import open_url"),
        ("p2os.connection", "from .transport.url import open_url"),
        ("p2os.sip", "import serial"),
        ("p2os.sip", "from p2os.columns import decode"),
        ("p2os.pioneer.kinematic", "import numpy"),
        ("bluepill_sim.gpio", "from p2os.timing import Nanos"),
        ("bluepill_sim.nvic", "import unicorn"),
        ("adapter_sim.adapter", "import testbench.wires"),
    ],
)
def test_the_judge_sees_a_broken_rule(name: str, text: str) -> None:
    assert faults(name, imports_of(name, text)) != []
