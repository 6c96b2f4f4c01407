"""Count collisions: one rule for every body.

A collision is a new contact of the hull with anything but the floor; contacts
that follow each other within 0.2 s are one.
"""

import math
from collections import deque

from p2os.pioneer.body.contract import MOST_HITS, Hit
from simbase.state import Stateful

#: Measured (tools/surveys/oblique_hits.py): against a face at an angle between these, degrees, and against an edge or a
#: post that is farther beside the robot's middle, m, the three bodies come to stand, or go on, with different headings.
DISPUTED_DEG = (25.0, 80.0)
DISPUTED_BESIDE_M = 0.05
#: Steps of 1 ms without contact after which a contact is a new one (chosen: longer than a bounce).
APART_STEPS = 200


class ContactCounter(Stateful):
    """Turn a stream of touching/not touching into a count, and remember the collisions."""

    __slots__ = ("_hits", "apart", "collisions", "place", "touching")
    STATE = ("_hits", "apart", "collisions", "place", "touching")

    def __init__(self) -> None:
        self.collisions = 0
        self.touching = False
        #: Where the last collision was, metres.
        self.place: tuple[float, float] | None = None
        #: Steps since the last contact, at most `APART_STEPS`: from there on a step without contact changes nothing.
        self.apart = APART_STEPS
        self._hits: deque[Hit] = deque(maxlen=MOST_HITS)

    def update(self, touching: bool, steps: int = 1) -> bool:
        """Take what was seen over the last `steps` steps; tell whether it is a new collision."""
        is_new = touching and self.apart >= APART_STEPS
        if touching:
            self.collisions += is_new
            self.apart = 0
        elif self.apart < APART_STEPS:
            self.apart = min(APART_STEPS, self.apart + steps)
        self.touching = touching
        return is_new

    def note(self, hit: Hit) -> None:
        """Remember what a new collision was."""
        self._hits.append(hit)
        self.place = hit.x_m, hit.y_m

    def bearing_rad(self, x_m: float, y_m: float, heading_rad: float) -> float | None:
        """Return where a robot at a pose is touched, counter-clockwise from ahead; None where it is not."""
        if not self.touching or self.place is None:
            return None
        x, y = self.place
        return math.remainder(math.atan2(y - y_m, x - x_m) - heading_rad, math.tau)

    def take_hits(self) -> list[Hit]:
        """Return the collisions that were noted since this was asked last, the last 16 at the most."""
        hits = list(self._hits)
        self._hits.clear()
        return hits
