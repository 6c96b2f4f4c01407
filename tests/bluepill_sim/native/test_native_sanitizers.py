"""The native core runs under the address and undefined-behaviour sanitizers, and with every warning an error."""

from pathlib import Path

import pytest

from tests.tools.examples import EXAMPLES
from tests.tools.suite.sanitized import built_sanitized, needs_compiler, printed_under_sanitizers

SOURCES = sorted((Path(__file__).parents[3] / "bluepill_sim" / "extension" / "source").rglob("*.c"))
UNOPTIMISED = Path(__file__).parents[1] / "firmware" / "unoptimised.elf"
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

pytestmark = needs_compiler


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the library; the interpreter's dispatch by a switch, since all other tests run the other one."""
    return built_sanitized(tmp_path_factory.mktemp("built") / "core.so", SOURCES, "-DINTERPRETER_PORTABLE")


@pytest.mark.parametrize("core", ["native", "own"])
def test_no_warning_and_no_finding(library: Path, tmp_path: Path, core: str) -> None:
    programs = (*(str(EXAMPLES / f"{name}.elf") for name in ("dodge", "motors", "encoders")), str(UNOPTIMISED))
    printed = printed_under_sanitizers(PROGRAM, str(library), str(tmp_path / "pins.vcd"), *programs, P2OS_CORE=core)
    assert printed.split() == ["NativeEngine"]
