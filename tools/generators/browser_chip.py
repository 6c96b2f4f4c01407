"""Build `bluepill_sim/cli/browser/chip.wasm`: the emulator's C as WebAssembly, for the page of `p2os mcu page`.

Needs Clang and LLD of one major version that know wasm32 (Debian's clang-22 and lld-22). The file is committed, so that
who installs the package needs neither; a test builds it again where both are there and compares the bytes.
Usage: python -m tools.generators.browser_chip
"""

import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TARGET = Path("bluepill_sim/cli/browser/chip.wasm")
#: The version whose bytes are committed; another one makes other bytes of the same program.
VERSION = 22
COMPILER, LINKER = f"clang-{VERSION}", f"wasm-ld-{VERSION}"
#: Of the library, what only Python's files of pins need; it writes files.
LEFT_OUT = frozenset({"edges.c"})
FLAGS = (
    "--target=wasm32", "-O2", "-flto", "-std=gnu11", "-mbulk-memory", "-ffreestanding", "-nostdlib",
    "-fvisibility=default", "-DINTERPRETER_PORTABLE", "-Ibluepill_sim/cli/browser/source/include", "-Wall", "-Wextra",
    "-Wno-gnu-variable-sized-type-not-at-end", "-Wl,--no-entry", "-Wl,--export-dynamic",
    "-Wl,--export=__wasm_call_ctors", "-Wl,--strip-all", "-Wl,-z,stack-size=65536",
)  # fmt: skip


def missing() -> str | None:
    """Return what is missing to build it; None: nothing is."""
    found = [name for name in (COMPILER, LINKER) if shutil.which(name) is None]
    return f"{' and '.join(found)} (hint: apt-get install clang-{VERSION} lld-{VERSION})" if found else None


def build(target: Path) -> None:
    """Build it.

    Raises:
        subprocess.CalledProcessError: It does not compile; the compiler has said why.
    """
    library = (ROOT / "bluepill_sim/extension/source").glob("*/*.c")
    sources = sorted(path for path in library if path.name not in LEFT_OUT)
    sources += sorted((ROOT / "bluepill_sim/cli/browser/source").glob("*.c"))
    names = [path.relative_to(ROOT).as_posix() for path in sources]
    subprocess.run([COMPILER, *FLAGS, "-o", str(target), *names], cwd=ROOT, check=True)


if __name__ == "__main__":
    if (what := missing()) is not None:
        sys.exit(f"browser_chip: {what} is not installed")
    build(ROOT / TARGET)
