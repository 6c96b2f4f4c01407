"""What a pull request is told of a campaign."""

from pathlib import Path

import pytest

from p2os.pioneer.world.drawing import Look
from robot_bench.campaign.pages.comment import MOST_SHOWN, _plain, write_comment
from robot_bench.campaign.trial import trial_of
from robot_bench.campaign.variants.against import Other
from robot_bench.campaign.whole import points_of, resume
from robot_bench.cli.campaigns import campaign as verb
from simbase.errors import UsageError
from tests.robot_bench.campaign.test_campaign import Shuffled, begun, carried


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("campaign") / "kept"
    carried(begun(path.parent), path, Shuffled(1))
    return path


@pytest.mark.slow
def test_a_comment_has_each_kind_of_failure_with_its_picture_and_the_line_that_replays_it(folder: Path) -> None:
    rows, campaign = points_of(folder), resume(folder)
    out = folder / "ci" / "comment.md"
    text = write_comment(folder, campaign, rows, out, url="https://example.org/")
    assert out.read_text() == text
    failing = [row for row in rows if row.failing is not None]
    assert text.startswith(f"## {campaign.name}: {len(failing)} of {len(rows)} points fail\n")
    pictures = sorted((out.parent / "pictures").glob("*.svg"))
    assert 0 < len(pictures) <= MOST_SHOWN
    for picture in pictures:
        drawn = picture.read_text()
        assert drawn.startswith('<svg xmlns="http://www.w3.org/2000/svg" width=')
        assert f'stroke="{Look.WAY.value}"' in drawn
        assert f'fill="{Look.HIT.value}"' in drawn
        assert f"![point {int(picture.stem)}](https://example.org/pictures/{picture.name})" in text
        assert f"p2os run {folder}/failures/{picture.stem}/dodge.toml" in text
        again = trial_of(str(folder / "failures" / picture.stem / "dodge.toml"))
        assert again.firmware_name == "dodge.elf"
    shown = len(pictures)
    assert ("more points" in text) is (shown < len(failing))
    assert "cause" not in text
    assert (folder / "journal.jsonl").read_text().count("\n") >= len(rows)


@pytest.mark.slow
def test_with_a_good_version_it_says_where_they_part_and_that_the_cause_is_unknown_where_it_is(folder: Path) -> None:
    rows, campaign = points_of(folder), resume(folder)
    same = Other("dodge.elf", campaign.trial.files["dodge.elf"])
    text = write_comment(folder, campaign, rows, folder / "comment.md", other=same)
    assert "- first parting wire: none\n" in text
    assert "- cause: unknown: dodge.elf does not fail here\n" in text  # these failures were made up


def test_what_markdown_would_take_for_marks_is_shown_as_it_is() -> None:
    assert _plain("a_b *c* <d>\n|e|") == "a\\_b \\*c\\* \\<d\\> \\|e\\|"
    assert _plain("`a_b.c:3`, d_e") == "`a_b.c:3`, d\\_e"


def test_a_comment_is_on_one_campaign() -> None:
    with pytest.raises(UsageError, match="on which campaign"):
        verb.comment_on([], None, None, "", trust=False)
