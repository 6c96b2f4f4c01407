"""A row: what a source says of the order of things, in our words, and how it is checked from reset."""

from collections.abc import Callable
from dataclasses import dataclass, field

from hypothesis import given, settings
from hypothesis.strategies import SearchStrategy

from tests.bluepill_sim.peripherals.sequences.bench import Bench
from tests.bluepill_sim.peripherals.sequences.sources import Source

#: Values that are tried where a row speaks of a range.
_VALUES = settings(max_examples=12)


@dataclass(frozen=True, slots=True, kw_only=True)
class SequenceRow:
    """One sentence."""

    peripheral: str
    #: Short name, unique in its peripheral.
    slug: str
    sentence: str
    sources: tuple[Source, ...]
    #: Takes a chip out of reset and fails where the sentence does not hold; None: it is not modelled.
    check: Callable[[], None] | None = None
    #: Why there is no check.
    not_modelled: str = ""
    #: What was chosen where sources disagree or leave it open.
    choice: str = ""

    @property
    def name(self) -> str:
        """Its name in the whole table."""
        return f"{self.peripheral}-{self.slug}"


@dataclass(slots=True)
class Sequences:
    """The rows of one peripheral, in the order of its page."""

    peripheral: str
    rows: list[SequenceRow] = field(default_factory=list)

    def row(
        self, slug: str, sentence: str, *sources: Source, choice: str = "", values: "SearchStrategy[int] | None" = None
    ) -> Callable[[Callable[..., None]], Callable[..., None]]:
        """Add a row with the check that is decorated: it takes a chip and, with `values`, one of them."""

        def add(check: Callable[..., None]) -> Callable[..., None]:
            self.rows.append(
                SequenceRow(
                    peripheral=self.peripheral, slug=slug, sentence=sentence, sources=sources, choice=choice,
                    check=_of_one(check) if values is None else _of_many(check, values),
                )
            )  # fmt: skip
            return check

        return add

    def not_modelled(self, slug: str, sentence: str, *sources: Source, why: str) -> None:
        """Add a row that the models do not answer."""
        self.rows.append(
            SequenceRow(peripheral=self.peripheral, slug=slug, sentence=sentence, sources=sources, not_modelled=why)
        )


def _of_one(check: Callable[..., None]) -> Callable[[], None]:
    def run() -> None:
        check(Bench())

    return run


def _of_many(check: Callable[..., None], values: "SearchStrategy[int]") -> Callable[[], None]:
    @_VALUES
    @given(value=values)
    def run(value: int) -> None:
        check(Bench(), value)

    return run
