"""The joystick that plugs into the robot, and how it drives.

Source: ARIA (JOYSTICKpac), Pioneer 2/3 H8 manual (JOYDRIVE). With its button
held the stick sets both speeds, as far as JOYVEL and JOYRVEL of the FLASH go.
"""

from dataclasses import dataclass

from p2os.protocol.packets import JoystickPacket

CENTRE, SPAN = 512, 512


@dataclass(slots=True)
class Joystick:
    """Where the stick stands; axes 0 to 1023, 512 in the middle."""

    x: int = CENTRE
    y: int = CENTRE
    throttle: int = 1023
    button1: int = 0
    button2: int = 0
    #: JOYDRIVE: the stick may drive while a client is connected.
    may_drive: bool = False
    #: Whether the last speeds were the stick's.
    drives: bool = False

    def packet(self) -> JoystickPacket:
        """Return the answer to JOYREQUEST."""
        return JoystickPacket(
            button1=self.button1, button2=self.button2, raw_x=self.x, raw_y=self.y, raw_throttle=self.throttle
        )

    def speeds(self, most_mm_s: int, most_deg_s: int) -> tuple[int, int]:
        """Return the speeds that the stick asks for, mm/s and deg/s; left is counter-clockwise."""
        return (self.y - CENTRE) * most_mm_s // SPAN, (CENTRE - self.x) * most_deg_s // SPAN
