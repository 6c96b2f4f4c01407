"""What the experiment of a silent line measures: when adapter and robot give up, and that nothing moves by itself then.

The adapter counts from the last packet that came, the robot from the last command; both are passive models, so that the
adapter's pins change in the very nanosecond, and the wheels' ramp begins with a step of the body.
"""

from robot_bench.experiments.validation.figures import Figure, FigureTolerance, Finding, Missing, worst_or_missing
from robot_bench.experiments.validation.motors import fitted_ramp
from robot_bench.experiments.validation.nominal import BODY_STEP_S, Nominal
from robot_bench.experiments.validation.signals import distance_wires, poses_between, value_course
from robot_bench.recording.run_record import RunRecord
from simbase.timing import NS_PER_MS, NS_PER_S

#: From the last command to the stop. Source: Pioneer 2 manual, FLASH parameter WatchDog, 2 s by default.
WATCHDOG_S = 2.0
#: chosen: what a line through a ramp's poses leaves open of its beginning, seconds.
FIT_S = 1e-3
#: chosen: after the ramp of a stop from the highest speed all stand, seconds.
STOPPED_S = 2.0


def silence_figures(record: RunRecord, nominal: Nominal) -> list[Finding]:
    """Return the figures of a run whose line goes down once while the robot drives, and comes up again."""
    down = next((fault.t for fault in record.faults if fault.op == "inject"), None)
    if down is None:
        return [Missing(group="wire", what="a line that goes down", why="no fault was injected")]
    # What was on its way when the line went down still comes.
    told, heard = (
        max((one.t for one in record.wire if one.direction == way and one.t < down + 100 * NS_PER_MS), default=0)
        for way in ("r2c", "c2r")
    )
    edges = [
        next((t for t, level in value_course(record, (wire,)) if t > down and level), None) for wire in distance_wires()
    ]
    pins: list[Figure] = [
        Figure(
            group="pins", what="the last packet to the distance pins that are safe", expected=nominal.liveness_s,
            measured=(t - told) / NS_PER_S, uncertainty=1e-9, unit="s", at=wire,
            bound=FigureTolerance(name="liveness", value=0, formula="in the very nanosecond"),
        )
        for wire, t in zip(distance_wires(), edges, strict=True) if t is not None
    ]  # fmt: skip
    if len(pins) < len(edges):
        pins = []
    ramp = fitted_ramp(record, down, down + round((WATCHDOG_S + STOPPED_S) * NS_PER_S))
    wheels = [] if ramp is None else [
        Figure(
            group="motion", what="the last command to the ramp of the stop", expected=WATCHDOG_S,
            measured=ramp[1] - heard / NS_PER_S, uncertainty=FIT_S, unit="s",
            bound=FigureTolerance(
                name="watchdog", value=BODY_STEP_S + FIT_S,
                formula=f"a step of the body {BODY_STEP_S * 1000:g} ms + the ramp's line {FIT_S * 1000:g} ms",
            ),
        )
    ]  # fmt: skip
    after = poses_between(record, down + round((WATCHDOG_S + STOPPED_S) * NS_PER_S), record.last_ns + 1)
    still = [
        Figure(
            group="motion", what="rim speed after that, and when the line is up again", expected=0.0,
            measured=max(abs(pose.left), abs(pose.right)) / 1000, uncertainty=1e-3, unit="mm/s",
            bound=FigureTolerance(name="standing", value=0, formula="nobody asked for a connection anew"),
            at=f"{pose.t / NS_PER_S:.2f} s",
        )
        for pose in after
    ]  # fmt: skip
    return [
        worst_or_missing(pins, "pins", "the last packet to the distance pins that are safe", "a pin never rose"),
        worst_or_missing(wheels, "motion", "the last command to the ramp of the stop", "the robot did not stop"),
        worst_or_missing(
            still, "motion", "rim speed after that, and when the line is up again", "no pose was recorded"
        ),
    ]
