"""Read the ESP32's program with a PC's compiler, against stub headers of our own: `python adapter_fw/check_esp32.py`.

This is no build: it shows that names, types and the board's tables fit together,
for each board and each pad. The ESP32's compiler and libraries are not reachable
from here; nothing has been flashed.
"""

import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
COMPILER = "g++"
BOARDS = ("rev_b", "rev_c", "thesis_board", "thesis_table3")
PADS = ("none", "bluepad32")
FLAGS = (
    "-std=c++17", "-Wall", "-Wextra", "-Wshadow", "-Werror", "-fno-exceptions", "-fno-rtti", "-fsyntax-only",
    "-isystem", str(HERE / "stubs" / "esp32"),
)  # fmt: skip


def sources(pad: str) -> list[Path]:
    """Return the program's own sources, with one of the pads."""
    pads = {f"pad_{other}.cpp" for other in PADS if other != pad}
    return [path for path in sorted((HERE / "esp32" / "src").glob("*.cpp")) if path.name not in pads]


def complaints(board: str, pad: str, robot: str = "p2dx") -> str:
    """Return the compiler's words; nothing where all is sound."""
    command = [COMPILER, *FLAGS, f'-DADAPTER_ROBOT="{robot}"', "-I", str(HERE / "generated" / board)]
    done = subprocess.run([*command, *map(str, sources(pad))], capture_output=True, text=True, check=False)
    return done.stderr


def main() -> int:
    """Check every board with every pad; the thesis's boards must be refused."""
    failed = 0
    for board in BOARDS:
        for pad in PADS:
            words = complaints(board, pad)
            is_expected = bool(words) is board.startswith("thesis")
            verdict = "refused" if words else "sound"
            print(f"{board}, pad {pad}: {verdict}{'' if is_expected else '  <- not expected'}")
            if not is_expected:
                sys.stderr.write(words)
                failed += 1
    return min(failed, 1)


if __name__ == "__main__":
    sys.exit(main())
