"""What a robot starts with, and comes back to when its session ends: devices and limits, from its FLASH."""

from collections.abc import Mapping
from dataclasses import replace

from p2os.parameters import RobotParameters
from p2os.pioneer.devices.battery import Battery
from p2os.pioneer.devices.rack import Rack
from p2os.pioneer.motion import MotionLimits
from p2os.pioneer.settings import ControllerSettings
from p2os.profiles import Profile

#: chosen: keeps a fresh battery above the half of a decivolt, so that it does not flicker.
BATTERY_MARGIN_V = 0.04
#: FLASH parameter → the limit that it sets.
LIMITS = {
    "transveltop": "top_velocity_mm_s", "rotveltop": "top_rotation_deg_s", "transvelmax": "max_velocity_mm_s",
    "rotvelmax": "max_rotation_deg_s", "transacc": "accel_mm_s2", "transdecel": "decel_mm_s2",
    "rotacc": "rot_accel_deg_s2", "rotdecel": "rot_decel_deg_s2",
}  # fmt: skip


def new_rack(settings: ControllerSettings) -> Rack:
    """Return the devices of a robot that was just switched on."""
    flash = settings.flash
    rack = Rack(
        battery=Battery.resting_at(
            settings.battery_decivolts / 10 + BATTERY_MARGIN_V, settings.errors.power.battery_resistance_ohm
        )
    )
    rack.gripper.kind = flash.number("gripper")
    rack.gyro.is_fitted = flash.number("hasgyro") > 0 and settings.profile is not Profile.P2OS
    rack.switches.e_stall = settings.profile is not Profile.P2OS
    return rack


def limits_of(parameters: RobotParameters, values: Mapping[str, int | str]) -> MotionLimits:
    """Return the limits with which a robot starts: those of its file, but for what its FLASH says."""
    limits = MotionLimits.of(parameters)
    found = {mine: value for name, mine in LIMITS.items() if isinstance(value := values.get(name), int)}
    return replace(limits, **found)
