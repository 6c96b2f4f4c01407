"""What a campaign leaves behind: a Parquet data set with a row a run, and a folder for each failure.

    results/part-00001.parquet     the first batch: seed, parameters, outcome, margins, hashes, versions
    failures/0007/dodge.toml       point 7 as a scenario with its files, for `p2os run`
    failures/0007/bisect.sh        judges the build of a commit by it, for `git bisect run`

A part is written whole or not at all, and names the same rows whoever worked on them; the seconds of a processor and
nothing else may differ.
Invariant: what a failure's folder holds is what was run: its trace has the hash that the data set names.
"""

import json
import shlex
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from string import Template

from robot_bench.campaign.campaign_file import Campaign
from robot_bench.campaign.conduct import FAILURES as FAILING
from robot_bench.campaign.conduct import CampaignProgress, PointFinding, PointRow, Run
from robot_bench.campaign.last_moment import LastMoment
from robot_bench.campaign.margin import goal_margin
from robot_bench.campaign.reaching.source import SourceReached, source_reached
from robot_bench.campaign.space import Space
from robot_bench.campaign.variants.diversity import FailureSet
from robot_bench.campaign.variants.mutation.interval import CONFIDENCE, share_interval
from simbase.errors import MissingDependencyError
from simbase.files import replacing, writing
from simbase.installation import installed_version

RESULTS, FAILURES = "results", "failures"
#: chosen: so many points the space has, for an interval that does not end with a sample of all.
MANY = 10**6
#: chosen: so many digits of a program's SHA-256 are shown; the data set has all.
SHOWN_HASH = 16

#: Exit codes are those that `git bisect run` knows: 0 good, 1 bad, 125 neither; from 128 on it ends.
BISECT = Template("""\
#!/bin/sh
# Is the commit that is checked out bad? Judged by the failure in this folder, with the firmware that it builds:
#   git bisect start BAD GOOD
#   git bisect run sh THIS_FILE build/robot.elf make
# The first word is the firmware's file, the others build it (none: it is in the repository). A commit that does not
# build, or whose program gives no verdict, is skipped.
firmware=$$1
shift
[ $$# -eq 0 ] || "$$@" || exit 125
[ -f "$$firmware" ] || exit 125
run=$$(mktemp -d) || exit 130
p2os run "$$(dirname "$$0")"/$scenario --firmware "$$firmware" --out "$$run/run"$trust
found=$$?
rm -rf "$$run"
case $$found in
    0 | 1) exit $$found ;;
    126 | 127 | 130) exit 130 ;;
    *) exit 125 ;;
esac
""")


