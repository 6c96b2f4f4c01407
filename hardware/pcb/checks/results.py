"""The result of one check, and the table of results that `make board` prints."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum


class CheckStatus(StrEnum):
    """How a check ended."""

    GOOD = "ok"
    BAD = "FAIL"
    #: A program or library that it needs is not installed.
    SKIPPED = "skipped"


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckResult:
    """One check of one subject."""

    name: str
    subject: str
    verdict: CheckStatus
    detail: str


def judged(name: str, subject: str, is_good: bool, detail: str) -> CheckResult:
    """Return the result of a check that has run."""
    return CheckResult(
        name=name, subject=subject, verdict=CheckStatus.GOOD if is_good else CheckStatus.BAD, detail=detail
    )


def listed(name: str, subject: str, faults: Iterable[str], detail: str) -> CheckResult:
    """Return the result of a check that lists faults: good where there are none."""
    found = list(faults)
    return judged(name, subject, not found, f"{len(found)}: {found[0]}" if found else detail)


def skipped(name: str, subject: str, why: str) -> CheckResult:
    """Return the result of a check that could not run."""
    return CheckResult(name=name, subject=subject, verdict=CheckStatus.SKIPPED, detail=why)


def table(results: list[CheckResult]) -> str:
    """Return the table that a person reads; the last line sums up."""
    widths = [max(len(str(getattr(one, name))) for one in results) for name in ("name", "subject", "verdict")]
    lines = [
        f"{one.verdict:<{widths[2]}}  {one.name:<{widths[0]}}  {one.subject:<{widths[1]}}  {one.detail}"
        for one in results
    ]
    counts = {verdict: sum(one.verdict is verdict for one in results) for verdict in CheckStatus}
    summary = f"{counts[CheckStatus.GOOD]} ok, {counts[CheckStatus.BAD]} failed, {counts[CheckStatus.SKIPPED]} skipped"
    return "\n".join([*lines, summary])
