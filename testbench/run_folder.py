"""The run folder, and the first line of its trace.

What the folder holds is listed in `testbench.artefacts`.
"""

import hashlib
import math
from importlib.metadata import version
from pathlib import Path

from p2os.errors import UsageError
from p2os.pioneer.scenery import Pose, World
from p2os.timing import NS_PER_S
from testbench.outcome import SUMMARY_NAME
from testbench.report.run_record import Json
from testbench.scenario import Scenario
from testbench.trace import TRACE_NAME

#: What mode C says of the place that it knows nothing of; 8 m of an empty plan.
UNKNOWN_PLACE: Json = {"name": "the real one", "extent": [-4.0, -4.0, 4.0, 4.0], "obstacles": []}


def prepare_folder(folder: Path) -> None:
    """Make a run folder, or clear one of an earlier run.

    Raises:
        UsageError: The folder holds something else.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"cannot make the run folder {folder}: {error.strerror}") from error
    if any(folder.iterdir()) and not (folder / TRACE_NAME).is_file():
        raise UsageError(f"{folder} holds something that is no run", hint="--out takes a new or an empty folder")
    for name in (TRACE_NAME, SUMMARY_NAME, "report.html", "pins.vcd", "pins.sr", "wire.jsonl", "usart.txt"):
        (folder / name).unlink(missing_ok=True)


def meta_of(scenario: Scenario, world: World | None, note: str | None) -> Json:
    """Return the trace's first line: what was run, where, with what robot; no world is mode C."""
    parameters = scenario.parameters
    start = Pose(0.0, 0.0, 0.0) if world is None else scenario.start or world.start
    return {
        "version": version("p2os"),
        "scenario": scenario.name,
        "description": scenario.description,
        "text": scenario.text,
        "firmware": scenario.firmware.name,
        "firmware_sha256": hashlib.sha256(scenario.firmware.read_bytes()).hexdigest(),
        "mode": "port" if world is None else scenario.mode,
        "body": "remote" if world is None else scenario.body,
        "seed": None if world is None else scenario.seed,
        "duration_s": scenario.duration_ns / NS_PER_S,
        "threshold_m": scenario.threshold_m,
        "step_mps": (scenario.direct if scenario.mode == "direct" else scenario.adapter).step_um_per_s / 1e6,
        "note": note,
        "start": {"x": start.x_m, "y": start.y_m, "heading": start.heading_rad},
        "world": UNKNOWN_PLACE if world is None else world.to_plain(),
        "robot": {
            "name": scenario.robot,
            "front_m": parameters.body.hull_front_m,
            "rear_m": parameters.body.hull_rear_m,
            "width_m": parameters.body.hull_width_m,
            "track_m": parameters.track_mm / 1000,
            "wheel_diameter_m": parameters.body.wheel_diameter_m,
            "sonar": [
                [sonar.x_mm / 1000, sonar.y_mm / 1000, math.radians(sonar.heading_deg)]
                for sonar in parameters.sonar[: parameters.sonar_fitted]
            ],
            "sonar_cone_rad": math.radians(parameters.sonar_cone_deg),
            "sonar_range_m": parameters.sonar_range_m,
        },
    }
