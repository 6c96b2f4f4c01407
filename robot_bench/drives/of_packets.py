"""A drive out of the packets of a P2OS line: odometry, speeds, commands, sonar."""

from collections.abc import Iterable
from dataclasses import dataclass, field

from p2os.capture import Chunk, Direction, Reading, rows_of
from p2os.protocol.frames import CHECKSUM_BYTES, PREFIX_BYTES, Frame
from p2os.protocol.odometry import Odometry
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import StandardSip
from p2os.robots.parameters import RobotParameters
from robot_bench.drives.drive import Drive, DriveRows, Trajectory, steps_of
from simbase.errors import FileError, shown_name
from simbase.timing import NS_PER_S

#: Commands whose argument is looked at.
MOTION_COMMANDS = ("VEL", "RVEL", "VEL2", "MOVE", "HEAD", "DHEAD", "ENABLE", "STOP", "E_STOP", "SETA", "SETRA")
#: One that comes later than this after the last follows one that was lost, seconds: the CONFIGpac has a byte for it.
LONGEST_CYCLE_S = 0.255


@dataclass(slots=True, kw_only=True)
class Told(DriveRows):
    """What the packets of a line tell, row by row."""

    parameters: RobotParameters
    sonar: dict[int, list[tuple[float, float]]] = field(default_factory=dict)

    def take(self, chunks: Iterable[Chunk], profile: Profile) -> None:
        """Take all packets; a packet that is no sound SIP inside is passed over."""
        parameters = self.parameters
        odometry, metres_per_count = Odometry(parameters), parameters.range_nm_per_count / 1e9
        before = 0.0
        for row in rows_of(chunks, Reading(profile=profile, parameters=parameters)):
            at = row.at_ns / NS_PER_S
            if row.direction is Direction.TO_ROBOT:
                argument = row.fields.get("argument") if row.name in MOTION_COMMANDS else None
                if isinstance(argument, int):
                    self.commands.setdefault(row.name, []).append((at, float(argument)))
                continue
            if not row.is_sip:
                continue
            sip = StandardSip.from_frame(Frame(row.data[PREFIX_BYTES:-CHECKSUM_BYTES]), profile)
            odometry.update(sip)
            self.poses.append((at, odometry.x_m, odometry.y_m, odometry.heading_rad))
            conv = parameters.velocity_conv / 1000
            self.left.append((at, sip.raw_left_velocity * conv))
            self.right.append((at, sip.raw_right_velocity * conv))
            each_s = spread_s(len(sip.sonar), parameters.sonar_fitted, at - before)
            before = at
            for place, reading in enumerate(sip.sonar, 1 - len(sip.sonar)):
                metres = min(reading.raw_range * metres_per_count, parameters.sonar_range_m)
                self.sonar.setdefault(reading.number, []).append((at + place * each_s, metres))

    def into(self, drive: Drive) -> Drive:
        """Put it into a drive."""
        drive.odometry = Trajectory.of_rows(self.poses) if len({row[0] for row in self.poses}) > 1 else None
        drive.told_left_mps, drive.told_right_mps = steps_of(self.left), steps_of(self.right)
        drive.commands = {name: steps_of(pairs) for name, pairs in self.commands.items()}
        drive.sonar_m = {number: steps_of(pairs) for number, pairs in self.sonar.items()}
        return drive


def spread_s(readings: int, fitted: int, since_s: float) -> float:
    """Return how far apart the readings of a packet were taken, seconds: they fire in turn between two packets.

    Args:
        readings: How many the packet has; all at once where it has one of every sonar.
        fitted: How many sonar there are.
        since_s: Since the packet before.
    """
    return min(since_s, LONGEST_CYCLE_S) / readings if 1 < readings < fitted else 0.0


def drive_of_capture(
    name: str, chunks: Iterable[Chunk], parameters: RobotParameters, profile: Profile = Profile.P2OS
) -> Drive:
    """Return what a recorded conversation tells of a drive.

    Args:
        name: What it is called.
        chunks: What was said.
        parameters: The robot's units.
        profile: Its firmware family.

    Raises:
        FileError: It has no two standard packets.
    """
    told = Told(parameters=parameters)
    told.take(chunks, profile)
    drive = told.into(Drive(name=name, parameters=parameters))
    if drive.odometry is None:
        raise FileError(f"{shown_name(name)} holds no two standard packets of a robot", hint="p2os decode FILE")
    drive.left_mps, drive.right_mps = drive.told_left_mps, drive.told_right_mps
    return drive
