"""The times that several parts live by stand in one table, and keep the robot alive."""

import re
from pathlib import Path

from p2os.protocol.times import CYCLE_NS, LIVENESS_NS, PULSE_NS, WATCHDOG_NS
from simbase.timing import NS_PER_MS

ROOT = Path(__file__).parents[3]


def test_a_living_link_never_lets_the_robot_stop() -> None:
    assert 3 * CYCLE_NS < LIVENESS_NS < WATCHDOG_NS
    assert LIVENESS_NS + PULSE_NS < WATCHDOG_NS


def test_no_other_file_states_the_liveness_or_the_pulse_period_as_a_number() -> None:
    milliseconds = "|".join(str(ns // NS_PER_MS) for ns in (LIVENESS_NS, PULSE_NS))
    stated = re.compile(rf"(?:liveness|pulse)_ns\b[^\n=]*=\s*(?:{milliseconds})\b", re.IGNORECASE)
    folders = ("p2os", "adapter_sim", "robot_bench", "adapter_fw/core", "adapter_fw/selftest")
    files = [
        path for folder in folders for path in (ROOT / folder).rglob("*") if path.suffix in {".py", ".hpp", ".cpp"}
    ]
    assert len(files) > 100
    assert [
        path.name for path in files if path.stem != "times" and stated.search(path.read_text(encoding="utf-8"))
    ] == []
