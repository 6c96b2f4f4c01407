"""The figures of a run: the table that a person reads first, and the outcome that `run --json` and `summary.json` give.

Invariant: they come from the trace alone: from its end line where there is one, and
from the samples where the run was cut.
"""

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import cast

from robot_bench.events.codec import Json
from robot_bench.events.kinds import Wave
from robot_bench.recording.disputed import body_note
from robot_bench.recording.run_folder import SUMMARY_NAME
from robot_bench.recording.run_record import RunRecord
from simbase.files import replace_text
from simbase.timing import NS_PER_S

#: Side of the cells that a run's coverage is counted in, metres.
CELL_M = 0.5
#: chosen: so many collisions are listed in the table; all stand in the state log.
LISTED_HITS = 5
#: How the first failure of a run begins that a signal ended.
INTERRUPTED = "interrupted"

_FROM_META = ("firmware_sha256", "scenario", "mode", "body", "world", "seed")
_FROM_END = (
    "virtual_s", "wall_s", "real_time_factor", "distance_m", "collisions", "min_clearance_m", "usart_baud",
    "trace_sha256",
    "passed", "failures", "goals_met", "goals_not_judged", "notes", "last_blocks",
)  # fmt: skip
#: What a run holds that was measured with `--coverage` or `--profile`.
MEASURED = ("coverage", "profile")
#: Why a run failed, in one line, where that was asked.
EXPLAINED = "explained"


def verdict(record: RunRecord) -> str:
    """Return what `verdict_of` says, or `cut at … s` for a run without an end."""
    return f"cut at {record.last_ns / NS_PER_S:.1f} s" if record.is_cut else verdict_of(record.end)


def verdict_of(end: Mapping[str, object]) -> str:
    """Return what a run came to, in the words of screen, page and plot; `end` is its last line or its outcome."""
    met, left, failures = (
        cast("Sequence[str]", end.get(key) or ()) for key in ("goals_met", "goals_not_judged", "failures")
    )
    if not end.get("passed"):
        return failures[0] if failures and failures[0].startswith(INTERRUPTED) else "failed"
    if left:
        return f"passed, {len(left)} goal{'s' if len(left) > 1 else ''} not judged"
    return "passed" if met else "ended well, no goals were set"


def distance_m(record: RunRecord) -> float:
    """Return the length of the path over ground, metres."""
    return sum(math.hypot(b.x - a.x, b.y - a.y) for a, b in pairwise(record.poses)) / 1e6


def cells_entered(record: RunRecord) -> int:
    """Return how many different cells of 0.5 m the robot's centre was in."""
    side = CELL_M * 1e6
    return len({(math.floor(pose.x / side), math.floor(pose.y / side)) for pose in record.poses})


def figures(record: RunRecord) -> list[tuple[str, str]]:
    """Return (name, value with unit) for each figure of the summary table."""
    rows = [
        ("virtual time", f"{record.last_ns / NS_PER_S:.1f} s"),
        ("distance", f"{distance_m(record):.2f} m"),
        ("cells of 0.5 m entered", f"{cells_entered(record)}"),
        ("collisions", f"{record.poses[-1].collisions if record.poses else 0}"),
        *((f"collision {number}", str(hit)) for number, hit in enumerate(record.contacts[:LISTED_HITS], 1)),
    ]
    if note := body_note(record):
        rows.append(("note", note))
    clearance = record.end.get("min_clearance_m")
    if isinstance(clearance, (int, float)):
        rows.append(("least clearance", f"{clearance:.3f} m"))
    rows.append(("packets on the wire", f"{len(record.wire)}"))
    rows += [(f"PWM on {net}", _pwm([wave for _, wave in waves if wave])) for net, waves in record.waves.items()
             if any(wave for _, wave in waves)]  # fmt: skip
    factor = record.end.get("real_time_factor")
    if isinstance(factor, (int, float)):
        rows.append(("speed", f"{factor:.1f} × real time"))
    return rows


