"""Who may import whom, read from the source itself.

The rules are those of ARCHITECTURE.md. A package or module that is not named
here may import only what its package's row allows.
"""

import ast
import re
import shutil
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path, PurePosixPath

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("simbase", "p2os", "bluepill_sim", "adapter_sim", "robot_bench")

#: What every package may import.
BASE = "simbase"

#: Modules that no model below the I/O layer may touch: time, ports and threads are passed in.
FORBIDDEN_IN_CORE = {
    "time", "datetime", "socket", "select", "serial", "threading", "asyncio", "subprocess",
    "multiprocessing", "signal", "termios", "pty", "secrets", "uuid",
}  # fmt: skip

#: Longest matching prefix wins. Values: what may be imported beside the standard library and the package itself.
ALLOWED = {
    "simbase": set(),
    "p2os": {"construct"},
    "simbase.installation": {"packaging"},
    "simbase.command_line": {"typer"},
    "p2os.transport": {"construct", "serial"},
    "p2os.cli": {"construct", "typer", "rich", "click", "serial"},
    "p2os.capture.formats.pcap_bulk": {"numpy"},
    "p2os.capture.formats.recording_bulk": {"numpy"},
    "p2os.capture.formats.arrow_files": {"pyarrow"},
    "p2os.capture.formats.mcap_files": {"mcap"},
    "p2os.capture.columns": {"construct", "numpy"},
    "p2os.capture.columns.arrow": {"numpy", "pyarrow"},
    "p2os.pioneer": set(),
    "p2os.pioneer.body.bullet": {"pybullet", "numpy"},
    "p2os.pioneer.world.formats": {"yaml", "PIL"},
    "p2os.pioneer.body.mujoco": {"mujoco", "numpy"},
    "p2os.cli.robots.pad_source": {"pygame"},
    "p2os.cli.captures.render": {"typer", "PIL"},
    "p2os.view": {"construct"},
    "p2os.view.server": {"starlette"},
    "p2os.view.server.serving": {"uvicorn"},
    "p2os.ros.bags": {"rosbags"},
    "p2os.ros.message_table": {"rosbags"},
    "p2os.ros.codec": {"cyclonedds"},
    "p2os.ros.dds": {"cyclonedds"},
    "p2os.ros.zenoh_node": {"zenoh"},
    "bluepill_sim": set(),
    "bluepill_sim.core.unicorn_core": {"unicorn"},
    "bluepill_sim.program.image": {"elftools", "intelhex"},
    "bluepill_sim.program.elf_file": {"elftools"},
    "bluepill_sim.program.line_table": {"elftools"},
    "bluepill_sim.program.variables": {"elftools"},
    "bluepill_sim.cli": {"typer", "rich", "click"},
    "bluepill_sim.__main__": {"typer"},
    "adapter_sim": {"p2os"},
    "robot_bench": {"p2os", "bluepill_sim", "adapter_sim", "typer", "rich", "click"},
    "robot_bench.drives": {"p2os", "numpy"},
    "robot_bench.view": {"p2os", "adapter_sim", "bluepill_sim"},
    "robot_bench.report": {"p2os", "matplotlib"},
    "robot_bench.report.edge_picture": {"bluepill_sim", "matplotlib"},
    "robot_bench.report.explain": {"p2os", "bluepill_sim", "adapter_sim"},
    "robot_bench.recording.event_files": {"p2os", "pyarrow"},
    "robot_bench.live": {"adapter_sim", "foxglove"},
    "robot_bench.experiments": {"p2os", "numpy", "scipy"},
    "robot_bench.experiments.pictures": {"matplotlib"},
    "robot_bench.experiments.sensitivity": {"p2os", "numpy", "SALib"},
    "robot_bench.experiments.validation": {"p2os", "adapter_sim"},
    "robot_bench.cli.pytest_plugin": {"p2os", "bluepill_sim", "pytest"},
    "robot_bench.campaign.variants.mutation.suite": {"bluepill_sim", "pytest"},
    "robot_bench.campaign.results": {"pyarrow"},
    "robot_bench.campaign.workers.dask_workers": {"p2os", "distributed"},
}

