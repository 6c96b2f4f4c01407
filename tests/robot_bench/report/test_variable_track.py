"""Stretches of a variable in any order are one channel: what is known, in the order of time, and where nothing is."""

import math
from typing import cast

from hypothesis import given
from hypothesis import strategies as st

from p2os.view.header import ChannelHeader, PageHeader
from p2os.view.recording import ViewRecording
from robot_bench.view.variable_track import VariableTrack

END = 40


def truth(at: int) -> int:
    """Return what the variable is at a time: another value each three."""
    return at // 3


def seen(begin: int, until: int) -> list[tuple[int, float]]:
    """Return the rows of a stretch that begins anew: its first value, and each change."""
    return [(at, truth(at)) for at in range(begin, until + 1) if at == begin or truth(at) != truth(at - 1)]


def value_at(times: list[int], values: list[float], at: int) -> float:
    return next((value for t, value in reversed(list(zip(times, values, strict=True))) if t <= at), math.nan)


@given(
    st.lists(st.tuples(st.integers(0, END), st.integers(0, END)).map(lambda ends: (min(ends), max(ends))), max_size=8)
)
def test_what_was_seen_is_shown_and_what_was_not_has_no_number(stretches: list[tuple[int, int]]) -> None:
    channel = ViewRecording(PageHeader(title="")).add(ChannelHeader(name="x", kind="samples"))
    track, known = VariableTrack(channel), set[int]()
    for begin, until in stretches:
        track.take(begin, until, seen(begin, until))
        known |= set(range(begin, until + 1))
        times, values = list(channel.times), cast("list[float]", list(channel.column("value")))
        assert times == sorted(times)
        last = max(known)
        for at in range(last + 1):
            shown = value_at(times, values, at)
            if at in known:
                assert shown == truth(at), (at, stretches)
            else:
                assert math.isnan(shown), (at, stretches)


def test_a_stretch_that_goes_on_adds_rows_at_the_end_and_leaves_the_others() -> None:
    channel = ViewRecording(PageHeader(title="")).add(ChannelHeader(name="x", kind="samples"))
    track = VariableTrack(channel)
    track.take(0, 10, [(0, 1.0), (5, 2.0)])
    track.take(10, 20, [(12, 3.0)])
    assert (list(channel.times), channel.generation) == ([0, 5, 12], 0)
    track.take(0, 20, [(0, 1.0), (5, 2.0), (12, 3.0)])  # it was set back, and comes by the same
    assert (list(channel.times), channel.generation) == ([0, 5, 12], 0)
    track.take(30, 31, [(30, 4.0)])
    track.take(22, 25, [(22, 5.0)])
    assert list(channel.times) == [0, 5, 12, 21, 22, 26, 30]
    assert channel.generation == 1


def test_a_fork_has_the_past_that_both_share() -> None:
    recording = ViewRecording(PageHeader(title=""))
    channel = recording.add(ChannelHeader(name="x", kind="samples"))
    track = VariableTrack(channel)
    track.take(0, 20, [(0, 1.0), (12, 3.0)])
    other = track.forked(recording.copied(channel, "fork 1", 10, -1), 10)
    other.take(10, 15, [(13, 9.0)])
    assert list(recording.tracks[1].times) == [0, 13]
    assert list(channel.times) == [0, 12]
