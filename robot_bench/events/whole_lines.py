"""What the first and the last line of a trace may hold: a kind for each key that somebody reads.

A key that is not listed is passed over, one that is missing is of an older trace; None stands for what was not known.
The check is made where a trace is read, so that nobody who reads these lines later meets a value of another kind.
"""

import math
from collections.abc import Callable, Mapping
from typing import TypeAlias, cast

#: Refuses a value that is not of its kind: raises ValueError.
Check: TypeAlias = Callable[[object], None]


def _text(value: object) -> None:
    _need(isinstance(value, str))


def _number(value: object) -> None:
    _need(isinstance(value, (int, float)) and not isinstance(value, bool))
    _need(math.isfinite(cast("float", value)) and abs(cast("float", value)) < _MOST)


def _flag(value: object) -> None:
    _need(isinstance(value, bool))


def _known(check: Check) -> Check:
    """Return the check of what may be None."""
    return lambda value: None if value is None else check(value)


def _each(check: Check, count: int | None = None) -> Check:
    """Return the check of a list, of so many."""

    def look(value: object) -> None:
        _need(isinstance(value, list) and count in {None, len(value)})
        for item in cast("list[object]", value):
            check(item)

    return look


def _named(check: Check) -> Check:
    """Return the check of an object whose values are of one kind."""

    def look(value: object) -> None:
        _need(isinstance(value, dict))
        for item in cast("dict[str, object]", value).values():
            check(item)

    return look


def _object(keys: Mapping[str, Check], needs: tuple[str, ...] = ()) -> Check:
    """Return the check of an object with these keys, some of which it cannot be without."""

    def look(value: object) -> None:
        _need(isinstance(value, dict))
        found = cast("dict[str, object]", value)
        _need(all(key in found for key in needs))
        for key, check in keys.items():
            if key in found:
                check(found[key])

    return look


def _setting(value: object) -> None:
    _need(isinstance(value, list) and len(value) == 2)
    _text(cast("list[object]", value)[0])


def _integer(value: object) -> None:
    _need(type(value) is int and abs(value) < _MOST)


def _function(value: object) -> None:
    """Look at what has run of a function: its name and five counts."""
    _need(isinstance(value, list) and len(value) == 6)
    name, *counts = cast("list[object]", value)
    _text(name)
    for count in counts:
        _integer(count)


def _thing(value: object) -> None:
    _object(
        dict.fromkeys(("name", "kind", "shape"), _text)
        | dict.fromkeys(("x", "y", "heading", "height", "radius", "length", "width"), _number),
        ("name", "x", "y"),
    )(value)


def _need(holds: bool) -> None:
    if not holds:
        raise ValueError("a value of another kind")


#: Metres, seconds and hertz stay far below.
_MOST = 1e18
_WORLD = _object({
    "name": _text, "extent": _known(_each(_number, 4)), "obstacles": _known(_each(_thing)),
})  # fmt: skip
_ROBOT = _object({
    "name": _text, "sonar": _each(_each(_number, 3)),
    **dict.fromkeys(
        ("front_m", "rear_m", "width_m", "track_m", "wheel_diameter_m", "sonar_cone_rad", "sonar_range_m"), _number
    ),
})  # fmt: skip
_META = _object({
    **dict.fromkeys(
        ("version", "scenario", "description", "text", "world_path", "firmware", "firmware_path", "mode", "body",
         "sram"), _text,
    ),
    **dict.fromkeys(("scenario_path", "firmware_sha256", "note", "body_version"), _known(_text)),
    **dict.fromkeys(
        ("duration_s", "threshold_m", "step_mps", "crystal_ppm", "interrupt_latency_cycles", "gives_up_s", "seed"),
        _known(_number),
    ),
    "settings": _known(_each(_setting)), "pins": _known(_named(_text)), "robots": _known(_each(_text)),
    "start": _object(dict.fromkeys(("x", "y", "heading"), _number)), "world": _known(_WORLD), "robot": _known(_ROBOT),
})  # fmt: skip
_MEASURED = _object(dict.fromkeys(("files", "table"), _each(_text)), ("files", "table"))
_PROGRAM = _object({
    "files": _each(_object(
        {"name": _text, "lines": _each(_text), **dict.fromkeys(("ran_ns", "one_way"), _each(_integer))},
        ("name", "lines", "ran_ns", "one_way"),
    )),
    "functions": _each(_function),
}, ("files", "functions"))  # fmt: skip
_END = _object({
    **dict.fromkeys(
        ("virtual_s", "wall_s", "real_time_factor", "distance_m", "usart_baud", "collisions", "min_clearance_m",
         "worst_lag_ms"), _known(_number),
    ),
    **dict.fromkeys(("coverage", "profile"), _known(_MEASURED)), "program": _known(_PROGRAM),
    "parts": _known(_each(_object(dict.fromkeys(("name", "words", "png"), _text), ("name", "words")))),
    "trace_sha256": _known(_text), "explained": _known(_text), "passed": _known(_flag),
    **dict.fromkeys(("failures", "goals_met", "goals_not_judged", "notes", "last_blocks"), _known(_each(_text))),
})  # fmt: skip


def check_whole_line(entry: Mapping[str, object]) -> None:
    """Look whether the first or the last line of a trace holds what it may; any other line passes.

    Raises:
        ValueError: It does not.
    """
    kind = entry.get("k")
    if kind == "meta":
        _META(dict(entry))
    elif kind == "end":
        _END(dict(entry))