#: The I/O layer: what may read a clock, open a port or start a thread.
IO_LAYER = (
    "p2os.__main__", "p2os.transport", "p2os.cli", "p2os.pioneer.serve.host", "p2os.pioneer.serve.background_host",
    "p2os.pioneer.serve.fleet", "p2os.pioneer.body.outside.connection",
    "p2os.pioneer.serve.control_line", "p2os.client.robot_thread", "p2os.client.robot_loop", "simbase.interrupts",
    "simbase.command_line",
    "simbase.listening",
    "p2os.ros.zenoh_node", "p2os.view.server",
    "bluepill_sim.cli", "bluepill_sim.cli.console", "bluepill_sim.__main__",
    "robot_bench.cli", "robot_bench.campaign.workers",
    "robot_bench.campaign.variants.shrinking.kept", "robot_bench.running.forks", "robot_bench.running.pacer",
    "robot_bench.live", "robot_bench.origin_gate", "robot_bench.report", "robot_bench.firmware.build",
)  # fmt: skip

#: What may log beside the I/O layer: what joins models to lines, and the bench. A model tells its owner by a callback.
LOGGING = (
    "p2os.event_log", "p2os.client.line", "robot_bench.bench.bench", "robot_bench.bench.board", "robot_bench.remote",
    "robot_bench.run",
)  # fmt: skip

#: The map of ARCHITECTURE.md, lowest first: a package imports none of its own row and none above it.
LAYERS = {
    "simbase": (
        ("timing", "state", "entry_points", "wire", "interrupts", "listening", "terminal"), ("installation",),
        ("errors", "lazy"),
        ("files", "units", "c_library"), ("trust",), ("user_classes",), ("command_line",),
    ),
    "p2os": (
        ("errors", "event_log"), ("toml_file",), ("toml_schema",), ("toml_record", "json_record"),
        ("robots", "gamepad"),
        ("protocol",), ("transport",),
        ("capture", "client", "pioneer"), ("ros", "view"), ("cli",), ("__main__",),
    ),
    "bluepill_sim": (
        ("errors",), ("spans", "extension"), ("fabric",), ("peripherals",), ("parts",), ("stm32f103",),
        ("memory",), ("core",), ("program", "native"), ("chip",), ("board",),
        ("analysis", "debug"), ("cli",), ("__main__",),
    ),
    "adapter_sim": (
        ("codec",), ("duty",), ("settings", "pinout"),
        ("pins", "receiver", "mixing", "encoders", "distances", "session"), ("masters", "driver"), ("adapter",),
    ),
    "robot_bench": (
        ("running", "firmware", "origin_gate"), ("wires",), ("events",), ("direct",), ("recording",),
        ("drives", "view"), ("scenario", "report"),
        ("adapter", "scenarios"), ("bench",), ("remote",), ("run",),
        ("networks", "experiments"), ("campaign",), ("ros", "live"), ("cli",),
    ),
}  # fmt: skip

#: `from p2os import Robot` is fetched on first use: the one look upwards.
FRONT_DOOR = "p2os"


def module_name(path: Path) -> str:
    """Return the dotted name of a source file."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def sources() -> list[Path]:
    """Return every source file of the packages."""
    return sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))


#: Folders of what is no code of ours: the tests themselves, what is built, what a machine keeps.
NO_CODE = {"tests", "build", "dist", "runs"}


def code(*patterns: str) -> list[Path]:
    """Return the files of all folders that hold code, whatever their names: what is new is judged, too."""
    folders = [path for path in ROOT.iterdir() if path.is_dir() and path.name not in NO_CODE and path.name[0] != "."]
    return sorted(path for folder in folders for pattern in patterns for path in folder.rglob(pattern))


@dataclass(frozen=True)
class Parsed:
    """What the judges look at in a source file."""

    imports: tuple[ast.Import | ast.ImportFrom, ...]  # wherever in it
    prints: bool
    listens: bool
    says_what_it_is: bool
    texts: tuple[str, ...]


@cache
def parsed(path: Path) -> Parsed:
    """Parse a source file, once for all judges."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    nodes = list(ast.walk(tree))
    called = [node.func for node in nodes if isinstance(node, ast.Call)]
    return Parsed(
        imports=tuple(node for node in nodes if isinstance(node, (ast.Import, ast.ImportFrom))),
        prints=any(isinstance(each, ast.Name) and each.id == "print" for each in called),
        listens=listens(module_name(path), nodes),
        says_what_it_is=not tree.body or bool(ast.get_docstring(tree)),
        texts=tuple(texts_of(nodes)),
    )


