"""How a capture is to be read: whose units, and which firmware's layouts; given, or found in what the robot says.

A robot gives its model in answer to SYNC2. A SIP longer than its sonar readings need has the tail that only ARCOS
sends; AROS and P2OS have the same shape, and what is neither given nor found is P2OS of a Pioneer 2-DX.
"""

from dataclasses import dataclass

from p2os.protocol.frames import Frame
from p2os.protocol.packets import IDENTITY_KIND, Identity
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import COUNT_AT, HEAD_BYTES, READING_BYTES, SIP_KINDS
from p2os.robots.parameters import ParametersError, RobotParameters, load_parameters

DEFAULT_ROBOT = "p2dx"


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """How a capture is to be read: the firmware's family, and whose units."""

    profile: Profile
    parameters: RobotParameters


class FollowedReading:
    """The reading of a conversation, as far as it has gone.

    Args:
        robot: Model or file; empty: what the robot says.
        profile: Firmware family; None: as the packets look.

    Raises:
        ParametersError: There is no such model or file.
    """

    def __init__(self, robot: str = "", profile: Profile | None = None) -> None:
        self._has_robot, self._has_profile = bool(robot), profile is not None
        self._has_sip = self._has_identity = False
        #: For the packet that was taken last, and what follows.
        self.reading = Reading(profile=profile or Profile.P2OS, parameters=load_parameters(robot or DEFAULT_ROBOT))

    @property
    def is_settled(self) -> bool:
        """Whether no packet of this robot will change it: what is not given was seen."""
        return (self._has_robot or self._has_identity) and (self._has_profile or self._has_sip)

    def take(self, payload: bytes) -> None:
        """Take the payload of a packet that the robot has sent."""
        kind = payload[0]
        if kind == IDENTITY_KIND and len(payload) > 1:
            self._take_identity(Identity.from_frame(Frame(payload)).subclass.lower())
        elif kind in SIP_KINDS and len(payload) >= HEAD_BYTES:
            has_tail = len(payload) > HEAD_BYTES + READING_BYTES * payload[COUNT_AT]
            if not self._has_profile and (has_tail or not self._has_sip):
                self._read(profile=Profile.ARCOS if has_tail else Profile.P2OS)
            self._has_sip = True

    def _take_identity(self, subclass: str) -> None:
        self._has_identity, self._has_sip = True, False  # a session begins, maybe with another robot
        if not self._has_robot:
            try:
                parameters = load_parameters(subclass or DEFAULT_ROBOT)
            except ParametersError:
                parameters = load_parameters(DEFAULT_ROBOT)
            self._read(parameters=parameters)

    def _read(self, *, profile: Profile | None = None, parameters: RobotParameters | None = None) -> None:
        """Change the reading, where that changes anything."""
        new = Reading(profile=profile or self.reading.profile, parameters=parameters or self.reading.parameters)
        if new != self.reading:
            self.reading = new
