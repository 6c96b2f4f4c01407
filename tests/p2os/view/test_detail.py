"""Levels of detail: what so many pixels show of any number of rows."""

from array import array
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from p2os.view.detail import RUN, Extremes, buckets, changes, curve, curve_of, rows_in, thinned_list
from p2os.view.frames import FrameFlags
from p2os.view.header import ChannelHeader
from p2os.view.recording import ChannelTrack

TIMES = st.lists(st.integers(0, 1000), min_size=1, max_size=60).map(sorted)


@settings(max_examples=40)
@given(st.lists(st.integers(-9, 9), min_size=1, max_size=3 * RUN**2), st.data())
def test_the_least_and_the_greatest_of_any_stretch_are_found_however_it_grew(
    values: list[int], data: st.DataObject
) -> None:
    index, whole = Extremes(), array("d", values)
    for end in sorted(data.draw(st.lists(st.integers(0, len(values)), max_size=3))):
        index.grow(whole[:end])
    index.grow(whole)
    first = data.draw(st.integers(0, len(values) - 1))
    last = data.draw(st.integers(first + 1, len(values)))
    least, greatest = index.within(first, last)
    assert first <= least < last > greatest >= first
    assert (whole[least], whole[greatest]) == (min(whole[first:last]), max(whole[first:last]))


def test_the_extremes_of_many_rows_are_found_across_runs_of_runs() -> None:
    draw = Random(1)
    values = array("d", [draw.random() for _ in range(3 * RUN**2 + 17)])
    index = Extremes()
    index.grow(values)
    for _ in range(300):
        first = draw.randrange(len(values))
        last = draw.randrange(first + 1, len(values) + 1)
        least, greatest = index.within(first, last)
        assert (values[least], values[greatest]) == (min(values[first:last]), max(values[first:last]))


