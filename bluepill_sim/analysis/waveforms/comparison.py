"""A capture of a board beside a run: the clocks, the wires that are not as declared, and the first edge not explained.

An edge is explained where the run has one of the same pin and direction no further away than the analyser's samples
allow. Where the run does not know a level (a pin that floats) nothing is judged.

Invariant: a run beside its own capture, whatever its clock, its beginning and its jitter within the allowance, has no
edge that is not explained.
"""

from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from statistics import median

from bluepill_sim.analysis.waveforms.alignment import MOST_ERROR, Alignment, ChannelPair, Met, Tolerance, align, meet
from bluepill_sim.analysis.waveforms.levels import CaptureError, LevelEdge, Signal, Waveforms

#: Samples by which an analyser may be off beside the one that an edge needs to be seen.
JITTER_SAMPLES = 1.0
#: chosen: of the edges of a channel so many are explained where it is another wire, and so few where it is its own.
_MOSTLY, _HARDLY = 0.8, 0.4
#: chosen: fewer edges do not tell one wire from another.
_LEAST_WIRE = 4
#: chosen: edges further apart than this are not one that is late.
_NEAR_NS = 1e6
#: chosen: of the edges behind one so many are as late, where time itself jumped.
_JUMPED = 0.8


@dataclass(frozen=True, slots=True, kw_only=True)
class Unexplained:
    """An edge of one side that the other does not have."""

    channel: str
    pin: str
    level: int
    #: Whether the capture has it, and not the run.
    is_added: bool
    #: In both; that of the side without the edge by the clocks.
    run_ns: float
    capture_ns: float
    #: What the other side has that is nearest: (ns of the run, level), None where it has none.
    nearest: LevelEdge | None
    #: The same edge in the capture, by how many ns later; None: it is missing or added.
    late_ns: float | None
    #: A pulse: how long it is, ns; None: it is none.
    pulse_ns: float | None
    #: The level that the other side has there.
    other_level: int
    #: Whether time itself jumps here.
    jump: "Jump | None" = None


@dataclass(frozen=True, slots=True)
class Jump:
    """From an edge on all of the capture is later than the run."""

    #: By how many ns; negative: earlier.
    late_ns: float
    #: Of the edges of the capture from there on so many are explained so.
    explained: int
    of: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Miswired:
    """A channel that is not at the pin that was said."""

    channel: str
    pin: str
    #: The pin that it shows.
    shows: str
    is_inverted: bool
    explained: int
    of: int


@dataclass(frozen=True, slots=True, kw_only=True)
class PinComparison:
    """What a capture and a run have of each other."""

    alignment: Alignment
    limits: Tolerance
    met: Sequence[Met]
    #: Edges not judged: the run does not know the level, or a pulse is shorter than a sample.
    unjudged: int
    miswired: Sequence[Miswired]
    #: How many edges are not explained, and the first.
    unexplained: int
    first: Unexplained | None

    def late_ns(self, met: Met) -> float | None:
        """Return by how much the edges of a channel that are not explained are late, in the middle of them all.

        None: fewer than half of them have one of the same direction within a millisecond.
        """
        clock, late = self.alignment.clock, list[float]()
        theirs = sorted((clock.in_run(met.track.capture[i][0]), met.track.capture[i][1]) for i in met.added)
        for j in met.missing:
            at, level = met.track.run[j]
            near = [when - at for when, to in theirs if to == level and abs(when - at) < _NEAR_NS]
            late += [min(near, key=abs)] if near else []
        return median(late) if late and len(late) >= len(met.missing) / 2 else None

    @property
    def explained(self) -> int:
        """How many edges are explained."""
        return sum(len(one.pairs) for one in self.met)


def wires_of(capture: Waveforms, run: Waveforms, declared: Mapping[str, str]) -> dict[str, str]:
    """Return the pin of each channel: as declared, else where both have the same name.

    Raises:
        CaptureError: A declared name is in neither, or nothing is left.
    """
    pins = {pin.lower(): pin for pin in run.signals}
    channels = {channel.lower(): channel for channel in capture.signals}
    wires = {} if declared else {channel: pins[low] for low, channel in channels.items() if low in pins}
    for channel, pin in declared.items():
        if channel.lower() not in channels:
            raise CaptureError(f"{capture.name} has no channel {channel}", hint=f"it has {_listed(capture)}")
        if pin.lower() not in pins:
            raise CaptureError(f"{run.name} has no pin {pin}", hint=f"it has {_listed(run)}")
        wires[channels[channel.lower()]] = pins[pin.lower()]
    if not wires:
        raise CaptureError(
            f"no channel of {capture.name} has the name of a pin of {run.name}",
            hint=f"--wire CHANNEL=PIN; {_listed(capture)}, and {_listed(run)}",
        )
    return wires


