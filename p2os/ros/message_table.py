"""The ROS 2 messages that p2os speaks: fields and type hashes, as rosbags has them of ROS 2 Jazzy (extra `ros`).

Not here: how a message is written (`codec`), nor which topic carries it (`topics`).

They are the same from Humble to Lyrical but for `Range`, which has no `variance` in Humble, and `Gid`, which has 24
bytes there. Hashes are by REP 2016 (RIHS01).

Source: rosbags' type store, but for services and for rmw_dds_common 3.1, of which rosbags takes `char` for another
type than the generated code does.

Invariant: a type that a field names is a type of this module too.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

from p2os.errors import MissingDependencyError

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore


@dataclass(frozen=True, slots=True)
class MessageField:
    """One field of a message.

    Args:
        name: Its name.
        kind: A primitive of ROS IDL, or the name of a type.
        count: Of an array of fixed length; 0 for any number, None for a single value.
    """

    name: str
    kind: str
    count: int | None = None


@dataclass(frozen=True, slots=True)
class MessageType:
    """One type: `nav_msgs/msg/Odometry`, its RIHS01 hash and its fields by name, in the order of the wire.

    The hash is empty where none ever stands on the wire.
    """

    name: str
    hash: str
    fields: Mapping[str, MessageField]

    @property
    def dds_name(self) -> str:
        """What DDS and rmw_zenoh call it."""
        return dds_name(self.name)


def dds_name(name: str) -> str:
    """Return what DDS and rmw_zenoh call a type: `nav_msgs::msg::dds_::Odometry_`."""
    package, group, last = name.split("/")
    return f"{package}::{group}::dds_::{last}_"


@cache
def standard_types() -> "Typestore":
    """Return the messages of ROS 2 Jazzy, as rosbags has them.

    Raises:
        MissingDependencyError: rosbags is not installed.
    """
    try:
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise MissingDependencyError("ROS 2 messages need rosbags", extra="ros") from error
    return get_typestore(Stores.ROS2_JAZZY)


@cache
def message_type(name: str) -> MessageType:
    """Return a type by its name, such as `nav_msgs/msg/Odometry`.

    Raises:
        MissingDependencyError: rosbags is not installed.
        KeyError: There is no such type.
    """
    if name in _OWN:
        return _OWN[name]
    store = standard_types()
    return _type(name, store.hash_rihs01(name), *(_field(field, *kind) for field, kind in store.fielddefs[name][1]))


def _field(name: str, node: int, inner: Any) -> MessageField:  # as rosbags nests them
    from rosbags.interfaces import Nodetype

    count = None
    if node in {Nodetype.ARRAY, Nodetype.SEQUENCE}:
        (node, inner), count = inner
    return MessageField(name, inner if node == Nodetype.NAME else inner[0], count)


def _type(name: str, hash_: str, *fields: MessageField) -> MessageType:
    return MessageType(name, hash_, {field.name: field for field in fields})


_GID = "rmw_dds_common/msg/Gid"
_NODE = "rmw_dds_common/msg/NodeEntitiesInfo"
#: What rosbags has not, or not as it stands on the wire; of services only the whole has a hash there.
_OWN = {row.name: row for row in (
    _type(_GID, "RIHS01_ab6f21cfbb0a6dbb837161e1110c2051a2850ed9f9c53944d7115d9bcebedf71",
          MessageField("data", "char", 16)),
    _type(_NODE, "RIHS01_8ffef65ee2d088c63b1e8fcd31e800ba9fc8dbe0ee15ca60d1676de5218087a7",
          MessageField("node_namespace", "string"), MessageField("node_name", "string"),
          MessageField("reader_gid_seq", _GID, 0), MessageField("writer_gid_seq", _GID, 0)),
    _type("rmw_dds_common/msg/ParticipantEntitiesInfo",
          "RIHS01_91a0593bacdcc50ea9bdcf849a938b128412cc1ea821245c663bcd26f83c295e",
          MessageField("gid", _GID), MessageField("node_entities_info_seq", _NODE, 0)),
    _type("std_srvs/srv/SetBool_Request", "", MessageField("data", "bool")),
    _type("std_srvs/srv/SetBool_Response", "", MessageField("success", "bool"), MessageField("message", "string")),
    # A structure of C cannot be empty: ROS IDL puts this member into those that are.
    _type("std_srvs/srv/Trigger_Request", "", MessageField("structure_needs_at_least_one_member", "uint8")),
    _type("std_srvs/srv/Trigger_Response", "", MessageField("success", "bool"), MessageField("message", "string")),
)}  # fmt: skip

#: Service → its hash, as the generated code of Jazzy's std_srvs has it.
SERVICES: Mapping[str, str] = {
    "std_srvs/srv/SetBool": "RIHS01_abe9e4bb6b41b40e6789712c00ec8871923e089af3f667a79992a428cff2da0a",
    "std_srvs/srv/Trigger": "RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f",
}
