"""Writes the pins of a run as a sigrok session (.sr), which PulseView opens: each net sampled evenly from 0 on.

The exact times stand in the VCD and in the trace.
"""

from pathlib import Path

from bluepill_sim.sight.sigrok_session import MOST_SAMPLES, runs, sample_at, write_session
from testbench.report.run_record import RunRecord
from testbench.vcd import edges_in_order, nets_in_order

#: Sample rates to choose from, Hz, the finest first: each divides 10**9.
RATES_HZ = (1_000_000, 100_000, 10_000)


def write_sigrok(record: RunRecord, path: Path) -> None:
    """Write every net's levels, sampled evenly over the run."""
    end_ns = record.last_ns
    rate_hz = next((rate for rate in RATES_HZ if sample_at(end_ns, rate) + 1 <= MOST_SAMPLES), RATES_HZ[-1])
    write_session(path, nets_in_order(record), rate_hz, runs(edges_in_order(record), 0, end_ns, rate_hz))
