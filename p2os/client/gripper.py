"""The gripper: its commands by name.

Source: Pioneer 2 gripper manual, command 33 and its arguments.
"""

from enum import IntEnum
from typing import Protocol

from p2os.commands import CommandNumber


class GripperAction(IntEnum):
    """The arguments of GRIPPER."""

    OPEN = 1
    CLOSE = 2
    STOP = 3
    LIFT_UP = 4
    LIFT_DOWN = 5
    LIFT_STOP = 6
    #: Close and lift, for driving.
    STORE = 7
    #: Lower and open, ready to grasp.
    DEPLOY = 8
    #: Stop paddles and lift.
    HALT = 15
    #: The grasping pressure; its value goes before it with GRIPPERVAL.
    PRESSURE = 16
    #: Lift for so long; its value goes before it with GRIPPERVAL.
    LIFT_CARRY = 17


class Sender(Protocol):
    """Sends one command with its argument."""

    def __call__(self, command: int, argument: int | bytes | None = None) -> None:
        """Send it."""


class Gripper:
    """Paddles and lift; what they do shows in GRIPPERpacs (`request`)."""

    def __init__(self, send: Sender) -> None:
        self._send = send

    def act(self, action: GripperAction) -> None:
        """Send any of the gripper's actions."""
        self._send(CommandNumber.GRIPPER, int(action))

    def open(self) -> None:
        """Open the paddles."""
        self.act(GripperAction.OPEN)

    def close(self) -> None:
        """Close the paddles until they grasp."""
        self.act(GripperAction.CLOSE)

    def stop(self) -> None:
        """Stop paddles and lift."""
        self.act(GripperAction.HALT)

    def lift_up(self) -> None:
        """Raise the lift."""
        self.act(GripperAction.LIFT_UP)

    def lift_down(self) -> None:
        """Lower the lift."""
        self.act(GripperAction.LIFT_DOWN)

    def store(self) -> None:
        """Close and lift, for driving."""
        self.act(GripperAction.STORE)

    def deploy(self) -> None:
        """Lower and open, ready to grasp."""
        self.act(GripperAction.DEPLOY)

    def set_pressure(self, value: int) -> None:
        """Set the grasping pressure, 0 to 255 of the gripper's own units."""
        self._send(CommandNumber.GRIPPERVAL, value)
        self.act(GripperAction.PRESSURE)

    def carry(self, value: int) -> None:
        """Move the lift for `value` times 20 ms, upwards where positive."""
        self._send(CommandNumber.GRIPPERVAL, value)
        self.act(GripperAction.LIFT_CARRY)

    def request(self, *, always: bool = False) -> None:
        """Ask for a GRIPPERpac, or for one a cycle; it comes as a `PacketArrived`."""
        self._send(CommandNumber.GRIPREQUEST, 2 if always else 1)