class Results:
    """Writes what came of the batches.

    Args:
        folder: Of the campaign.
        campaign: What is done.
        space: What varies.

    Raises:
        MissingDependencyError: pyarrow is not installed.
        FileError: The folder cannot be written.
    """

    def __init__(self, folder: Path, campaign: Campaign, space: Space) -> None:
        try:
            import pyarrow  # noqa: ICN001, F401 - whether it is there
        except ImportError as error:
            raise MissingDependencyError("results of campaigns need pyarrow", extra="campaign") from error
        self.folder = folder
        self._campaign = campaign
        self._spans = {f"vary.{dimension.name}": dimension.span for dimension in space.dimensions}
        #: The rows of each part.
        self._parts: list[list[PointRow]] = []
        with writing(folder, hint="--out another folder"):
            (folder / RESULTS).mkdir(parents=True, exist_ok=True)

    def add(self, rows: Sequence[PointRow]) -> None:
        """Write a batch: a part of its own, or, of rows that are there and have more runs now, their parts again.

        Raises:
            FileError: The disk is full.
        """
        known = {row.number: (part, at) for part, held in enumerate(self._parts) for at, row in enumerate(held)}
        parts = {known[row.number][0] for row in rows if row.number in known}
        for row in rows:
            if row.number in known:
                part, at = known[row.number]
                self._parts[part][at] = row
        if not parts:
            parts = {len(self._parts)}
            self._parts.append([*rows])
        for part in sorted(parts):
            path = self.folder / RESULTS / f"part-{part + 1:05d}.parquet"
            with writing(path, hint="make room, then --resume"):
                self._write([self._entry(row, run) for row in self._parts[part] for run in row.runs], path)
        with writing(self.folder / FAILURES, hint="make room, then --resume"):
            for row in rows:
                if row.failing is not None:
                    scenario = row.failing.trial.write(self.failure_folder(row))
                    trust = " --trust" if row.failing.trial.trusted else ""
                    text = BISECT.substitute(scenario=shlex.quote(scenario.name), trust=trust)
                    (scenario.parent / "bisect.sh").write_text(text, encoding="utf-8")

    def failure_folder(self, row: PointRow) -> Path:
        """Return the folder of a point that failed."""
        return self.folder / FAILURES / f"{row.number:04d}"

    def replay(self, row: PointRow) -> str:
        """Return the command that runs a failure again."""
        name = row.proposal.trial(self._campaign.trial, ()).name
        trust = ["--trust"] if self._campaign.trial.trusted else []
        return shlex.join(["p2os", "run", str(self.failure_folder(row) / f"{name}.toml"), *trust])

    def _entry(self, row: PointRow, run: Run) -> dict[str, object]:
        outcome = run.outcome
        programs = run.trial.programs
        values: dict[str, object] = {
            "number": row.number, "stage": run.stage.value, "finding": row.finding.value,
            "verdict": outcome.verdict.value, "margin": run.margin, "seed": run.trial.seed,
            "body": run.trial.table["body"], "search": self._campaign.search, "campaign_seed": self._campaign.seed,
            "trial_sha256": run.trial.sha256, "trace_sha256": outcome.sha256,
            "firmware": ", ".join(programs), "firmware_sha256": ", ".join(programs.values()),
            "p2os": installed_version(),
            "virtual_s": outcome.virtual_ns / 1e9, "cpu_s": run.cpu_s, "distance_m": outcome.distance_m,
            "clearance_m": outcome.clearance_m, "contacts": len(outcome.hits), "failures": list(outcome.failures),
            "excused": [goal.kind for goal in outcome.excused_goals],
            "blocks": len(outcome.blocks), "states": len(outcome.lines), "new": row.new,
            "obstacles": json.dumps(row.proposal.obstacles), "faults": json.dumps(row.proposal.faults),
        }  # fmt: skip
        for goal in outcome.goals:
            key = f"margin.{goal.robot}.{goal.kind}" if goal.robot else f"margin.{goal.kind}"
            found = goal_margin(goal, outcome)
            values[key] = min(found, float(str(values[key]))) if key in values else found
        return values | {name: row.proposal.values.get(name.removeprefix("vary.")) for name in self._spans}

    def _write(self, entries: Sequence[dict[str, object]], path: Path) -> None:
        """Write rows as one Parquet file, whole or not at all; every part has the same columns."""
        import pyarrow as pa
        from pyarrow import parquet

        types = {"text": pa.string(), "number": pa.float64(), "whole": pa.int64(), "texts": pa.list_(pa.string())}
        names = list(dict.fromkeys(name for entry in entries for name in entry))
        schema = pa.schema([(name, types[self._type(name)]) for name in names])
        rows = [{name: self._cast(name, entry.get(name)) for name in names} for entry in entries]
        with replacing(path) as part:
            parquet.write_table(pa.Table.from_pylist(rows, schema=schema), part)

    def _type(self, name: str) -> str:
        """Return what a column holds."""
        if name.startswith("margin."):
            return "number"
        if name not in self._spans:
            return _TYPES.get(name, "text")
        span = self._spans[name]
        kinds = {type(value) for value in span.choices}
        if kinds:
            return "whole" if kinds == {int} else "number" if kinds <= {int, float} else "text"
        return "whole" if span.is_whole else "number"

    def _cast(self, name: str, value: object) -> object:
        return value if value is None or self._type(name) != "text" else str(value)


