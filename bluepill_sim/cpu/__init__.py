"""The Cortex-M3 itself: instructions run on Unicorn; nothing else of the package knows that."""

from bluepill_sim.cpu.debug_unit import WatchKind, Watchpoint
from bluepill_sim.cpu.engine import Engine
from bluepill_sim.cpu.frozen import it_state_of
from bluepill_sim.cpu.halt import DEBUG_HALTS, Halt, HaltKind
from bluepill_sim.cpu.recorder import BLOCK, EXCEPTION_RETURN, BlockRecorder, Row
from bluepill_sim.cpu.registers import GENERAL, Register, RegisterFile

__all__ = [
    "BLOCK", "DEBUG_HALTS", "EXCEPTION_RETURN", "GENERAL",
    "BlockRecorder", "Engine", "Halt", "HaltKind", "Register", "RegisterFile", "Row", "WatchKind", "Watchpoint",
    "it_state_of",
]  # fmt: skip
