"""The libraries in C and C++ with one source changed: compiled beside the tree, linked from what did not change.

Which sources and flags make a library says pyproject.toml. Optimised less than what is installed, and not as a whole:
the same program, sooner built.
"""

import hashlib
import os
import shlex
import subprocess
import tomllib
from collections.abc import Iterable
from copy import copy
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tools.mutants.mutant import SourceMutant

#: Most time that a compiler has for one source, or a linker.
COMPILER_LIMIT_S = 120
#: Of files that a library may be made of.
ENDINGS = (".c", ".h", ".cpp", ".hpp", ".inc")


@dataclass(frozen=True, slots=True, kw_only=True)
class Library:
    """One library: where it is built, of which sources, how."""

    file: str
    sources: tuple[str, ...]
    compiler: tuple[str, ...]


def libraries(root: Path) -> tuple[Library, ...]:
    """Return the libraries that are built with the packages."""
    modules = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]["ext-modules"]
    return tuple(_library(module, root) for module in modules)


def _library(module: dict[str, Any], root: Path) -> Library:
    default, variable = ("g++", "CXX") if module.get("language") == "c++" else ("gcc", "CC")
    flags = [flag for flag in module.get("extra-compile-args", []) if not flag.startswith(("-O", "-W"))]
    includes = [f"-I{folder}" for folder in module.get("include-dirs", [])]
    macros = ["-D" + "=".join(macro) for macro in module.get("define-macros", [])]
    sources = [path.relative_to(root).as_posix() for each in module["sources"] for path in root.glob(each)]
    return Library(
        file=str(module["name"]).replace(".", "/") + ".so",
        sources=tuple(sorted(sources)),
        compiler=(*shlex.split(os.environ.get(variable, default)), "-O1", "-fPIC", "-w", *flags, *includes, *macros),
    )  # fmt: skip


class Natives:
    """The libraries that some files are part of, in one copy of the tree.

    Args:
        tree: The copy; it holds sound sources but in `built_with`.
        scratch: A folder for what is compiled.
        paths: The files that will change.
        kept: Where the objects of sound sources are kept from one run to the next.

    Raises:
        OSError: A source does not compile as it stands.
    """

    def __init__(self, tree: Path, scratch: Path, paths: Iterable[str], kept: Path) -> None:
        self._tree, self._objects, self._scratch = tree, scratch, scratch
        folders = {tuple(path.split("/")[:2]) for path in paths if not path.endswith(".py")}
        self._libraries = [
            library for library in libraries(tree)
            if folders & {tuple(source.split("/")[:2]) for source in library.sources}
        ]  # fmt: skip
        self._needs: dict[Path, frozenset[str]] = {}  # of an object, the files that it is made of
        for library in self._libraries:
            of_library = sources_digest(tree, library)
            for name in library.sources:
                file = self._object(library, name)
                before = [kept / f"{of_library}-{file.name}{ending}" for ending in ("", ".d")]
                if not all(each.exists() for each in before):
                    compiled = self._compiled(library, name)
                    if compiled is None:
                        raise OSError(f"{name} does not compile as it stands (hint: make setup)")
                    kept.mkdir(parents=True, exist_ok=True)
                    before[1].write_bytes((scratch / "made.d").read_bytes())
                    before[0].write_bytes(compiled)
                file.write_bytes(before[0].read_bytes())
                self._needs[file] = _needs(before[1])

    def beside(self, tree: Path, scratch: Path) -> "Natives":
        """Return those of another copy, which need not compile what is sound again."""
        other = copy(self)
        other.__dict__ |= {"_tree": tree, "_scratch": scratch}
        return other

    def built_with(self, mutant: SourceMutant) -> dict[str, bytes] | None:
        """Return the libraries that a change makes other ones, by their files; None where it does not compile.

        The tree holds the change while this is called, and held none before. Empty where the compiler makes the
        same program of it.
        """
        built: dict[str, bytes] = {}
        for library in self._libraries:
            concerned = [name for name in library.sources if mutant.path in self._needs[self._object(library, name)]]
            changed = {name: self._compiled(library, name) for name in concerned}
            if None in changed.values():
                return None
            if any(object_ != self._object(library, name).read_bytes() for name, object_ in changed.items()):
                linked = self._linked(library, changed)
                if linked is None:
                    return None
                built[library.file] = linked
        return built

    def knows(self, path: str) -> bool:
        """Tell whether a file is part of a library."""
        return any(path in needs for needs in self._needs.values())

    def _object(self, library: Library, name: str) -> Path:
        return self._objects / f"{Path(library.file).stem}-{name.replace('/', '-')}.o"

    def _compiled(self, library: Library, name: str) -> bytes | None:
        made, needs = self._scratch / "made.o", self._scratch / "made.d"
        words = [*library.compiler, "-c", name, "-o", str(made), "-MMD", "-MF", str(needs)]
        return made.read_bytes() if self._run(words) else None

    def _linked(self, library: Library, changed: dict[str, bytes | None]) -> bytes | None:
        objects = [self._object(library, name) for name in library.sources if name not in changed]
        for number, object_ in enumerate(changed.values()):
            objects.append(self._scratch / f"changed{number}.o")
            objects[-1].write_bytes(object_ or b"")
        made = self._scratch / "made.so"
        words = [*library.compiler, "-shared", *map(str, objects), "-o", str(made), "-Wl,--no-undefined", "-lm"]
        return made.read_bytes() if self._run(words) else None

    def _run(self, words: list[str]) -> bool:
        try:
            done = subprocess.run(words, cwd=self._tree, capture_output=True, check=False, timeout=COMPILER_LIMIT_S)
        except subprocess.TimeoutExpired:
            return False
        return done.returncode == 0


def _needs(file: Path) -> frozenset[str]:
    """Return the project's files that an object is made of, as the compiler notes them."""
    rule = file.read_text(encoding="utf-8").replace("\\\n", " ").partition(":")[2]
    inside = (os.path.normpath(word) for word in rule.split() if not word.startswith("/"))
    return frozenset(Path(each).as_posix() for each in inside)


def sources_digest(tree: Path, library: Library) -> str:
    """Return a name of all that a library may be made of."""
    hashed = hashlib.sha256(repr(library).encode())
    for folder in sorted({name.split("/")[0] for name in library.sources}):
        for path in sorted((tree / folder).rglob("*")):
            if path.suffix in ENDINGS:
                hashed.update(f"{path.relative_to(tree)}\0".encode() + hashlib.sha256(path.read_bytes()).digest())
    return hashed.hexdigest()[:16]
