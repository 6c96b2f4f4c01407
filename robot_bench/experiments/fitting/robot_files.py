"""What was fitted as files that `p2os serve` and scenarios take: a robot (`--robot`) and sensors' errors (`--errors`).

Invariant: what was not seen is not written, and so stays that of the model on which the file is based.
"""

from collections.abc import Iterator, Mapping

from p2os.robots.parameters import RobotParameters
from robot_bench.experiments.fitting.least_squares import Estimate

#: Estimate → section and key of a robot file; all of them are whole numbers there, but the cone.
_ROBOT: Mapping[str, tuple[str, str]] = {
    "track_mm": ("conversion", "track_mm"), "accel_mm_s2": ("motion", "accel_mm_s2"),
    "decel_mm_s2": ("motion", "decel_mm_s2"), "rot_accel_deg_s2": ("motion", "rot_accel_deg_s2"),
    "rot_decel_deg_s2": ("motion", "rot_decel_deg_s2"), "cone_deg": ("sonar", "cone_deg"),
}  # fmt: skip
_WHEELS = ("left_wheel", "right_wheel")
_NOISE = ("noise_m", "noise_part")
_NOT_HELD = (
    "command_delay_s", "packet_delay_s", "sonar_delay_s", "sonar_offset_m", "speed_gain", "turn_gain", "reversal_s",
)  # fmt: skip


def robot_text(base: str, parameters: RobotParameters, found: Mapping[str, Estimate]) -> str:
    """Return a robot file.

    Args:
        base: The shipped model on which it is based.
        parameters: Its numbers.
        found: What was fitted.
    """
    sections: dict[str, list[str]] = {}
    for name, (section, key) in _ROBOT.items():
        if name in found:
            one = found[name]
            value = f"{one.value:.2f}" if key == "cone_deg" else f"{round(one.value)}"
            sections.setdefault(section, []).append(f"{key} = {value}  # {_interval(one)}")
    if all(name in found for name in _WHEELS):
        mean = sum(found[name].value for name in _WHEELS) / 2
        diameter = parameters.body.wheel_diameter_m * mean
        sections["body"] = [f"wheel_diameter_m = {diameter:.5f}  # {mean:.5f} of the model's"]
    return "\n".join([
        "# Fitted by `p2os fit`; intervals hold with 95 %.", *_not_held(found), f'based_on = "{base}"',
        *(line for section, lines in sections.items() for line in ("", f"[{section}]", *lines)), "",
    ])  # fmt: skip


def errors_text(parameters: RobotParameters, found: Mapping[str, Estimate]) -> str:
    """Return a file of sensors' errors: what the firmware assumes wrongly, and the sonar's noise."""
    lines = ["# Fitted by `p2os fit`; intervals hold with 95 %.", 'based_on = "ideal"']
    odometry = [f"{name} = {found[name].value:.6f}  # {_interval(found[name])}" for name in _WHEELS if name in found]
    if "track_mm" in found:
        # The robot file holds whole millimetres.
        odometry.append(f"track = {round(found['track_mm'].value) / parameters.track_mm:.6f}  # of the one assumed")
    noise = [f"{name} = {found[name].value:.6f}  # {_interval(found[name])}" for name in _NOISE if name in found]
    for section, rows in (("odometry", odometry), ("sonar", noise)):
        if rows:
            lines += ["", f"[{section}]", *rows]
    return "\n".join([*lines, ""])


def _interval(one: Estimate) -> str:
    return f"{one.low:.6g} to {one.high:.6g}"


def _not_held(found: Mapping[str, Estimate]) -> Iterator[str]:
    """Yield what no key of a robot file holds, as comments."""
    for name in _NOT_HELD:
        if name in found:
            yield f"# {name} = {found[name].value:.5g}, {_interval(found[name])}: no key of this file"
