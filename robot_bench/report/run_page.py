"""The page of a run: its channels, and as sections the figures, the goals, and what else the trace's end tells.

The page itself is `p2os.view.page`; one file, which needs no network.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import cast

from p2os.view.header import PageBlock, PageCell, PageList, PagePicture, PageSection, PageTable, PageText
from p2os.view.page import page_of
from p2os.view.recording import ViewRecording
from robot_bench.events.codec import Json
from robot_bench.recording.run_folder import TRACE_NAME
from robot_bench.recording.run_record import RunRecord
from robot_bench.recording.summary import EXPLAINED, MEASURED, figures
from robot_bench.view.program_sections import program_panel_of
from robot_bench.view.run_recording import recording_of


def render_run(record: RunRecord) -> str:
    """Return the report of a run as one HTML document."""
    return page_of(run_report(record), all_is_in=TRACE_NAME)


def run_report(record: RunRecord, *, is_measured: bool = True) -> ViewRecording:
    """Return a run as the page shows it: rows and report; the drive's figures, which take a while, where wanted."""
    found = recording_of(record)
    program = cast("Json", record.end.get("program") or {})
    found.header = replace(
        found.header, panels=[program_panel_of(program)] if program else (), lead=lead_of(record.meta),
        why=str(record.end.get(EXPLAINED) or ""), sections=run_sections(record, is_measured=is_measured),
        footer=_footer(record),
    )  # fmt: skip
    return found


def run_sections(record: RunRecord, *, is_measured: bool = True) -> list[PageSection]:
    """Return the sections of a run's report, as of `run_report`."""
    return list(_sections(record, is_measured=is_measured))


def named_rows(pairs: list[tuple[str, str]]) -> list[list[PageCell]]:
    """Return names and values as rows of a table."""
    return [[PageCell(text=name), PageCell(text=value, is_number=True)] for name, value in pairs]


def _sections(record: RunRecord, *, is_measured: bool) -> Iterator[PageSection]:
    yield PageSection(title="Figures", blocks=[PageTable(rows=named_rows(figures(record)))])
    goals = _goals(record.end)
    if goals:
        yield PageSection(title="Goals", blocks=[PageList(items=goals)])
    if blocks := cast("list[str]", record.end.get("last_blocks") or []):
        listing = PageText(text="\n".join(blocks), is_listing=True)
        yield PageSection(title="What ran last, by cycle", blocks=[listing], is_folded=True)
    if is_measured:
        yield from _measures(record)
    yield from _parts(record.end)
    yield from _measured(record.end)


def _goals(end: Json) -> list[PageCell]:
    """Return the goals, those missed with their reason."""
    words = (("goals_met", "passed"), ("goals_not_judged", "open"), ("failures", "failed"))
    return [
        PageCell(text=text, standing=standing)  # type: ignore[arg-type]  # one of the three
        for key, standing in words for text in cast("list[str]", end.get(key) or [])
    ]  # fmt: skip


def _measures(record: RunRecord) -> Iterator[PageSection]:
    """Yield the section of the drive's figures; none where NumPy is not installed."""
    try:
        from robot_bench.report.measures import measures_section
    except ModuleNotFoundError:
        return
    yield from measures_section(record)


def _parts(end: Json) -> Iterator[PageSection]:
    """Yield a section of what was plugged into the board."""
    rows = cast("list[dict[str, str]]", end.get("parts") or [])
    blocks: list[PageBlock] = [PagePicture(title=row["name"], alt=row["words"], png=row["png"])
                               for row in rows if "png" in row]  # fmt: skip
    if rows:
        table = PageTable(rows=[[PageCell(text=row["name"]), PageCell(text=row["words"])] for row in rows])
        yield PageSection(title="Parts", blocks=[table, *blocks])


def _measured(end: Json) -> Iterator[PageSection]:
    """Yield a section for coverage and one for the profile, where the run measured them."""
    for key in MEASURED:
        if facts := cast("Json", end.get(key) or {}):
            files = [PageCell(text=name, href=name) for name in cast("list[str]", facts["files"])]
            listing = PageText(text="\n".join(cast("list[str]", facts["table"])), is_listing=True)
            yield PageSection(title=key.title(), blocks=[listing, PageList(items=files)])


def lead_of(meta: Json) -> str:
    """Return the sentence under the title: what was run, on what, in what."""
    world = cast("Json", meta.get("world") or {})
    path = {"direct": "wired straight to the body", "adapter": "through adapter and P2OS"}.get(
        str(meta.get("mode")), ""
    )
    parts = [
        f"firmware {meta.get('firmware', '?')}",
        *(
            [f"world {world.get('name', '?')}", f"{meta.get('body', '?')} body", path, f"seed {meta.get('seed', '?')}"]
            if world
            else ["a BluePill by itself"]
        ),
    ]
    return " · ".join(part for part in parts if part)


def _footer(record: RunRecord) -> str:
    digest = record.end.get("trace_sha256")
    note = str(record.meta.get("note") or "")
    parts = [
        f"trace sha256 {digest}" if digest else "the run was cut: no trace hash",
        f"firmware sha256 {record.meta.get('firmware_sha256', '?')}",
        note,
    ]
    return " · ".join(part for part in parts if part)
