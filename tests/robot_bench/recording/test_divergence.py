"""Two runs are alike, or it is told which signal parts first, and when."""

from pathlib import Path
from typing import Any

import typer
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from robot_bench.cli import diff
from robot_bench.events.codec import line_of
from robot_bench.events.kinds import Event, Note, PinEdge, Text
from robot_bench.recording.divergence import differences, signal_of

rows = st.lists(st.tuples(st.integers(1, 9), st.sampled_from(["DD1", "DD2"]), st.booleans()), max_size=9)


def edges(reported: list[tuple[int, str, bool]]) -> list[Event]:
    t, found = 0, []
    for after, wire, level in reported:
        t += after
        found.append(PinEdge(t=t, wire=wire, level=level))
    return found


@given(rows, rows)
def test_the_first_difference_of_each_signal_is_found(one: list[Any], other: list[Any]) -> None:
    ours, theirs = edges(one), edges(other)
    found = differences(ours, theirs)
    assert [item.at for item in found] == sorted(item.at for item in found)
    for wire in ("DD1", "DD2"):
        a, b = ([event for event in run if signal_of(event) == wire] for run in (ours, theirs))
        said = [item for item in found if item.signal == wire]
        assert len(said) == (a != b)
        for item in said:
            place = a.index(item.one) if item.one is not None else len(a)
            assert a[:place] == b[:place]
            assert a[place : place + 1] != b[place : place + 1]
            assert (item.one, item.other) == (
                [*a, None, None][place],
                [*b, None, None][place] if place < len(b) else None,
            )


def write(folder: Path, *events: Event) -> str:
    folder.mkdir()
    text = '{"k":"meta","scenario":"s"}\n' + "".join(f"{line_of(event)}\n" for event in events)
    (folder / "trace.jsonl").write_text(text, encoding="utf-8")
    return str(folder)


def test_the_verb_says_what_parts_first_and_what_came_before(tmp_path: Path) -> None:
    app = typer.Typer()
    diff.register(app)
    same = Note(t=1_000_000, who="adapter", what="driving"), Text(t=2_000_000, data=b"forward\n")
    one = write(tmp_path / "one", *same, PinEdge(t=3_000_000, wire="DD4", level=True))
    other = write(tmp_path / "other", *same, PinEdge(t=3_000_001, wire="DD4", level=True), Text(t=4_000_000, data=b"x"))
    said = CliRunner().invoke(app, [one, other])
    assert said.exit_code == 1
    assert said.stdout.splitlines() == [
        "alike until 0.003000 s; DD4 differs first",
        "     0.001000 s  adapter: driving",
        "     0.002000 s  usart1 sends 'forward'",
        "DD4:",
        "   3000000 ns  DD4 high   one",
        "   3000001 ns  DD4 high   other",
        "usart1 text:",
        "   nothing more   one",
        "   4000000 ns  usart1 sends 'x'   other",
    ]
    alike = CliRunner().invoke(app, [one, one])
    assert (alike.exit_code, alike.stdout) == (0, "alike: 3 events\n")


def fleet(folder: Path, **robots: Event) -> str:
    """The folder of a run of robots "a" and "b"; one without an event has left no trace."""
    for name, event in robots.items():
        write(folder / name, event)
        trace = folder / name / "trace.jsonl"
        trace.write_text(trace.read_text().replace('"s"', '"s","robots":["a","b"]'), encoding="utf-8")
    return str(folder)


def test_two_runs_differ_in_the_same_whichever_is_named_first(tmp_path: Path) -> None:
    """Also where one of them has a robot that the other has not."""
    app = typer.Typer()
    diff.register(app)
    same, edge = Note(t=1, who="adapter", what="driving"), PinEdge(t=3, wire="DD4", level=True)
    for name in ("one", "other"):
        (tmp_path / name).mkdir()
    one, other = fleet(tmp_path / "one", a=same), fleet(tmp_path / "other", a=same, b=edge)
    for words in ([one, other], [other, one]):
        said = CliRunner().invoke(app, words)
        assert (said.exit_code, "alike until 0.000000 s; b: DD4 differs first" in said.stdout) == (1, True)
    assert CliRunner().invoke(app, [other, other]).exit_code == 0