def _listed(waveforms: Waveforms) -> str:
    names = list(waveforms.signals)
    return ", ".join(names[:12]) + (f" and {len(names) - 12} more" if len(names) > 12 else "")


def compare_pins(
    run: Waveforms,
    capture: Waveforms,
    wires: Mapping[str, str],
    *,
    jitter_samples: float = JITTER_SAMPLES,
    most_error: float = MOST_ERROR,
) -> PinComparison:
    """Lay a capture beside a run.

    Args:
        run: What the model did.
        capture: What an analyser saw.
        wires: The pin of each channel.
        jitter_samples: By how many samples an edge may be off beside the one that it needs to be seen.
        most_error: By which part the clocks may differ, above 0.

    Raises:
        CaptureError: There is nothing to compare: no edges, or none that agree.
    """
    # An edge at t was within (t - sample, t]: it is taken in the middle.
    limits = Tolerance(
        near_ns=capture.sample_ns * (0.5 + jitter_samples) + 0.5 * run.sample_ns + 1e-3,
        most_error=most_error,
        run_ns=(run.start_ns, run.end_ns),
        capture_ns=(capture.start_ns, capture.end_ns),
    )
    middle = {channel: _moved(capture.signals[channel], capture.sample_ns / 2) for channel in wires}
    pins = {pin: _moved(signal, run.sample_ns / 2) for pin, signal in run.signals.items()}
    declared = [ChannelPair(channel, pin, middle[channel], pins[pin]) for channel, pin in wires.items()]
    for what, sides in (("capture", middle), ("run", {pin: pins[pin] for pin in wires.values()})):
        if not any(sides.values()):
            raise CaptureError(f"the {what} has no edge on {', '.join(sides)}", hint="nothing to align")
    others = [
        ChannelPair(channel, pin, middle[channel], edges, is_inverted)
        for channel, own in wires.items() for pin, edges in pins.items() for is_inverted in (False, True)
        if edges and (pin, is_inverted) != (own, False)
    ]  # fmt: skip
    found = align(declared, [], limits)
    if found is None or found.explained < 0.5 * sum(len(track.capture) for track in declared):
        found = align(declared, others, limits) or found
    if found is None:
        raise CaptureError(
            f"no edge of {capture.name} agrees with {run.name}", hint="is it the same program, and --wire right?"
        )
    judged = [
        _judged(meet(track, found.clock, limits), run.signals[track.pin], found, (limits, capture.sample_ns))
        for track in declared
    ]
    met = [one for one, _ in judged]
    return PinComparison(
        alignment=found, limits=limits, met=met, unjudged=sum(count for _, count in judged),
        miswired=list(_miswired(met, others, found, limits)),
        unexplained=sum(len(one.added) + len(one.missing) for one in met), first=_first(met, found, limits),
    )  # fmt: skip


def _moved(signal: Signal, by_ns: float) -> list[LevelEdge]:
    return [(at - by_ns, level) for at, level in signal.edges]


def _judged(met: Met, signal: Signal, found: Alignment, how: tuple[Tolerance, float]) -> tuple[Met, int]:
    """Return what has met without the edges that nobody can know, and how many those are.

    The run may not know a level, and an analyser sees no pulse that is shorter than its sample.
    """
    limits, sample_ns = how
    unseen: set[int] = set()
    for j, after in pairwise(met.missing):
        if after == j + 1 and j not in unseen and met.track.run[after][0] - met.track.run[j][0] < sample_ns:
            unseen |= {j, after}
    times = ((i, found.clock.in_run(met.track.capture[i][0])) for i in met.added)
    added = [i for i, at in times if not signal.is_unknown(at, limits.near_ns)]
    missing = [j for j in met.missing if j not in unseen]
    return replace(met, added=added, missing=missing), len(met.added) - len(added) + len(unseen)


