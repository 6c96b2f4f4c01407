"""`p2os mcu run --budget`: the end comes when it was promised, whatever a program costs."""

import struct
from dataclasses import dataclass
from pathlib import Path

import pytest

from bluepill_sim.__main__ import run
from bluepill_sim.board import BluePill
from bluepill_sim.cli import run as run_verb
from simbase.timing import NS_PER_S, Nanos
from tests.bluepill_sim.machine import Machine

#: What a reset costs on the clock of these tests.
RESET_NS: Nanos = 200_000


@dataclass
class Clock:
    """In the place of `time`: it goes on by what a board does."""

    boards: list[BluePill]

    def monotonic_ns(self) -> Nanos:
        return sum(board.resets.total() for board in self.boards) * RESET_NS


def test_a_program_that_resets_itself_over_and_over_keeps_to_the_budget(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    source = (  # it puts PC13 low meanwhile: one that does nothing but reset is ended before
        "mov32 r1, #0x40021018\nmov32 r2, #0x10\nstr r2, [r1, #0]\n"
        "mov32 r1, #0x40011004\nmov32 r2, #0x44244444\nstr r2, [r1, #0]\n"
        "mov32 r1, #0xE000ED0C\nmov32 r2, #0x05FA0004\nstr r2, [r1, #0]\n"
    )
    ((_, program),) = Machine(source, {}).image.segments
    path = tmp_path / "resets.bin"
    path.write_bytes(program)
    assert struct.unpack_from("<I", program)[0] == 0x2000_5000
    boards: list[BluePill] = []

    def make(*words: object, **options: object) -> BluePill:
        boards.append(BluePill(*words, **options))  # type: ignore[arg-type]  # what the verb says
        return boards[0]

    monkeypatch.setattr(run_verb, "BluePill", make)
    monkeypatch.setattr(run_verb, "time", Clock(boards))
    assert run(["run", str(path), "--for", "10s", "--budget", "0.5s"]) == 1
    took_s = boards[0].resets.total() * RESET_NS / NS_PER_S
    assert 0.5 < took_s <= 0.5 + 2 * run_verb.LOOK_S
    error = capfd.readouterr().err
    assert "0.5 s of wall clock are used up" in error
    assert " resets (SOFTWARE " in error
