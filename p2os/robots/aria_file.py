"""ARIA's parameter files (`p2dx.p` and the like), as users of ARIA keep them.

Lines are `Key value ; comment` under `Section` headings. What such a file does
not say (masses, wheels, default accelerations) comes from the shipped model of
the same subclass, or of the family it belongs to.

Two values are not taken as they stand: an AngleConvFactor of 0.00153 is the
4096 counts a turn of the robot, rounded (taken so it would turn 0.26 % short);
a front and rear length of 0 are half the length each, as ARIA itself reads them.
"""

import math
from collections.abc import Callable, Mapping

from p2os.robots.model import ParametersError
from p2os.robots.model_file import Table, merged, shipped_table
from simbase.errors import shown

#: How far an angle factor may lie from a power of two a turn and still be meant as it: 0.00153 is 0.26 % off.
ANGLE_TOLERANCE = 0.005

#: ARIA's key → section and key of ours, and how the value is turned.
KEYS: Mapping[str, tuple[str, str, Callable[[float], float]]] = {
    "DistConvFactor": ("conversion", "distance_nm_per_count", lambda mm: round(mm * 1_000_000)),
    "AngleConvFactor": ("conversion", "angle_counts_per_turn", lambda radians: counts_per_turn(radians)),  # noqa: PLW0108 - defined below
    "VelConvFactor": ("conversion", "velocity_um_s_per_count", lambda mm_s: mm_s * 1000),
    "RangeConvFactor": ("conversion", "range_um_per_count", lambda mm: mm * 1000),
    "DiffConvFactor": ("conversion", "track_mm", lambda factor: round(2 / factor)),
    "Vel2Divisor": ("conversion", "vel2_divisor_mm_s", round),
    "MaxVelocity": ("limits", "max_velocity_mm_s", round),
    "MaxRVelocity": ("limits", "max_rotation_deg_s", round),
    "RobotRadius": ("footprint", "radius_mm", round),
    "RobotWidth": ("footprint", "width_mm", round),
    "RobotLength": ("footprint", "length_mm", round),
    "RobotLengthFront": ("footprint", "front_mm", round),
    "RobotLengthRear": ("footprint", "rear_mm", round),
    "TransVelMax": ("motion", "max_velocity_mm_s", round),
    "RotVelMax": ("motion", "max_rotation_deg_s", round),
    "TransAccel": ("motion", "accel_mm_s2", round),
    "TransDecel": ("motion", "decel_mm_s2", round),
    "RotAccel": ("motion", "rot_accel_deg_s2", round),
    "RotDecel": ("motion", "rot_decel_deg_s2", round),
    "MaxLatVelocity": ("equipment", "max_lateral_mm_s", round),
    "GyroScaler": ("equipment", "gyro_scaler", float),
    "SonarNum": ("sonar", "fitted", round),
}
#: Keys whose 0 means "as the robot itself has it", so that the shipped number stays.
ZERO_IS_UNSET = frozenset({"motion", "footprint"})
FLAGS: Mapping[str, str] = {"HasMoveCommand": "has_move", "RequestIOPackets": "sends_io_packets"}
#: A bumper that is there → how many segments it has.
BUMPERS: Mapping[str, tuple[str, str]] = {
    "FrontBumpers": ("NumFrontBumpers", "front_bumpers"),
    "RearBumpers": ("NumRearBumpers", "rear_bumpers"),
}
#: chosen: what a measure of a robot may be in ARIA's units; the smallest in use is an angle factor of 0.00153.
SMALLEST, LARGEST = 1e-6, 1e6


def counts_per_turn(radians: float) -> int:
    """Return how many counts of an angle factor make a turn; near a power of two, that power."""
    counts = 2 * math.pi / radians
    power = 1 << max(0, round(math.log2(counts)))
    return power if abs(counts / power - 1) < ANGLE_TOLERANCE else round(counts)


