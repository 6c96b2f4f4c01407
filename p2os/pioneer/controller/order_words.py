"""The words that follow an order, read by a table: of faults, of inputs, and of changes of the world."""

import math
from collections.abc import Mapping, Sequence

from simbase.errors import UsageError

#: What a word may be: a number from least to most, whole where they are; one of some words; None: anything.
Range = tuple[float, float] | Mapping[str, int] | list[str] | None


def read_words(
    text: str, order: str, given: Sequence[str], words: Sequence[str], ranges: Mapping[str, Range]
) -> dict[str, str | float]:
    """Return the value of each word that is given; a word in brackets may be left out.

    Args:
        text: The whole line.
        order: What it begins with.
        given: The words behind that.
        words: What they are called.
        ranges: What each may be.

    Raises:
        UsageError: A word is missing, too many or out of range.
    """
    usage = f"usage: {' '.join([order, *words])}"
    if not len([word for word in words if not word.startswith("[")]) <= len(given) <= len(words):
        raise UsageError(f"{text!r} {'has too many words' if len(given) > len(words) else 'is incomplete'}", hint=usage)
    names = [word.strip("[]") for word in words]
    return {name: _value(value, ranges[name], usage) for name, value in zip(names, given, strict=False)}


def _value(given: str, allowed: Range, usage: str) -> str | float:
    if allowed is None:
        return given
    if not isinstance(allowed, tuple):
        if given not in allowed:
            raise UsageError(f"{given!r} is none of {', '.join(allowed)}", hint=usage)
        return given
    least, most = allowed
    is_whole = isinstance(least, int)
    try:
        value = float(given)
    except ValueError:
        value = math.nan
    if not least <= value <= most or (is_whole and not given.isdecimal()):
        raise UsageError(f"{given!r} is no number of {least:g} to {most:g}", hint=usage)
    return int(given) if is_whole else value
