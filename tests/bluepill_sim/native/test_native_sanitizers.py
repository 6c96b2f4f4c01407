"""The native core runs under the address and undefined-behaviour sanitizers, and with every warning an error."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.tools.examples import EXAMPLES

SOURCES = sorted((Path(__file__).parents[3] / "bluepill_sim" / "extension" / "source").rglob("*.c"))
UNOPTIMISED = Path(__file__).parents[1] / "firmware" / "unoptimised.elf"
COMPILER = shutil.which("gcc")
PROGRAM = """
import sys
from bluepill_sim.extension import library
library.library_path = lambda: sys.argv[1]
from pathlib import Path
from bluepill_sim import BluePill
from bluepill_sim.analysis.probe import Probe
from bluepill_sim.analysis.waveforms.vcd_writer import write_vcd
for program in sys.argv[3:]:
    board = BluePill(program)
    board.chip.record_blocks(100)
    for step in range(40):
        board.pin("PA4").drive(step % 3 == 0)
        board.usart1.receive(b"x")
        board.advance_to(board.now_ns + 777_777)
    probe = Probe(board)
    board.advance_to(board.now_ns + 300_000_000)
    probe.finish()
    write_vcd(probe, Path(sys.argv[2]))
    snapshot = board.snapshot()
    board.advance_to(board.now_ns + 5_000_000)
    board.restore(snapshot)
    board.advance_to(board.now_ns + 5_000_000)
print(type(board.chip.engine).__name__)
"""

pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C compiler")


def run(*command: str, **environment: str) -> str:
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=120, check=False, env={**os.environ, **environment}
    )
    assert done.returncode == 0, done.stderr[-4000:]
    return done.stdout


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the library; the interpreter's dispatch by a switch, since all other tests run the other one.

    A null pointer and a place beside an object end it by the address sanitizer: to look for them twice takes 3 s.
    """
    library = tmp_path_factory.mktemp("built") / "core.so"
    run(
        "gcc", "-std=c11", "-Og", "-g1", "-Wall", "-Wextra", "-Wconversion", "-Wno-sign-conversion", "-Werror", "-fPIC",
        "-shared", "-fsanitize=address,undefined", "-fno-sanitize=null,object-size", "-fno-sanitize-recover=all",
        "-DINTERPRETER_PORTABLE", "-o", str(library), *map(str, SOURCES),
    )  # fmt: skip
    return library


@pytest.mark.parametrize("core", ["native", "own"])
def test_no_warning_and_no_finding(library: Path, tmp_path: Path, core: str) -> None:
    preload = run("gcc", "-print-file-name=libasan.so").strip()
    if not Path(preload).is_file():
        pytest.skip("the compiler comes without a sanitizer's library")
    printed = run(
        sys.executable,
        "-c",
        PROGRAM,
        str(library),
        str(tmp_path / "pins.vcd"),
        *(str(EXAMPLES / f"{name}.elf") for name in ("dodge", "motors", "encoders")),
        str(UNOPTIMISED),
        LD_PRELOAD=preload,
        ASAN_OPTIONS="detect_leaks=0",
        P2OS_CORE=core,
    )
    assert printed.split() == ["NativeEngine"]
