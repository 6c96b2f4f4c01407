"""A simulated laser range finder: what it is, what a client sets of it, and its packets.

The simulator sends its readings on the robot's own line; no robot does that. ARIA sets the
field and the angle between readings itself, each as whole degrees or hundredths of one, and
places the laser by its own parameter file: so does the robot's file here.

Source: ARIA's simulated laser and AMRISim's robot models, from what they write and read.
Not modelled: noise, reflectors (every surface reflects alike), the time that a sweep takes.

Invariant: a sweep has no more than `MOST_READINGS`, whatever a client sets.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from p2os.pioneer.sonar.ring import Cone
from p2os.protocol.packets import SimLaserPacket
from simbase.errors import UsageError, shown
from simbase.units import ANGLE, LENGTH

#: AMRISim puts so many readings into a packet at the most.
READINGS_PER_PACKET = 32
#: chosen: a quarter of a degree over 270 degrees; a client could ask for 36,000.
MOST_READINGS = 1081
#: A range has 16 bits, mm.
FARTHEST_M = 65.535
#: chosen, as the driver of SICK's LMS1xx has it: what is nearer is no thing, for ROS.
NEAREST_M = 0.01
#: SIM_LRF_ENABLE: what 2 asks for.
EXTENDED = 2
#: What a surface without a reflector gives.
PLAIN_REFLECTANCE = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class LaserModel:
    """A laser's field, degrees from straight ahead, the right end first, and its ranges.

    Raises:
        UsageError: The field, the angle between readings or the range cannot be.
    """

    start_deg: int
    end_deg: int
    #: Angle between readings.
    step_cdeg: int
    range_m: float
    #: What is nearer a real one does not see; the simulated one sees it, and the laser's sheet says so to a program.
    nearest_m: float = NEAREST_M

    def __post_init__(self) -> None:
        if not -180 <= self.start_deg < self.end_deg <= 180:
            raise UsageError(f"a laser's field of {self.start_deg} to {self.end_deg} degrees is none", hint=HINT)
        if not 1 <= self.readings <= MOST_READINGS or not 0 < self.range_m <= FARTHEST_M:
            raise UsageError(
                f"a laser of {self.readings} readings to {self.range_m:g} m is none",
                hint=f"1 to {MOST_READINGS} readings, up to {FARTHEST_M} m",
            )

    @property
    def readings(self) -> int:
        """How many readings a sweep has."""
        return (self.end_deg - self.start_deg) * 100 // self.step_cdeg + 1


HINT = "--laser lms2xx, or field, angle between readings and range: --laser 180deg,1deg,8m"
#: Models by ARIA's names, as AMRISim has them. The nearest ranges are those of ROS' drivers of the same lasers (LMS1xx,
#: cob_sick_s300, sick_tim); that of the LMS-200 is chosen.
LASERS: Mapping[str, LaserModel] = {
    "lms2xx": LaserModel(start_deg=-90, end_deg=90, step_cdeg=100, range_m=32.767),
    "lms1XX": LaserModel(start_deg=-135, end_deg=135, step_cdeg=100, range_m=20.0),
    "s3series": LaserModel(start_deg=-135, end_deg=135, step_cdeg=50, range_m=30.0, nearest_m=0.001),
    "tim510": LaserModel(start_deg=-135, end_deg=135, step_cdeg=300, range_m=4.0, nearest_m=0.05),
}


def read_laser(text: str) -> LaserModel:
    """Return the laser that a text names, as `lms2xx` or `180deg,1deg,8m`.

    Raises:
        UsageError: It names none.
    """
    for name, model in LASERS.items():
        if text.lower() == name.lower():
            return model
    parts = text.split(",")
    if len(parts) != 3:
        raise UsageError(
            f"no laser {shown(text)}", hint=f"lasers: {', '.join(LASERS)}; or {HINT.rsplit(': ', maxsplit=1)[-1]}"
        )
    try:
        field, step, range_m = ANGLE.read(parts[0]), ANGLE.read(parts[1]), LENGTH.read(parts[2])
    except UsageError as error:
        raise UsageError(f"no laser {shown(text)}: {error}", hint=HINT) from error
    half, step_cdeg = round(math.degrees(field) / 2), round(math.degrees(step) * 100)
    if step_cdeg < 1:
        raise UsageError(f"no laser {shown(text)}: less than 0.01 degrees between readings", hint=HINT)
    return LaserModel(start_deg=-half, end_deg=half, step_cdeg=step_cdeg, range_m=range_m)


@dataclass(slots=True)
class Laser:
    """The laser of one robot; without a model there is none."""

    model: LaserModel | None = None
    #: SIM_LRF_ENABLE: 0 off, 1 plain packets, 2 extended ones.
    mode: int = 0
    start_deg: int = 0
    end_deg: int = 0
    step_cdeg: int = 1
    #: A client has set where the field begins, and not yet where it ends.
    is_end_due: bool = False
    #: The simulator has moved the robot since the last extended packet.
    has_jumped: bool = False

    @classmethod
    def of(cls, model: LaserModel | None) -> "Laser":
        """Return a laser that was just switched on."""
        if model is None:
            return cls()
        return cls(model, start_deg=model.start_deg, end_deg=model.end_deg, step_cdeg=model.step_cdeg)

    @property
    def is_fitted(self) -> bool:
        """Whether there is one."""
        return self.model is not None

    @property
    def range_m(self) -> float:
        """Its longest range, metres; what a reading shows where there is no echo."""
        return 0.0 if self.model is None else self.model.range_m

    def set_start(self, degrees: int) -> None:
        """Set where the field begins (SIM_LRF_SET_FOV_START), degrees from straight ahead."""
        self.start_deg, self.is_end_due = _within_turn(degrees), True

    def set_end(self, degrees: int) -> None:
        """Set where the field ends (SIM_LRF_SET_FOV_END)."""
        self.end_deg, self.is_end_due = _within_turn(degrees), False

    def set_step(self, hundredths: int) -> None:
        """Set the angle between readings (SIM_LRF_SET_RES), hundredths of a degree; below one it stays."""
        self.step_cdeg = hundredths if hundredths > 0 else self.step_cdeg

    def fan(self, x_mm: int, y_mm: int) -> Cone:
        """Return the rays of a sweep, from where the laser is on the robot."""
        count = min(max(self.end_deg - self.start_deg, 0) * 100 // self.step_cdeg + 1, MOST_READINGS)
        headings = tuple(math.radians(self.start_deg + ray * self.step_cdeg / 100) for ray in range(count))
        return Cone(x_mm / 1000, y_mm / 1000, headings, tuple((math.cos(way), math.sin(way)) for way in headings))

    def packets(self, ranges_m: Sequence[float], pose: tuple[float, float, float]) -> list[SimLaserPacket]:
        """Return the packets of a sweep.

        Args:
            ranges_m: The readings, the rightmost first.
            pose: The odometer's: mm, mm and degrees.
        """
        ranges_mm = [round(range_m * 1000) for range_m in ranges_m]
        x, y, heading = (_signed16(round(value)) for value in pose)
        sweep = SimLaserPacket(
            is_extended=self.mode == EXTENDED, total=len(ranges_mm), raw_pose=(x, y, heading),
            flags=int(self.has_jumped),
        )  # fmt: skip
        found = []
        for first in range(0, len(ranges_mm), READINGS_PER_PACKET):
            part = tuple(ranges_mm[first : first + READINGS_PER_PACKET])
            found.append(
                replace(
                    sweep, first=first, ranges_mm=part, reflectances=(PLAIN_REFLECTANCE,) * len(part),
                    flags_of_readings=(0,) * len(part), flags=sweep.flags if first == 0 else 0,
                )
            )  # fmt: skip
        self.has_jumped = self.has_jumped and self.mode != EXTENDED
        return found


def _within_turn(degrees: int) -> int:
    return min(max(degrees, -180), 180)


def _signed16(value: int) -> int:
    return (value + 0x8000) % 0x10000 - 0x8000
