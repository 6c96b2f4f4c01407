"""A bench run to its end, here or in another process: without pytest, so that such a process starts with less."""

import pickle
import sys

from robot_bench.bench import Bench


def finished(bench: Bench) -> tuple[str, str]:
    """Return the trace of a bench that has come to its end, and its hash."""
    bench.run_until(bench.end)
    bench.finish()
    bench.trace.flush()
    return bench.trace.text if bench.trace.path is None else bench.trace.path.read_text(), bench.trace.sha256


if __name__ == "__main__":
    benches = pickle.load(sys.stdin.buffer)  # noqa: S301 - our own bytes
    sys.stdout.buffer.write(pickle.dumps([finished(bench) for bench in benches]))
