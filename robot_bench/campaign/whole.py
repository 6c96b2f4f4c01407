"""A campaign from its file to its folder: begun, or gone on with after anything was killed.

    dodge-001/dodge-campaign.toml   the campaign as it was begun, options of the command line included
    dodge-001/scenario/             its scenario and all files that it names
    dodge-001/journal.jsonl         every run that was done
    dodge-001/results/              the data set; failures/ a folder each; report.html

The campaign's own file is put there last, and whole: without it nothing was begun.

Invariant: the folder alone says what was done and is enough to go on, on another machine too.
"""

import contextlib
import json
import os
import shutil
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from p2os.errors import ScenarioError
from p2os.toml_file import read_toml, read_user_text, toml_text
from robot_bench.campaign.campaign_file import Campaign, load_campaign, parse_campaign
from robot_bench.campaign.conduct import CampaignProgress, Conduct, PointRow, Workers
from robot_bench.campaign.last_moment import LastMoment, last_moment
from robot_bench.campaign.pages.page import render
from robot_bench.campaign.reaching.corpus import BEGUN, added, read_corpus, write_corpus
from robot_bench.campaign.results import Results, Whole
from robot_bench.campaign.trial import Done, Trial
from robot_bench.campaign.variants.against import FOLDER as AGAINST
from robot_bench.campaign.variants.against import Other
from simbase.errors import FileError, P2osError, UsageError
from simbase.files import replace_text, write_text, writing
from simbase.timing import Nanos
from simbase.trust import Trust

SCENARIO = "scenario"
SUMMARY = "summary.json"
#: Its page.
PAGE = "report.html"
#: chosen: of so many failures it is found until when they were avoidable; each takes ten runs or so.
MOST_MOMENTS = 3


def begin(
    file: Path,
    folder: Path,
    *,
    firmware: Path | None,
    overrides: Mapping[str, object],
    other: Other | None = None,
    trust: bool | Trust = False,
) -> Campaign:
    """Make a campaign's folder from its file.

    Args:
        file: The campaign file.
        folder: New or empty.
        firmware: Takes the place of the scenario's.
        overrides: Keys of the file that are set otherwise; of a table, the keys in it.
        other: The version that is compared with, kept beside.
        trust: As of `load_campaign`.

    Raises:
        ScenarioError: The file breaks the schema.
        UsageError: The folder is not empty.
        FileError: It cannot be written; then nothing is left of it.
    """
    text = read_user_text(file, "a campaign", ScenarioError, hint="p2os campaign new SCENARIO writes one")
    table = dict(read_toml(text, file.name, "a campaign", ScenarioError)[0])
    for key, value in overrides.items():
        held = table.get(key)
        table[key] = {**held, **value} if isinstance(held, dict) and isinstance(value, dict) else value
    found = parse_campaign(text if not overrides else toml_text(table), file, firmware=firmware, trust=trust)
    if folder.is_dir() and any(folder.iterdir()):
        raise UsageError(f"{folder} is not empty", hint=f"p2os campaign --resume {folder}, or another folder")
    try:
        with writing(folder, hint="--out another folder"):
            scenario = found.trial.write(folder / SCENARIO)
            if other is not None:
                other.keep(folder)
            kept = {key: value for key, value in table.items() if key not in {"firmware", "goal"}}
            kept["scenario"] = f"{SCENARIO}/{scenario.name}"
            if found.corpus_file is not None:
                kept["corpus"] = os.path.relpath(found.corpus_file.resolve(), folder.resolve())
                write_corpus(folder / BEGUN, found.corpus)
            replace_text(folder / f"{file.stem}.toml", toml_text(kept))
    except BaseException:
        for part in (SCENARIO, AGAINST):  # it was empty before
            shutil.rmtree(folder / part, ignore_errors=True)
        with contextlib.suppress(OSError):
            (folder / BEGUN).unlink(missing_ok=True)
        raise
    return load_campaign(folder / f"{file.stem}.toml", trust=Trust(keys=found.trial.trusted))