def texts_of(nodes: Iterable[ast.AST]) -> list[str]:
    """Return the texts of a source; docstrings, which are for readers, are not among them."""
    nodes = list(nodes)
    reported = {
        id(node.body[0].value)
        for node in nodes
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) and node.body
        and isinstance(node.body[0], ast.Expr)
    }  # fmt: skip
    return [
        node.value for node in nodes
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in reported
    ]  # fmt: skip


def imports(path: Path) -> set[str]:
    """Return the dotted names that a file imports, wherever in it."""
    return imports_of(module_name(path), parsed(path).imports, is_package=path.name == "__init__.py")


def imports_of(name: str, nodes: Iterable[ast.AST], *, is_package: bool = False) -> set[str]:
    """Return the dotted names that a module's nodes import."""
    found = set()
    for node in nodes:
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                parent = name.split(".") if is_package else name.split(".")[:-1]
                parent = parent[: len(parent) - node.level + 1]
                base = ".".join([*parent, *([base] if base else [])])
            found |= {base} | {f"{base}.{alias.name}" for alias in node.names if base.split(".")[0] in PACKAGES}
    return found


def within(name: str, prefix: str) -> bool:
    """Tell whether a module is `prefix` or stands below it."""
    return name == prefix or name.startswith(f"{prefix}.")


def allowed_for(name: str) -> set[str]:
    """Return the row of ALLOWED that judges a module."""
    return ALLOWED[max((prefix for prefix in ALLOWED if within(name, prefix)), key=len)]


def layer(name: str) -> int | None:
    """Return the row of a module in its package's LAYERS; None for the package itself and its data."""
    package, _, rest = name.partition(".")
    part = rest.partition(".")[0]
    return next((number for number, row in enumerate(LAYERS[package]) if part in row), None)


def is_upwards(name: str, target: str) -> bool:
    """Tell whether a module imports another part of its package that does not stand below it."""
    if name.split(".")[:2] == target.split(".")[:2] or "." not in name:
        return False
    here, there = layer(name), layer(target)
    return here is not None and there is not None and there >= here


def is_in_io_layer(name: str) -> bool:
    """Tell whether a module stands above the passive models."""
    return any(within(name, prefix) for prefix in IO_LAYER)


def faults(name: str, targets: set[str]) -> list[str]:
    """Return every import of a module that breaks a rule."""
    package = name.split(".", maxsplit=1)[0]
    result = []
    for target in sorted(targets):
        top = target.split(".")[0]
        if top in FORBIDDEN_IN_CORE and not is_in_io_layer(name):
            result.append(f"{name} imports {target}: only the I/O layer may")
        elif target in {"logging", "p2os.event_log"} and not is_in_io_layer(name) and name not in LOGGING:
            result.append(f"{name} imports {target}: models do not log")
        elif top not in sys.stdlib_module_names and top not in {package, BASE} and top not in allowed_for(name):
            result.append(f"{name} imports {target}: its row in ALLOWED does not have it")
        if top == package and is_upwards(name, target):
            result.append(f"{name} imports {target}: it stands beside or above it")
    return result


def test_a_module_imports_only_what_its_place_allows() -> None:
    assert [fault for path in sources() for fault in faults(module_name(path), imports(path))] == []


def test_a_file_is_one_idea_and_opens_with_what_it_is() -> None:
    silent = [module_name(path) for path in sources() if not parsed(path).says_what_it_is]
    assert silent == [], "a module opens with a docstring"


def test_models_print_nothing() -> None:
    models = [path for path in sources() if not is_in_io_layer(module_name(path))]
    assert [module_name(path) for path in models if parsed(path).prints] == []


def test_nothing_has_a_name_that_says_nothing() -> None:
    assert [path for path in sources() if path.stem in {"utils", "util", "common", "misc", "helpers"}] == []


#: Packages whose modules meet elsewhere, and where: none of them imports another that stands beside it.
APART = {
    "bluepill_sim.peripherals": "through pins, IRQ lines and the clock",
}


def siblings(name: str, targets: set[str]) -> set[str]:
    """Return what a module of a package of APART imports that stands beside it."""
    found = set()
    for package in APART:
        if within(name, package) and name != package:
            own = name.removeprefix(f"{package}.").split(".")[0]
            beside = {target.removeprefix(f"{package}.").split(".")[0]
                      for target in targets if within(target, package) and target != package}  # fmt: skip
            found |= {f"{package}.{each}" for each in beside - {own}}
    return found


def test_one_peripheral_never_imports_another() -> None:
    judged = [path for path in sources() if any(within(module_name(path), package) for package in APART)]
    assert len(judged) >= 2 * len(APART)
    broken = {module_name(path): found for path in judged if (found := siblings(module_name(path), imports(path)))}
    assert broken == {}, f"they meet {APART}"


