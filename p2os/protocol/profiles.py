"""Firmware families, where they differ on the wire.

P2OS runs on Pioneer 2 with a C166 controller, AROS on the H8 and ARCOS on the
SH2 controllers that followed.
"""

from enum import Enum

from p2os.robots.parameters import RobotParameters


class Profile(Enum):
    """The family of a robot's firmware."""

    #: SIP ends at DIGOUT; analog port before gripper; word 16 is a servo's pulse width.
    P2OS = "P2OS"
    #: Gripper before analog port; word 16 holds flags.
    AROS = "AROS"
    #: As AROS, with a tail after DIGOUT.
    ARCOS = "ARCOS"

    @property
    def has_flags(self) -> bool:
        """Whether the SIP's word at offset 16 holds flags."""
        return self is not Profile.P2OS

    @property
    def has_gripper_first(self) -> bool:
        """Whether the gripper's byte stands before the analog port's."""
        return self is not Profile.P2OS


def profiles_of(parameters: RobotParameters) -> tuple[Profile, ...]:
    """Return the families of the firmware that a model had, its usual one first."""
    return tuple(map(Profile, parameters.firmware))