#: Columns that are no texts.
_TYPES = {
    **dict.fromkeys(("margin", "virtual_s", "cpu_s", "distance_m", "clearance_m"), "number"),
    **dict.fromkeys(("number", "seed", "campaign_seed", "contacts", "blocks", "states", "new"), "whole"),
    **dict.fromkeys(("failures", "excused"), "texts"),
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class PointRate:
    """How many of the points that were drawn from the whole space are so, one of each trace."""

    count: int
    of: int

    @property
    def bounds(self) -> tuple[float, float]:
        """Between what the share of the whole space lies, 0 to 1, with `CONFIDENCE`."""
        return share_interval(self.count, self.of, MANY)

    def __str__(self) -> str:
        low, high = (100 * bound for bound in self.bounds)
        return f"{self.count} of {self.of}: {low:.1f} to {high:.1f} % ({CONFIDENCE:.0%} confidence)"


@dataclass(slots=True, kw_only=True)
class Whole:
    """What came of a campaign."""

    campaign: Campaign
    space: Space
    folder: Path
    progress: CampaignProgress
    results: Results
    #: Number of a point → until when its failure was avoidable.
    moments: dict[int, LastMoment] = field(default_factory=dict)
    was_interrupted: bool = False
    #: What was reached of the source, of so many blocks and ways; both only grow.
    _source: tuple[int, int, SourceReached | None] = (-1, -1, None)

    @property
    def counts(self) -> Mapping[PointFinding, int]:
        """How many points came to each finding."""
        return Counter(row.finding for row in self.progress.rows)

    @property
    def failures(self) -> list[PointRow]:
        """The points whose failure was proven."""
        return self.progress.failures

    @property
    def different_runs(self) -> int:
        """How many runs the points came to, those with the same trace counted once."""
        return len({row.cheap.outcome.sha256 for row in self.progress.rows})

    @property
    def rates(self) -> Mapping[str, PointRate]:
        """How many of the points fail, and are excused, by those that tell of the whole space; nothing without any."""
        drawn = {row.cheap.outcome.sha256: row for row in reversed(self.progress.rows) if row.is_drawn}
        known = [row for row in drawn.values() if row.finding is not PointFinding.ERROR]
        counts = Counter("fail" if row.finding in FAILING else row.finding.value for row in known)
        return {name: PointRate(counts[name], len(known)) for name in ("fail", "excused") if known}

    @property
    def source(self) -> SourceReached | None:
        """What of the program's source the cheap runs have reached; None where there is no one program."""
        blocks, ways = self.progress.blocks, self.progress.ways
        if self._source[:2] != (len(blocks), len(ways)):  # asked for by the page, the summary and the terminal
            self._source = len(blocks), len(ways), source_reached(self.campaign.trial, blocks, ways)
        return self._source[2]

    @property
    def unreached(self) -> list[str]:
        """What had to be reached and no point has."""
        return [said for said, numbers in self.progress.reached.items() if not numbers]

    def as_json(self) -> dict[str, object]:
        """Return all that came of it; times of this machine left out."""
        return {
            "campaign": self.campaign.name,
            "firmware": [{"name": name, "sha256": sha256} for name, sha256 in self.campaign.trial.programs.items()],
            "search": self.campaign.search,
            "different_runs": self.different_runs,
            "points": len(self.progress.rows),
            "rates": {
                name: {"count": rate.count, "of": rate.of, "bounds": [round(bound, 6) for bound in rate.bounds]}
                for name, rate in self.rates.items()
            },
            "runs": self.progress.runs,
            "journal_left_out": {str(line): why for line, why in self.progress.left_out.items()},
            "virtual_s": self.progress.virtual_ns / 1e9,
            "blocks": len(self.progress.blocks),
            "states": len(self.progress.states),
            "transitions": len(self.progress.transitions),
            "reach": {said: numbers[:1] for said, numbers in self.progress.reached.items()},
            "source": None if (source := self.source) is None else {
                "lines": source.lines, "lines_of": source.lines_of, "ways": source.ways, "ways_of": source.ways_of,
                "unreached": dict(source.unreached()),
            },
            "was_interrupted": self.was_interrupted,
            "findings": {finding.value: self.counts.get(finding, 0) for finding in PointFinding},
            "failures": [
                {
                    "number": row.number, "finding": row.finding.value, "failures": list(run.outcome.failures),
                    "trace_sha256": run.outcome.sha256, "margin": run.margin, "parameters": dict(row.proposal.values),
                    "avoidable": moment.words if (moment := self.moments.get(row.number)) else None,
                    "replay": self.results.replay(row),
                }
                for row in self.failures if (run := row.failing) is not None
            ],
            **FailureSet.of(self.progress.rows).to_plain(),
        }  # fmt: skip