@pytest.mark.parametrize(
    "text",
    [
        "import bluepill_sim.peripherals.{other}",
        "from bluepill_sim.peripherals.{other} import made",
        "from bluepill_sim.peripherals import {other}",
        "from . import {other}",
        "from .{other} import made",
        "def f():\n    from bluepill_sim.peripherals.{other} import made",
    ],
)
def test_the_judge_sees_each_peripheral_that_imports_another(text: str) -> None:
    names = [path.stem for path in (ROOT / "bluepill_sim" / "peripherals").glob("*.py") if path.stem != "__init__"]
    assert len(names) >= 2
    for name, other in zip(names, names[1:] + names[:1], strict=True):
        module = f"bluepill_sim.peripherals.{name}"
        assert siblings(module, imports_of(module, ast.walk(ast.parse(text.format(other=other))))) == {
            f"bluepill_sim.peripherals.{other}"
        }
        assert siblings(module, imports_of(module, ast.walk(ast.parse(text.format(other=name))))) == set()


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("p2os.protocol.frames", "import time"),
        ("p2os.protocol.connection", "from p2os.transport import open_url"),
        ("p2os.protocol.connection", "from ..transport.url import open_url"),
        ("p2os.protocol.sip", "import serial"),
        ("p2os.protocol.sip", "from p2os.capture.columns import decode"),
        ("p2os.client.core", "from p2os.pioneer.serve import host"),
        ("bluepill_sim.core.nvic", "from bluepill_sim.chip import Chip"),
        ("robot_bench.wires.nets", "from robot_bench.run import run_scenario"),
        ("p2os.pioneer.body.kinematic", "import numpy"),
        ("adapter_sim.adapter", "import logging"),
        ("p2os.pioneer.controller.controller", "from p2os.event_log import logger"),
        ("bluepill_sim.peripherals.gpio", "from p2os.robots.parameters import load_parameters"),
        ("bluepill_sim.core.nvic", "import unicorn"),
        ("adapter_sim.adapter", "import robot_bench.wires.nets"),
    ],
)
def test_the_judge_sees_a_broken_rule(name: str, text: str) -> None:
    assert faults(name, imports_of(name, ast.walk(ast.parse(text)))) != []


# Who listens -------------------------------------------------------------------------

#: Libraries that can listen on TCP, and what of them does.
LISTENING_LIBRARIES = {
    "socket", "asyncio", "socketserver", "http", "xmlrpc", "wsgiref", "multiprocessing", "websockets", "foxglove",
    "zenoh", "distributed", "uvicorn",
}  # fmt: skip
LISTENING_NAMES = re.compile(
    r"listen|create_(unix_)?server|start_(unix_)?server|\w*Server|serve_forever|make_server|LocalCluster|Listener|open"
)
#: Who listens without `simbase.listening`, and why no web page can use it.
UNGUARDED = {
    "simbase.listening": "makes the guarded ones",
    "p2os.view.server.serving": "its protocol is HTTP: it asks for Host, Origin and token",
    "robot_bench.origin_gate": "its protocol is HTTP: it asks for the Origin",
    "robot_bench.live": "Foxglove's server: behind the gate, at an address of loopback that is drawn",
    "p2os.ros.zenoh_node": "zenoh's own router: a link begins with its InitSyn, as no request does",
    "robot_bench.campaign.workers.dask_workers": "Dask's own scheduler: a link begins with the count of its frames",
    "examples.outside_body.lock_step": "a program without p2os: a connection begins with Hello",
    "tools.hostile.watched": "a judge's own line to a robot, which is attacked by none",
    "tools.hostile.browser": "serves the page that attacks",
}
UNGUARDED_IN_C = {
    "examples/outside_body/lock_step.hpp": "as lock_step.py",
    "adapter_fw/host/wires.cpp": "a Unix socket: no browser opens one",
}


def listens(name: str, nodes: Iterable[ast.AST]) -> bool:
    """Tell whether a module makes listening sockets itself, or has a library make one."""
    nodes = list(nodes)
    if not {target.split(".")[0] for target in imports_of(name, nodes)} & LISTENING_LIBRARIES:
        return False
    for node in nodes:
        if isinstance(node, ast.Attribute):
            words, of = [node.attr], node.value.id if isinstance(node.value, ast.Name) else ""
        elif isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in LISTENING_LIBRARIES:
            words, of = [alias.name for alias in node.names], node.module or ""
        else:
            continue
        if any(LISTENING_NAMES.fullmatch(word) and (word != "open" or of == "zenoh") for word in words):
            return True
    return False


