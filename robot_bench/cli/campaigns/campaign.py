"""`p2os campaign`: searches for the worlds in which a firmware fails, and proves each that it finds."""

import contextlib
import json
import os
import shlex
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Annotated

import typer

from p2os.cli.groups import BENCH
from p2os.cli.quantities import option
from p2os.cli.trust import Trusted, said
from p2os.transport.wall_clock import wall_clock
from robot_bench.campaign.campaign_file import Campaign, campaign_schema
from robot_bench.campaign.conduct import CampaignProgress, PointFinding, Workers
from robot_bench.campaign.journal import NAME as JOURNAL
from robot_bench.campaign.pages.comment import write_comment
from robot_bench.campaign.results import SHOWN_HASH, Whole
from robot_bench.campaign.search import SEARCHES
from robot_bench.campaign.suggestion import suggested
from robot_bench.campaign.variants.against import Against, Other, first_apart, reported
from robot_bench.campaign.variants.diversity import FailureSet
from robot_bench.campaign.whole import begin, carry_out, points_of, resume
from robot_bench.campaign.workers.processes import Processes
from robot_bench.cli.progress import RunDisplay, counting_bar
from robot_bench.cli.run import refuse
from robot_bench.cli.workers import Jobs, core_count
from robot_bench.recording.run_folder import used_folder
from robot_bench.scenario.loading import load_scenario
from simbase.command_line.program import EXIT_INTERRUPTED
from simbase.errors import UsageError, nearest
from simbase.trust import Trust
from simbase.units import COUNT

HELP = """Search for worlds in which a firmware fails.

A campaign file states what varies, what must hold and how much may be spent.
Cheap runs propose failures, full runs confirm them, and another process repeats
each with the same hash.

Exit code: 0 nothing fails; 1 something does, no point has a verdict, or a
[[reach]] was not reached; 130 interrupted (--resume continues).

\b
Examples:
  p2os campaign new dodge                        write dodge-campaign.toml
  p2os campaign dodge-campaign.toml -j 2         search
  p2os campaign dodge-campaign.toml --firmware build/x.elf --runs 50
  p2os campaign --resume campaigns/dodge-001     continue an interrupted search
  p2os campaign c.toml --firmware new.elf --against old.elf    points where they differ
  p2os campaign big.toml --dask local -j 4       workers of Dask
  p2os campaign c.toml --minutes 5 --out found   in a pull request, then:
  p2os campaign comment found --against good.elf --out found/comment.md
"""
#: chosen: so many failures are shown one by one.
MOST_SHOWN = 12
#: Where the folders of campaigns are made.
CAMPAIGNS = Path("campaigns")


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("campaign", help=HELP, rich_help_panel=BENCH)(campaign)