def _pwm(waves: Sequence[Wave]) -> str:
    """Return frequencies and duties of a pin's waves."""
    hz, duty = [wave.frequency_hz for wave in waves], [100 * wave.duty for wave in waves]
    frequency = f"{min(hz):.6g} Hz" if min(hz) == max(hz) else f"{min(hz):.6g} to {max(hz):.6g} Hz"
    return f"{frequency}, duty {min(duty):.1f} to {max(duty):.1f} %"


def outcome_of(record: RunRecord) -> Json:
    """Return a run's figures as one JSON object."""
    result: Json = {key: record.meta.get(key) for key in _FROM_META}
    world = result["world"]
    result["world"] = world.get("name") if isinstance(world, Mapping) else world
    end = record.end
    if record.is_cut:
        end = end_of_a_broken_run(record, f"the run was cut at {record.last_ns / NS_PER_S:.1f} s")
    result.update((key, end.get(key)) for key in _FROM_END)
    result.update((key, end[key]) for key in (*MEASURED, EXPLAINED) if key in end)
    if note := body_note(record):
        result["notes"] = [*cast("Sequence[str]", result["notes"] or ()), note]
    result["hits"] = [
        {"t_s": hit.t / NS_PER_S, "what": hit.what, "x_m": hit.x_m, "y_m": hit.y_m, "part": hit.part}
        for hit in record.contacts
    ]
    lines = [line for _, line in record.usart_lines()]
    result["usart_lines"], result["usart_last"] = len(lines), lines[-1] if lines else None
    return result


def outcome_of_all(scenario: str, robots: Mapping[str, Json]) -> Json:
    """Return what came of a run with several robots: of each, and of all together."""
    first = next(iter(robots.values()))

    def each(key: str) -> list[object]:
        return [one[key] for one in robots.values() if one.get(key) is not None]

    def texts(key: str) -> list[str]:
        return [f"{name}: {line}" for name, one in robots.items() for line in cast("Sequence[str]", one.get(key) or ())]

    interrupted = [line for line in cast("Sequence[str]", first["failures"]) if line.startswith(INTERRUPTED)]
    hashes = "".join(str(value) for value in each("trace_sha256"))
    return {
        **{key: first[key] for key in ("body", "world", "seed", "virtual_s", "wall_s", "real_time_factor")},
        "scenario": scenario,
        "mode": f"{len(robots)} robots",
        "passed": all(one["passed"] for one in robots.values()),
        "failures": interrupted or texts("failures"),
        **{key: texts(key) for key in ("goals_met", "goals_not_judged", "notes", "last_blocks")},
        "distance_m": sum(cast("list[float]", each("distance_m"))),
        "collisions": sum(cast("list[int]", each("collisions"))),
        "min_clearance_m": min(cast("list[float]", each("min_clearance_m")), default=None),
        "hits": [
            {**hit, "what": f"{name} and {hit['what']}"}
            for name, one in robots.items() for hit in cast("Sequence[Mapping[str, object]]", one["hits"])
        ],
        "trace_sha256": hashlib.sha256(hashes.encode()).hexdigest(),
        "robots": dict(robots),
    }  # fmt: skip


def write_outcome(record: RunRecord, folder: Path) -> Json:
    """Write `summary.json` and return what it holds."""
    outcome = outcome_of(record)
    replace_text(folder / SUMMARY_NAME, json.dumps(outcome, indent=2, sort_keys=True) + "\n")
    return outcome


def end_of_a_broken_run(record: RunRecord, reason: str) -> Json:
    """Return the last line of a run that did not come to its end, as far as its trace tells."""
    return {
        "virtual_s": record.last_ns / NS_PER_S,
        "distance_m": round(distance_m(record), 6),
        "collisions": record.poses[-1].collisions if record.poses else None,
        "passed": False,
        "failures": [reason],
        "goals_met": [],
        "goals_not_judged": [],
        "notes": [],
        "last_blocks": [],
    }
