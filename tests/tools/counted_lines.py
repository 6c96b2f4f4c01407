"""Which lines and branches of the packages run: `pytest --count-lines FOLDER`, for tools/check_coverage.py.

Each process of a run writes a file of its own, and one in `by_test` with the lines that each file of tests ran, which
tools/mutants asks. slipcover puts probes into the bytecode of what is imported: calls,
each behind an instruction that does nothing, and that becomes a jump over the call once it was seen.

slipcover itself makes new code for that jump and looks for all functions that have the old one; here it is written
in place, between two tests. And slipcover makes a module's probes in every process, 20 s in each; here they are made
once and kept by the hash of the source, as bytecode is. From Python 3.12 on the interpreter takes probes out.
"""

import ast
import ctypes
import hashlib
import json
import marshal
import os
import sys
from collections import defaultdict
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dis import opmap
from functools import partial
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from pathlib import Path
from types import CodeType, ModuleType

import slipcover.slipcover
from _pytest.assertion.rewrite import AssertionRewritingHook
from slipcover import Slipcover, branch

PACKAGES = ("simbase", "p2os", "bluepill_sim", "adapter_sim", "robot_bench", "hardware")
#: Beside `# pragma: no cover` and `if TYPE_CHECKING:`, which slipcover leaves out by itself.
UNCOUNTED = (r"@overload", r"raise NotImplementedError", r"\.\.\.$")
#: Whether probes are calls within the code, and can be kept with it.
IS_IN_CODE = sys.version_info < (3, 12)
#: Where code is kept, in the project.
KEPT = Path(".pytest_cache", "counted")
#: Stands in kept code for what a probe calls.
CALLED = "what a probe calls"
#: Whatever else changes what is kept.
MAKER = Path(__file__).read_bytes() + f"{sys.version} {slipcover.__version__}".encode()

Label = int | tuple[int, int]  # a line, or a branch's two lines


def is_ours(module: str) -> bool:
    """Tell whether a module is one of the packages."""
    return module.partition(".")[0] in PACKAGES


def modules(root: Path) -> list[Path]:
    """Return the files of all modules of the packages."""
    return [path for package in PACKAGES for path in sorted((root / package).rglob("*.py"))]


class Numbers:
    """In place of slipcover's module of probes: a probe is its number in the file."""

    signal = CALLED

    def __init__(self) -> None:
        self._made = 0

    def new(self, _counter: Slipcover, _file: str, _label: Label, _threshold: int) -> int:
        """Return the next number."""
        self._made += 1
        return self._made - 1


def in_order_of_probes(code: CodeType) -> Iterator[CodeType]:
    """Go through a module's code, what is within a function before the function."""
    for each in code.co_consts:
        if isinstance(each, CodeType):
            yield from in_order_of_probes(each)
    yield code


def code_of(counter: Slipcover, path: Path) -> CodeType:
    """Return a module's code with slipcover's probes."""
    return counter.instrument(compile(branch.preinstrument(ast.parse(path.read_bytes())), str(path), "exec"))


def code_to_keep(path: Path) -> bytes:
    """Return a module's code, where its probes are, and which lines and branches there are, marshalled."""
    counter = Slipcover(branch=True)
    slipcovers, slipcover.slipcover.probe = slipcover.slipcover.probe, Numbers()
    try:
        code = code_of(counter, path)
    finally:
        slipcover.slipcover.probe = slipcovers
    places = [counter.code2index[each] for each in in_order_of_probes(code)]
    return marshal.dumps((code, places, counter.code_lines[str(path)], counter.code_branches[str(path)]))


def keep(path: Path, root: Path) -> Path:
    """Return the file where a module's code is kept, made where that is not done."""
    made_of = (str(path).encode(), path.read_bytes(), MAKER)
    file = root / KEPT / hashlib.sha256(b"\0".join(made_of)).hexdigest()
    if not file.exists():
        file.parent.mkdir(parents=True, exist_ok=True)
        part = file.with_suffix(f".{os.getpid()}")
        part.write_bytes(code_to_keep(path))
        part.replace(file)
    return file


def keep_all(root: Path) -> None:
    """Keep the code of all modules, on all cores, and of no others."""
    with ProcessPoolExecutor() as pool:
        kept = {*pool.map(partial(keep, root=root), modules(root), chunksize=8)}
    for file in {*(root / KEPT).glob("*")} - kept:
        file.unlink()


