"""`python -m hardware.pcb diff`: what two boards do not share is said and drawn, and nothing else."""

import xml.etree.ElementTree as ET
from functools import cache
from pathlib import Path

import pytest

from hardware.pcb.__main__ import main
from hardware.pcb.outputs.difference import NEW, OLD, BoardContents, picture, read_source, words
from hardware.pcb.outputs.generated_files import GENERATED

BOARD = GENERATED / "rev-b" / "rev-b.kicad_pcb"


@pytest.fixture
def changed(tmp_path: Path):
    def change(before: str, after: str) -> Path:
        text = BOARD.read_text(encoding="utf-8")
        assert text.count(before) >= 1
        path = tmp_path / "changed.kicad_pcb"
        path.write_text(text.replace(before, after, 1), encoding="utf-8")
        return path

    return change


@cache
def committed() -> BoardContents:
    return read_source("rev-b")


def colours(svg: str) -> dict[str, int]:
    ET.fromstring(svg)  # noqa: S314 - made here
    return {colour: svg.count(f'"{colour}"') - 1 for colour in (OLD, NEW)}


def test_a_board_has_no_difference_from_itself() -> None:
    board = committed()
    assert len(board.parts) == 111
    assert words(board, board) == []
    assert colours(picture(board, board, ("a", "b"))) == {OLD: 0, NEW: 0}


# Each change, the line that says it, and how many shapes are only old and only new.
@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        ('(property "Value" "680R"', '(property "Value" "330R"', "R12: 680R"),
        ("(at 109 60.5)", "(at 109.1 60.5)", "U1: BluePill"),
        ('(net 14 "DD3_BP")', '(net 14 "DD3_XX")', "nets: 1 gone, 1 new: DD3_BP, DD3_XX"),
        ("(width 0.25)", "(width 0.3)", "tracks and strokes: 1 gone, 1 new"),
        ("(drill 0.3)", "(drill 0.4)", "pads and vias: 1 gone, 1 new"),
    ],
)
def test_one_change_is_one_line_and_red_and_green(changed, before: str, after: str, said: str) -> None:
    old, new = committed(), read_source(str(changed(before, after)))
    assert any(line.startswith(said) for line in words(old, new)), words(old, new)
    drawn = colours(picture(old, new, ("a", "b")))
    assert drawn[OLD] == drawn[NEW]
    assert bool(drawn[OLD]) is ("Value" not in before)


def test_turned_pads_stand_where_their_part_puts_them() -> None:
    """R1 is turned by 180 degrees or not: its pads must meet its tracks, whatever the angle."""
    board = committed()
    ends = {(point, one.text) for one in board.strokes if one.layer == "F.Cu" for point in (one.start, one.end)}
    pads = [land for land in board.lands if len(land.layers) == 1 and land.net not in {"", "GND"}]
    assert len(pads) > 80
    apart = [
        land
        for land in pads
        if not any(net == land.net and abs(x - land.at[0]) < 2 and abs(y - land.at[1]) < 2 for (x, y), net in ends)
    ]
    assert apart == []


def test_the_verb_says_and_draws(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "d.svg"
    assert main(["diff", "rev-b", "lm317", "--out", str(out)]) == 0
    said = capsys.readouterr().out.splitlines()
    assert any(line.startswith("U4: new, LM317") for line in said)
    assert said[-1] == f"{out}: red is gone, green is new"
    assert "only lm317" in out.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("source", "reason"),
    [("nope", "there is no board 'nope'"), ("nope:rev-b", "git has no nope:rev-b"), (__file__, "is no board")],
)
def test_what_is_no_board_is_one_line_and_1(
    source: str, reason: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert main(["diff", source, "rev-b", "--out", str(tmp_path / "d.svg")]) == 1
    said = capsys.readouterr().err
    assert reason in said
    assert said.count("\n") == 1