def test_every_tcp_listener_is_guarded_or_says_why_not() -> None:
    found = {module_name(path) for path in code("*.py") if parsed(path).listens}
    assert found == UNGUARDED.keys(), "make it by simbase.listening.listen_tcp, or add its row with the reason"


def test_every_listener_in_c_is_none_that_a_browser_can_use() -> None:
    files = code("*.c", "*.cpp", "*.h", "*.hpp", "*.ino")
    texts = {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8", errors="replace") for path in files}
    sockets = {name: text for name, text in texts.items() if re.search(r"sys/socket\.h|WiFiServer|lwip", text)}
    found = {name for name, text in sockets.items() if re.search(r"\blisten\s*\(|WiFiServer", text)}
    assert found == UNGUARDED_IN_C.keys()
    assert not re.search(r"AF_INET|sockaddr_in\b", texts["adapter_fw/host/wires.cpp"])


@pytest.mark.parametrize(
    ("text", "is_seen"),
    [
        ("import socket\nmade = socket.socket()\nmade.bind(('', 1))\nmade.listen()", True),
        ("from socket import create_server\ncreate_server(('', 1))", True),
        ("import asyncio\nasync def f():\n    await asyncio.start_server(g, port=1)", True),
        ("from http.server import ThreadingHTTPServer", True),
        ("import zenoh\nzenoh.open(config)", True),
        ("import socket\nsocket.create_connection(('', 1))", False),
        ("loops.listen('robot')", False),
        ("from simbase.listening import listen_tcp\nlisten_tcp('127.0.0.1', 0)", False),
    ],
)
def test_the_judge_sees_who_listens(text: str, is_seen: bool) -> None:
    assert listens("robot_bench.bench", ast.walk(ast.parse(text))) is is_seen


#: Most names that a folder shows.
MOST_NAMES = 16

#: Folders that may show more, each with its reason.
LONG_FOLDERS = {
    ".": "the top folder",
    "p2os/robots": "one TOML file a robot, beside the loader that finds them",
    "robot_bench": "one package or module a layer of the bench",
    "robot_bench/firmware": "the sources and programs of the examples, built by one command",
    "bluepill_sim/peripherals": "one peripheral a file",
    "bluepill_sim/extension/source/devices": "one device a file",
    "docs": "one page a subject",
    "tests/adapter_fw": "one rig, many runs of the same firmware",
    "tests/bluepill_sim/core": "one assembled machine for all of them",
    "tests/golden": "recordings",
    "adapter_fw/fuzz": "inputs that were found",
    "hardware/pcb/generated": "files of the board, written by `make board`",
}


def shown_names() -> dict[str, set[str]]:
    """Return the names that each folder of the repository shows; a header and its source count as one."""
    folders: dict[str, set[str]] = {}
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False).stdout.split(
        "\n"
    )
    for path in map(PurePosixPath, filter(None, listed)):
        for parent, child in zip(path.parents, [path, *path.parents], strict=False):
            name = child.stem if child.suffix in {".c", ".cpp", ".h", ".hpp"} else child.name
            folders.setdefault(str(parent), set()).add(name)
    return {
        folder: names - {"__init__.py", "__main__.py", "py.typed", "conftest.py"} for folder, names in folders.items()
    }


def test_no_link_is_committed() -> None:
    listed = subprocess.run(["git", "ls-files", "-s"], cwd=ROOT, capture_output=True, text=True, check=False).stdout
    assert [line for line in listed.splitlines() if line.startswith("120000")] == []


def test_a_folder_shows_no_more_names_than_one_looks_through() -> None:
    folders = shown_names()
    if not folders:
        pytest.skip("no git checkout")
    may = tuple(folder for folder in LONG_FOLDERS if folder != ".")
    long = {folder: len(names) for folder, names in folders.items() if len(names) > MOST_NAMES}
    assert [folder for folder in long if folder not in LONG_FOLDERS and not folder.startswith(may)] == []


