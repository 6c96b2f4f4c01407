"""Each step of finding a clock that lays a capture beside a run, of small tracks at random, as approved.

What is found in the end hides most of what the steps have done: many proposals lead to the same clock.
"""

import random
from collections.abc import Iterator

from bluepill_sim.analysis.waveforms import alignment
from bluepill_sim.analysis.waveforms.alignment import ChannelPair, Clock, Tolerance, align, meet
from tests.tools.suite.approved import Trace, judge_of, said

NEAR_NS, MOST_ERROR = 20.0, 0.01


def edges_of(draw: random.Random, count: int) -> list[tuple[float, int]]:
    """Return edges that alternate, most of them the same time apart: what repeats itself has several clocks."""
    at, level, edges = draw.choice((0.0, 500.0)), draw.randrange(2), list[tuple[float, int]]()
    for _ in range(count):
        at, level = at + draw.choice((100.0, 100.0, 100.0, 250.0, 700.0)), level ^ 1
        edges.append((at, level))
    return edges


def track_of(draw: random.Random, name: str) -> ChannelPair:
    """Return a track whose capture is as late as the run, but for jitter, and lacks edges or has more."""
    run, is_inverted = edges_of(draw, draw.choice((0, 1, 3, 4, 9, 30))), draw.random() < 0.2
    error, offset = draw.choice((0.0, 0.001, -0.009, 0.02)), draw.choice((0.0, 300.0, -50.0))
    capture = [
        ((at - offset) / (1 + error) + draw.choice((0.0, 0.0, 0.0, 7.0, -19.0, 21.0)), level ^ is_inverted)
        for at, level in run if draw.random() < 0.95
    ]  # fmt: skip
    if draw.random() < 0.3:
        at = draw.randrange(len(capture) + 1)
        late = draw.choice((1000.0, 400.0))
        capture = capture[:at] + [(when + late, level) for when, level in capture[at:]]
    return ChannelPair(name, f"P{name}", sorted(capture), run, is_inverted)


def limits_of(draw: random.Random, tracks: list[ChannelPair]) -> Tolerance:
    ends = [
        (min((edges[0][0] for edges in all_edges if edges), default=0.0) - draw.choice((0.0, 30.0, -150.0)),
         max((edges[-1][0] for edges in all_edges if edges), default=0.0) + draw.choice((0.0, 30.0, -150.0)))
        for all_edges in ([track.run for track in tracks], [track.capture for track in tracks])
    ]  # fmt: skip
    return Tolerance(NEAR_NS, MOST_ERROR, ends[0], ends[1])


def clock_of(draw: random.Random) -> Clock:
    within = draw.choice((MOST_ERROR, 0.001, 0.0))
    return Clock(draw.choice((0.0, 300.0, -50.0, 1300.0)), draw.choice((0.0, 0.001, -0.009)), within)


def proposed(draw: random.Random) -> Iterator[str]:
    """Which times are proposed to be the same, in which order."""
    for _ in range(40):
        tracks = [track_of(draw, name) for name in "ABC"[: draw.choice((1, 2, 3))]]
        limits = limits_of(draw, tracks)
        found = [
            [[track.channel for track in those], one, other]
            for those, one, other in alignment._proposals(tracks[:2], tracks[2:], limits)
        ]
        track = tracks[0]
        places = [(0, 0), (len(track.capture) // 2, len(track.run) // 2), (len(track.capture) - 1, len(track.run) - 1)]
        rows = [alignment._row(track.capture, track.run, at, limits) for at in places if track.capture and track.run]
        yield said([rows, [*alignment._seeds(track.capture, track.run, limits)], len(found), found[:60]])
    yield said([[alignment._spread(range(count), most) for count in (0, 3, 4, 5, 11)] for most in (1, 4)])
    yield said([alignment._spread(range(count)) for count in (24, 25, 300)])


def followed(draw: random.Random) -> Iterator[str]:
    """Which clock follows from two times, by the edges of a window and by all; and what that explains."""
    for _ in range(60):
        tracks = [track_of(draw, name) for name in "AB"]
        limits, clock = limits_of(draw, tracks), clock_of(draw)
        track = max(tracks, key=lambda one: len(one.capture))
        times = (track.capture[0][0], track.run[0][0]) if track.capture and track.run else (0.0, 50.0)
        window = sorted((draw.choice((-500.0, 0.0, 900.0)), draw.choice((0.0, 800.0, 5_000.0))))
        points = alignment._points(tracks, clock, (window[0], window[1]), (draw.choice((20.0, 60.0)), limits))
        met = meet(track, clock, limits, draw.choice((None, 60.0)))
        yield said(
            [
                *(alignment._follow(tracks, *times, limits), alignment._settle(tracks, clock, limits), points),
                *(alignment._explained_first(tracks, clock, limits), [*alignment._alone_ns(met, clock)], met.gain),
                *(met.pairs, met.added, met.missing, align(tracks[:1], tracks[1:], limits)),
            ]
        )


def lines(draw: random.Random) -> Iterator[str]:
    """Which lines are laid through points: of least squares, trimmed, and with the smallest residual."""
    for _ in range(120):
        start, slope = draw.choice((0.0, 40.0)), draw.choice((0.0, 0.004, -0.02))
        points = sorted(
            (at, start + slope * at + draw.choice((0.0, 3.0, -8.0, 15.0, 70.0)))
            for at in draw.choices((0.0, 100.0, 150.0, 400.0, 1_000.0, 9_000.0), k=draw.choice((0, 1, 2, 3, 4, 8)))
        )
        clock = clock_of(draw)
        found: list[object] = [points, alignment._line(points), alignment._trimmed(points, draw.choice((5.0, 20.0)))]
        found.append(alignment._smallest_worst(points, clock, draw.choice((5.0, 20.0)), draw.choice((0.01, 0.001))))
        if points:
            found += [alignment._hull(points, side) for side in (1.0, -1.0)]
            found += [alignment._span(points), alignment._minimax(points, clock, draw.choice((0.01, 0.001)))]
        yield said(found)


def begun(draw: random.Random) -> Iterator[str]:
    """Which of the clocks that were tried is taken, where time jumps in the capture."""
    for _ in range(25):
        run = edges_of(draw, 40)
        jump, cut = draw.choice((0.0, 2_000.0)), draw.choice((4, 8, 9, 20, 36))
        capture = [(at + (jump if place >= cut else 0.0), level) for place, (at, level) in enumerate(run)]
        track = ChannelPair("A", "PA", capture, run, False)
        limits = limits_of(draw, [track])
        tried = [
            (meet(track, clock, limits).gain, len(meet(track, clock, limits).pairs), clock)
            for clock in (Clock(-jump, 0.0), Clock(0.0, 0.0), Clock(-100.0, 0.0))
        ]
        best = draw.choice(
            ((tried[0][0], draw.choice((1, 100, 350, 400, 450, 500)), tried[0][2]), max(tried)[:2] + tried[0][2:])
        )
        yield said([cut, best, alignment._from_the_beginning([track], best, tried, limits), align([track], [], limits)])


TRACES: dict[str, Trace] = {"proposed": proposed, "followed": followed, "lines": lines, "begun": begun}
test_a_walk_shows_what_was_approved = judge_of(__file__, TRACES)
