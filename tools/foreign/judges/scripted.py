"""A talk that takes more than questions and answers: a function of ours with the board, in virtual time."""

from collections.abc import Callable
from dataclasses import dataclass

from bluepill_sim import BluePill
from bluepill_sim.errors import BluePillError
from tools.foreign.row import RowError, RowPlace

#: Talks to a board; returns what came back, raises `RowError`, or an error of the emulator's.
Script = Callable[[BluePill, RowPlace], str]


@dataclass(frozen=True, kw_only=True)
class Scripted:
    """Boots an image and has a function talk to it.

    Args:
        image: The firmware, a file of the cache.
        script: The function.
    """

    image: str
    script: Script

    @property
    def needs(self) -> tuple[str, ...]:
        """The image."""
        return (self.image,)

    def run(self, place: RowPlace) -> str:
        """Return what came back."""
        board = BluePill(place.path(self.image))
        try:
            return self.script(board, place)
        except BluePillError as error:
            raise RowError(f"{error}; {board.verdict or 'at ' + board.where()}") from error
