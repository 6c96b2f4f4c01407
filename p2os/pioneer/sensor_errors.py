"""How much the sensors err: every number of it, and the two sets that ship.

`ideal` errs in nothing. `realistic` is what a Pioneer's sensors do by rule of
thumb; each number is chosen, since no published measurement of a 2-DX was found.
A TOML file starts from one of them and changes what it names:

    based_on = "realistic"
    [sonar]
    noise_m = 0.02
    [odometry]
    left_wheel = 1.01

What acts where: `p2os.pioneer.sonar.errors` on the echoes, the odometer on the
wheel angles, the devices on compass, gyro and battery.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path

from p2os.toml_file import TomlPlaces, TomlSource, is_file, read_toml, read_user_text
from p2os.toml_schema import Key, TablePlace, filled, within
from simbase.errors import FileError, nearest, shown, shown_name


class SensorErrorsError(FileError):
    """A file of sensor errors is missing or breaks its schema."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SonarErrors:
    """The errors of a range."""

    #: Standard deviation of every echo, m, and its part of the range.
    noise_m: float = 0.0
    noise_part: float = 0.0
    #: Probability that an echo is lost.
    dropout: float = 0.0
    #: A surface met at more than this from the square sends no echo back, deg; 90 loses none.
    specular_deg: float = 90.0
    #: Probability that a sonar receives the ping of the one fired before it: the range is drawn anew, always nearer.
    crosstalk: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometryErrors:
    """The errors of dead reckoning: true size over the size that the firmware assumes."""

    left_wheel: float = 1.0
    right_wheel: float = 1.0
    track: float = 1.0
    #: Standard deviation of the heading after 1 m of way, deg: it grows with the root of the way.
    drift_deg: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class HeadingErrors:
    """The errors of compass and gyro."""

    compass_noise_deg: float = 0.0
    #: The same everywhere: iron of the robot itself.
    compass_bias_deg: float = 0.0
    #: Counts of the GYROpac; one is 0.95 deg/s.
    gyro_noise_counts: float = 0.0
    gyro_bias_counts: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class PowerErrors:
    """The errors of the voltmeter."""

    #: Ohms of battery and cables: the sag under load.
    battery_resistance_ohm: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorErrors:
    """All of them."""

    sonar: SonarErrors = SonarErrors()
    odometry: OdometryErrors = OdometryErrors()
    heading: HeadingErrors = HeadingErrors()
    power: PowerErrors = PowerErrors()


IDEAL = SensorErrors()
REALISTIC = SensorErrors(
    sonar=SonarErrors(noise_m=0.01, noise_part=0.005, dropout=0.01, specular_deg=25.0, crosstalk=0.005),
    odometry=OdometryErrors(left_wheel=1.002, right_wheel=0.999, drift_deg=0.4),
    heading=HeadingErrors(compass_noise_deg=2.0, compass_bias_deg=5.0, gyro_noise_counts=0.7, gyro_bias_counts=1.0),
    power=PowerErrors(battery_resistance_ohm=0.15),
)
SETS: Mapping[str, SensorErrors] = {"ideal": IDEAL, "realistic": REALISTIC}
#: Key → least and most; upper ends without another reason are chosen: what no sensor that works exceeds.
RANGES: Mapping[str, tuple[float, float]] = {
    "noise_m": (0, 10), "noise_part": (0, 10), "drift_deg": (0, 360), "compass_noise_deg": (0, 180),
    "gyro_noise_counts": (0, 512), "battery_resistance_ohm": (0, 10),
    "dropout": (0, 1), "crosstalk": (0, 1), "specular_deg": (0, 90), "left_wheel": (0.5, 2), "right_wheel": (0.5, 2),
    "track": (0.5, 2),
    "compass_bias_deg": (-180, 180), "gyro_bias_counts": (-512, 512),
}  # fmt: skip


def load_sensor_errors(name_or_path: str) -> SensorErrors:
    """Return a set that ships, or one from a file.

    Raises:
        SensorErrorsError: There is no such set or file, or it breaks the schema.
    """
    if name_or_path in SETS:
        return SETS[name_or_path]
    path = Path(name_or_path)
    if path.suffix != ".toml" and not is_file(path):
        hint = f"{nearest(name_or_path, SETS)}, or a TOML file"
        raise SensorErrorsError(f"no set of sensor errors {shown(name_or_path)}", hint=hint)
    text = read_user_text(path, "a set of sensor errors", SensorErrorsError, hint=f"sets: {', '.join(SETS)}")
    table, places = read_toml(text, shown_name(path), "a set of sensor errors", SensorErrorsError)
    return parse_sensor_errors(table, shown_name(path), places)


def parse_sensor_errors(table: Mapping[str, object], where: str, places: TomlPlaces | None = None) -> SensorErrors:
    """Return the errors that a table names, from its `based_on`.

    Args:
        table: As TOML gives it.
        where: What to call it in messages.
        places: Its lines; None where it was never a file.

    Raises:
        SensorErrorsError: The table breaks the schema.
    """
    place = TablePlace(TomlSource(where, places), error=SensorErrorsError)
    given = filled(table, _TOP, place)
    found = SETS[given.pop("based_on")]
    for section, values in given.items():
        part = getattr(found, section)
        keys = tuple(_key(item.name, getattr(part, item.name)) for item in fields(part))
        checked = {key: float(value) for key, value in filled(values, keys, within(place, section)).items()}
        found = replace(found, **{section: replace(part, **checked)})
    return found


_TOP = (
    Key(name="based_on", kind="text", choices=tuple(SETS), default="ideal"),
    *(Key(name=part.name, kind="table", default={}) for part in fields(SensorErrors)),
)


def _key(name: str, default: float) -> Key:
    least, most = RANGES[name]
    return Key(name=name, kind="number", least=least, most=most, default=default)
