"""What a program expects of a run and did not get."""

from collections.abc import Sequence

from simbase.errors import P2osError


class ExpectationError(P2osError, AssertionError):
    """Something did not happen in time, or happened that must not; `last_events` are the last ones, in words."""

    def __init__(self, what: str, last_events: Sequence[str] = (), *, hint: str | None = None) -> None:
        super().__init__(what, hint=hint)
        self.last_events = tuple(last_events)

    def __str__(self) -> str:
        events = "".join(f"\n  {line}" for line in self.last_events)
        return super().__str__() + (f"\nlast events:{events}" if events else "")
