"""Which tests stand nearest to a line of a source file, nearest first.

What was counted says it: of Python by the suite where it has run here (`pytest --count-lines .coverage`, as `make test`
does, notes the lines of each file of tests), of C by native_lines.py. Names and imports order what it says, and say it
alone where nothing was counted.
"""

import ast
import hashlib
import json
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path

#: Files of tests that are asked about one mutant, at most.
MOST_FILES = 16
#: So many of them by their names and imports, whether they were counted at the line or not.
NOT_COUNTED = 4
#: Seconds that a file of tests is taken to last, of which nothing is known, and at least.
UNKNOWN_S, LEAST_S = 1.0, 0.2
#: How many are asked before those of another package that hold all that it does with this one, and how many of those.
NEAREST, OF_ELSEWHERE = 6, 2
#: How much more seldom one that stands further away notices something, as a power of its place.
SELDOM = 1.5
#: A word in the names of files of tests that hold all that a module does at once: they are asked first.
WHOLE = "walks"
#: What a file of tests imports that shows what modules declare, and how many of these are asked first about a line
#: outside functions.
DECLARED, OF_DECLARED = "tests.tools.suite.declared", 2
#: How many lines below one that is counted another may stand in the same statement of C.
STATEMENT = 3
#: Programs at random, which go through most of the emulated core.
PROGRAM_WALKS = tuple(f"tests/bluepill_sim/core/walks/test_{name}_walks.py" for name in ("left_to_python", "program"))
#: What tests a library in C or C++, by the folder of its sources or by a file: there are no imports to read. Of those
#: that were counted at a line, these come first, in this order.
TESTS_OF_C = {
    # What is made of declarations is held to them as text.
    **dict.fromkeys(
        ("bluepill_sim/extension/source/registers", "bluepill_sim/extension/source/fabric/layout.h",
         "bluepill_sim/extension/source/interpreter/encodings.h"),
        ("tests/bluepill_sim/fabric/test_descriptions.py",)),
    # What few tests reach.
    "bluepill_sim/extension/source/core/latency.c": (
        "tests/bluepill_sim/analysis/test_races.py", "tests/bluepill_sim/analysis/walks/test_races_walks.py",
        *PROGRAM_WALKS, "tests/bluepill_sim/cli/test_whole_answers.py"),
    "bluepill_sim/extension/source/core/forced.c": (
        *PROGRAM_WALKS, "tests/bluepill_sim/peripherals/pins/test_floating.py",
        *(f"tests/bluepill_sim/native/test_native_{name}.py"
          for name in ("registers", "warned", "ambiguous", "core", "random_registers")),
        "tests/bluepill_sim/fabric/test_ahead.py",
        "tests/bluepill_sim/peripherals/walks/test_gpio_afio_exti_crc_walks.py"),
    "bluepill_sim/extension/source/fabric/edges.c": (
        "tests/bluepill_sim/fabric/walks/test_fabric_walks.py", "tests/bluepill_sim/analysis/waveforms",
        "tests/bluepill_sim/core/interpreter/test_heap.py", "tests/bluepill_sim/cli/test_whole_answers.py",
        "tests/bluepill_sim/analysis/test_silicon_pins.py"),
    "bluepill_sim/extension/source/fabric/ahead.c": (
        "tests/bluepill_sim/fabric/test_ahead.py", *PROGRAM_WALKS,
        "tests/bluepill_sim/fabric/walks", "tests/bluepill_sim/peripherals/buses/test_bits_on_pins.py",
        "tests/bluepill_sim/fabric"),
    "bluepill_sim/extension/source/core/access.c": (
        *PROGRAM_WALKS,
        "tests/bluepill_sim/walks/test_native_registers_walks.py",
        *(f"tests/bluepill_sim/native/test_native_{name}.py"
          for name in ("registers", "ambiguous", "warned", "system", "random_registers", "core", "polling")),
        *(f"tests/bluepill_sim/core/test_{name}.py" for name in ("forced_bits", "core_parts", "imprecise_faults")),
        "tests/bluepill_sim/core/walks", "tests/bluepill_sim/peripherals/walks/test_gpio_afio_exti_crc_walks.py",
        "tests/bluepill_sim/native"),
    "bluepill_sim/extension/source/core/host.c": (
        *(f"tests/bluepill_sim/peripherals/walks/test_{name}_walks.py" for name in ("adc_dma", "usart", "spi_i2c")),
        *PROGRAM_WALKS, "tests/bluepill_sim/native/test_native_dma.py",
        "tests/bluepill_sim/peripherals/dma", "tests/bluepill_sim/native/test_bus_device.py",
        *(f"tests/bluepill_sim/core/test_{name}.py" for name in ("sleep", "late_arrival", "time")),
        *(f"tests/bluepill_sim/native/test_native_{name}.py" for name in ("core", "timers", "polling"))),
    "bluepill_sim/extension/source/core/run.c": (
        *(f"tests/bluepill_sim/core/walks/test_{name}_walks.py"
          for name in ("left_to_python", "program", "faults", "points", "counting_loops")),
        *(f"tests/bluepill_sim/core/interpreter/test_{name}.py"
          for name in ("exact", "own_core", "continued", "chaining")),
        *(f"tests/bluepill_sim/core/test_{name}.py"
          for name in ("sleep", "time", "late_arrival", "debug_halts", "exceptions")),
        *(f"tests/bluepill_sim/native/test_native_{name}.py" for name in ("core", "polling", "system"))),
    "bluepill_sim/extension/source/core/exceptions.c": (
        *PROGRAM_WALKS, *(f"tests/bluepill_sim/core/walks/test_{name}_walks.py" for name in ("faults", "points")),
        *(f"tests/bluepill_sim/core/interpreter/test_{name}.py" for name in ("continued", "exact")),
        *(f"tests/bluepill_sim/core/test_{name}.py"
          for name in ("late_arrival", "masks", "stacks", "sleep", "imprecise_faults", "faults", "time", "traps")),
        *(f"tests/bluepill_sim/native/test_native_{name}.py" for name in ("system", "core"))),
    # What counts in cycles, and what counts in ticks of a timer.
    "bluepill_sim/extension/source/fabric/ramp.c": (
        *(f"tests/bluepill_sim/core/walks/test_{name}_walks.py"
          for name in ("scs_system_control", "left_to_python", "program", "counting_loops")),
        "tests/bluepill_sim/peripherals/walks/test_tim_walks.py", "tests/bluepill_sim/test_timers.py",
        "tests/bluepill_sim/peripherals/tim", "tests/bluepill_sim/core/test_time.py", "tests/bluepill_sim/fabric"),
    "bluepill_sim/extension/source/core/blocks.c": (
        *PROGRAM_WALKS, "tests/bluepill_sim/core/interpreter/test_heap.py",
        *(f"tests/bluepill_sim/core/interpreter/test_{name}.py"
          for name in ("exact", "continued", "own_core", "chaining")),
        *(f"tests/bluepill_sim/core/test_{name}.py" for name in ("block_log", "late_arrival", "core_parts", "time")),
        *(f"tests/bluepill_sim/native/test_native_{name}.py" for name in ("core", "system", "polling", "ambiguous")),
        "tests/bluepill_sim/debug/cores/test_core_comparison.py", "tests/bluepill_sim/analysis/test_races.py"),
    "bluepill_sim/extension/source/core/tlb.c": (
        "tests/bluepill_sim/native/test_native_tlb.py", "tests/bluepill_sim/core/test_flash_patch.py",
        *PROGRAM_WALKS, "tests/bluepill_sim/native"),
    "bluepill_sim/extension/source/devices": (
        *(f"tests/bluepill_sim/native/test_native_{name}.py"
          for name in ("random_registers", "registers", "timers", "dma", "streams")),
        "tests/bluepill_sim/peripherals/sequences", "tests/bluepill_sim/peripherals", "tests/bluepill_sim/native"),
    "bluepill_sim/extension/source/interpreter": (
        *(f"tests/bluepill_sim/core/interpreter/test_{name}.py"
          for name in ("against_unicorn", "tidy", "memory_bounds", "hooks", "blocks_decode", "special")),
        *PROGRAM_WALKS,
        *(f"tests/bluepill_sim/core/interpreter/test_{name}.py"
          for name in ("continued", "exact", "own_core", "heap")),
        "tests/bluepill_sim/core/interpreter", "tests/bluepill_sim/core/test_kernels.py",
        "tests/bluepill_sim/core/test_flag_vectors.py", "tests/bluepill_sim/native/test_native_core.py",
        "tests/bluepill_sim/core", "tests/bluepill_sim/native"),
    "bluepill_sim/extension/source/core": (
        *PROGRAM_WALKS,
        *(f"tests/bluepill_sim/core/test_{name}.py"
          for name in ("exceptions", "faults", "imprecise_faults", "late_arrival", "masks", "stacks", "time", "traps")),
        *(f"tests/bluepill_sim/native/test_native_{name}.py" for name in ("system", "core", "polling", "ambiguous")),
        "tests/bluepill_sim/core/interpreter/test_heap.py",
        "tests/bluepill_sim/core/interpreter/test_exact.py", "tests/bluepill_sim/core/interpreter/test_own_core.py",
        "tests/bluepill_sim/core/interpreter/test_continued.py", "tests/bluepill_sim/core/test_flash_patch.py",
        "tests/bluepill_sim/board/test_resets.py", "tests/bluepill_sim/core", "tests/bluepill_sim/native",
        "tests/bluepill_sim/peripherals/walks/test_adc_dma_walks.py"),
    "bluepill_sim/extension/source/fabric": (
        "tests/bluepill_sim/fabric/walks", *PROGRAM_WALKS,
        "tests/bluepill_sim/fabric",
        *(f"tests/bluepill_sim/peripherals/walks/test_{name}_walks.py" for name in ("tim", "spi_i2c")),
        "tests/bluepill_sim/test_timers.py", "tests/bluepill_sim/peripherals/tim/test_tim.py",
        "tests/bluepill_sim/core/test_core_parts.py", "tests/bluepill_sim/native"),
    "bluepill_sim/extension/source": ("tests/bluepill_sim/fabric", "tests/bluepill_sim/native", "tests/bluepill_sim"),
    "robot_bench/wires": ("tests/robot_bench/wires",),
    "robot_bench/direct": ("tests/robot_bench/direct",),
    "adapter_fw/core/app": ("tests/adapter_fw/test_units.py", "tests/adapter_fw/test_shell.py"),
    # What is generated is held to what it is generated from, and what is refused to its bounds.
    **dict.fromkeys(
        ("adapter_fw/core/adapter/setting_table.hpp", "adapter_fw/core/p2os/times.hpp",
         "adapter_fw/core/p2os/commands.hpp"),
        ("tests/adapter_sim/test_settings.py", "tests/adapter_fw/test_number_bounds.py")),
    **dict.fromkeys(
        ("adapter_fw/core/adapter/settings.cpp", "adapter_fw/core/adapter/settings.hpp"),
        ("tests/adapter_fw/test_number_bounds.py", "tests/adapter_fw/test_units.py")),
    "adapter_fw/core": ("tests/adapter_fw/walks", "tests/adapter_fw/test_units.py", "tests/adapter_fw/test_sameness.py",
                        "tests/adapter_fw/test_number_bounds.py", "tests/adapter_fw/test_safety.py",
                        "tests/adapter_fw/test_program.py", "tests/adapter_fw/test_in_the_bench.py"),
}  # fmt: skip

