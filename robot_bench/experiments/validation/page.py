"""The page of a validation: every figure of every variant side by side, with its bound and the formula of that.

Self-contained HTML without script, as the report of a run is without network.
"""

import html
from collections.abc import Mapping, Sequence
from importlib.resources import files

from robot_bench.experiments.validation.experiments import Experiment
from robot_bench.experiments.validation.figures import (
    GROUPS,
    LOOSE_BECAUSE,
    Figure,
    Finding,
    Missing,
    loose,
    shown_value,
)
from robot_bench.experiments.validation.trials import TrialResult

#: Widths of the strip that shows a difference in bounds, pixels.
STRIP_WIDTH, STRIP_HEIGHT = 120, 14
#: chosen: the strip ends at so many bounds.
STRIP_BOUNDS = 1.5
STYLE = """
table.figures-of td, table.figures-of th, table.matrix td, table.matrix th {
  padding: 4px 8px; border-bottom: 1px solid var(--line); text-align: left; vertical-align: top; }
table.figures-of td.n, table.matrix td { font-variant-numeric: tabular-nums; }
th { font-weight: 650; font-size: 13px; color: var(--faint); }
.group { color: var(--faint); }
.bad { color: var(--bad); font-weight: 650; }
.good { color: var(--good); }
.formula { color: var(--faint); font-size: 12.5px; }
.wide { overflow-x: auto; }
svg { display: block; }
"""


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
    body = "".join(_experiment(experiments[name], [r for r in results if r.experiment == name]) for name in names)
    style = files("robot_bench.report").joinpath("page.css").read_text(encoding="utf-8") + STYLE
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>validation · {verdict}</title><style>{style}</style></head><body>"
        f'<header><h1>Validation <span class="verdict {verdict}">{verdict}</span></h1>'
        f'<p class="lead">{_safe(lead)}</p></header><main>{_matrix(names, results)}{body}{_bounds(results)}</main>'
        f"<footer>{_safe(command)}</footer></body></html>\n"
    )


def _matrix(names: Sequence[str], results: Sequence[TrialResult]) -> str:
    variants = list(dict.fromkeys(result.variant for result in results))
    head = "".join(f"<th>{_safe(variant.name)}</th>" for variant in variants)
    rows = ""
    for name in names:
        cells = ""
        for variant in variants:
            found = [one for one in results if one.experiment == name and one.variant == variant]
            bad = sum(not one.passed for one in found)
            word = "–" if not found else "passed" if not bad else "failed"
            many = f" {len(found) - bad} of {len(found)}" if len(found) > 1 else ""
            cells += f'<td class="{"bad" if bad else "good"}">{word}{many}</td>'
        rows += f'<tr><td><a href="#{_safe(name)}">{_safe(name)}</a></td>{cells}</tr>'
    return f'<div class="wide"><table class="matrix"><tr><th></th>{head}</tr>{rows}</table></div>'


def _experiment(experiment: Experiment, results: Sequence[TrialResult]) -> str:
    rows = ""
    for what, found in _by_figure(results).items():
        group, name = what
        for number, (result, finding) in enumerate(found):
            first = (
                f'<td rowspan="{len(found)}"><span class="group">{_safe(group)}</span><br>{_safe(name)}</td>'
                if number == 0
                else ""
            )
            rows += f"<tr>{first}{_row(result, finding)}</tr>"
    return (
        f'<h2 id="{_safe(experiment.name)}">{_safe(experiment.name)} <small>{_safe(experiment.hypothesis)}</small></h2>'
        f'<p class="lead">{_safe(experiment.procedure)}</p><div class="wide"><table class="figures-of">'
        "<tr><th>figure</th><th>variant</th><th>expected</th><th>measured</th><th>difference</th><th>in bounds</th>"
        f"<th>bound and its formula</th></tr>{rows}</table></div>"
    )


def _by_figure(results: Sequence[TrialResult]) -> dict[tuple[str, str], list[tuple[TrialResult, Finding]]]:
    rows: dict[tuple[str, str], list[tuple[TrialResult, Finding]]] = {}
    for result in results:
        for finding in result.findings:
            rows.setdefault((finding.group, finding.what), []).append((result, finding))
    return dict(sorted(rows.items(), key=lambda item: GROUPS.index(item[0][0])))


def _row(result: TrialResult, finding: Finding) -> str:
    where = result.variant.name + (f", {result.world}, seed {result.seed}" if result.world else "")
    if isinstance(finding, Missing):
        return f'<td>{_safe(where)}</td><td colspan="5" class="bad">{_safe(finding.why)}</td>'
    value = f"{shown_value(finding.measured, finding.unit)}"
    if finding.uncertainty:
        value += f" ± {finding.uncertainty:.2g}"
    at = f" <small>({_safe(finding.at)})</small>" if finding.at else ""
    grade = "good" if finding.is_met else "bad"
    return (
        f'<td>{_safe(where)}</td><td class="n">{_safe(shown_value(finding.expected, finding.unit))}</td>'
        f'<td class="n">{_safe(value)}{at}</td><td class="n {grade}">{round(finding.difference, 9) + 0.0:+.3g}</td>'
        f'<td>{_strip(finding)}</td><td class="formula">{_safe(finding.bound.formula)}</td>'
    )


def _strip(figure: Figure) -> str:
    """Return a strip with the bound as a band and the difference as a dot; one out of the strip stands at its end."""
    unit = STRIP_WIDTH / 2 / STRIP_BOUNDS
    middle = STRIP_WIDTH / 2
    signed = figure.share if figure.difference >= 0 else -figure.share
    place = middle + unit * max(0.12 - STRIP_BOUNDS, min(STRIP_BOUNDS - 0.12, signed))
    colour = "var(--good)" if figure.is_met else "var(--bad)"
    band = 2 * unit if figure.bound.value else 2
    return (
        f'<svg width="{STRIP_WIDTH}" height="{STRIP_HEIGHT}" role="img" aria-label="{figure.share:.2f} of the bound">'
        f'<rect x="{middle - band / 2:.1f}" y="4" width="{band:.1f}" height="6" fill="var(--line)"/>'
        f'<line x1="{middle}" x2="{middle}" y1="2" y2="12" stroke="var(--faint)"/>'
        f'<circle cx="{place:.1f}" cy="7" r="4" fill="{colour}"/></svg>'
    )


def _bounds(results: Sequence[TrialResult]) -> str:
    """Return the bounds that would hold at half their size, each with its reason."""
    rows = "".join(
        f"<tr><td>{_safe(name)}</td><td>{share:.2f}</td>"
        f"<td>{_safe(LOOSE_BECAUSE.get(name, 'these runs come no nearer to it'))}</td></tr>"
        for name, share in sorted(loose(one for result in results for one in result.findings).items())
    )
    if not rows:
        return ""
    return (
        "<h2>Bounds that half their size would hold too <small>every other one is broken by some figure at half its "
        'size</small></h2><div class="wide"><table class="figures-of">'
        f"<tr><th>bound</th><th>largest share seen</th><th>why it is not tighter</th></tr>{rows}</table></div>"
    )


def _safe(text: str) -> str:
    return html.escape(text)
