"""What pyproject.toml cannot say: how parts in C and C++ are built, a wheel's tag and bill of materials, and its page.

A part that does not compile fails the build, and so does a missing compiler: there is no lesser wheel that nobody asked
for. `P2OS_NATIVE=0` leaves the parts out, and a file beside each says so, which `p2os doctor` tells.
`P2OS_WHEEL_PLATFORM` is the platform of a wheel whose compiler (`CC`, `CXX`) builds for another machine.
"""

import os
import re
import shutil
import subprocess
from copy import copy
from pathlib import Path

from setuptools import Extension, setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_ext import build_ext
from setuptools.errors import CompileError, PlatformError

#: Parts whose files are optimised together: a word that a device moves goes through six of them. Clang's may lack the
#: linker's half, and a build must not fail for it.
OPTIMISED_WHOLE, WHOLE = ("bluepill_sim._native",), ("-flto=auto",)
#: The platform that is built for; empty: this one.
PLATFORM = os.environ.get("P2OS_WHEEL_PLATFORM", "")
#: The bill of materials that staging has written, and where a wheel has it (PEP 770).
BILL, BILLS = Path("sbom.cdx.json"), "sboms"
README_LINK = re.compile(r"(!?)\[([^]]*)\]\((?!https?:)([^)#]*)[^)]*\)")


class BuildParts(build_ext):
    """Builds the parts."""

    def finalize_options(self) -> None:
        """Expand the patterns among the files of each part, and build as many parts at once as there are cores."""
        super().finalize_options()
        self.parallel = self.parallel or os.cpu_count()
        for part in self.extensions:
            part.sources = expanded(part.sources)
            part.depends = expanded(part.depends)

    def run(self) -> None:
        """Build, and write down what was left out and why."""
        is_wanted = os.environ.get("P2OS_NATIVE") != "0"
        for part in self.extensions:
            self._remove(part.name)
            self._note(part.name).unlink(missing_ok=True)
            if not is_wanted:
                self._note(part.name).parent.mkdir(parents=True, exist_ok=True)
                self._note(part.name).write_text("P2OS_NATIVE=0 was set\n", encoding="utf-8")
                self.warn(f"{part.name} is left out: P2OS_NATIVE=0 was set")
        self.left_out = [] if is_wanted else [part.name for part in self.extensions]
        self.extensions = self.extensions if is_wanted else []
        super().run()

    def build_extensions(self) -> None:
        """Build each part.

        Raises:
            CompileError: One does not compile.
            PlatformError: There is no compiler.
        """
        for part in self.extensions:
            language, attribute = ("C++", "compiler_cxx") if part.language == "c++" else ("C", "compiler")
            if not self._has(attribute):
                raise PlatformError(
                    f"no {language} compiler was found, which {part.name} needs (apt-get install g++ libc6-dev; "
                    "with P2OS_NATIVE=0 in the environment it is left out)"
                )
        super().build_extensions()

    def build_extension(self, ext: Extension) -> None:
        """Build a part, from objects of its own.

        Raises:
            CompileError: It does not compile.
        """
        if ext.name in OPTIMISED_WHOLE and self._is_gcc():
            ext.extra_compile_args = [*ext.extra_compile_args, *WHOLE]
            ext.extra_link_args = [*ext.extra_link_args, "-O2", *WHOLE]
        own = copy(self)  # parts are built at the same time, and some of the same sources, by other flags
        own.build_temp = str(Path(self.build_temp, ext.name))
        try:
            super(BuildParts, own).build_extension(ext)
        except CompileError as error:
            raise CompileError(
                f"{ext.name} does not compile: {error} (the compiler's words stand above; "
                "with P2OS_NATIVE=0 in the environment p2os is installed without it)"
            ) from error

    def get_ext_filename(self, ext_name: str) -> str:
        """Return the file of a part: no tag of a Python, for it calls nothing of Python's; ctypes loads it."""
        is_windows = PLATFORM.startswith("win") if PLATFORM else os.name == "nt"
        return f"{ext_name.replace('.', os.sep)}.{'pyd' if is_windows else 'so'}"

    def get_outputs(self) -> list[str]:
        """Return the files that are installed, the notes among them."""
        return [*super().get_outputs(), *(str(self._note(name)) for name in getattr(self, "left_out", []))]

    def _has(self, attribute: str) -> bool:
        """Tell whether a compiler is there."""
        try:
            self.compiler.initialize()  # Microsoft's is looked for here
        except PlatformError:
            return False
        except AttributeError:
            pass
        command = getattr(self.compiler, attribute, None)
        return not command or shutil.which(command[0]) is not None

    def _is_gcc(self) -> bool:
        """Tell whether the compiler is GCC, which links what it has left for the linker by itself."""
        command = getattr(self.compiler, "compiler", None)
        if not command:
            return False
        said = subprocess.run(  # noqa: S603  # the compiler that builds it
            [command[0], "-dM", "-E", "-x", "c", os.devnull], capture_output=True, text=True, check=False
        )
        return "__GNUC__" in said.stdout and "__clang__" not in said.stdout

    def _remove(self, name: str) -> None:
        """Remove what earlier builds have left, or it would be installed, or loaded first."""
        path = Path(self.get_ext_fullpath(name))
        for folder in (path.parent, Path(*name.split(".")[:-1])):  # in an editable installation the sources'
            for left in folder.glob(f"{path.stem}.*{path.suffix}"):
                left.unlink()
        path.unlink(missing_ok=True)

    def _note(self, name: str) -> Path:
        return Path(self.get_ext_fullpath(name)).with_name(f"{name.rpartition('.')[2]}.left_out")


class AnyPython(bdist_wheel):
    """A wheel for every Python 3 of a platform, or of any where it holds no part in C."""

    def get_tag(self) -> tuple[str, str, str]:
        """Return the tag: no part is bound to the ABI of a Python."""
        return ("py3", "none", PLATFORM if PLATFORM and not self.root_is_pure else super().get_tag()[2])

    def egg2dist(self, egginfo_path: str, distinfo_path: str) -> None:
        """Make the folder about the distribution, with its bill of materials."""
        super().egg2dist(egginfo_path, distinfo_path)
        if BILL.is_file():
            bills = Path(distinfo_path, BILLS)
            bills.mkdir()
            shutil.copy2(BILL, bills / BILL.name)


def expanded(patterns: list[str]) -> list[str]:
    """Return the files that patterns stand for."""
    return [file.as_posix() for pattern in patterns for file in sorted(Path().glob(pattern))]


def page() -> str:
    """Return README.md for a page outside the repository: relative links become words, pictures go."""
    text = README_LINK.sub(
        lambda found: "" if found[1] else found[2] if found[2] == found[3] else f"{found[2]} (`{found[3]}`)",
        Path("README.md").read_text(encoding="utf-8"),
    )
    return f"{text}\nThe files named here are in the source distribution.\n"


setup(
    cmdclass={"build_ext": BuildParts, "bdist_wheel": AnyPython},
    long_description=page(),
    long_description_content_type="text/markdown",
)
