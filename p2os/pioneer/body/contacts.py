"""Count collisions: one rule for every body.

A collision is a new contact of the hull with anything but the floor; contacts
that follow each other within 0.2 s are one.
"""

#: Steps of 1 ms without contact after which a contact is a new one (chosen: longer than a bounce).
APART_STEPS = 200


class ContactCounter:
    """Turn a stream of touching/not touching into a count."""

    __slots__ = ("_apart", "collisions", "touching")

    def __init__(self) -> None:
        self.collisions = 0
        self.touching = False
        self._apart = APART_STEPS

    def update(self, touching: bool, steps: int = 1) -> bool:
        """Take what was seen over the last `steps` steps; tell whether it is a new collision."""
        is_new = touching and self._apart >= APART_STEPS
        if touching:
            self.collisions += is_new
            self._apart = 0
        elif self._apart < APART_STEPS:
            self._apart = min(APART_STEPS, self._apart + steps)
        self.touching = touching
        return is_new

    def snapshot(self) -> tuple[int, bool, int]:
        """Return all that decides the future."""
        return self.collisions, self.touching, self._apart

    def restore(self, snapshot: tuple[int, bool, int]) -> None:
        """Put back what `snapshot` returned."""
        self.collisions, self.touching, self._apart = snapshot