Counted = Mapping[str, Mapping[str, frozenset[int]]]


class Nearest:
    """What is known of a tree's tests.

    Args:
        root: The project.
        counted: Of each source file, the lines that each file of tests ran, and of one in C, under "", those that have
            code; empty where nothing was counted.
    """

    def __init__(self, root: Path, counted: Counted) -> None:
        self._root, self._counted = root, counted
        self._imports = {
            path.relative_to(root).as_posix(): _imports(path) for path in sorted((root / "tests").rglob("*.py"))
        }
        self._tests = [name for name in self._imports if name.rpartition("/")[2].startswith("test_")]

    def of(self, path: str, line: int) -> tuple[str, ...]:
        """Return the files of tests nearest to a line, at most `MOST_FILES`."""
        if not path.endswith(".py"):
            return self._of_c(path, line)
        first = self._of_declared(path) if line not in _in_functions(self._root / path) else []
        return tuple(dict.fromkeys((*first, *self._of_python(path, line))))[:MOST_FILES]

    def of_package_in_c(self, package: str) -> tuple[str, ...]:
        """Return the files of tests that may run anything of a package's libraries in C or C++."""
        folders = {folder for place, tests in TESTS_OF_C.items()
                   if f"{place}/".startswith(f"{package}/") for folder in tests}  # fmt: skip
        return tuple(name for name in self._tests if any(f"{name}/".startswith(f"{folder}/") for folder in folders))

    def made_of(self, test: str) -> tuple[str, ...]:
        """Return what a file of tests says by: itself, what of its own folder it imports, and the data beside it."""
        folder = test.rpartition("/")[0]
        modules = {f"{name.replace('.', '/')}.py" for name in self._imported_by(test)} & {*self._imports}
        data = {
            path.relative_to(self._root).as_posix()
            for path in (self._root / folder).iterdir() if path.is_file() and path.suffix != ".py"
        }  # fmt: skip
        return tuple(sorted({test, *data, *(name for name in modules if name.rpartition("/")[0] == folder)}))

    def digest_of(self, test: str, root: Path) -> str:
        """Return a name of what a file of tests says by, as it stands in a copy of the project."""
        hashed = hashlib.sha256()
        for each in self.made_of(test):
            place = root / each
            hashed.update(f"{each}\0".encode() + (place.read_bytes() if place.exists() else b""))
        return hashed.hexdigest()[:16]

    def _of_python(self, path: str, line: int) -> tuple[str, ...]:
        by_name = self._by_name(path)
        files = self._counted.get(path, {})
        ran = {name for name, lines in files.items() if line in lines} & {*self._tests}
        if not ran:  # run by an import, if at all: who imports it may look at what it has made, and run no line of it
            return tuple([*by_name, *sorted({*files} & {*self._tests} - {*by_name})][:MOST_FILES])
        near = [name for name in by_name if name in ran]
        mirror = f"tests/{path.rpartition('/')[0]}"
        others = sorted(
            ran - {*near}, key=lambda name: (WHOLE not in _words(name), _apart(mirror, _folder(name)), name)
        )
        # Some that hold all that another package does with it come before the last of those that are nearest.
        elsewhere = [name for name in (*near[NEAREST:], *others) if WHOLE in _words(name)][:OF_ELSEWHERE]
        known = [*dict.fromkeys((*near[:NEAREST], *elsewhere, *near, *others))][: MOST_FILES - NOT_COUNTED]
        # What was written since the suite was counted is known by its imports alone.
        return (*known, *[name for name in by_name if name not in known][:NOT_COUNTED])

    def _of_declared(self, path: str) -> list[str]:
        """Return who shows what modules declare, of the nearest packages."""
        folder = path.rpartition("/")[0]
        shown = [name for name in self._tests if DECLARED in self._imports[name]]
        near = [name for name in shown if name.split("/")[1] == path.partition("/")[0]]
        asked = f'"{folder.replace("/", ".")}"'
        names_it = {name: asked in (self._root / name).read_text(encoding="utf-8") for name in near}
        mirror = f"tests/{folder}"
        return sorted(near, key=lambda name: (not names_it[name], _apart(mirror, _folder(name)), name))[:OF_DECLARED]

    def _by_name(self, path: str) -> list[str]:
        module = path.removesuffix("/__init__.py").removesuffix(".py").replace("/", ".")
        found = _ordered({name: self._distance(path, module, name) for name in self._tests})
        return found or self._by_parts(path)

    def _by_parts(self, path: str) -> list[str]:
        """Return who imports what a file itself imports, the most of it first: a verb is tried by its command line."""
        file = self._root / path
        parts = (
            {name for name in _imports(file) if name.startswith(f"{path.partition('/')[0]}.")}
            if file.exists()
            else {*()}
        )
        shared = {name: len(parts & self._imported_by(name)) for name in self._tests}
        return _ordered({name: (-count,) if count else None for name, count in shared.items()})

    def _distance(self, path: str, module: str, test: str) -> tuple[int, ...] | None:
        """Return how far a file of tests stands from a module: its mirror, its folder, who imports it."""
        stem, folder, its_folder = Path(path).stem, f"tests/{path.rpartition('/')[0]}", _folder(test)
        imported = self._imported_by(test)
        words = _words(test)
        apart = _apart(folder, its_folder)
        mirrors = bool({*stem.split("_")} <= words)
        does_import = any(name == module or name.startswith(f"{module}.") for name in imported)
        if mirrors and (does_import or apart <= 1 or test.startswith(f"{folder}/")):
            return 0, WHOLE not in words, apart
        # Walks go through all that the folder above them has.
        is_walk = WHOLE in words and f"{folder}/".startswith(f"{its_folder.removesuffix(f'/{WHOLE}')}/")
        if does_import or is_walk:
            return 1, not is_walk and not {*stem.split("_")} & words, apart
        package = module.rpartition(".")[0]
        if apart <= 1 and any(name == package or name.startswith(f"{package}.") for name in imported):
            return 2, not {*stem.split("_")} & words, apart
        if any(name == package or name.startswith(f"{package}.") for name in imported):
            return 3, apart
        above = package.rpartition(".")[0]  # what is loaded by a name is imported by nobody
        if "." in above and apart <= 1 and any(name.startswith(f"{above}.") for name in imported):
            return 4, package.rpartition(".")[2] not in words, apart
        return None

    def _imported_by(self, test: str) -> frozenset[str]:
        """Return what a file of tests imports, and what the helpers import that it does."""
        found, waiting = set[str](), [test]
        while waiting:
            for name in self._imports[waiting.pop()] - found:
                found.add(name)
                file = f"{name.replace('.', '/')}.py"
                if file in self._imports:
                    waiting.append(file)
        return frozenset(found)

    def _of_c(self, path: str, line: int) -> tuple[str, ...]:
        by_name, files = self._of_c_by_name(path), self._counted.get(path, {})
        counted = max((each for each in files.get("", ()) if each <= line), default=0)
        ran = {name for name, lines in files.items() if counted in lines and line - counted <= STATEMENT}
        near = [name for name in by_name if name in ran]
        # Of the others, first who runs most of the file.
        others = sorted((ran & {*self._tests}) - {*near}, key=lambda name: (-len(files[name]), name))
        known = [*near, *others][: MOST_FILES - NOT_COUNTED]
        return (*known, *[name for name in by_name if name not in known][: NOT_COUNTED if ran else MOST_FILES])

    def _of_c_by_name(self, path: str) -> list[str]:
        folders = next((tests for place, tests in TESTS_OF_C.items() if f"{path}/".startswith(f"{place}/")), ())
        stem = {*Path(path).stem.split("_")}
        # Where a walk has its name, those of other sources show little of it.
        has_own = any(WHOLE in _words(name) and stem & _words(name) for name in self._tests if name.startswith(folders))
        order = {
            name: (not stem & _words(name), WHOLE not in _words(name) or (has_own and not stem & _words(name)), place)
            for name in reversed(self._tests)
            for place, folder in reversed([*enumerate(folders)])
            if name == folder or name.startswith(f"{folder}/")
        }
        return _ordered(order)