def _miswired(
    met: Sequence[Met], others: Sequence[ChannelPair], found: Alignment, limits: Tolerance
) -> Iterator[Miswired]:
    for own in met:
        count = len(own.pairs) + len(own.added)
        if count < _LEAST_WIRE or len(own.pairs) > _HARDLY * count:
            continue
        of_channel = [track for track in others if track.channel == own.track.channel]
        best = max((meet(track, found.clock, limits) for track in of_channel), key=lambda one: one.gain, default=None)
        if best is not None and len(best.pairs) >= _MOSTLY * count:
            yield Miswired(channel=own.track.channel, pin=own.track.pin, shows=best.track.pin,
                           is_inverted=best.track.is_inverted, explained=len(best.pairs), of=count)  # fmt: skip


def _first(met: Sequence[Met], found: Alignment, limits: Tolerance) -> Unexplained | None:
    """Return the first edge that is not explained, with what the other side has."""
    clock = found.clock
    alone = [(clock.in_run(one.track.capture[i][0]), True, i, one) for one in met for i in one.added]
    alone += [(one.track.run[j][0], False, j, one) for one in met for j in one.missing]
    if not alone:
        return None
    run_ns, is_added, number, one = min(alone, key=lambda row: row[:3])
    track = one.track
    level = (track.capture if is_added else track.run)[number][1]
    if is_added:
        theirs: list[LevelEdge] = list(track.run)
        candidates = [track.run[j] for j in one.missing]
    else:
        theirs = [(clock.in_run(at), to) for at, to in track.capture]
        candidates = [(clock.in_run(track.capture[i][0]), track.capture[i][1]) for i in one.added]
    nearest = min(theirs, key=lambda edge: abs(edge[0] - run_ns), default=None)
    same = min((edge for edge in candidates if edge[1] == level), key=lambda edge: abs(edge[0] - run_ns), default=None)
    pulse_ns = _pulse(one, number, is_added=is_added, scale=1.0 + clock.error if is_added else 1.0)
    late_ns = None
    if same is not None and (pulse_ns is None or abs(same[0] - run_ns) < pulse_ns):
        late_ns = run_ns - same[0] if is_added else same[0] - run_ns
    before = bisect_right(theirs, (run_ns, 2)) - 1
    other_level = theirs[before][1] if before >= 0 else theirs[0][1] ^ 1 if theirs else level ^ 1
    return Unexplained(
        channel=track.channel, pin=track.pin, level=level, is_added=is_added, run_ns=run_ns,
        capture_ns=clock.in_capture(run_ns), nearest=nearest, late_ns=late_ns,
        pulse_ns=None if late_ns is not None else pulse_ns, other_level=other_level,
        jump=_jump(met, found, limits, run_ns),
    )  # fmt: skip


def _pulse(met: Met, number: int, *, is_added: bool, scale: float) -> float | None:
    """Return how long the pulse is that begins with an edge: the next of its side is alone too."""
    numbers, edges = (met.added, met.track.capture) if is_added else (met.missing, met.track.run)
    if number + 1 not in numbers:
        return None
    return (edges[number + 1][0] - edges[number][0]) * scale


def _jump(met: Sequence[Met], found: Alignment, limits: Tolerance, begin_ns: float) -> Jump | None:
    """Return by how much all behind an edge is late: what another clock explains from there on, and this one does not.

    Args:
        met: What has met.
        found: The clock before.
        limits: Of it.
        begin_ns: When the edge is, in the run.
    """
    capture_ns = found.clock.in_capture(begin_ns)
    rest = [
        ChannelPair(
            one.track.channel,
            one.track.pin,
            [edge for edge in one.track.capture if edge[0] >= capture_ns - limits.near_ns],
            one.track.run,
        )
        for one in met
    ]
    count = sum(len(track.capture) for track in rest)
    within = replace(limits, capture_ns=(capture_ns, limits.capture_ns[1]))
    kept = sum(len(meet(track, found.clock, within).pairs) for track in rest)
    if count < _LEAST_WIRE or kept > _HARDLY * count:
        return None
    again = align(rest, [], within)
    if again is None or again.explained < _JUMPED * count:
        return None
    late_ns = found.clock.in_run(again.clock.in_capture(begin_ns)) - begin_ns
    return Jump(late_ns, again.explained, count)