class Counter(Slipcover):
    """slipcover's counter, with code that is kept and probes that are taken out in place."""

    def __init__(self, root: Path) -> None:
        super().__init__(branch=True, exclude_also=list(UNCOUNTED))
        self._root = root
        self._counted: list[tuple[CodeType, set[int], list[tuple[int, Label]]]] = []  # of each: seen, where which are
        self._taken_out: list[tuple[int, int]] = []  # where a probe was, and the instruction that stood there
        self._since = defaultdict[str, set[int]](set)  # lines seen since they were last reported, by file

    def code_of(self, path: Path) -> CodeType:
        """Return a module's code with probes, and count what they see from now on."""
        if not IS_IN_CODE:
            return code_of(self, path)
        kept = marshal.loads(keep(path, self._root).read_bytes())  # noqa: S302 - of this tool's own making
        code, places, self.code_lines[str(path)], self.code_branches[str(path)] = kept
        seen = set[int]()
        code = calling(code, seen)
        probes = [
            (id(each) + CodeType.__basicsize__ + offset, label)
            for each, labels in zip(in_order_of_probes(code), places, strict=True) for offset, label in labels
        ]  # fmt: skip
        self._counted.append((code, seen, probes))  # the code, for what is freed may not be written to
        return code

    def take_out_seen(self) -> None:
        """Note what was seen since the last time, and take its probes out."""
        for code, seen, probes in self._counted:
            while seen:
                address, label = probes[seen.pop()]
                self.all_seen[code.co_filename].add(label)
                if isinstance(label, int):
                    self._since[code.co_filename].add(label)
                instruction = ctypes.c_ubyte.from_address(address)
                self._taken_out.append((address, instruction.value))
                instruction.value = opmap["JUMP_FORWARD"]

    def lines_since(self) -> dict[str, list[int]]:
        """Return the lines seen since this was last asked, by file, and put their probes back."""
        self.take_out_seen()
        for address, instruction in self._taken_out:
            ctypes.c_ubyte.from_address(address).value = instruction
        self._taken_out.clear()
        found = {file: sorted(lines) for file, lines in self._since.items()}
        self._since.clear()
        return found

    def seen(self) -> dict[str, list[Label]]:
        """Return all lines and branches that were seen, by file."""
        self.take_out_seen()
        for file, labels in self._get_newly_seen().items():  # those that the interpreter tells of
            self.all_seen[file].update(labels)
        return {file: sorted(labels, key=str) for file, labels in self.all_seen.items()}


def calling(code: CodeType, seen: set[int]) -> CodeType:
    """Return code whose probes add their numbers to a set."""
    consts = (
        calling(each, seen) if isinstance(each, CodeType) else seen.add if each == CALLED else each
        for each in code.co_consts
    )
    return code.replace(co_consts=tuple(consts))


class Loader(SourceFileLoader):
    """Loads a module with probes."""

    def __init__(self, name: str, path: str, counter: Counter) -> None:
        super().__init__(name, path)
        self._counter = counter

    def get_code(self, fullname: str) -> CodeType:  # noqa: ARG002 - a loader has one module
        """Return its code."""
        return self._counter.code_of(Path(self.path))


class Finder(MetaPathFinder):
    """Finds the modules of the packages in the project, and has them loaded with probes."""

    def __init__(self, root: Path, counter: Counter) -> None:
        self._root, self._counter = root, counter

    def find_spec(self, name: str, path: Sequence[str] | None, _target: ModuleType | None = None) -> ModuleSpec | None:
        """Return what says of a module of the packages how it is loaded, and nothing of others."""
        spec = PathFinder.find_spec(name, path) if is_ours(name) else None
        if spec is None or spec.origin is None or type(spec.loader) is not SourceFileLoader:
            return None
        if not Path(spec.origin).is_relative_to(self._root):
            return None
        spec.loader = Loader(name, spec.origin, self._counter)
        return spec


class LineCounter:
    """A plugin of pytest, in place before any of the packages is imported."""

    def __init__(self, root: Path, folder: Path, *, is_worker: bool) -> None:
        # Where the project is installed its own plugin of pytest comes first. What that has imported is imported anew,
        # and not by pytest, which takes all modules of a plugin's distribution for ones with assertions to rewrite.
        for name in filter(is_ours, list(sys.modules)):
            del sys.modules[name]
        for finder in sys.meta_path:
            if isinstance(finder, AssertionRewritingHook):
                finder._must_rewrite.difference_update([*filter(is_ours, finder._must_rewrite)])
                finder._marked_for_rewrite_cache.clear()
        if IS_IN_CODE and not is_worker:
            keep_all(root)
        self._folder, self._counter = folder, Counter(root)
        self._finder = Finder(root, self._counter)
        self._by_test: dict[str, list[dict[str, list[int]]]] = {}
        self._test = ""  # the file whose tests run
        sys.meta_path.insert(0, self._finder)

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        """Note what the last file of tests ran when another one begins."""
        if (file := nodeid.partition("::")[0]) != self._test:
            self._note()
            self._test = file

    def pytest_runtest_logfinish(self) -> None:
        """Take out the probes of what was seen."""
        self._counter.take_out_seen()

    def _note(self) -> None:
        self._by_test.setdefault(self._test, []).append(self._counter.lines_since())

    def pytest_unconfigure(self) -> None:
        """Write what was seen."""
        sys.meta_path.remove(self._finder)
        self._folder.mkdir(exist_ok=True)
        self._note()
        (self._folder / "by_test").mkdir(exist_ok=True)
        for file, found in (
            (f"{os.getpid()}.json", self._counter.seen()),
            (f"by_test/{os.getpid()}.json", self._lines()),
        ):
            (self._folder / file).write_text(json.dumps(found), encoding="utf-8")

    def _lines(self) -> dict[str, dict[str, list[int]]]:
        """Return the lines that each file of tests ran; what was imported before the first is nobody's."""
        reported: dict[str, dict[str, list[int]]] = {}
        for test, parts in self._by_test.items():
            lines = defaultdict[str, set[int]](set)
            for file, of_part in ((file, each) for part in parts for file, each in part.items()):
                lines[file].update(of_part)
            reported[test] = {file: sorted(each) for file, each in lines.items()}
        reported.pop("", None)
        return reported