def resume(folder: Path, *, trust: bool | Trust = False) -> Campaign:
    """Return the campaign of a folder that was begun; `trust` as of `load_campaign`.

    Raises:
        FileError: It is none.
    """
    files = sorted(folder.glob("*.toml")) if folder.is_dir() else []
    if not files and (folder / SCENARIO).is_dir():
        raise FileError(
            f"{folder} was not begun to its end, as by a kill or a full disk: no run was done",
            hint="remove it, and begin anew: p2os campaign FILE",
        )
    if len(files) != 1 or not (folder / SCENARIO).is_dir():
        raise FileError(f"{folder} is no campaign's folder", hint="give the one that `p2os campaign FILE` made")
    return load_campaign(files[0], trust=trust)


def carry_out(
    campaign: Campaign,
    folder: Path,
    workers: Workers,
    *,
    clock: Callable[[], Nanos],
    on_run: Callable[[CampaignProgress], None] = lambda _: None,
    look: Callable[[], None] = lambda: None,
) -> Whole:
    """Carry a campaign out in its folder; a KeyboardInterrupt ends it in good order.

    Args:
        campaign: As of `begin` or `resume`.
        folder: Its folder.
        workers: Who runs.
        clock: Wall clock, nanoseconds.
        on_run: Called after each run.
        look: Called between slices of what this process runs itself.

    Raises:
        MissingDependencyError: A library is not installed.
        FileError: The disk is full.
    """
    conduct = Conduct(campaign, folder, workers, clock=clock, on_run=on_run)
    results = Results(folder, campaign, conduct.space)
    whole = Whole(
        campaign=campaign, space=conduct.space, folder=folder, progress=conduct.progress, results=results
    )  # fmt: skip
    try:
        for rows in conduct.within_minutes():
            results.add(rows)
        for row in whole.failures[:MOST_MOMENTS]:
            if row.failing is not None and (moment := _moment(row, look)) is not None:
                whole.moments[row.number] = moment
    except KeyboardInterrupt:
        whole.was_interrupted = True
    finally:
        conduct.close()
    _keep_corpus(whole)
    write_text(whole.folder / PAGE, render(whole))
    text = json.dumps(whole.as_json(), indent=2, sort_keys=True)
    write_text(folder / SUMMARY, f"{text}\n")
    return whole


class _NothingMissing:
    """Workers of a campaign that is only read: what its journal does not have ends it."""

    def run(self, trials: Sequence[Trial], _on_done: Callable[[int, Done], None], *, anew: bool = False) -> None:
        """Refuse to run anything, also `anew`.

        Raises:
            LookupError: Something is to be run.
        """
        if trials:
            raise LookupError(f"the journal has not all runs{' that prove' if anew else ''}")

    def close(self) -> None:
        """End nothing."""


def points_of(folder: Path, *, trust: bool | Trust = False) -> list[PointRow]:
    """Return the points of a campaign's folder with what its journal has of them.

    Raises:
        FileError: It is no campaign's folder.
    """
    conduct = Conduct(resume(folder, trust=trust), folder, _NothingMissing(), clock=lambda: 0)
    try:
        for rows in (conduct.batches(), conduct.near_misses()):
            for _ in rows:
                pass
    except LookupError:
        pass
    finally:
        conduct.close()
    return conduct.progress.rows


def _keep_corpus(whole: Whole) -> None:
    """Add the points that reached something new to the corpus as it is now: another campaign may have, meanwhile."""
    path = whole.campaign.corpus_file
    if path is None:
        return
    if not path.parent.is_dir():  # the folder was carried elsewhere
        path = whole.folder / path.name
    new = [whole.space.coordinates(row.proposal.point) for row in whole.progress.rows if row.new]
    write_corpus(path, added(read_corpus(path), new))


def _moment(row: PointRow, look: Callable[[], None]) -> LastMoment | None:
    run = row.failing
    if run is None:
        return None
    try:
        return last_moment(run.trial, look)
    except P2osError:  # several robots, or one on own pins
        return None
