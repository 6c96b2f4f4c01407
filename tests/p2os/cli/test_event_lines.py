"""The lines that `p2os serve` prints."""

from p2os.cli.virtual.serve import MOST_LINES, EventLines
from simbase.timing import NS_PER_S


def test_a_robot_that_is_one_of_many_says_which() -> None:
    lines: list[str] = []
    events = EventLines(lines.append, "robot 2  ")
    events.write_event(1_500_000_000, "motors", "on")
    events.write_event(1_500_000_000, "opened", "")
    assert lines == ["     1.500 s  robot 2  motors: on\n", "     1.500 s  robot 2  opened\n"]


def test_a_flood_is_cut_each_second_and_what_was_left_out_is_reported() -> None:
    lines: list[str] = []
    events = EventLines(lines.append)
    for count in range(3 * MOST_LINES):
        events.write_event(count, "synchronised", "")
    assert len(lines) == MOST_LINES
    events.write_event(NS_PER_S - 1, "synchronised", "")
    assert len(lines) == MOST_LINES
    events.write_event(NS_PER_S, "client gone", "it left")
    assert lines[MOST_LINES:] == [
        f"     1.000 s  left out: {2 * MOST_LINES + 1} lines like the last\n",
        "     1.000 s  client gone: it left\n",
    ]
    events.write_event(2 * NS_PER_S, "client connected", "x")
    assert len(lines) == MOST_LINES + 3
