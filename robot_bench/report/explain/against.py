"""What a program that does what it should would have done with the same inputs.

Its chip is given what the pins of the failed run held; the first time that its motors are asked for something else,
and stay so, is told. From there on the two would have been elsewhere, so nothing later is.

Invariant: only what the user calls a reference is one.
"""

from pathlib import Path

from robot_bench.report.explain.chain import ChainLink, Evidence
from robot_bench.report.explain.probing import Prober
from robot_bench.report.explain.replay import ChipReplay
from simbase.timing import NS_PER_MS, Nanos

#: chosen: two programs that differ for less are not told of: they take turns at other instants.
_LASTS_NS: Nanos = 60 * NS_PER_MS


def compare(prober: Prober, reference: Path, until: Nanos) -> list[ChainLink]:
    """Return where the failed program first asked its motors for something else than the reference, up to a time.

    Raises:
        ImageError: The reference cannot be read.
    """
    replay = ChipReplay(reference, prober.replay.record)
    ours = prober.replay.run(0, until)
    theirs = replay.run(0, until)
    since: Nanos | None = None
    for at in [*sorted({t for seen in (ours, theirs) for t, net, _ in seen.edges if net.startswith("motor")}), until]:
        if since is not None and at - since > _LASTS_NS:
            return [_told(prober, replay, reference, since)]
        same = prober.codes_with(ours, at) == prober.codes_with(theirs, at)
        since = None if same else at if since is None else since
    return [
        ChainLink(
            t=until,
            part="firmware",
            says=f"{reference.name} would have asked the motors for the same all the time",
            evidence=Evidence.REPLAYED,
        )
    ]


def _told(prober: Prober, replay: ChipReplay, reference: Path, since: Nanos) -> ChainLink:
    at = since + _LASTS_NS
    codes = [prober.codes_with(one.run(0, at), at) for one in (prober.replay, replay)]
    high = [net for net in prober.sensors if prober.replay.level(net, since)]
    seen = f"with {', '.join(high)} high" if high else "with no sensor's pin high"
    ours, theirs = (f"{left:+d}, {right:+d}" for left, right in codes)
    return ChainLink(
        t=since, part="firmware", evidence=Evidence.REPLAYED,
        says=f"sets the motors to {ours}, where {reference.name}, given the same inputs, has {theirs}, {seen}",
    )  # fmt: skip
