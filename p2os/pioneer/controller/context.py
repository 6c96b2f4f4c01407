"""The parts of a robot that commands act on, saved and restored together.

No command is carried out here (`commands`), and nothing is sent (`reporter`).
"""

import math
from dataclasses import dataclass, field

from p2os.pioneer.controller.dead_reckoning import DeadReckoning
from p2os.pioneer.controller.faults import Faults
from p2os.pioneer.controller.motion import NM_PER_MM, UDEG_PER_DEG, Motion
from p2os.pioneer.controller.packet_requests import Requests
from p2os.pioneer.devices.fitted import Devices
from p2os.pioneer.random_source import RandomSource
from p2os.pioneer.sonar.schedule import SonarSchedule
from p2os.protocol.profiles import Profile
from simbase.state import Stateful
from simbase.timing import Nanos


@dataclass(slots=True)
class BumperWatch:
    """What the firmware's watch over its bumpers remembers."""

    #: When it looks next.
    next_ns: Nanos = 0
    #: Until when both wheels are reported as stalled by a bumper.
    stalled_until: Nanos = -1


@dataclass(slots=True, kw_only=True)
class Context(Stateful):
    """The parts of a robot that commands act on."""

    motion: Motion
    reckoning: DeadReckoning
    sonar: SonarSchedule
    vel2_divisor: int
    devices: Devices = field(default_factory=Devices)
    requests: Requests = field(default_factory=Requests)
    profile: Profile = Profile.P2OS
    #: Executes what any family knows.
    lenient: bool = False
    #: The joystick's full throw.
    joystick_mm_s: int = 0
    joystick_deg_s: int = 0
    low_battery_decivolts: int = 0
    #: Working values of the FLASH that a client has set, by the CONFIGpac's names.
    kept: dict[str, int] = field(default_factory=dict)
    faults: Faults = field(default_factory=Faults)
    bumper_watch: BumperWatch = field(default_factory=BumperWatch)
    random_source: RandomSource = field(default_factory=RandomSource)
    #: Where the odometry's own drift was drawn last, mm along the path.
    drifted_at_mm: float = 0.0
    # What a command leaves for the controller to do, within the same instant.
    #: Someone has asked for the configuration, and the answer has not been sent.
    config_wanted: bool = False
    #: HOSTBAUD's code.
    baud_wanted: int | None = None
    #: RESET or MAINTENANCE.
    restart_wanted: str | None = None
    #: SIM_SET_POSE: x and y in mm, heading in degrees.
    pose_wanted: tuple[int, int, int] | None = None
    #: SIM_RESET: back to where the robot began, the session goes on.
    sim_reset_wanted: bool = False
    #: LOADWORLD: the name of another world, as it came.
    world_wanted: bytes | None = None
    #: SIM_EXIT's code; stays, for whoever runs the robot.
    exit_code: int | None = None
    #: Events to be notified: (what in a word or two, detail).
    notes: list[tuple[str, str]] = field(default_factory=list)

    @property
    def heading_udeg(self) -> int:
        """Return how far the robot has turned since the start, in micro-degrees."""
        return round(math.degrees(self.reckoning.turned_rad) * UDEG_PER_DEG)

    @property
    def travel_nm(self) -> int:
        """Return how far the robot has driven along its path since the start, in nanometres."""
        return round(self.reckoning.travel_mm * NM_PER_MM)

    @property
    def motors_enabled(self) -> bool:
        """Tell whether the wheels have power."""
        return self.motion.is_powered

    def follow_joystick(self) -> None:
        """Follow the joystick while its button is held and it may drive; stop once when it no longer does."""
        stick = self.devices.joystick
        if stick.may_drive and stick.button1:
            speed, turn = stick.speeds(self.joystick_mm_s, self.joystick_deg_s)
            self.motion.set_velocity(speed)
            self.motion.set_rotation(turn)
            stick.drives = True
        elif stick.drives:
            stick.drives = False
            self.motion.stop()
