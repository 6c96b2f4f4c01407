"""The emulator's library in C: found next to the package, loaded by ctypes.

It is built with the package where there is a C compiler (`p2os doctor` says why it is
not there), and the emulator needs it: the devices are in it. `P2OS_CORE=python` in the
environment chooses the Python executor for the core, `native`, the default, the one in C; both run instructions on
Unicorn. `own` is the one in C with the interpreter of our own (`source/interpreter/`) in Unicorn's place.
"""

import ctypes
import os
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from typing import Any

from bluepill_sim.errors import BluePillError
from bluepill_sim.extension.layout import SHARED, structure
from simbase.c_library import built, loaded
from simbase.errors import MissingDependencyError

#: The library, as a module.
PART = "bluepill_sim._native"

#: The name of the environment variable, and what it may hold.
CORE_VARIABLE, CORE_CHOICES = "P2OS_CORE", ("native", "python", "own", "exact")
#: What `core_chosen` says; empty: nothing.
_chosen: ContextVar[str] = ContextVar("core", default="")

UNKNOWN_BLOCK = ctypes.CFUNCTYPE(None, ctypes.c_uint32, ctypes.c_uint32)
READ = ctypes.CFUNCTYPE(ctypes.c_uint32, ctypes.c_uint32, ctypes.c_uint32, ctypes.c_uint32)
WRITE = ctypes.CFUNCTYPE(None, ctypes.c_uint32, ctypes.c_uint32, ctypes.c_uint32, ctypes.c_uint32)
TRAPPED = ctypes.CFUNCTYPE(None, ctypes.c_uint32, ctypes.c_uint32, ctypes.c_uint32)
RECORDED = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_uint32)
BAD_ACCESS = ctypes.CFUNCTYPE(ctypes.c_bool, ctypes.c_uint32, ctypes.c_uint32, ctypes.c_uint32, ctypes.c_uint64)
WRITE_AT_ONCE = ctypes.CFUNCTYPE(ctypes.c_bool, ctypes.c_uint32, ctypes.c_uint32, ctypes.c_uint64)
ACCESS_CYCLE = ctypes.CFUNCTYPE(ctypes.c_uint64)
ACCESS_PC = ctypes.CFUNCTYPE(ctypes.c_uint32)


#: The functions of Unicorn that C calls, in the order of `struct unicorn_api`.
UNICORN_FUNCTIONS = (
    "uc_emu_start", "uc_emu_stop", "uc_reg_read", "uc_reg_read_batch", "uc_reg_write_batch", "uc_reg_write",
)  # fmt: skip


class UnicornApi(ctypes.Structure):
    """`struct unicorn_api`."""

    _fields_ = tuple((name, ctypes.c_void_p) for name in UNICORN_FUNCTIONS)


class Callbacks(ctypes.Structure):
    """`struct callbacks`."""

    _fields_ = (
        ("unknown_block", UNKNOWN_BLOCK),
        ("read", READ),
        ("write", WRITE),
        ("trapped", TRAPPED),
        ("recorded", RECORDED),
        ("access_cycle", ACCESS_CYCLE),
        ("access_pc", ACCESS_PC),
        ("bad_access", BAD_ACCESS),
        ("write_at_once", WRITE_AT_ONCE),
    )


