"""What public drivers, the manuals and our pages say of the order of things, each checked from reset."""

import re

import pytest

from tests.bluepill_sim.peripherals.sequences.row import SequenceRow
from tests.bluepill_sim.peripherals.sequences.sources import Citation, Page
from tests.bluepill_sim.peripherals.sequences.table import ROWS
from tools.generators import sequences

CHECKED = [row for row in ROWS if row.check is not None]
#: What the table has at least, of rows and of peripherals.
LEAST_ROWS, LEAST_PERIPHERALS = 300, 20


@pytest.mark.parametrize("row", CHECKED, ids=lambda row: row.name)
def test_the_sequence_holds_from_reset(row: SequenceRow, watchdog: None) -> None:
    assert row.check is not None
    row.check()


def test_a_row_is_one_fact_with_a_source_and_a_check_or_a_reason() -> None:
    assert len({row.name for row in ROWS}) == len({row.sentence for row in ROWS}) == len(ROWS)
    assert [row.name for row in ROWS if not row.sources] == []
    assert [row.name for row in ROWS if (row.check is None) is not bool(row.not_modelled)] == []


def test_a_citation_names_a_commit_a_file_and_a_line_and_a_page_of_ours_has_its_heading() -> None:
    cited = [source for row in ROWS for source in row.sources]
    for source in cited:
        if isinstance(source, Citation):
            assert re.fullmatch(r"[0-9a-f]{40}", source.repository.commit)
            assert re.fullmatch(r"[\w./-]+\.(c|h|rs|cpp)", source.path)
            assert source.line > 0
        if isinstance(source, Page):
            text = (sequences.ROOT / "docs" / source.page).read_text(encoding="utf-8")
            assert re.search(rf"^#+ {re.escape(source.heading)}", text, re.MULTILINE)


def test_the_table_is_as_long_and_as_wide_as_its_page_says() -> None:
    assert len(ROWS) >= LEAST_ROWS
    assert len({row.peripheral for row in ROWS}) >= LEAST_PERIPHERALS


def test_the_page_is_that_of_the_rows() -> None:
    assert (sequences.ROOT / sequences.PAGE).read_text(encoding="utf-8") == sequences.page()
