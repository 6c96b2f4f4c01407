"""Changes at their times: what scripts of the world and of faults have in common.

Invariant: each change is applied once, in order of time, and saving and restoring keeps the place.
"""

from collections.abc import Callable, Sequence
from typing import Generic, Protocol, TypeVar, cast

from simbase.errors import UsageError
from simbase.state import PartState, Stateful
from simbase.timing import NS_PER_S, Nanos, Reached


class TimedAction(Protocol):
    """What is due at a time."""

    @property
    def at(self) -> Nanos:
        """When."""


T = TypeVar("T", bound=TimedAction)


class Timeline(Stateful, Generic[T]):
    """Applies changes when they are due.

    Args:
        changes: In any order; those of one time keep theirs.
        apply: Makes one change.
    """

    STATE = ("_changes", "_done")

    def __init__(self, changes: Sequence[T], apply: Callable[[T], None]) -> None:
        self._changes = tuple(sorted(changes, key=lambda change: change.at))
        self._apply_change = apply
        self._done = 0

    def add(self, *changes: T, now: Nanos = -1) -> None:
        """Take more changes, and make those that are due by `now`.

        Raises:
            P2osError: One that is due cannot be made; none of them will be.
        """
        kept = self._changes
        done, left = kept[: self._done], kept[self._done :]
        self._changes = (*done, *sorted((*left, *changes), key=lambda change: change.at))
        try:
            self.advance_to(now)
        except BaseException:
            self._changes = kept
            raise

    def take_back(self, *changes: T) -> None:
        """Forget those of some changes that were added and are still to come."""
        kept, left = self._changes[: self._done], self._changes[self._done :]
        gone = set(map(id, changes))
        self._changes = (*kept, *(change for change in left if id(change) not in gone))

    def begun_as(self, saved: PartState, now: Nanos) -> PartState:
        """Return what another timeline saved at a time, with this one's changes to come in place of its own.

        Raises:
            UsageError: Until then the two do not make the same changes.
        """
        done = cast("int", saved["_done"])
        made, own = cast("tuple[T, ...]", saved["_changes"])[:done], self._changes
        if own[:done] != made or (done < len(own) and own[done].at <= now):
            raise UsageError(f"until {now / NS_PER_S:g} s something else happens here", hint="run from the beginning")
        return PartState(saved, _changes=own)

    def next_deadline(self) -> Nanos | None:
        """Return when the next change is due."""
        return self._changes[self._done].at if self._done < len(self._changes) else None

    def advance_to(self, limit: Nanos) -> Reached:
        """Make every change that is due."""
        while self._done < len(self._changes) and self._changes[self._done].at <= limit:
            self._apply_change(self._changes[self._done])
            self._done += 1
        return Reached(limit)
