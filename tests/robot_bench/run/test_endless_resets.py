"""A program that resets for ever ends its bench."""

from pathlib import Path

from robot_bench.bench import Bench
from simbase.timing import NS_PER_MS
from tests.bluepill_sim.board.test_reset_loop import RESET, program


def test_a_bench_ends_and_says_so(tmp_path: Path) -> None:
    bench = Bench.from_scenario("motors", body="kinematic", firmware=program(RESET, tmp_path))
    bench.run_until("5 s")
    assert bench.chip.has_died
    assert bench.end < 2_000 * NS_PER_MS
    assert "it resets for ever" in bench.chip.verdict
