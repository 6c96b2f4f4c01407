"""What mutation found, for a person (80 columns), for scripts (JSON) and for CI (JUnit).

    score = noticed / (noticed + survived)

Mutants that left the same trace are told apart: on these runs no goal could have noticed them. Of a sample the score of
all lies within an interval; where all were tried, the score is exact.

Invariant: the same results give the same text.
"""

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as ET

from bluepill_sim.analysis.columns import in_columns
from bluepill_sim.analysis.coverage import Coverage
from bluepill_sim.program.alterations import OPERATORS
from bluepill_sim.program.line_table import LineTable, source_lines
from bluepill_sim.program.mutants import Mutant
from robot_bench.campaign.variants.mutation.interval import CONFIDENCE, share_interval
from robot_bench.campaign.variants.mutation.trial import Fate, MutantResult
from robot_bench.events.codec import Json
from simbase.files import writing

#: What a terminal has.
_WIDTH = 80
#: chosen: so many survivors are listed; --json and --junit have all.
MOST_SHOWN = 40
#: The target of a branch says nothing that its line does not.
_TARGET = re.compile(r",? 0x[0-9a-f]{8}$")


@dataclass(frozen=True, slots=True, kw_only=True)
class Mutation:
    """All that was tried, and what came of each."""

    firmware: Path
    scenarios: Sequence[str]
    #: How many instructions the scenarios ran, and how many changes of them there are.
    instructions: int
    possible: int
    seed: int | None
    tried: Sequence[Mutant]
    #: By place in `tried`; None: interrupted before.
    found: Sequence[MutantResult | None]
    coverage: Coverage
    lines: LineTable

    @property
    def pairs(self) -> list[tuple[Mutant, MutantResult]]:
        """The mutants of which something came."""
        return [(one, found) for one, found in zip(self.tried, self.found, strict=True) if found is not None]

    @property
    def survivors(self) -> list[Mutant]:
        """Those that changed a run and that no goal noticed."""
        return [one for one, found in self.pairs if found.fate is Fate.SURVIVED]

    @property
    def score(self) -> float | None:
        """Noticed among those that changed a run, percent; None where none did."""
        return score([found for _, found in self.pairs])

    @property
    def is_sample(self) -> bool:
        """Whether there are changes that were not tried."""
        return len(self.pairs) < self.possible

    @property
    def bounds(self) -> tuple[float, float] | None:
        """Between what the score of all mutants lies, percent, with `CONFIDENCE`; None where none changed a run."""
        found = [one for _, one in self.pairs]
        same = sum(one.fate is Fate.SAME for one in found)
        if same == len(found):
            return None
        # Of those not tried some leave the same trace too, so the whole is smaller, and the bounds are nearer.
        noticed, whole = sum(one.is_noticed for one in found), self.possible - same
        low, high = share_interval(noticed, len(found) - same, whole)
        return 100 * low, 100 * high

    def words(self, mutant: Mutant) -> str:
        """Return a change as a person reads it."""
        before, after = (_TARGET.sub("", text) for text in (mutant.alteration.before, mutant.alteration.after))
        return f"{before} -> {after}"

    def place(self, mutant: Mutant) -> str:
        """Return where a mutant is: "dodge.c:12", or the symbol."""
        return self.coverage.place(mutant.address)

    def source(self, mutant: Mutant) -> str:
        """Return the line of the source, where the file is there."""
        row = self.lines.at(mutant.address)
        text = [] if row is None else source_lines(row.file, self.firmware.parent)
        return text[row.line - 1].strip() if row is not None and row.line <= len(text) else ""


def score(found: Sequence[MutantResult]) -> float | None:
    """Return how many of those that changed a run were noticed, percent; None where none did."""
    noticed = sum(one.is_noticed for one in found)
    different = sum(one.fate is not Fate.SAME for one in found)
    return 100 * noticed / different if different else None


def report_lines(mutation: Mutation) -> Iterator[str]:
    """Return the report, line by line."""
    what = f"{len(mutation.pairs)} tried" + ("" if mutation.seed is None else f" (seed {mutation.seed})")
    yield f"{mutation.firmware.name} on {', '.join(mutation.scenarios)}"[:_WIDTH]
    yield f"{mutation.instructions} instructions ran; {mutation.possible} changes of them, {what}"
    yield ""
    yield from in_columns(
        ("changed", "tried", "noticed", "survived", "same trace", "score"), list(_rows(mutation)), right=range(1, 6)
    )
    yield from _reporters(mutation)
    yield from _survivors(mutation)
    yield ""
    bounds = mutation.bounds
    if bounds is not None and mutation.is_sample:
        yield (
            f"score of all {mutation.possible}: {bounds[0]:.1f} to {bounds[1]:.1f} % ({CONFIDENCE:.0%} confidence, by "
            f"a sample of {len(mutation.pairs)})"
        )
    yield _sum(mutation)


