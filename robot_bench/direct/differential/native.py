"""The functions in C of a differential robot's step, and the structs that they work on, as the C files declare them.

Invariant: a struct is owned by one part in Python, which keeps it alive and declares what of it is state.
"""

import ctypes
from functools import cache
from typing import Any

from robot_bench.wires.edges import PART
from simbase.c_library import built, loaded

#: As in bridge.h.
MOST_PINS, COMBINATIONS = 3, 8
_FUNCTIONS = {
    "battery_source_v": "dp",
    "battery_give": "vpdd",
    "bridge_pass": "ipszll",
    "drive_begin": "vpppp",
    "drive_end": "vpddddd",
    "encoder_turn": "zpdll",
    "train_aim": "vppddp",
    "train_step": "vpppd",
    "train_supply_v": "dpppddd",
    "train_take": "vpppddd",
}


def _numbers(kind: Any, *names: str) -> list[tuple[str, Any]]:
    return [(name, kind) for name in names]


class BridgeOutput(ctypes.Structure):
    """What a pin does: a wave, or with no period a level, which is `high`."""

    _fields_ = _numbers(ctypes.c_int64, "ns", "at", "period", "high", "ticks_hz")


class BridgeStruct(ctypes.Structure):
    """A bridge."""

    _fields_ = [  # ctypes wants a list
        *_numbers(ctypes.c_int64, "pins", "dead_ns"),
        ("does", ctypes.c_int64 * COMBINATIONS),
        ("now", BridgeOutput * MOST_PINS),
        ("shares", ctypes.c_double * 3),
    ]


class TrainStruct(ctypes.Structure):
    """A drive train: what it is made of, its state, and what became of its last step."""

    _fields_ = _numbers(
        ctypes.c_double, "dt_s", "ohm", "drop_v", "k", "friction_nm", "damping_nm_s", "own", "other",
        "left_radps", "right_radps", "mean_left", "mean_right", "left_a", "right_a", "supply_a",
    )  # fmt: skip


class BatteryStruct(ctypes.Structure):
    """A battery and its state."""

    _fields_ = _numbers(
        ctypes.c_double, "full_v", "empty_v", "capacity_ah", "ohm", "idle_a", "used_ah", "volts"
    )  # fmt: skip


class EncoderStruct(ctypes.Structure):
    """An encoder, its state, and where it writes the edges of a step."""

    _fields_ = [  # as above
        *_numbers(ctypes.c_double, "edges_per_rad", "angle"),
        ("level_codes", ctypes.c_uint8 * 2),
        *_numbers(ctypes.c_size_t, "room", "of_a", "of_b"),
        *_numbers(ctypes.c_void_p, "times", "codes"),
    ]


def in_struct(name: str, doc: str) -> Any:
    """Return a number that a part has in its `struct`, where C works on it, as an attribute of the part."""

    def number(part: Any) -> float:
        return float(getattr(part.struct, name))

    def set_number(part: Any, value: float) -> None:
        setattr(part.struct, name, value)

    return property(number, set_number, doc=doc)


@cache
def functions() -> Any:
    """Return the functions in C.

    Raises:
        MissingDependencyError: They were not built.
    """
    return loaded(built(PART), _FUNCTIONS, "the library for motors and encoders", PART)
