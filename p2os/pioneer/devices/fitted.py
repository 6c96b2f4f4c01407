"""All devices that are fitted to one robot, saved and restored together."""

from dataclasses import dataclass, field

from p2os.pioneer.devices.aux_ports import PORTS, AuxPort
from p2os.pioneer.devices.battery import Battery
from p2os.pioneer.devices.gripper import ON_USER_IO, SWITCHES, VirtualGripper
from p2os.pioneer.devices.heading_sensors import Compass, Gyro
from p2os.pioneer.devices.joystick import Joystick
from p2os.pioneer.devices.laser import Laser
from p2os.pioneer.devices.pins import Pins
from simbase.timing import Nanos


@dataclass(slots=True)
class Switches:
    """What the firmware keeps in single bits and numbers."""

    #: BUMPSTALL: 0 off, 1 front, 2 rear, 3 both.
    bump_stall: int = 0
    #: E_STALL: the stop button causes a stall.
    e_stall: bool = False
    #: The red button is pressed.
    stop_button: bool = False
    #: The low battery has been reported, once a session.
    battery_reported: bool = False


@dataclass(slots=True)
class Devices:
    """The devices."""

    battery: Battery = field(default_factory=Battery)
    gripper: VirtualGripper = field(default_factory=VirtualGripper)
    pins: Pins = field(default_factory=Pins)
    joystick: Joystick = field(default_factory=Joystick)
    compass: Compass = field(default_factory=Compass)
    gyro: Gyro = field(default_factory=Gyro)
    aux: tuple[AuxPort, ...] = field(default_factory=lambda: tuple(AuxPort(number) for number in PORTS))
    laser: Laser = field(default_factory=Laser)
    switches: Switches = field(default_factory=Switches)

    def digital_in(self, now: Nanos) -> int:
        """Return the user's inputs; a gripper on them holds the lower six with its switches.

        ARIA reads such a gripper here and not in the gripper's own byte.
        """
        pins = self.pins.digital_in
        if self.gripper.kind != ON_USER_IO:
            return pins
        return pins & ~SWITCHES | int(self.gripper.state(now)) & SWITCHES