def _rows(mutation: Mutation) -> Iterator[Sequence[str]]:
    for name in (*OPERATORS, "all"):
        found = [one for mutant, one in mutation.pairs if name in {mutant.alteration.operator, "all"}]
        fates = Counter(one.fate for one in found)
        noticed = sum(one.is_noticed for one in found)
        counts = (len(found), noticed, fates[Fate.SURVIVED], fates[Fate.SAME])
        yield name, *map(str, counts), _percent(score(found))


def _reporters(mutation: Mutation) -> Iterator[str]:
    """Tell what noticed how many: a goal that notices none could be left out as far as these mutants go."""
    words = {Fate.CRASHED: "the program ended in a fault", Fate.STOPPED: "it cost far more than the program"}
    counts = Counter(
        words.get(found.fate, f"{found.scenario}: {found.says.partition(': ')[0]}")
        for _, found in mutation.pairs if found.is_noticed
    )  # fmt: skip
    if counts:
        yield ""
        yield "noticed first by"
        for what, count in sorted(counts.items(), key=lambda row: (-row[1], row[0])):
            yield f"{count:5d}  {what}"[:_WIDTH]


def _survivors(mutation: Mutation) -> Iterator[str]:
    survivors = mutation.survivors
    if not survivors:
        return
    yield ""
    yield "survived: the run was another, and no goal noticed"
    for mutant in survivors[:MOST_SHOWN]:
        yield f"  {mutation.place(mutant):20} {mutation.words(mutant)}"[:_WIDTH]
        if source := mutation.source(mutant):
            yield f"  {'':20} {source}"[:_WIDTH]
    if len(survivors) > MOST_SHOWN:
        yield f"  and {len(survivors) - MOST_SHOWN} more; --json and --junit have all"


def _sum(mutation: Mutation) -> str:
    found = [one for _, one in mutation.pairs]
    noticed, same = sum(one.is_noticed for one in found), sum(one.fate is Fate.SAME for one in found)
    left = len(mutation.tried) - len(found)
    return (
        f"score {_percent(mutation.score)}: {noticed} noticed of {len(found) - same} that changed a run"
        + (f"; {same} left the same trace" if same else "")
        + (f"; {left} not tried" if left else "")
    )


def as_json(mutation: Mutation) -> Json:
    """Return all of it as one JSON object."""
    return {
        "firmware": mutation.firmware.name,
        "scenarios": list(mutation.scenarios),
        "instructions": mutation.instructions,
        "possible": mutation.possible,
        "seed": mutation.seed,
        "tried": len(mutation.pairs),
        "score": None if mutation.score is None else round(mutation.score, 3),
        "score_bounds": None if mutation.bounds is None else [round(bound, 3) for bound in mutation.bounds],
        "mutants": [_plain(mutation, mutant) | found.to_plain() for mutant, found in mutation.pairs],
    }


def _plain(mutation: Mutation, mutant: Mutant) -> Json:
    return {
        "address": f"{mutant.address:#010x}", "place": mutation.place(mutant), "operator": mutant.alteration.operator,
        "before": mutant.alteration.before, "after": mutant.alteration.after, "code": mutant.alteration.code.hex(),
        "source": mutation.source(mutant),
    }  # fmt: skip


def write_junit(mutation: Mutation, path: Path) -> None:
    """Write what CI services read: a test case a mutant, failed where it survived, skipped where the trace is the same.

    Raises:
        FileError: It cannot be written.
    """
    fates = Counter(found.fate for _, found in mutation.pairs)
    counts: Mapping[str, int] = {
        "tests": len(mutation.pairs), "failures": fates[Fate.SURVIVED], "errors": 0, "skipped": fates[Fate.SAME],
    }  # fmt: skip
    suite = ET.Element(
        "testsuite", {"name": f"mutants of {mutation.firmware.name}", **{key: str(n) for key, n in counts.items()}}
    )
    for mutant, found in mutation.pairs:
        name = f"{mutation.place(mutant)} {mutant.address:#010x} {mutation.words(mutant)}"
        case = ET.SubElement(suite, "testcase", classname=mutant.alteration.operator, name=name)
        if found.fate is Fate.SURVIVED:
            ET.SubElement(case, "failure", message="no goal noticed it").text = mutation.source(mutant)
        elif found.fate is Fate.SAME:
            ET.SubElement(case, "skipped", message="the same trace: no goal can notice it on these runs")
    with writing(path):
        ET.ElementTree(suite).write(path, encoding="utf-8", xml_declaration=True)


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f} %"
