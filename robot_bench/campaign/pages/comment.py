"""The comment of a campaign on a pull request: Markdown, and a picture for each kind of failure.

    ## dodge-campaign: 2 of 64 points fail
    ![point 7](pictures/0007.svg)
    **point 7** answers: the motors had +3, +3 from …
    first parting wire: motor1_comm2 at 3.204 s · cause: dodge_fsm.c:122-123
    p2os run campaigns/dodge-001/failures/0007/dodge.toml

Of failures that are alike the first is shown. Nothing is fetched or sent: who posts it says where the pictures are.

Invariant: it is made of the campaign's folder alone, and of the version that it is compared with.
"""

import re
import shlex
from collections.abc import Iterator, Sequence
from pathlib import Path

from robot_bench.campaign.campaign_file import Campaign
from robot_bench.campaign.conduct import FAILURES, PointFinding, PointRow
from robot_bench.campaign.pages.plan_picture import picture
from robot_bench.campaign.variants.against import Other, first_apart, reported
from robot_bench.campaign.variants.diversity import FailureSet
from robot_bench.campaign.variants.fault_line import by_version
from simbase.errors import P2osError
from simbase.files import write_text, writing

#: chosen: so many kinds of failures are shown; a comment is read, not searched.
MOST_SHOWN = 3
PICTURES = "pictures"
#: What Markdown would take for marks.
_MARKS = re.compile(r"([\\`*_\[\]<>|~])")


def write_comment(
    folder: Path, campaign: Campaign, rows: Sequence[PointRow], out: Path, *, other: Other | None = None, url: str = ""
) -> str:
    """Write the comment of a campaign's folder, with its pictures beside it; return it.

    Args:
        folder: The campaign's.
        campaign: What was done.
        rows: Its points.
        out: The file of the comment.
        other: A version that is good: it says where the failing one parts from it, and by which source line.
        url: What stands before the path of each picture, where they are put.

    Raises:
        FileError: It cannot be written.
    """
    failing = [row for row in rows if row.finding in FAILURES]
    shown = _first_of_each_kind(rows, failing)
    lines = [f"## {_plain(campaign.name)}: {_verdict(rows, failing)}", ""]
    with writing(out.parent, hint="--out another file"):
        (out.parent / PICTURES).mkdir(parents=True, exist_ok=True)
    for row in shown:
        name = f"{PICTURES}/{row.number:04d}.svg"
        write_text(out.parent / name, picture(row.failing or row.cheap))
        lines += [*_of_failure(folder, campaign, row, f"{url}{name}", other), ""]
    left = len(failing) - len(shown)
    if left:
        lines += [f"and {left} more points, in `failures/`", ""]
    lines += [f"<sub>{_footer(campaign, rows)}</sub>", ""]
    text = "\n".join(lines)
    write_text(out, text)
    return text


def _first_of_each_kind(rows: Sequence[PointRow], failing: Sequence[PointRow]) -> list[PointRow]:
    firsts = {numbers[0] for numbers in FailureSet.of(rows).kinds}
    return [row for row in failing if row.number in firsts][:MOST_SHOWN]


def _verdict(rows: Sequence[PointRow], failing: Sequence[PointRow]) -> str:
    return f"{len(failing)} of {len(rows)} points fail" if failing else f"none of {len(rows)} points fails"


def _of_failure(folder: Path, campaign: Campaign, row: PointRow, image: str, other: Other | None) -> Iterator[str]:
    run = row.failing or row.cheap
    yield f"![point {row.number}]({image})"
    yield ""
    yield f"**point {row.number}**: {_plain(next(iter(run.outcome.failures), ''))}"
    yield ""
    if other is not None:
        parted, cause = _against(row, other)
        yield f"- first parting wire: {_plain(parted)}"
        yield f"- cause: {_plain(cause)}"
        yield ""
    name = row.proposal.trial(campaign.trial, ()).name
    path = folder / "failures" / f"{row.number:04d}" / f"{name}.toml"
    yield f"```sh\n{shlex.join(['p2os', 'run', str(path)])}\n```"


def _against(row: PointRow, other: Other) -> tuple[str, str]:
    """Return where a failing point's run parts from that of a good version, and by which line the two differ."""
    trial = row.cheap.trial if row.finding is PointFinding.CONFIRMED else (row.failing or row.cheap).trial
    difference = first_apart(trial, other)
    try:
        cause = by_version([trial], other)
    except P2osError as error:
        return "none" if difference is None else reported(difference), f"unknown: {error}"
    said = f"`{cause.line}`, {cause.says}" if cause.line else f"unknown: {cause.says}"
    return "none" if difference is None else reported(difference), said


def _footer(campaign: Campaign, rows: Sequence[PointRow]) -> str:
    counts = [
        f"{sum(row.finding is finding for row in rows)} {finding.value}"
        for finding in PointFinding
        if any(row.finding is finding for row in rows)
    ]
    programs = ", ".join(f"{name} {sha256[:16]}" for name, sha256 in campaign.trial.programs.items())
    return _plain(f"{', '.join(counts)}; {programs}; each failure was run again with the same hash")


def _plain(text: str) -> str:
    """Return a text so that Markdown shows it as it is, but for code in backquotes at its beginning."""
    head, tail = ("", text)
    if text.startswith("`") and (end := text.find("`", 1)) > 0:
        head, tail = text[: end + 1], text[end + 1 :]
    return head + _MARKS.sub(r"\\\1", tail.replace("\n", " "))
