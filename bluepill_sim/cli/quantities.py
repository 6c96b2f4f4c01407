"""Options of `p2os mcu`: a number with its unit, as `simbase.units` reads it, and what many of its verbs take."""

from pathlib import Path
from typing import Annotated, Any

import typer

from bluepill_sim.spans import LONGEST
from simbase.timing import Nanos
from simbase.units import TIME, Quantity


def option(quantity: Quantity, *flags: str, **words: Any) -> Any:
    """Return an option that takes a quantity, for an `Annotated`; `words` are those of `Quantity.option`."""
    return typer.Option(*flags, **quantity.option(typer.BadParameter, **words))


def time_option(*flags: str, purpose: str, shown: str = "") -> Any:
    """Return an option that takes a span of the chip's time, up to what `to_nanos` takes."""
    return option(TIME, *flags, purpose=purpose, shown=shown, least="0s", most=LONGEST)


Firmware = Annotated[Path, typer.Argument(help="ELF, HEX or BIN.", metavar="FIRMWARE")]
Span = Annotated[Nanos, time_option("--for", purpose="How much virtual time.", shown="1s")]
Drive = Annotated[
    list[str] | None, typer.Option(help="Put a level on a pin at a time; repeatable.", metavar="PIN=LEVEL@TIME")
]
JsonOutput = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]
