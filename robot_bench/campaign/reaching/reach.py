"""What the points of a campaign have to reach at least once: a source line, a state, a level of a pin, a printed text.

    [[reach]]
    state = "BACK_OUT"

    [[reach]]
    line = "dodge_fsm.c:212"

Invariant: each table names one of the four; what a run prints and drives is looked for as an event in words, the same
as in goals, and what it executes by the addresses of the line.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

from p2os.errors import ScenarioError
from p2os.toml_record import Record
from p2os.toml_schema import Key
from robot_bench.campaign.trial import Outcome


class ToReachTable(Record):
    """`[[reach]]`: what at least one point has to reach; one of the four."""

    line: Annotated[str | None, Key(doc='a line of the firmware\'s source: `"dodge_fsm.c:212"`')] = None
    state: Annotated[str | None, Key(doc="a state, by the word for it in what the firmware prints at USART1")] = None
    pin: Annotated[str | None, Key(doc="a wire, as in events")] = None
    text: Annotated[str | None, Key(doc="what the firmware prints at USART1 has it in it")] = None
    level: Annotated[Literal["high", "low", "changes"], Key(doc="of the pin")] = "high"

    def __post_init__(self) -> None:
        named = [name for name in ("line", "state", "pin", "text") if getattr(self, name)]
        if len(named) != 1:
            raise ScenarioError("one of line, state, pin and text has to be named", hint='state = "BACK_OUT"')
        if self.line is not None and not re.fullmatch(r".+:[1-9]\d*", self.line):
            raise ScenarioError(f"line = {self.line!r} is no line of a file", hint='line = "dodge_fsm.c:212"')

    @property
    def said(self) -> str:
        """What it is called on the page."""
        if self.pin is not None:
            return f"pin {self.pin} {self.level}"
        return next(
            f"{name} {value}" for name in ("line", "state", "text") if (value := getattr(self, name)) is not None
        )

    @property
    def words(self) -> str:
        """The events in words that say that it was reached; empty for a line."""
        if self.pin is not None:
            return f"pin {self.pin} {self.level}"
        if self.state is not None:
            return rf"usart1 matches (?<!\w){re.escape(self.state)}(?!\w)"
        return "" if self.text is None else f"usart1 sends {self.text}"


@dataclass(frozen=True, slots=True)
class ToReach:
    """What has to be reached, and how it is seen in an outcome."""

    said: str
    #: As of `ToReachTable.words`.
    words: str = ""
    #: The first addresses of the blocks that execute the line, whole or in part.
    blocks: frozenset[int] = frozenset()

    def is_in(self, outcome: Outcome) -> bool:
        """Tell whether a run has reached it."""
        return self.words in outcome.happened if self.words else bool(self.blocks & outcome.blocks)


def looked_for(reaches: Sequence[ToReach]) -> tuple[str, ...]:
    """Return what a trial has to look for."""
    return tuple(dict.fromkeys(reach.words for reach in reaches if reach.words))