def campaign(
    words: Annotated[
        list[str] | None,
        typer.Argument(
            help="A campaign file; `new` and a scenario; `comment` and a folder.",
            metavar="[FILE|new SCENARIO|comment FOLDER]",
        ),
    ] = None,
    jobs: Jobs = None,
    firmware: Annotated[
        Path | None, typer.Option(help="ELF, HEX or BIN in place of the scenario's.", metavar="FILE")
    ] = None,
    against: Annotated[
        Path | None, typer.Option(help="Another version: search for worlds where they differ.", metavar="FILE")
    ] = None,
    search: Annotated[str | None, typer.Option(help="Who proposes.", metavar="SEARCH")] = None,
    runs: Annotated[
        int | None, option(COUNT, "--runs", purpose="Cheap runs, in place of the file's.", above_zero=True)
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Of the search.", metavar="SEED", min=0)] = None,
    minutes: Annotated[
        float | None, typer.Option(help="Of the clock, in place of the file's.", metavar="MINUTES", min=0.1)
    ] = None,
    url: Annotated[
        str, typer.Option(help="Of a comment's pictures: what stands before their path.", metavar="URL")
    ] = "",
    out: Annotated[
        Path | None, typer.Option(help="Folder; default campaigns/NAME-NNN, or NAME-campaign.toml.", metavar="PATH")
    ] = None,
    go_on: Annotated[
        Path | None, typer.Option("--resume", help="Go on with a campaign's folder.", metavar="FOLDER")
    ] = None,
    dask: Annotated[str | None, typer.Option(help="Workers of Dask on this machine.", metavar="local")] = None,
    scheduler: Annotated[str | None, typer.Option(help="Dask's scheduler.", metavar="ADDRESS")] = None,
    trust: Trusted = False,
    json_output: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
    schema: Annotated[bool, typer.Option("--schema", help="Print the JSON schema of campaigns.")] = False,
) -> None:
    """Conduct a campaign."""
    asked = words or []
    if schema:
        typer.echo(json.dumps(campaign_schema(), indent=2))
        return
    if search is not None and search not in SEARCHES:
        raise UsageError(f"there is no search {search!r}", hint=nearest(search, list(SEARCHES)))
    if asked[:1] == ["new"]:
        refuse(
            {"jobs": jobs, "against": against, "resume": go_on, "dask": dask, "scheduler": scheduler,
             "json": json_output or None},
            "cannot stand beside new: no key of a campaign file holds it", hint="give it when the campaign is run",
        )  # fmt: skip
        keys = {"search": search, "seed": seed, "runs": runs}
        write_new(asked[1:], out, firmware, {key: value for key, value in keys.items() if value is not None})
        return
    _refuse_dask(dask, scheduler)
    if asked[:1] == ["comment"]:
        typer.echo(comment_on(asked[1:], out, against, url, trust=said(trust)), nl=False)
        return
    budget = {key: value for key, value in (("runs", runs), ("minutes", minutes)) if value is not None}
    given: dict[str, object] = {"search": search, "seed": seed, "budget": budget or None}
    overrides = {key: value for key, value in given.items() if value is not None}
    if go_on is not None:
        if asked or overrides or firmware or against or out:
            raise UsageError("--resume goes on with what was begun", hint="leave file and options out, but for -j")
        folder, found = go_on, resume(go_on, trust=said(trust))
        other = Other.of(folder)
    elif len(asked) == 1:
        file = Path(asked[0])
        with used_folder(out, file.stem, CAMPAIGNS) as folder:
            other = None if against is None else Other.read(against)
            found = begin(file, folder, firmware=firmware, overrides=overrides, other=other, trust=said(trust))
    else:
        raise UsageError("which campaign?", hint="p2os campaign FILE, or p2os campaign new SCENARIO")
    with RunDisplay(is_shown=False) as display:
        workers = _workers(found, jobs or core_count(), dask, scheduler, display)
        if other is not None:
            workers = Against(workers, other)
        try:
            with shown(found) as on_run:
                done = carry_out(
                    found, folder, workers, clock=wall_clock, on_run=on_run, look=display.raise_if_interrupted
                )
        finally:
            workers.close()
    tell(done, other, json_output=json_output)


def write_new(words: list[str], out: Path | None, firmware: Path | None, keys: Mapping[str, object]) -> None:
    """Write a campaign file for a scenario.

    Args:
        words: The scenario.
        out: The file; None: after the scenario.
        firmware: The program in place of the scenario's; the file names it.
        keys: Other keys of the file that were given: `search`, `seed`, `runs`.

    Raises:
        UsageError: No scenario is named, or the file is there.
    """
    if len(words) != 1:
        raise UsageError("a campaign for which scenario?", hint="p2os campaign new dodge")
    scenario = load_scenario(words[0], firmware=firmware, trust=Trust(only_reads=True))
    path = out or Path(f"{scenario.name}-campaign.toml")
    given = dict(keys)
    if firmware is not None:
        given["firmware"] = _seen_from(path, firmware)
    name = str(_seen_from(path, Path(words[0]))) if Path(words[0]).is_file() else words[0]
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(suggested(scenario, name, str(path), given))
    except FileExistsError as error:
        raise UsageError(f"{path} is there already", hint="--out another file") from error
    except OSError as error:
        raise UsageError(f"cannot write {path}: {error.strerror}", hint="--out another file") from error
    typer.echo(f"{path}: what may vary, what has to hold, how much may be spent")
    typer.echo(f"next: p2os campaign {shlex.quote(str(path))}")


def _refuse_dask(dask: str | None, scheduler: str | None) -> None:
    if dask not in {None, "local"}:
        raise UsageError(f"there is no --dask {dask!r}", hint="--dask local, or --scheduler ADDRESS")
    if dask and scheduler:
        raise UsageError("--dask local and --scheduler cannot stand together", hint="leave one of the two out")


def comment_on(words: list[str], out: Path | None, against: Path | None, url: str, *, trust: bool | Trust) -> str:
    """Write the comment of a campaign on a pull request, with its pictures; return it.

    Raises:
        UsageError: No folder is named.
    """
    if len(words) != 1:
        raise UsageError("a comment on which campaign?", hint="p2os campaign comment campaigns/dodge-001")
    folder = Path(words[0])
    campaign, rows = resume(folder, trust=trust), points_of(folder, trust=trust)
    other = Other.of(folder) if against is None else Other.read(against)
    return write_comment(folder, campaign, rows, out or folder / "comment.md", other=other, url=url)


def _seen_from(path: Path, other: Path) -> str:
    """Return a file as a file in another folder names it; an absolute one as it is."""
    return str(other) if other.is_absolute() else os.path.relpath(other, path.parent)


def _workers(found: Campaign, jobs: int, dask: str | None, scheduler: str | None, display: RunDisplay) -> Workers:
    if dask or scheduler:
        from robot_bench.campaign.workers.dask_workers import DaskWorkers

        workers = DaskWorkers(scheduler, jobs, found.limits, display.raise_if_interrupted)
        typer.echo(f"Dask: {workers.where}", err=True)
        return workers
    return Processes(jobs, found.limits, display.raise_if_interrupted)


@contextlib.contextmanager
def shown(found: Campaign) -> Iterator[Callable[[CampaignProgress], None]]:
    """Tell on stderr how a campaign goes: a bar on a terminal, elsewhere a line each tenth; yield what is told."""
    whole, reported = found.budget.runs, 0

    def update(progress: CampaignProgress) -> None:
        nonlocal reported
        points = progress.answered
        said = f"{progress.runs} runs, {len(progress.failures)} failures, {len(progress.blocks)} blocks"
        tell_bar(points, said)
        if not sys.stderr.isatty() and points * 10 // whole > reported:
            reported = points * 10 // whole
            typer.echo(f"{points} of {whole} points: {said}", err=True)

    with counting_bar("points", whole) as tell_bar:
        yield update


def tell(done: Whole, other: Other | None, *, json_output: bool) -> None:
    """Print what came of a campaign, and end the command with its exit code."""
    for words in done.progress.left_out_words():
        typer.echo(f"{done.folder / JOURNAL}: {words}; left out, what it told was run again", err=True)
    parts = {} if other is None or done.was_interrupted else parted(done, other)
    if json_output:
        against = {} if other is None else {"against": {"name": other.name, "sha256": other.sha256}}
        typer.echo(json.dumps(done.as_json() | against | ({"parted": parts} if parts else {}), sort_keys=True))
    else:
        print_whole(done, parts, other)
    if done.was_interrupted:
        raise typer.Exit(EXIT_INTERRUPTED)
    if done.failures or done.unreached or {row.finding for row in done.progress.rows} == {PointFinding.ERROR}:
        raise typer.Exit(1)


def parted(done: Whole, other: Other) -> dict[int, str]:
    """Return of the first points where two versions differ when and in what they part."""
    found: dict[int, str] = {}
    for row in done.failures[:MOST_SHOWN]:
        difference = None if row.failing is None else first_apart(row.failing.trial, other)
        if difference is not None:
            found[row.number] = reported(difference)
    return found


def print_whole(done: Whole, parts: Mapping[int, str], other: Other | None) -> None:
    """Print the failures, each with the command that runs it again, what else was found, and the sum."""
    for row in done.failures[:MOST_SHOWN]:
        run = row.failing
        if run is None:
            continue
        typer.echo(f"failed  point {row.number}, {row.finding.value}: {next(iter(run.outcome.failures), '')}")
        moment = done.moments.get(row.number)
        if moment is not None:
            typer.echo(f"        {moment.words}")
        if row.number in parts:
            typer.echo(f"        {parts[row.number]}")
        typer.echo(f"        {done.results.replay(row)}")
    if len(done.failures) > MOST_SHOWN:
        typer.echo(f"and {len(done.failures) - MOST_SHOWN} more; {done.folder / 'failures'} has all")
    print_errors(done)
    for line in _facts(done, other):
        typer.echo(line)
    counts = [f"{done.counts[finding]} {finding.value}" for finding in PointFinding if done.counts.get(finding)]
    progress = done.progress
    typer.echo(f"report  {done.folder / 'report.html'}")
    again = " (interrupted: --resume goes on)" if done.was_interrupted else ""
    typer.echo(
        f"{', '.join(counts) or 'nothing'} of {len(progress.rows)} points, {progress.runs} runs, "
        f"{progress.virtual_ns / 3.6e12:.2f} h of virtual time, {progress.cpu_s:.0f} s of processors{again}"
    )


def _facts(done: Whole, other: Other | None) -> Iterator[str]:
    """Return how different the failures are, whose they are, and whether some points were one and the same run."""
    if done.failures:
        yield from (f"{what}: {value}" for what, value in FailureSet.of(done.progress.rows).words().items())
    yield from (f"unreached  {said}: no point has reached it" for said in done.unreached)
    source = done.source
    if source is not None:
        of = f"{source.lines} of {source.lines_of} lines, " if source.lines_of else ""
        yield f"reached  {of}{source.ways} of {source.ways_of} ways of branches; the report names the others"
    for name, sha256 in done.campaign.trial.programs.items():
        yield f"firmware {name}, sha256 {sha256[:SHOWN_HASH]}"
    if other is not None:
        yield f"against  {other.name}, sha256 {other.sha256[:SHOWN_HASH]}"
    points, different = len(done.progress.rows), done.different_runs
    if different < points:
        several = "s" * (different > 1)
        yield f"note    {points} points made {different} different run{several}: in the others nothing varied that acts"


def print_errors(done: Whole) -> None:
    """Print why points have no verdict that holds, each reason once with its points."""
    unexplained: dict[tuple[PointFinding, str], list[int]] = {}
    for row in done.progress.rows:
        if row.finding in {PointFinding.ERROR, PointFinding.NOT_REPEATED}:
            why = next((run.outcome.failures[0] for run in row.runs if run.outcome.failures), "")
            unexplained.setdefault((row.finding, why), []).append(row.number)
    for (finding, why), numbers in [*unexplained.items()][:MOST_SHOWN]:
        places = ", ".join(map(str, numbers[:MOST_SHOWN])) + (", …" if len(numbers) > MOST_SHOWN else "")
        typer.echo(f"{finding.value}  point{'s' if len(numbers) > 1 else ''} {places}: {why}")
