"""When a program is asked, and since when it looks no more, by a chip that is given what it notices."""

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim.core import BLOCK
from robot_bench.report.explain.probing import NOTICE_NS, SOON_NS, InputEffect, Prober, SensorResponse
from robot_bench.report.explain.replay import Hold
from simbase.timing import NS_PER_MS, NS_PER_S
from tests.robot_bench.recording.records import pose


class Looking(Prober):
    """A program that notices a change so long after it, while it looks, which is until a time."""

    def __init__(self, ends: int, after: int = NS_PER_MS) -> None:
        self.sensors, self.ends, self.after = ["DD1", "DD2"], ends, after
        self.replay = SimpleNamespace(end=60 * NS_PER_S)  # type: ignore[assignment]  # as much of it as is asked
        self.spans = set[int]()

    def noticed(self, holds: Sequence[Hold], until: int, since: int) -> int | None:
        assert [hold.wire for hold in holds] == ["DD1", "DD2"]
        assert {(hold.level, hold.since, hold.until) for hold in holds} == {(None, since, until)}
        self.spans.add(until - since)
        at = since + self.after
        return at if at <= min(until, self.ends) else None


@settings(max_examples=40)
@given(ends_ms=st.integers(700, 29_000), after_ms=st.integers(1, 400))
def test_since_when_it_looks_no_more_is_found_to_a_millisecond(ends_ms: int, after_ms: int) -> None:
    program = Looking(ends_ms * NS_PER_MS, after_ms * NS_PER_MS)
    found = program.ended_noticing(30 * NS_PER_S)
    last = (ends_ms - after_ms) * NS_PER_MS
    if found is None:
        assert last < 29 * NS_PER_S
    else:
        assert last - NS_PER_MS <= found <= last


def test_one_that_never_looked_ended_at_no_time() -> None:
    assert Looking(-1).ended_noticing(30 * NS_PER_S) is None
    assert Looking(60 * NS_PER_S).takes_notice(0, NS_PER_MS)
    assert not Looking(60 * NS_PER_S).takes_notice(0, NS_PER_MS - 1)
    program = Looking(60 * NS_PER_S)
    program.takes_notice(59 * NS_PER_S)
    assert program.spans == {NS_PER_S}, "the run ends"


@pytest.mark.parametrize(
    ("after_ns", "at_ms", "wait_ns"),
    [(NS_PER_MS, 5000, 100 * NS_PER_MS), (50 * NS_PER_MS, 5000, 200 * NS_PER_MS), (NOTICE_NS, 5000, NOTICE_NS),
     (NOTICE_NS + 1, 5000, NOTICE_NS), (25 * NS_PER_MS, 1, 100 * NS_PER_MS)],
)  # fmt: skip
def test_how_long_it_surely_takes_to_notice(after_ns: int, at_ms: int, wait_ns: int) -> None:
    assert Looking(60 * NS_PER_S, after_ns)._usual_wait(at_ms * NS_PER_MS) == wait_ns


@pytest.mark.parametrize(
    ("until_s", "moments_s"),
    [(30.0, [3.0, 8.875, 14.75, 20.625, 26.5]), (6.6, [3.0, 3.025, 3.05, 3.075, 3.1]), (6.5, []), (0.0, []),
     (99.0, [3.0, 16.375, 29.75, 43.125, 56.5])],
)  # fmt: skip
def test_a_program_is_asked_from_two_seconds_after_it_drives_on(until_s: float, moments_s: list[float]) -> None:
    program: Any = Looking(0)
    speeds = ((0, 0), (1, 20_001), (2, 0))
    program.replay.record = SimpleNamespace(poses=[pose(t * NS_PER_S, left=left) for t, left in speeds])
    assert program.moments(round(until_s * NS_PER_S)) == [round(at * NS_PER_S) for at in moments_s]
    assert len(program.moments(round(until_s * NS_PER_S), 3)) == (3 if moments_s else 0)
    program.replay.record.poses[1] = pose(NS_PER_S, left=-20_000)
    assert program.moments(round(until_s * NS_PER_S)) == []


def test_lines_are_counted_over_spans_and_those_are_new_that_ran_only_just_before() -> None:
    program: Any = Looking(0)
    spans: list[tuple[int, int]] = []

    def run(since: int, until: int, *, rows: bool) -> SimpleNamespace:
        assert rows
        spans.append((since, until))
        ran = [(0, 8, BLOCK), (1, 8, BLOCK), (2, 8, BLOCK + 1)] + [(3, 16, BLOCK)] * (until == 2 * NS_PER_S)
        return SimpleNamespace(rows=ran)

    program.replay.run, program.replay.line = run, lambda address: f"a.c:{address}"
    assert program.lines_run(0, 2 * NS_PER_S) == {"a.c:8": 4, "a.c:16": 1}
    assert spans == [(0, 1500 * NS_PER_MS), (1500 * NS_PER_MS, 2 * NS_PER_S)]
    spans.clear()
    assert program.new_lines(2 * NS_PER_S) == ["a.c:16"]
    assert spans == [(1992 * NS_PER_MS, 2 * NS_PER_S), (1700 * NS_PER_MS, 1992 * NS_PER_MS)]


@pytest.mark.parametrize(
    ("until", "ends"),
    [(SOON_NS + 3, [SOON_NS + 3]), (SOON_NS + 2, [SOON_NS + 2]), (SOON_NS + 4, [SOON_NS + 3, SOON_NS + 4])],
)
def test_what_most_programs_notice_soon_is_tried_first(
    until: int, ends: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    program: Any = Looking(0)
    monkeypatch.setattr(Looking, "noticed", Prober.noticed)
    program._as_recorded, program._beside = Mock(), Mock()
    program._parting = Mock(return_value=(None, ""))
    assert program.noticed([], until, 3) is None
    assert [one.args for one in program._as_recorded.call_args_list] == [(3, end) for end in ends]
    assert [one.args[2:] for one in program._beside.call_args_list] == [(3, end) for end in ends]
    assert all(one.kwargs == {"ends_parted": True} for one in program._beside.call_args_list)
    program._parting = Mock(side_effect=[(7, "")])
    assert program.noticed([], until, 3) == 7


def test_what_was_asked_is_compared_by_its_turn() -> None:
    response = SensorResponse(at=0, base=(3, 2), codes=(-1, 2), noticed=None, answered=None)
    assert response.turn == 4
    assert InputEffect(noticed=None, by="", answered=None, before=(0, 0), after=(0, 0)).otherwise_ns == 0
