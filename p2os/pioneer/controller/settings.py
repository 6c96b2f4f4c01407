"""The settings of a virtual robot: its firmware, its FLASH, its line, its sensors' errors."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum

from p2os.pioneer.controller.flash import FlashParameters
from p2os.pioneer.devices.laser import LASERS, LaserModel
from p2os.pioneer.sensor_errors import IDEAL, SensorErrors
from p2os.protocol.bauds import BAUDS, BAUDS_TEXT
from p2os.protocol.profiles import Profile, profiles_of
from p2os.protocol.times import CYCLE_NS, WATCHDOG_NS
from p2os.robots.parameters import RobotParameters
from simbase.errors import UsageError, shown
from simbase.timing import NS_PER_MS, Nanos

#: The CONFIGpac has one byte for the cycle.
LONGEST_SIP_PERIOD_MS = 255
#: A simulator's serial number: by it ARIA looks for no batteries, sonar boards or lasers on lines of their own.
SIMULATOR_SERIAL = "SIM"


class SonarPerSip(Enum):
    """How many sonar readings a standard packet carries."""

    #: Two new readings a cycle in ring order, as a Pioneer 2 sends them.
    TWO = "two"
    #: Every fitted sonar in every packet.
    ALL = "all"

    @property
    def pings_per_cycle(self) -> int | None:
        """Return the readings a packet, or None for all."""
        return 2 if self is SonarPerSip.TWO else None


@dataclass(frozen=True, slots=True, kw_only=True)
class ControllerSettings:
    """The settings of a virtual robot's firmware.

    Raises:
        UsageError: a value cannot be sent in the robot's packets.
    """

    #: In the answer to SYNC2; ARIA takes "MobileSim" for its own simulator, so any other name will do.
    name: str = "Virtual"
    serial: str = "VIRTUAL"
    #: Whose packets it sends; None: those of the first firmware that the model had.
    profile: Profile | None = None
    #: Answers syncs out of order and executes what any family or simulator knows, as AMRISim does.
    lenient: bool = False
    sip_period_ns: Nanos = CYCLE_NS
    watchdog_ns: Nanos = WATCHDOG_NS
    sonar_per_sip: SonarPerSip = SonarPerSip.TWO
    #: Also the sonar that are an option of the model, as ARIA's parameter file has them; the robot is made with them.
    rear_sonar: bool = False
    #: The battery's resting voltage at the start; it drains from there.
    battery_decivolts: int = 126
    #: Speed of the host's line, bit/s; None: a line that takes no time.
    baud: int | None = None
    flash: FlashParameters = field(default_factory=FlashParameters)
    errors: SensorErrors = IDEAL
    #: A simulated laser, as a simulator has it; then commands 35 to 38 are its setup, as ARIA sends it.
    laser: LaserModel | None = None
    #: Decides every random error.
    seed: int = 0

    def __post_init__(self) -> None:
        period_ms = self.sip_period_ns / NS_PER_MS
        if not 1 <= period_ms <= LONGEST_SIP_PERIOD_MS:
            raise UsageError(f"a packet every {period_ms:g} ms is not between 1 and {LONGEST_SIP_PERIOD_MS} ms")
        if not 0 <= self.battery_decivolts <= 0xFF:
            raise UsageError(f"a battery of {self.battery_decivolts / 10:g} V does not fit the packet (0 to 25.5 V)")
        if self.baud is not None and self.baud not in BAUDS:
            raise UsageError(f"a line of {self.baud} bit/s is none that HOSTBAUD names", hint=f"rates: {BAUDS_TEXT}")

    @classmethod
    def of(
        cls,
        *,
        client: str | None = None,
        firmware: Profile | None = None,
        lenient: bool | None = None,
        laser: LaserModel | None = None,
        all_sonar: bool = False,
        rear_sonar: bool | None = None,
        flash: FlashParameters | None = None,
        errors: SensorErrors = IDEAL,
        baud: int | None = None,
    ) -> "ControllerSettings":
        """Return what the options of `p2os serve` name, over what a client library expects; None leaves one as it is.

        Raises:
            UsageError: Nobody has written down what the client expects, or a value cannot be sent.
        """
        base = cls() if client is None else cls.for_client(client)
        found = replace(
            base, profile=firmware or base.profile, lenient=base.lenient if lenient is None else lenient,
            laser=laser or base.laser, sonar_per_sip=SonarPerSip.ALL if all_sonar else base.sonar_per_sip,
            rear_sonar=base.rear_sonar if rear_sonar is None else rear_sonar, errors=errors, baud=baud,
        )  # fmt: skip
        return found if flash is None else found.with_flash(flash)

    @classmethod
    def for_client(cls, name: str) -> "ControllerSettings":
        """Return what the programs of a client library expect of a simulated robot.

        Raises:
            UsageError: Nobody has written down what it expects.
        """
        if name not in CLIENTS:
            raise UsageError(f"no settings for {shown(name)}", hint=f"there are some for: {', '.join(CLIENTS)}")
        return CLIENTS[name]

    def family_of(self, parameters: RobotParameters) -> Profile:
        """Return whose packets a model sends with these settings."""
        return self.profile or profiles_of(parameters)[0]

    def with_flash(self, flash: FlashParameters) -> "ControllerSettings":
        """Return these settings with what a FLASH file sets."""
        return replace(
            self,
            flash=flash,
            name=flash.text("name"),
            serial=flash.text("serial"),
            sip_period_ns=flash.number("sipcycle") * NS_PER_MS,
            watchdog_ns=flash.number("watchdog") * NS_PER_MS,
        )


#: Client library → what its programs expect of a simulator, as they find it in MobileSim.
CLIENTS: Mapping[str, ControllerSettings] = {
    "aria": ControllerSettings(
        profile=Profile.ARCOS, lenient=True, sonar_per_sip=SonarPerSip.ALL, serial=SIMULATOR_SERIAL,
        laser=LASERS["lms2xx"], rear_sonar=True,
    ),
}  # fmt: skip
