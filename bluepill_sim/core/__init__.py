"""The Cortex-M3 itself: instructions run on Unicorn; nothing else of the package knows that.

What another engine would have to be: everything of `Engine` without an
underscore, which is all that `processor.py`, `chip.py` and `board.py` use.

    run(stop_at)          to the first block boundary at or after a cycle, or to what ends the run before: a `Halt`
    step(stop_at)         one instruction
    cycle, pc, is_thumb   the state between runs; `jump` sets the last two; `it_state` is ITSTATE where it matters
    stop_at               moved by callbacks from inside a run: 0 ends it at the next boundary
    block, access_cycle, access_pc   inside an access: the block that runs, the accessing instruction and its time
    registers             `RegisterFile`
    map_memory, map_io, drop_code, forget_costs, on_read_only_write, on_read_only_written
    set_traps, stops_after_mask_change, on_event, note_raised, clear_exclusive
    breakpoints, watchpoints, is_inside_block, recorder   for debuggers and tools
    snapshot, restore

A debugger's halts stand inside a block. The rest of that block keeps the
cycles and the end of the run that it had, and nothing may interrupt there, so
that a run with halts is the same as one without.
"""

from bluepill_sim.core.blocks import it_state_of
from bluepill_sim.core.debugging.debug_unit import WatchKind, Watchpoint
from bluepill_sim.core.engine import Engine
from bluepill_sim.core.halts import DEBUG_HALTS, Halt, HaltKind
from bluepill_sim.core.recorder import BLOCK, EXCEPTION_RETURN, BlockRecorder, BlockRow
from bluepill_sim.core.unicorn_core import GENERAL, Reg, RegisterFile

__all__ = [
    "BLOCK",
    "DEBUG_HALTS",
    "EXCEPTION_RETURN",
    "GENERAL",
    "BlockRecorder",
    "BlockRow",
    "Engine",
    "Halt",
    "HaltKind",
    "Reg",
    "RegisterFile",
    "WatchKind",
    "Watchpoint",
    "it_state_of",
]  # fmt: skip
