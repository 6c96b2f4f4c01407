"""`p2os mcu run --budget`: the end comes when it was promised, whatever a program costs."""

import struct
import time
from pathlib import Path

import pytest

from p2os.cli.main import run
from tests.bluepill_sim.machine import Machine


def test_a_program_that_resets_itself_over_and_over_keeps_to_the_budget(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    source = "mov32 r1, #0xE000ED0C\nmov32 r2, #0x05FA0004\nstr r2, [r1, #0]\n"
    ((_, program),) = Machine(source, {}).image.segments
    path = tmp_path / "resets.bin"
    path.write_bytes(program)
    assert struct.unpack_from("<I", program)[0] == 0x2000_5000
    began_s = time.monotonic()
    assert run(["mcu", "run", str(path), "--for", "10s", "--budget", "0.5s"]) == 1
    assert time.monotonic() - began_s < 3
    error = capfd.readouterr().err
    assert "0.5 s of wall clock are used up" in error
    assert " resets (SOFTWARE " in error