@cache
def module_graph() -> dict[str, set[str]]:
    """Return every module of the packages with the modules that it imports, wherever in it."""
    modules = {module_name(path): path for path in sources()}
    graph: dict[str, set[str]] = {}
    for name, path in modules.items():
        found = set()
        for node in parsed(path).imports:
            if isinstance(node, ast.Import):
                found |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module:
                found |= {full if (full := f"{node.module}.{alias.name}") in modules else node.module
                          for alias in node.names}  # fmt: skip
        graph[name] = (found & modules.keys()) - {name, FRONT_DOOR}
    graph[FRONT_DOOR] = set()  # the one look upwards
    return graph


def test_every_part_of_a_package_has_its_layer() -> None:
    parts = {tuple(module_name(path).split(".")[:2]) for path in sources()}
    assert [part for part in parts if len(part) > 1 and layer(".".join(part)) is None] == []


def circles(graph: dict[str, set[str]]) -> list[str]:
    """Return the names that lead back to themselves, or stand between two that do."""
    left = {name: set(targets) & graph.keys() for name, targets in graph.items()}
    while free := left.keys() - set().union(*left.values()) | {name for name, targets in left.items() if not targets}:
        left = {name: targets - free for name, targets in left.items() if name not in free}
    return sorted(left)


def test_no_modules_import_each_other_in_a_circle() -> None:
    assert circles(module_graph()) == []


def test_no_neighbours_in_a_folder_import_each_other_in_a_circle() -> None:
    graph = module_graph()
    folders = {name.rpartition(".")[0] for name in graph} - {""}
    for folder in sorted(folders):
        below: dict[str, set[str]] = {}
        for name, targets in graph.items():
            if within(name, folder) and name != folder:
                child = name.removeprefix(f"{folder}.").split(".")[0]
                inside = {target.removeprefix(f"{folder}.").split(".")[0]
                          for target in targets if target.startswith(f"{folder}.")}  # fmt: skip
                below.setdefault(child, set()).update(inside - {child})
        assert circles(below) == [], folder


def test_the_judge_sees_a_circle() -> None:
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}, "e": set()}) == ["a", "b", "c"]


#: Where the emulator's C stands, and of which folders the files of each may call functions.
C_SOURCES = ROOT / "bluepill_sim" / "extension" / "source"
C_FOLDERS = {
    "fabric": {"fabric"}, "devices": {"devices", "fabric"}, "interpreter": {"interpreter", "fabric"},
    "core": {"core", "fabric", "interpreter"},
}  # fmt: skip
#: Ideas that are longer than a file: their files call each other; `core.h`, `tim.h` and `interpreter.h` say so.
C_IDEAS = {
    "core": {f"core/{name}.c" for name in ("access", "blocks", "exceptions", "faults", "polling", "run", "scs")},
    "interpreter": {f"interpreter/{name}.c" for name in ("blocks", "decode", "execute", "tidy")},
    "memory": {f"interpreter/{name}.c" for name in ("hooks", "memory")},
    "timers": {f"devices/{name}.c" for name in ("tim", "tim_counter", "tim_inputs", "tim_outputs")},
}

C_NO_CODE = re.compile(r'/\*.*?\*/|__attribute__\(\(.*?\)\)|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\])\'', re.DOTALL)
C_MACRO = re.compile(r"^#define (\w+)\([^)]*\)((?:[^\n]*\\\n)*[^\n]*)", re.MULTILINE)
C_FUNCTION = re.compile(
    r"^(?P<head>[A-Za-z][^\n;={}#()]*\b)(?P<name>\w+)\([^;{}()]*(?:\([^()]*\)[^;{}()]*)*\)\s*\{(?P<body>[^\n]*\}$|.*?^\})",
    re.MULTILINE | re.DOTALL,
)
C_DATA = re.compile(r"^(?!static|extern)(?:const )?struct \w+ (\w+)(?:\[\w*\])? = ", re.MULTILINE)
#: What a header makes by a macro at its outer level: functions of its list, or the head of one.
C_MADE = re.compile(r"^(?P<macro>[A-Z][A-Z0-9_]*)\([^;{}]*?\)(?:\s*\{(?P<body>.*?^\}))?", re.MULTILINE | re.DOTALL)
C_INCLUDE = re.compile(r'^#include "(?:[^"\n]*/)?([^"/\n]+)"', re.MULTILINE)
#: A call, an address, a value of a field, a struct whose field is meant.
C_USE = re.compile(r"(?<![\w.>])\w+(?=\()|(?<=&)\w+|(?<== )\w+(?=[,;}]|\s*\})|(?<![\w.>])\w+(?=\.)")


