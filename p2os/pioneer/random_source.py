"""Seeded randomness that can be saved: one stream a purpose, so that none disturbs another."""

import random
from dataclasses import dataclass, field


@dataclass(slots=True)
class RandomSource:
    """The streams of one robot, by name.

    Each begins from the robot's seed and its own name, and exists from its first use.
    """

    seed: int = 0
    streams: dict[str, random.Random] = field(default_factory=dict)

    def of(self, name: str) -> random.Random:
        """Return a stream."""
        if name not in self.streams:
            self.streams[name] = random.Random(f"{self.seed} {name}")
        return self.streams[name]
