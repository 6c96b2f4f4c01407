"""The transports by their names; each is imported when it is opened."""

from collections.abc import Callable, Mapping

from p2os.ros.message_table import standard_types
from p2os.ros.transport import NodeOptions, RosTransport
from simbase.errors import UsageError, shown


def _dds(options: NodeOptions) -> RosTransport:
    from p2os.ros.dds import DdsNode

    return DdsNode(options)


def _zenoh(options: NodeOptions) -> RosTransport:
    from p2os.ros.zenoh_node import ZenohNode

    return ZenohNode(options)


#: Name → what opens it.
TRANSPORTS: Mapping[str, Callable[[NodeOptions], RosTransport]] = {"dds": _dds, "zenoh": _zenoh}


def open_transport(name: str, options: NodeOptions) -> RosTransport:
    """Return a node of a transport.

    Raises:
        UsageError: There is no such transport.
        MissingDependencyError: It is not installed, or rosbags is not.
        TransportError: Its network cannot be had.
    """
    if name not in TRANSPORTS:
        raise UsageError(f"there is no transport {shown(name)}", hint=" or ".join(TRANSPORTS))
    standard_types()  # now, and not with the first message, when the robot is there
    return TRANSPORTS[name](options)
