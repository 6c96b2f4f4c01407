"""The P2OS protocol: wire, commands, packets, connection, client and virtual robot.

`from p2os import Robot` is the blocking client. It is fetched on first use, so
that the protocol alone loads no port.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from p2os.client.robot import Robot

__all__ = ["Robot"]


def __getattr__(name: str) -> object:
    if name == "Robot":
        from p2os.client.robot import Robot

        return Robot
    raise AttributeError(f"module 'p2os' has no attribute {name!r}")
