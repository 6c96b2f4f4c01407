"""The page of a validation: every figure of every variant side by side, with its bound and the formula of that.

The page itself is `p2os.view.page`.
"""

from collections.abc import Iterator, Mapping, Sequence

from p2os.view.header import PageCell, PageHeader, PageSection, PageTable, PageText
from p2os.view.page import document
from robot_bench.experiments.validation.experiments import Experiment
from robot_bench.experiments.validation.figures import GROUPS, LOOSE_BECAUSE, Finding, Missing, loose, shown_value
from robot_bench.experiments.validation.trials import TrialResult

_HEAD = ("figure", "variant", "expected", "measured", "difference", "of the bound", "bound and its formula")


def render(
    results: Sequence[TrialResult], experiments: Mapping[str, Experiment], *, command: str, settings: Sequence[str] = ()
) -> str:
    """Return the page of a validation.

    Args:
        results: Of every experiment and variant.
        experiments: What they claim, by name.
        command: How it was asked for.
        settings: What was set otherwise than what is expected.
    """
    failed = [result for result in results if not result.passed]
    verdict = "failed" if failed else "passed"
    names = [name for name in experiments if any(result.experiment == name for result in results)]
    lead = (
        f"{len(results)} experiments in {len({r.variant for r in results})} variants of the bench, {len(failed)} failed"
    )
    if settings:
        lead += f"; run with {', '.join(settings)}, which is not expected"
    sections = [
        PageSection(title="Experiments", blocks=[_matrix(names, results)]),
        *(_experiment(experiments[name], [r for r in results if r.experiment == name]) for name in names),
        *_bounds(results),
    ]
    return document(
        PageHeader(title="Validation", verdict=verdict, standing="failed" if failed else "passed", lead=lead,
                   sections=sections, footer=command)
    )  # fmt: skip


def _matrix(names: Sequence[str], results: Sequence[TrialResult]) -> PageTable:
    variants = list(dict.fromkeys(result.variant for result in results))
    rows = []
    for name in names:
        cells = [PageCell(text=name)]
        for variant in variants:
            found = [one for one in results if one.experiment == name and one.variant == variant]
            bad = sum(not one.passed for one in found)
            word = "–" if not found else "passed" if not bad else "failed"
            many = f" {len(found) - bad} of {len(found)}" if len(found) > 1 else ""
            cells.append(PageCell(text=f"{word}{many}", standing="failed" if bad else "passed" if found else ""))
        rows.append(cells)
    return PageTable(head=["", *(variant.name for variant in variants)], rows=rows)


def _experiment(experiment: Experiment, results: Sequence[TrialResult]) -> PageSection:
    rows = []
    for (group, name), found in _by_figure(results).items():
        for number, (result, finding) in enumerate(found):
            first = PageCell(text=f"{group}: {name}" if number == 0 else "")
            rows.append([first, *_row(result, finding)])
    return PageSection(
        title=experiment.name, note=experiment.hypothesis,
        blocks=[PageText(text=experiment.procedure), PageTable(head=_HEAD, rows=rows)],
    )  # fmt: skip


def _by_figure(results: Sequence[TrialResult]) -> dict[tuple[str, str], list[tuple[TrialResult, Finding]]]:
    rows: dict[tuple[str, str], list[tuple[TrialResult, Finding]]] = {}
    for result in results:
        for finding in result.findings:
            rows.setdefault((finding.group, finding.what), []).append((result, finding))
    return dict(sorted(rows.items(), key=lambda item: GROUPS.index(item[0][0])))


def _row(result: TrialResult, finding: Finding) -> list[PageCell]:
    where = PageCell(text=result.variant.name + (f", {result.world}, seed {result.seed}" if result.world else ""))
    if isinstance(finding, Missing):
        return [where, PageCell(text=finding.why, standing="failed"), *[PageCell(text="")] * 4]
    value = shown_value(finding.measured, finding.unit)
    if finding.uncertainty:
        value += f" ± {finding.uncertainty:.2g}"
    standing = "passed" if finding.is_met else "failed"
    return [
        where,
        PageCell(text=shown_value(finding.expected, finding.unit), is_number=True),
        PageCell(text=value + (f" ({finding.at})" if finding.at else ""), is_number=True),
        PageCell(text=f"{round(finding.difference, 9) + 0.0:+.3g}", is_number=True, standing=standing),  # type: ignore[arg-type]  # one of the two
        PageCell(text=f"{finding.share:.0%}", is_number=True),
        PageCell(text=finding.bound.formula),
    ]


def _bounds(results: Sequence[TrialResult]) -> Iterator[PageSection]:
    """Yield the bounds that would hold at half their size, each with its reason."""
    rows = [
        [
            PageCell(text=name),
            PageCell(text=f"{share:.2f}", is_number=True),
            PageCell(text=LOOSE_BECAUSE.get(name, "these runs come no nearer to it")),
        ]
        for name, share in sorted(loose(one for result in results for one in result.findings).items())
    ]
    if rows:
        yield PageSection(
            title="Bounds that half their size would hold too",
            note="every other one is broken by some figure at half its size",
            blocks=[PageTable(head=("bound", "largest share seen", "why it is not tighter"), rows=rows)],
        )
