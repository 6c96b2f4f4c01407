"""A run of random edges, and what an analyser sees of it: by its clock, samples and jitter."""

import math
import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from bluepill_sim.analysis.waveforms.levels import LevelEdge, Signal, Waveforms

PINS = tuple(f"PA{n}" for n in range(8))
SAMPLE_NS = 1e9 / 24e6


def random_run(seed: int, *, edges: int = 200, pins: int = 4) -> Waveforms:
    """Return pins that toggle at random, from a tenth of a microsecond to a millisecond apart."""
    rng = random.Random(seed)
    signals = {}
    for pin in PINS[:pins]:
        at, first = 0, rng.randint(0, 1)
        held: list[LevelEdge] = []
        for number in range(edges):
            at += round(200 + rng.random() * rng.choice((13, 200, 1_000, 8_680, 50_000, 1_000_000)))
            held.append((float(at), (first + number + 1) & 1))
        signals[pin] = Signal(first=first, edges=held)
    end = max((signal.edges[-1][0] for signal in signals.values() if signal.edges), default=0.0) + 1_000
    return Waveforms(name="run", signals=signals, start_ns=0.0, end_ns=end, sample_ns=1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Analyser:
    """How it looks at a board."""

    offset_ns: float = 0.0
    #: By which the board is faster.
    ppm: float = 0.0
    sample_ns: float = SAMPLE_NS
    jitter: int = 0
    #: From when to when it looks, as shares of the run.
    between: tuple[float, float] = (0.0, 1.0)
    seed: int = 0


def seen(run: Waveforms, how: Analyser) -> Waveforms:
    """Return what it sees."""
    rng = random.Random(how.seed)

    def own_ns(at: float) -> float:
        return (at - how.offset_ns) / (1 + how.ppm * 1e-6)

    begin, end = (share * run.end_ns for share in how.between)
    signals = {}
    for pin, signal in run.signals.items():
        before = [level for at, level in signal.edges if at < begin]
        edges = [
            ((math.ceil(own_ns(at) / how.sample_ns) + rng.randint(-how.jitter, how.jitter)) * how.sample_ns, level)
            for at, level in signal.edges if begin <= at <= end
        ]  # fmt: skip
        signals[pin] = Signal(first=before[-1] if before else signal.first, edges=edges)
    return Waveforms(
        name="capture", signals=signals, start_ns=own_ns(begin), end_ns=own_ns(end), sample_ns=how.sample_ns
    )


def with_edges(capture: Waveforms, edges: Mapping[str, Sequence[LevelEdge]]) -> Waveforms:
    """Return a capture in which pins have other edges."""
    changed = {pin: replace(capture.signals[pin], edges=list(each)) for pin, each in edges.items()}
    return replace(capture, signals={**capture.signals, **changed})
