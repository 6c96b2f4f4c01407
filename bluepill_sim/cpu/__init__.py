"""The Cortex-M3 itself: instructions run on Unicorn; nothing else of the package knows that."""

from bluepill_sim.cpu.engine import Engine
from bluepill_sim.cpu.halt import Halt, HaltKind
from bluepill_sim.cpu.registers import GENERAL, Register, RegisterFile

__all__ = ["GENERAL", "Engine", "Halt", "HaltKind", "Register", "RegisterFile"]
