"""A copy of the project in which mutants live: the checkout is never touched.

Invariant: between two mutants a copy holds what the checkout held when it was made.
"""

import hashlib
import json
import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import distributions
from pathlib import Path

#: The distribution that the checkout is installed as, and what of its metadata says where its code is.
DISTRIBUTION, DIRECT_URL = "p2os", "direct_url.json"

#: What is built beside sources: libraries, and objects that are named by what they were made of.
BUILT = ("*/*.so", "*/build/objects/*.o")
#: Where in its folder a copy is.
TREE = "tree"
#: Variables that the tests do not get; what is compiled is kept in the copy.
NOT_INHERITED = ("PYTEST", "XDG_", "MAKE", "PYTHONDONTWRITEBYTECODE")


class Tree:
    """A copy: all files that git knows or would add, and what was built beside them.

    Args:
        root: The checkout.
        folder: Where the copy and the metadata of its install go.

    Raises:
        OSError: The project is not installed.
    """

    def __init__(self, root: Path, folder: Path) -> None:
        self.folder = folder / TREE
        self.path = (folder / "installed", self.folder)
        hashed = hashlib.sha256()
        words = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
        listed = subprocess.run(words, cwd=root, capture_output=True, text=True, check=True).stdout.split("\0")
        built = [path.relative_to(root).as_posix() for pattern in BUILT for path in root.glob(pattern)]
        for name in (*filter(None, listed), *built):
            if (root / name).is_file():
                copy = self.folder / name
                copy.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(root / name, copy, follow_symlinks=False)
                hashed.update(f"{name}\0".encode() + hashlib.sha256(copy.read_bytes()).digest())
                if copy.suffix == ".py":
                    _copy_compiled(root / name, copy)
        #: Names what the copy holds.
        self.digest = hashed.hexdigest()
        self._install(self.path[0])

    def _install(self, folder: Path) -> None:
        """Write metadata of an editable install of the copy: packages offer by them what they offer."""
        installed = [each for each in distributions(name=DISTRIBUTION) if each.read_text(DIRECT_URL)]
        if not installed:
            raise OSError(f"{DISTRIBUTION} is not installed from a checkout (hint: make setup)")
        place = folder / f"{DISTRIBUTION}-{installed[0].version}.dist-info"
        place.mkdir(parents=True)
        for name in ("METADATA", "entry_points.txt"):
            (place / name).write_text(installed[0].read_text(name) or "", encoding="utf-8")
        said = {"url": self.folder.as_uri(), "dir_info": {"editable": True}}
        (place / DIRECT_URL).write_text(json.dumps(said), encoding="utf-8")

    def environment(self, home: Path) -> dict[str, str]:
        """Return the environment of tests: the copy comes before what is installed, and the user's files stay his."""
        kept = {name: value for name, value in os.environ.items() if not name.startswith(NOT_INHERITED)}
        path = os.pathsep.join(map(str, self.path))
        return kept | {"PYTHONPATH": path, "HOME": str(home), "TMPDIR": str(home)}

    @contextmanager
    def holding(self, files: dict[str, bytes]) -> Iterator[None]:
        """Hold other contents in some files; what Python compiled of them is dropped before and after.

        A compiled module names its source by length and second: two mutants of one second would be one.
        """
        before = {name: (self.folder / name).read_bytes() for name in files}
        try:
            self._write(files)
            yield
        finally:
            self._write(before)

    def _write(self, files: dict[str, bytes]) -> None:
        for name, text in files.items():
            path = self.folder / name
            for kept in path.parent.glob(f"__pycache__/{path.stem}.*.pyc"):
                kept.unlink(missing_ok=True)
            written = path.with_name(f".{path.name}.written")  # a library that a process has mapped is not written into
            written.write_bytes(text)
            written.replace(path)


def _copy_compiled(source: Path, copy: Path) -> None:
    """Copy what Python and pytest have compiled of a module: they know it by its length and second, which are kept."""
    for kept in source.parent.glob(f"__pycache__/{source.stem}.*.pyc"):
        place = copy.parent / kept.parent.name / kept.name
        place.parent.mkdir(exist_ok=True)
        shutil.copy2(kept, place)