def c_graph(texts: dict[str, str]) -> dict[str, set[str]]:
    """Return each file of C with those that define what it uses, by itself or by what headers have it do."""
    included = {name: set(C_INCLUDE.findall(text)) for name, text in texts.items()}
    texts = {name: C_NO_CODE.sub(" ", text) for name, text in texts.items()}
    owners: dict[str, str] = {}
    inlined: dict[str, set[str]] = {}
    for name, text in texts.items():
        if name.endswith(".h"):
            inlined[name.rpartition("/")[2]] = included[name] | {
                word for made in C_MADE.finditer(C_MACRO.sub("", text))
                for word in (made["macro"], *C_USE.findall(made["body"] or ""))
            }  # fmt: skip
    own: dict[str, set[str]] = {name: set() for name in texts}
    for name, text in texts.items():
        inlined |= {macro: set(C_USE.findall(body)) for macro, body in C_MACRO.findall(text)}
        owners |= dict.fromkeys(C_DATA.findall(text), name)
        for found in C_FUNCTION.finditer(text):
            if name.endswith(".h"):
                inlined[found["name"]] = set(C_USE.findall(found["body"]))
            elif "static" in found["head"].split():
                own[name].add(found["name"])
            else:
                owners[found["name"]] = name
    graph = {}
    for name, text in texts.items():
        if name.endswith(".c"):
            used, left = set(own[name]), (set(C_USE.findall(text)) | included[name]) - own[name]
            while left:
                used.add(word := left.pop())
                left |= inlined.get(word, set()) - used
            graph[name] = {owners[word] for word in used - own[name] if word in owners} - {name}
    return graph


@cache
def emulator_graph() -> dict[str, set[str]]:
    """Return what the files of the emulator's C use of each other."""
    return c_graph({path.relative_to(C_SOURCES).as_posix(): path.read_text(encoding="utf-8")
                    for path in C_SOURCES.rglob("*.[ch]")})  # fmt: skip


def test_no_c_files_call_each_other_in_a_circle_but_those_of_one_idea() -> None:
    ideas = {file: idea for idea, files in C_IDEAS.items() for file in files}
    merged: dict[str, set[str]] = {}
    for file, targets in emulator_graph().items():
        idea = ideas.get(file, file)
        merged.setdefault(idea, set()).update({ideas.get(target, target) for target in targets} - {idea})
    assert circles(merged) == []


@pytest.mark.parametrize("idea", C_IDEAS)
def test_the_files_of_an_idea_in_c_are_no_more_than_call_each_other(idea: str) -> None:
    files = C_IDEAS[idea]
    assert set(circles({file: targets & files for file, targets in emulator_graph().items() if file in files})) == files


def test_a_c_file_calls_nothing_of_a_folder_above_its_own() -> None:
    wrong = [(file, target) for file, targets in emulator_graph().items() for target in targets
             if target.partition("/")[0] not in C_FOLDERS[file.partition("/")[0]]]  # fmt: skip
    assert wrong == []


@pytest.mark.parametrize(
    ("pins", "waves", "is_seen"),
    [
        ("void pins(void)\n{\n    show();\n}", "void show(void) { pins(); }", True),
        ("void pins(void)\n{\n    shown();\n}", "void show(void) { pins(); }", True),
        ("void pins(void)\n{\n    SHOWN(1);\n}", "void show(void) { pins(); }", True),
        ("void pins(void) { wave_kind.event(); }", "struct kind wave_kind = {.event = pins};", True),
        ('#include "made.h"\nvoid pins(void) { }', "void show(void) { pins(); }", True),
        ('#include "fabric.h"\nvoid pins(void) { }', "void show(void) { pins(); }", False),
        ("void pins(void) { show(); }", '/* pins(); */ void show(void) { put("pins()"); port->pins(); }', False),
        ("void pins(void) { show(); }", "static void pins(void) { }\nvoid show(void) { pins(); }", False),
    ],
)  # fmt: skip
def test_the_judge_sees_a_circle_in_c(pins: str, waves: str, is_seen: bool) -> None:
    header = "static inline void shown(void)\n{\n    show();\n}\n#define SHOWN(x) \\\n    show()\n"
    made = "#define MAKE(name) static void name##_made(void)\nMAKE(first)\n{\n    show();\n}\n"
    texts = {"a/fabric.h": header, "a/made.h": made, "pins.c": pins, "waves.c": waves}
    assert bool(circles(c_graph(texts))) is is_seen


