"""Options of `p2os mcu` that take a number with its unit, as `simbase.units` reads it."""

from typing import Any

import typer

from bluepill_sim.spans import LONGEST
from simbase.units import TIME, Quantity


def option(quantity: Quantity, *flags: str, **words: Any) -> Any:
    """Return an option that takes a quantity, for an `Annotated`; `words` are those of `Quantity.option`."""
    return typer.Option(*flags, **quantity.option(typer.BadParameter, **words))


def time_option(*flags: str, purpose: str, shown: str = "") -> Any:
    """Return an option that takes a span of the chip's time, up to what `to_nanos` takes."""
    return option(TIME, *flags, purpose=purpose, shown=shown, least="0s", most=LONGEST)
