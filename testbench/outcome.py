"""The outcome of a run in figures: what `run --json` prints and `summary.json` keeps.

The figures come from the trace: from its end line where there is one, and from
the samples where the run was cut.
"""

import json
from collections.abc import Mapping
from pathlib import Path

from p2os.timing import NS_PER_S
from testbench.report.run_record import Json, RunRecord
from testbench.report.summary import distance_m

SUMMARY_NAME = "summary.json"

_FROM_META = ("firmware_sha256", "scenario", "mode", "body", "world", "seed")
_FROM_END = (
    "virtual_s", "wall_s", "real_time_factor", "distance_m", "collisions", "min_clearance_m", "trace_sha256",
    "passed", "failures", "goals_met", "notes", "last_blocks",
)  # fmt: skip


def outcome_of(record: RunRecord) -> Json:
    """Return a run's figures as one JSON object."""
    result: Json = {key: record.meta.get(key) for key in _FROM_META}
    world = result["world"]
    result["world"] = world.get("name") if isinstance(world, Mapping) else world
    end = _end_of_a_cut_run(record) if record.is_cut else record.end
    result.update((key, end.get(key)) for key in _FROM_END)
    return result


def write_outcome(record: RunRecord, folder: Path) -> Json:
    """Write `summary.json` and return what it holds."""
    outcome = outcome_of(record)
    (folder / SUMMARY_NAME).write_text(json.dumps(outcome, indent=2, sort_keys=True) + "\n", encoding="utf-8")
    return outcome


def _end_of_a_cut_run(record: RunRecord) -> Json:
    return {
        "virtual_s": record.last_ns / NS_PER_S,
        "distance_m": round(distance_m(record), 6),
        "collisions": record.poses[-1].collisions if record.poses else None,
        "passed": False,
        "failures": [f"the run was cut at {record.last_ns / NS_PER_S:.1f} s"],
        "goals_met": [],
        "notes": [],
        "last_blocks": [],
    }
