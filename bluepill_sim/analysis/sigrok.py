"""Writes what a probe has recorded as a sigrok session; a floating wire shows as 0.

Invariant: the same recording gives the same bytes.
"""

from pathlib import Path

from bluepill_sim.analysis.probe import Probe, signals_in_order
from bluepill_sim.analysis.sigrok_session import MOST_SAMPLES, RATE_NAMES, runs, write_session
from bluepill_sim.errors import BluePillError
from bluepill_sim.timing import NS_PER_S

#: Sample rates to choose from, Hz, the finest first.
RATES_HZ = tuple(RATE_NAMES)


def write_sigrok(probe: Probe, path: Path) -> None:
    """Write the recording, sampled evenly at the finest rate that keeps it small.

    Raises:
        BluePillError: the file cannot be written.
    """
    names = signals_in_order(probe)
    start_ns, span_ns = probe.start_ns, probe.end_ns - probe.start_ns
    rate_hz = next((rate for rate in RATES_HZ if span_ns * rate // NS_PER_S < MOST_SAMPLES), RATES_HZ[-1])
    by_name = probe.edges
    edges = sorted((at - start_ns, n, value) for n, name in enumerate(names) for at, value in by_name.get(name, ()))
    bits = sum((probe.initial[name] & 1) << n for n, name in enumerate(names))
    try:
        write_session(path, names, rate_hz, runs(edges, bits, span_ns, rate_hz))
    except OSError as error:
        raise BluePillError(f"cannot write {path}: {error.strerror}", hint="give a file in a folder") from error
