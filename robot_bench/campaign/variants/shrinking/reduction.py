"""How a list is made short and a number round while something still holds: without knowing what of.

`fewest` is delta debugging: halves, quarters, and so on are left out, each alone and each alone kept, until nothing
that is left can be left out by itself.

Source: A. Zeller and R. Hildebrandt, Simplifying and Isolating Failure-Inducing Input, IEEE TSE 28(2), 2002, fig. 4.
Invariant: what is returned holds, if what was given does; the same answers give the same questions.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from typing import TypeVar

T = TypeVar("T")

#: chosen: what people write, the roundest first: of metres and seconds, and of an angle in degrees.
STEPS = (1.0, 0.5, 0.1, 0.05, 0.01, 0.001)
ANGLE_STEPS = (90.0, 45.0, 15.0, 5.0, 1.0, 0.1)


def fewest(items: Sequence[T], holds: Callable[[Sequence[T]], bool]) -> list[T]:
    """Return items of which none can be left out by itself, in their order.

    Args:
        items: It holds for all of them.
        holds: Tells whether it holds for some of them; for none too.
    """
    left = list(items)
    if left and holds([]):
        return []
    parts = 2
    while len(left) >= 2:
        pieces = _cut(left, parts)
        smaller = next((piece for piece in pieces if holds(piece)), None)
        if smaller is not None:
            left, parts = smaller, 2
            continue
        others = (_without(pieces, number) for number in range(len(pieces))) if parts > 2 else ()
        rest = next((some for some in others if holds(some)), None)  # with two pieces these are the pieces again
        if rest is not None:
            left, parts = rest, max(parts - 1, 2)
        elif parts >= len(left):
            break
        else:
            parts = min(2 * parts, len(left))
    return left


def _cut(items: Sequence[T], parts: int) -> list[list[T]]:
    """Return a list in so many pieces, as alike in length as can be."""
    bounds = [len(items) * number // parts for number in range(parts + 1)]
    return [list(items[a:b]) for a, b in pairwise(bounds)]


def _without(pieces: Sequence[Sequence[T]], number: int) -> list[T]:
    return [item for other, piece in enumerate(pieces) if other != number for item in piece]


def rounder(value: float, steps: Sequence[float] = STEPS) -> Iterator[float]:
    """Yield the numbers that are rounder than one and near it, the roundest first."""
    if value == 0 or not math.isfinite(value):
        return
    given = {value}
    if abs(value) < steps[0] / 2:
        given.add(0.0)
        yield 0.0
    for step in steps:
        near = rounded(value, step, steps)
        if near == value:
            return
        if near not in given:
            given.add(near)
            yield near


def rounded(value: float, step: float, steps: Sequence[float] = STEPS) -> float:
    """Return the multiple of a step that is nearest, as a person writes it; a half away from zero.

    What would be 0 so is rounded by the first finer step that leaves something of it: a width is none then.
    """
    for finer in (step, *(other for other in steps if other < step)):
        count = math.floor(abs(value) / finer + 0.5)
        if count:
            return math.copysign(round(count * finer, 9), value)
    return value
