"""Rows as lines for a person: when, which way, what, and what stands in it."""

import math
from typing import cast

from p2os.timing import NS_PER_S
from p2os.trace.describe import Plain
from p2os.trace.listing import Row

#: The longest run of bytes shown in one line; `--explain` shows all.
SHOWN_BYTES = 24


def line_of(row: Row, *, has_time: bool = True) -> str:
    """Return a row as one line."""
    time = f"{row.at_ns / NS_PER_S:10.6f} s  " if has_time else ""
    arrow = " " if row.direction is None else row.direction.arrow
    if not row.valid:
        return f"{time}{arrow} !! {row.name}: {row.problem}: {_hex(row.data)}"
    return f"{time}{arrow} {row.name}{_inside(row)}"


def summary_of(rows: int, damaged: int, capture_s: float) -> str:
    """Return the last line of a listing."""
    packets = rows - damaged
    text = f"{packets} packet{'' if packets == 1 else 's'}"
    if capture_s > 0:
        text += f" in {capture_s:.3f} s"
    return f"{text}, {damaged} damaged" if damaged else f"{text}, none damaged"


def _inside(row: Row) -> str:
    if "x_m" in row.fields:
        return f"  {_sip(row.fields)}"
    if "argument" in row.fields and not set(row.fields) - {"argument", "unit"}:
        return f" {row.fields['argument']} {row.fields.get('unit', '')}".rstrip()
    if "text" in row.fields:
        return f' "{row.fields["text"]}" ({row.fields["argument"]})'
    inside = {name: value for name, value in row.fields.items() if name not in {"argument", "unit"}}
    shown = ", ".join(f"{name} {_value(value)}" for name, value in inside.items())
    unit = f", each x {row.fields['unit']}" if "unit" in row.fields else ""
    return f"  {shown}{unit}" if shown else ""


def _sip(fields: dict[str, Plain]) -> str:
    number = {name: value for name, value in fields.items() if isinstance(value, (int, float))}
    text = (
        f"x {number['x_m']:.3f} m, y {number['y_m']:.3f} m, heading {math.degrees(number['heading_rad']):.1f} deg, "
        f"wheels {number['left_mps']:.3f} {number['right_mps']:.3f} m/s, {number['battery_v']:.1f} V"
    )
    stalls = [side for side in ("left", "right") if fields[f"stall_{side}"]]
    if stalls:
        text += f", stalled {' and '.join(stalls)}"
    sonar = cast("dict[str, float]", fields["sonar_m"])
    if sonar:
        text += ", sonar " + " ".join(f"{place}:{range_m:.3f}" for place, range_m in sonar.items()) + " m"
    return text


def _value(value: Plain) -> str:
    if isinstance(value, str):
        return value if value and " " not in value else f'"{value}"'
    if isinstance(value, list):
        return "[" + " ".join(_value(item) for item in value) + "]"
    if isinstance(value, dict):
        return "{" + " ".join(f"{key}:{_value(item)}" for key, item in value.items()) + "}"
    if value is None:
        return "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return str(value)


def _hex(data: bytes) -> str:
    shown = data[:SHOWN_BYTES].hex(" ")
    return shown if len(data) <= SHOWN_BYTES else f"{shown} … ({len(data)} bytes)"
