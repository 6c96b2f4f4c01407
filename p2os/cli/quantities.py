"""Options of the command line that take a number with its unit, as `simbase.units` reads it."""

from typing import Any

import typer

from simbase.units import Quantity


def option(quantity: Quantity, *flags: str, **words: Any) -> Any:
    """Return an option that takes a quantity, for an `Annotated`; `words` are those of `Quantity.option`."""
    return typer.Option(*flags, **quantity.option(typer.BadParameter, **words))
