"""Which level a wire has that several hold.

Not modelled: voltages, and currents between drivers.
Invariant: the level does not depend on the order of those who hold the wire.
"""

from collections.abc import Collection


def level_of(hard: Collection[bool], pulls: Collection[bool] = ()) -> bool | None:
    """Return the level that they make together; None where nobody holds the wire.

    Hard low wins over hard high, and a pull down over a pull up: a wire that is
    fought over is read as low, repeatably. The real one is anything between.

    Args:
        hard: the levels that are driven hard.
        pulls: those of resistors, which yield to anything driven hard.
    """
    if hard:
        return all(hard)
    return all(pulls) if pulls else None


def are_fighting(hard: Collection[bool | None]) -> bool:
    """Tell whether a wire is driven hard to different levels."""
    return len(set(hard)) > 1