def aria_table(source: str, text: str, base_of: Callable[[str], str]) -> Table:
    """Return the table of an ARIA parameter file over that of the model it is nearest to.

    Args:
        source: The file's name, for messages.
        text: The file.
        base_of: Gives the shipped model for a subclass.

    Raises:
        ParametersError: A value is no number, or there is no Subclass.
    """
    values, sonar, infrared = _lines(source, text)
    if "Subclass" not in values:
        raise ParametersError(f"{source}: no Subclass", hint="an ARIA parameter file names one in its first section")
    subclass = values["Subclass"].lower()
    base = shipped_table(base_of(subclass))
    table: Table = {
        "subclass": subclass,
        "robot_class": values.get("Class", "Pioneer"),
        "title": base["title"] if base["subclass"] == subclass else subclass,
        "equipment": _equipment(source, values),
    }
    for key, (section, name, turn) in KEYS.items():
        if key in values:
            number = _number(source, key, values[key])
            if number or section not in ZERO_IS_UNSET:
                _positive(source, key, number, name)
                table.setdefault(section, {})[name] = turn(number)
    _halves(table, values)
    if "SonarNum" in values:
        count = min(int(table["sonar"]["fitted"]), len(sonar))
        table["sonar"] |= {"fitted": count, "poses": [list(sonar[number]) for number in sorted(sonar)]}
    if "IRNum" in values:
        table["infrared"] = {"points": [list(infrared[number]) for number in sorted(infrared)]}
    return merged(base, table)


def _lines(
    source: str, text: str
) -> tuple[dict[str, str], dict[int, tuple[float, float, float]], dict[int, tuple[float, float]]]:
    """Return the first value of each key, and the sonar and the infra-red eyes by their numbers."""
    values: dict[str, str] = {}
    sonar: dict[int, tuple[float, float, float]] = {}
    infrared: dict[int, tuple[float, float]] = {}
    for line in text.splitlines():
        words = line.split(";")[0].split()
        if len(words) < 2 or words[0] == "Section":
            continue
        if words[0] == "IRUnit":
            eye = [_number(source, "IRUnit", word) for word in words[1:6]]
            if len(eye) < 5:
                raise ParametersError(
                    f"{source}: IRUnit needs a number, a type, cycles, x and y: {shown(line.strip())}"
                )
            infrared[int(eye[0])] = (eye[3], eye[4])
            continue
        if words[0] != "SonarUnit":
            values.setdefault(words[0], words[1])
            continue
        numbers = [_number(source, "SonarUnit", word) for word in words[1:5]]
        if len(numbers) < 4:
            raise ParametersError(f"{source}: SonarUnit needs a number, x, y and a heading: {shown(line.strip())}")
        sonar[int(numbers[0])] = (numbers[1], numbers[2], numbers[3])
    return values, sonar, infrared


def _equipment(source: str, values: Mapping[str, str]) -> Table:
    found: Table = {name: values[key].lower() == "true" for key, name in FLAGS.items() if key in values}
    for key, (count, name) in BUMPERS.items():
        if key in values:
            is_there = values[key].lower() == "true"
            found[name] = round(_number(source, count, values.get(count, "5"))) if is_there else 0
    return found


def _halves(table: Table, values: Mapping[str, str]) -> None:
    """Put half the length where the file says nothing of front and rear."""
    footprint = table.get("footprint", {})
    if "length_mm" in footprint and "RobotLengthFront" in values:
        half = footprint["length_mm"] // 2
        footprint.setdefault("front_mm", footprint["length_mm"] - half)
        footprint.setdefault("rear_mm", half)


def _positive(source: str, key: str, number: float, name: str) -> None:
    if number < 0 or (number == 0 and name not in {"max_lateral_mm_s", "fitted"}):
        raise ParametersError(f"{source}: {key} = {number:g} must be positive")


def _number(source: str, key: str, word: str) -> float:
    try:
        number = float(word)
    except ValueError as error:
        raise ParametersError(f"{source}: {key} = {shown(word)} is no number") from error
    if math.isnan(number):
        raise ParametersError(f"{source}: {key} = {shown(word)} is no number")
    if number and not SMALLEST <= abs(number) <= LARGEST:
        raise ParametersError(f"{source}: {key} = {shown(word)} is out of range")
    return number
