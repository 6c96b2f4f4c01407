"""The parts of a robot that commands act on."""

import math
from dataclasses import dataclass, field, replace

from p2os.pioneer.chance import Chance
from p2os.pioneer.devices.rack import Rack
from p2os.pioneer.faults import Faults
from p2os.pioneer.motion import NM_PER_MM, UDEG_PER_DEG, Motion
from p2os.pioneer.odometry_counts import DeadReckoning
from p2os.pioneer.requests import Requests
from p2os.pioneer.sonar_schedule import SonarSchedule
from p2os.profiles import Profile
from p2os.timing import Nanos


@dataclass(slots=True)
class Guard:
    """What the firmware's watch over its bumpers remembers."""

    #: When it looks next.
    next_ns: Nanos = 0
    #: Until when both wheels are told to be stalled by a bumper.
    stalled_until: Nanos = -1


@dataclass(slots=True, kw_only=True)
class Works:
    """The parts of a robot that commands act on."""

    motion: Motion
    reckoning: DeadReckoning
    sonar: SonarSchedule
    vel2_divisor: int
    rack: Rack = field(default_factory=Rack)
    requests: Requests = field(default_factory=Requests)
    profile: Profile = Profile.P2OS
    #: Obeys what any family knows.
    lenient: bool = False
    #: The joystick's full throw.
    joystick_mm_s: int = 0
    joystick_deg_s: int = 0
    low_battery_decivolts: int = 0
    #: Working values of the FLASH that a client has set, by the CONFIGpac's names.
    kept: dict[str, int] = field(default_factory=dict)
    faults: Faults = field(default_factory=Faults)
    guard: Guard = field(default_factory=Guard)
    chance: Chance = field(default_factory=Chance)
    #: Where the odometry's own drift was drawn last, mm along the path.
    drifted_at_mm: float = 0.0
    # What a command leaves for the controller to do, within the same instant.
    #: Someone has asked for the configuration, and the answer has not been sent.
    config_wanted: bool = False
    #: HOSTBAUD's code.
    baud_wanted: int | None = None
    #: RESET or MAINTENANCE.
    restart_wanted: str | None = None
    #: To be told: (what in a word or two, detail).
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

    def let_the_stick_drive(self) -> None:
        """Follow the joystick while its button is held and it may drive; stop once when it no longer does."""
        stick = self.rack.joystick
        if stick.may_drive and stick.button1:
            speed, turn = stick.speeds(self.joystick_mm_s, self.joystick_deg_s)
            self.motion.set_velocity(speed)
            self.motion.set_rotation(turn)
            stick.drives = True
        elif stick.drives:
            stick.drives = False
            self.motion.stop()

    def snapshot(self) -> object:
        """Return all that decides the future; what a command leaves to be done is done by then."""
        return {
            "motion": self.motion.snapshot(),
            "reckoning": self.reckoning.snapshot(),
            "sonar": self.sonar.snapshot(),
            "rack": self.rack.snapshot(),
            "requests": self.requests.snapshot(),
            "kept": tuple(sorted(self.kept.items())),
            "faults": self.faults.copy(),
            "guard": replace(self.guard),
            "chance": self.chance.snapshot(),
            "drifted_at_mm": self.drifted_at_mm,
        }

    def restore(self, snapshot: object) -> None:
        """Put back what `snapshot` returned."""
        assert isinstance(snapshot, dict)  # noqa: S101  # our own value
        self.motion.restore(snapshot["motion"])
        self.reckoning.restore(snapshot["reckoning"])
        self.sonar.restore(snapshot["sonar"])
        self.rack.restore(snapshot["rack"])
        self.requests.restore(snapshot["requests"])
        self.kept = dict(snapshot["kept"])
        self.faults, self.guard = snapshot["faults"].copy(), replace(snapshot["guard"])
        self.chance.restore(snapshot["chance"])
        self.drifted_at_mm = snapshot["drifted_at_mm"]