#: Result and arguments, as `simbase.c_library` spells them.
FUNCTION_TYPES = {
    "core_shared_bytes": "z",
    "core_new": "pppp",
    "core_free": "vp",
    "core_run": "upq",
    "core_add_row": "bpuuuuupupu",
    "core_set_views": "vppu",
    "core_forget_rows": "vp",
    "core_forget_range": "vpuu",
    "core_set_loop": "bpup",
    "core_set_fault": "vpuuuu",
    "measure_decode": "upuup",
    "measure_block": "vpuuubpp",
    "core_declare_zero": "vpu",
    "core_forget_zeros": "vp",
    "core_declare_unclocked": "vpubq",
    "core_forget_unclocked": "vp",
    "core_declare_duplicated": "vpu",
    "system_init": "vp",
    "system_reset": "vp",
    "system_power_up": "vp",
    "system_has": "bu",
    "system_read": "upuqp",
    "system_write": "upuuuq",
    "systick_advance": "bpq",
    "systick_read": "upuq",
    "systick_write": "vpuuq",
    "core_block_start": "up",
    "core_ways": "pp",
    "core_block_from": "up",
    "core_block_around": "up",
    "core_set_page": "vpupupuppu",
    "core_set_regions": "vpuuuu",
    "core_join": "vpp",
    "core_next_event": "qp",
    "core_clear_exclusive": "vp",
    "core_leave_block": "vp",
    "core_region": "ppuu",
    "core_trap": "ppuuu",
    "core_start_recording": "bpu",
    "fabric_new": "pppp",
    "fabric_add_memory": "bppuub",
    "fabric_bus": "qpuuuuu",
    "fabric_master": "up",
    "fabric_set_analog": "vpp",
    "fabric_set_samples": "vpup",
    "fabric_channel_uv": "qpuq",
    "fabric_set_wave": "vpuuuqqq",
    "fabric_look": "vpup",
    "fabric_resume": "vp",
    "fabric_free": "vp",
    "fabric_set_host": "vpp",
    "fabric_set_time": "vpqqu",
    "fabric_set_clocks": "vpp",
    "fabric_set_clock": "vpuu",
    "fabric_clocks_changed": "vp",
    "fabric_event_ns": "qp",
    "fabric_next_ns": "qp",
    "fabric_run_events": "vpq",
    "fabric_catch_up": "vpuq",
    "fabric_schedule": "vpuq",
    "fabric_due": "qpu",
    "fabric_add_slot": "ip",
    "fabric_add_device": "bpuspp",
    "fabric_configure_pin": "vpuub",
    "fabric_set_gate": "vpuuu",
    "fabric_set_initial": "vpupub",
    "fabric_reset_device": "vpu",
    "fabric_put_output": "bpuuu",
    "fabric_set_output": "vpuub",
    "fabric_read": "upuu",
    "fabric_write": "vpuuuu",
    "fabric_command": "upuuuu",
    "fabric_word_count": "upu",
    "fabric_take_words": "ppu",
    "fabric_stop_at_words": "vpub",
    "fabric_set_line": "vpub",
    "fabric_line": "upu",
    "fabric_restore_line": "vpuu",
    "fabric_wire": "bpuuu",
    "fabric_pins_changed": "vpu",
    "fabric_offer": "vpuuu",
    "fabric_put_inputs": "bpupu",
    "fabric_last_output": "qp",
    "fabric_forget_output": "vp",
    "fabric_subscribe": "ipppppb",
    "fabric_stop_at": "vpup",
    "fabric_is_watched": "bpu",
    "fabric_unsubscribe": "vpu",
    "fabric_row_count": "zpu",
    "fabric_take_rows": "ppu",
    "fabric_take_stop": "bp",
    "fabric_end_slice": "vp",
    "fabric_has_news": "bp",
    "interpreter_new": "p",
    "interpreter_free": "vp",
    "interpreter_emu_start": "ipqqqz",
    "interpreter_emu_stop": "ip",
    "interpreter_reg_read": "ipip",
    "interpreter_reg_write": "ipip",
    "interpreter_reg_read_batch": "ipppi",
    "interpreter_reg_write_batch": "ipppi",
    "interpreter_map": "ipqzup",
    "interpreter_map_io": "ipqzpppp",
    "interpreter_unmap": "ipqz",
    "interpreter_hook": "zpuppqq",
    "interpreter_unhook": "vpz",
    "interpreter_drop": "vpqq",
    "interpreter_find_pages": "vpb",
    "interpreter_set_trap": "vppp",
    "interpreter_take_apart": "vubp",
    "interpreter_look": "zpsupz",
    "interpreter_context_bytes": "z",
    "interpreter_save": "vpp",
    "interpreter_restore": "vpp",
    "core_use_interpreter": "vppb",
    "core_vary_latency": "vpup",
    "edge_log_new": "p",
    "edge_log_free": "vp",
    "edge_log_put": "bpquu",
    "edge_log_take": "bppzpp",
    "edge_log_write": "ipppuqq",
    "edge_log_rows": "pp",
    "edge_log_count": "zp",
    "edge_log_used": "vpp",
}


def is_native_wanted() -> bool:
    """Tell whether engines are to be native.

    Raises:
        BluePillError: `P2OS_CORE` names no core.
    """
    return _choice() != "python"


def is_interpreter_wanted() -> bool:
    """Tell whether engines are to run instructions by the interpreter of our own.

    Raises:
        BluePillError: `P2OS_CORE` names no core.
    """
    return _choice() in {"own", "exact"}


def is_exact_wanted() -> bool:
    """Tell whether the interpreter is to act on what is due at the instruction, not behind its block.

    Raises:
        BluePillError: `P2OS_CORE` names no core.
    """
    return _choice() == "exact"


@contextmanager
def core_chosen(name: str) -> Iterator[None]:
    """Choose the core of the engines that are made within, one of `CORE_CHOICES`, whatever `P2OS_CORE` says."""
    before = _chosen.set(name)
    try:
        yield
    finally:
        _chosen.reset(before)


def _choice() -> str:
    choice = _chosen.get() or os.environ.get(CORE_VARIABLE, "")
    if choice and choice not in CORE_CHOICES:
        raise BluePillError(
            f"{CORE_VARIABLE}={choice}: no such core",
            hint=f"{CORE_VARIABLE} is {', '.join(CORE_CHOICES[:-1])} or {CORE_CHOICES[-1]}, or not set",
        )
    return choice


@cache
def library_path() -> str | None:
    """Return where the library is; None where it was not built."""
    return built(PART)


@cache
def library() -> Any:
    """Return the loaded library.

    Raises:
        MissingDependencyError: it was not built, or is of another version of the package.
    """
    found = loaded(library_path(), FUNCTION_TYPES, "the emulator's library", PART, ctypes.PyDLL)
    if found.core_shared_bytes() != ctypes.sizeof(structure(SHARED)):
        raise MissingDependencyError("the emulator's library is of another version", hint="install the package again")
    return found


def made(where: int | None, what: str) -> int:
    """Return where C has made something, or that it has.

    Raises:
        MemoryError: It had no memory.
    """
    if not where:
        raise MemoryError(f"no memory for {what}")
    return where


def address_of(name: str) -> ctypes.c_void_p:
    """Return a function of the library as a callback for Unicorn."""
    return ctypes.cast(library()[name], ctypes.c_void_p)
