"""An explanation: steps from what the world held to the failure, each with its time and its evidence.

Invariant: a step says what was recorded, replayed, or seen to change in a replay with one input changed; nothing else.
"""

from dataclasses import asdict, dataclass
from enum import StrEnum
from textwrap import wrap

from simbase.timing import NS_PER_S, Nanos

#: Columns of a terminal.
WIDTH = 80
_TIME = 11


class Evidence(StrEnum):
    """How something is known."""

    #: It stands in the trace.
    RECORDED = "recorded"
    #: The chip was run again with what its pins held.
    REPLAYED = "replayed"
    #: The chip was run again with something changed, and compared.
    CHANGED = "changed"
    #: It follows from where things are.
    GEOMETRY = "geometry"


class Standing(StrEnum):
    """How far an explanation comes."""

    CAUSE = "cause"
    UNKNOWN = "unknown"
    #: Nothing failed.
    NOTHING = "nothing"


@dataclass(frozen=True, slots=True, kw_only=True)
class ChainLink:
    """A link of the chain: of the world, a sensor, the firmware, a wire, the motion, or the contact."""

    t: Nanos
    part: str
    says: str
    evidence: Evidence


@dataclass(frozen=True, slots=True, kw_only=True)
class Explanation:
    """Why a run failed, or that this is not known."""

    failure: str
    standing: Standing
    #: The cause, or what is known instead, in one sentence.
    summary: str
    steps: tuple[ChainLink, ...] = ()
    #: What is odd, and was not shown to be the cause.
    also: tuple[str, ...] = ()
    #: What kept the explanation from going further; empty where nothing did.
    limits: tuple[str, ...] = ()

    @property
    def line(self) -> str:
        """The summary line: of reports and tests."""
        if self.standing is Standing.NOTHING:
            return self.summary
        return f"{'cause' if self.standing is Standing.CAUSE else 'cause unknown'}: {self.summary}"

    def to_plain(self) -> dict[str, object]:
        """Return it as one JSON object; times are nanoseconds."""
        return asdict(self) | {"line": self.line}

    def text(self) -> str:
        """Return it for a person, 80 columns wide."""
        lines = _wrapped(f"failed: {self.failure}", "") if self.failure else []
        lines += _wrapped(self.line, "  ")
        if self.steps:
            lines.append("")
        for step in sorted(self.steps, key=lambda step: step.t):
            head = f"{step.t / NS_PER_S:9.3f} s "
            lines += _wrapped(f"{head} {step.part:<9}{step.says} [{step.evidence}]", " " * (_TIME + 11), is_row=True)
        for title, notes in (("also seen, not shown to be the cause:", self.also), ("not known:", self.limits)):
            if notes:
                lines += ["", title, *(line for note in notes for line in _wrapped(f"- {note}", "  "))]
        return "\n".join(lines) + "\n"


def _wrapped(text: str, indent: str, *, is_row: bool = False) -> list[str]:
    if is_row:  # runs of blanks are columns
        head, body = text[: len(indent)], text[len(indent) :]
        return wrap(body, WIDTH, initial_indent=head, subsequent_indent=indent, break_on_hyphens=False)
    return wrap(text, WIDTH, subsequent_indent=indent, break_on_hyphens=False)