@given(TIMES, st.integers(1, 20))
def test_pixels_part_the_rows(times: list[int], pixels: int) -> None:
    found = list(buckets(times, 0, len(times), pixels))
    assert [row for first, last in found for row in range(first, last)] == list(range(len(times)))
    assert len(found) <= pixels
    span = times[-1] - times[0] + 1
    for first, last in found:
        assert len({(times[row] - times[0]) * pixels // span for row in range(first, last)}) == 1


@given(TIMES, st.integers(1, 20))
def test_changes_stand_for_all_of_them(times: list[int], pixels: int) -> None:
    found = list(changes(times, 0, len(times), pixels))
    rows = [row for row, _ in found]
    assert rows == sorted(set(rows))
    assert (rows[0], rows[-1]) == (0, len(times) - 1)
    assert sum(count for _, count in found) == len(times)
    assert len(found) <= 3 * pixels


@given(TIMES, st.integers(1, 20), st.data())
def test_a_curve_keeps_what_stands_out(times: list[int], pixels: int, data: st.DataObject) -> None:
    values = array("d", data.draw(st.lists(st.integers(0, 9), min_size=len(times), max_size=len(times))))
    index = Extremes()
    index.grow(values)
    rows = curve(times, [index], 0, len(times), pixels)
    assert rows == sorted(set(rows))
    assert (rows[0], rows[-1]) == (0, len(times) - 1)
    assert {min(values), max(values)} <= {values[row] for row in rows}
    assert len(rows) <= 4 * pixels


@pytest.mark.parametrize("last_row", [9_999, 6_499])  # 100 rows a pixel: by the index; 65: by it or directly
def test_a_curve_has_the_least_and_the_greatest_of_each_pixel(last_row: int) -> None:
    values = [(n * 7919) % 1000 for n in range(last_row + 1)]
    chosen = curve_of(range(last_row + 1), [values], 100)
    assert list(chosen) == sorted(set(chosen))
    pixel_of = [n * 100 // (last_row + 1) for n in range(last_row + 1)]
    for pixel in range(100):
        here = [values[n] for n in range(last_row + 1) if pixel_of[n] == pixel]
        shown = [values[n] for n in chosen if pixel_of[n] == pixel]
        assert (min(shown), max(shown)) == (min(here), max(here))
    assert curve_of(range(400), [range(400)], 100) == range(400)
    assert len(curve_of(range(401), [[*range(401)]], 100)) < 401
    assert not curve_of([], [[]], 100)


@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("count", [4001, 4002])
def test_changes_keep_both_levels_of_every_pixel(count: int, first: int) -> None:
    rows = [row for row, _ in changes(range(count), 0, count, 40)]
    for pixel in range(40):
        assert {(row + first) & 1 for row in rows if row * 40 // count == pixel} == {0, 1}
    assert not list(changes([], 0, 0, 40))


@given(TIMES, st.integers(-5, 1005), st.integers(0, 500))
def test_a_stretch_has_what_is_in_force_before_it_and_the_first_behind(
    times: list[int], begin: int, length: int
) -> None:
    first, last = rows_in(times, begin, begin + length)
    inside = [row for row, at in enumerate(times) if begin <= at <= begin + length]
    assert set(inside) <= set(range(first, last))
    assert first == 0 or times[first] <= begin
    assert last == len(times) or times[last - 1] > begin + length
    assert sum(at > begin + length for at in times[first:last]) <= 1
    assert sum(at < begin for at in times[first:last]) <= 1


@given(st.lists(st.integers(0, 3), min_size=1, max_size=60), st.integers(2, 30))
def test_a_list_keeps_what_is_most_severe_and_both_ends(severity: list[int], most: int) -> None:
    rows = thinned_list(severity.__getitem__, 0, len(severity), most)
    assert rows == sorted(set(rows))
    assert (rows[0], rows[-1]) == (0, len(severity) - 1)
    assert len(rows) == min(most, len(severity))
    left = {severity[row] for row in range(len(severity)) if row not in rows}
    assert not left or min(severity[row] for row in rows[1:-1] or [0]) >= 0
    if severity.count(3) <= most - 2:
        assert {row for row, one in enumerate(severity) if one == 3} <= set(rows)


@pytest.mark.parametrize("kind", ["levels", "samples", "state", "goal", "waves"])
def test_a_channel_is_whole_where_it_fits_and_says_where_it_does_not(kind: str) -> None:
    track = ChannelTrack(ChannelHeader(name="x", kind=kind))
    cells = {"levels": (1, 1), "samples": (0.5,), "state": (0, ""), "goal": (0, 0.0, ""), "waves": (1.0, 1.0, 0.0)}[
        kind
    ]
    for n in range(41):
        track.append(n, *cells)
    whole = track.frame(0, 39, 10)
    assert (whole.count, whole.of, whole.flags) == (41, 41, FrameFlags(0)) or whole.flags & FrameFlags.REDUCED
    assert track.frame(0, 38, 10).flags == FrameFlags(0), "40 rows for 10 pixels"
    assert track.frame(0, 39, 10).flags == FrameFlags.REDUCED, "41 rows"


def test_a_sample_that_is_no_number_hides_no_extreme() -> None:
    track = ChannelTrack(ChannelHeader(name="x", kind="samples"))
    for n in range(200):
        track.append(n, float("nan") if n in {0, 90} else 7.0 if n == 91 else 5.0 if n == 92 else 6.0)
    assert {5.0, 6.0, 7.0} <= set(track.frame(0, 199, 2).columns[1])


def test_ranges_are_thinned_by_the_nearest_echo_row_by_row() -> None:
    track = ChannelTrack(ChannelHeader(name="x", kind="ranges", width=2))
    for n in range(100):
        track.append(n, (3.0, float("nan") if n % 2 else 0.5 if n == 42 else 2.0))
    frame = track.frame(0, 99, 3)
    assert len(frame.columns[1]) == 2 * frame.count
    assert 0.5 in frame.columns[1]


def test_time_never_runs_back_in_a_channel() -> None:
    track = ChannelTrack(ChannelHeader(name="x", kind="samples"))
    for t in (5, 3, 7):
        track.append(t, 0.0)
    assert list(track.times) == [5, 5, 7]


@pytest.mark.parametrize("count", [0, 1, 2, 3, 7])
def test_a_list_that_has_room_is_whole(count: int) -> None:
    assert thinned_list(lambda _: 0, 5, 5 + count, count) == [*range(5, 5 + count)]