@pytest.mark.soak
@pytest.mark.skipif(shutil.which("nm") is None or shutil.which("gcc") is None, reason="needs gcc and nm")
def test_the_judge_sees_in_c_what_the_linker_does(tmp_path: Path) -> None:
    owners: dict[str, str] = {}
    wanted: dict[str, set[str]] = {}
    for file in emulator_graph():
        made = tmp_path / f"{Path(file).stem}.o"
        subprocess.run(["gcc", "-O1", "-std=c11", "-c", C_SOURCES / file, "-o", made], check=True)
        listed = subprocess.run(["nm", made], capture_output=True, text=True, check=True).stdout
        for kind, name in (line.split()[-2:] for line in listed.splitlines()):
            if kind in set("TDBR"):
                owners[name] = file
            elif kind == "U":
                wanted.setdefault(file, set()).add(name)
    linked = {file: {owners[name] for name in wanted.get(file, ()) if name in owners} for file in emulator_graph()}
    assert linked == emulator_graph()


#: Rim speed of one step of a motor value, in mm/s, m/s and µm/s.
MOTOR_STEP = {62.5, 0.0625, 62_500}
#: However it is spelled: what has none of it is not parsed.
MOTOR_STEP_DIGITS = re.compile(r"6[._]?2[._]?5")


def test_the_speed_of_a_motor_step_is_said_once() -> None:
    texts = {module_name(path): path.read_text(encoding="utf-8") for path in sources()}
    found = {
        name for name, text in texts.items() if MOTOR_STEP_DIGITS.search(text) for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Constant)
        and (node.value in MOTOR_STEP if isinstance(node.value, int | float) else "62.5 mm/s" in str(node.value))
    }  # fmt: skip
    assert found == {"p2os.robots.motor_step"}


def test_what_is_written_of_a_motor_step_for_readers_is_that_speed() -> None:
    written = re.compile(r"([\d.]+) mm/s (?:a (?:motor )?step|\(four steps)|(?:eight steps of|step is) ([\d.]+) mm/s")
    files = [*(ROOT / "docs").glob("*.md"), *(ROOT / "robot_bench").glob("firmware/*.[ch]"),
             ROOT / "robot_bench" / "cli" / "project" / "template" / "main.c"]  # fmt: skip
    said = {(path.name, float(one or other)) for path in files
            for one, other in written.findall(path.read_text(encoding="utf-8"))}  # fmt: skip
    assert len(said) >= 5
    assert {speed for _, speed in said} == {62.5}


def test_the_map_names_what_is_there() -> None:
    text = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
    paths = set(re.findall(r"`([\w./*-]+/[\w./*-]*)`", text))
    assert [path for path in sorted(paths) if not any(ROOT.glob(path.rstrip("/")))] == []
    facts = re.findall(r"`([A-Za-z_.]+)`(?: in |, )`([\w/.]+\.py)`", text)
    assert len(facts) >= 5
    gone = [
        (name, path) for name, path in facts if name.split(".")[-1] not in (ROOT / path).read_text(encoding="utf-8")
    ]
    assert gone == []


#: Class names that stand in more than one module of what we ship, with what makes them one word of one meaning.
NAMED_TWICE = {
    "Body": "examples of an outside body: each is a program that a user copies whole",
    "Engine": "the engine of a simulation, in each field's own sense: of instructions, and of physics",
    "Pose": "a pose: of a world's things, and the event that tells one; an event's class is named as its trace says",
    "Ranges": "sonar ranges: the message of an outside body, and the event that tells them",
    "Robot": "the client, blocking and asyncio: one program changes its import alone",
    "SonarRays": "the same idea on two physics engines, exchanged for each other",
    "Wave": "a timer's wave on a pin, and the event that tells one",
}


def classes_by_name() -> dict[str, list[str]]:
    """Return the modules of each public class at a module's top, of all tracked code but the tests."""
    found: dict[str, list[str]] = {}
    for path in code("*.py"):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                found.setdefault(node.name, []).append(module_name(path))
    return found


def test_a_class_name_stands_once_or_says_why_not() -> None:
    twice = {name: modules for name, modules in classes_by_name().items() if len(modules) > 1}
    surprising = {name: modules for name, modules in twice.items() if name not in NAMED_TWICE}
    assert surprising == {}, "name the class by what it is in its field, or say in NAMED_TWICE why both are one word"
    assert sorted(NAMED_TWICE) == sorted(twice), "a reason stands for a name that no longer stands twice"
    assert len(NAMED_TWICE) <= 20