def cheapest_first(files: Sequence[str], lasted: Mapping[str, float]) -> tuple[str, ...]:
    """Return files of tests, nearest first, in the order in which they are asked: the next one before a longer one.

    Args:
        files: The nearest first.
        lasted: Seconds that they take, where that is known.
    """
    cost = {name: (place + 1) ** SELDOM * max(lasted.get(name, UNKNOWN_S), LEAST_S) for place, name in enumerate(files)}
    return tuple(sorted(files, key=cost.__getitem__))


def counted_lines(folder: Path, root: Path) -> Counted:
    """Return what a run of the suite has counted, by source file; nothing where there was none."""
    found: dict[str, dict[str, frozenset[int]]] = {}
    for file in sorted(folder.glob("by_test/*.json")):
        for test, sources in json.loads(file.read_text(encoding="utf-8")).items():
            for source, lines in sources.items():
                if Path(source).is_relative_to(root):
                    of_source = found.setdefault(Path(source).relative_to(root).as_posix(), {})
                    of_source[test] = of_source.get(test, frozenset()) | frozenset(lines)
    return found


@cache
def _in_functions(path: Path) -> frozenset[int]:
    """Return the lines of a module that run when a function is called: of what stands before its body, none."""
    nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if path.exists() else ()
    made = [each for each in nodes if isinstance(each, ast.FunctionDef | ast.AsyncFunctionDef)]
    return frozenset(line for each in made for line in range(each.body[0].lineno, (each.end_lineno or 0) + 1))


def _ordered(distances: Mapping[str, tuple[int, ...] | None]) -> list[str]:
    ordered = sorted((distance, name) for name, distance in distances.items() if distance is not None)
    return [name for _, name in ordered]


@cache
def _words(test: str) -> frozenset[str]:
    return frozenset(word for part in Path(test).with_suffix("").parts[1:] for word in part.split("_"))


def _folder(test: str) -> str:
    return test.rpartition("/")[0]


def _apart(one: str, other: str) -> int:
    """Return how many steps lead from one folder to the other."""
    parts, others = one.split("/"), other.split("/")
    same = next((place for place, (a, b) in enumerate(zip(parts, others, strict=False)) if a != b), None)
    same = min(len(parts), len(others)) if same is None else same
    return len(parts) + len(others) - 2 * same


@cache
def _imports(path: Path) -> frozenset[str]:
    found = set[str]()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return frozenset(found)
