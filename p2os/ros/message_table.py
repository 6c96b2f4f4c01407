"""The ROS 2 messages that p2os speaks: fields and type hashes, as facts.

Not here: how a message is written (`codec`), nor which topic carries it (`topics`).

Source: the .msg files of common_interfaces 5.3, rcl_interfaces 2.0, geometry2 0.36 and rmw_dds_common 3.1 (Jazzy);
hashes by REP 2016 (RIHS01). They are the same from Humble to Lyrical but for `Range`, which has no `variance` in
Humble, and `Gid`, which has 24 bytes there.

Invariant: a type that a field names stands above it.
"""

from collections.abc import Mapping
from dataclasses import dataclass

#: What the types of the table begin with, to be written shorter.
_PACKAGES = {
    "builtin": "builtin_interfaces/msg/", "std": "std_msgs/msg/", "geo": "geometry_msgs/msg/",
    "sensor": "sensor_msgs/msg/", "diag": "diagnostic_msgs/msg/", "rmw": "rmw_dds_common/msg/",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Field:
    """One field of a message.

    Args:
        name: Its name.
        kind: A primitive of ROS IDL, or the name of a type of the table.
        count: Of an array of fixed length; 0 for any number, None for a single value.
    """

    name: str
    kind: str
    count: int | None = None


@dataclass(frozen=True, slots=True)
class MessageType:
    """One type: `nav_msgs/msg/Odometry`, its RIHS01 hash and its fields in the order of the wire.

    The hash is empty where none ever stands on the wire.
    """

    name: str
    hash: str
    fields: tuple[Field, ...]

    @property
    def dds_name(self) -> str:
        """What DDS and rmw_zenoh call it."""
        return dds_name(self.name)


def dds_name(name: str) -> str:
    """Return what DDS and rmw_zenoh call a type: `nav_msgs::msg::dds_::Odometry_`."""
    package, group, last = name.split("/")
    return f"{package}::{group}::dds_::{last}_"


def _type(name: str, hash_: str, *fields: str) -> MessageType:
    return MessageType(_full(name), f"RIHS01_{hash_}" if hash_ else "", tuple(_field(text) for text in fields))


def _full(name: str) -> str:
    start, slash, rest = name.partition("/")
    return f"{_PACKAGES.get(start, f'{start}/')}{rest}" if slash else name


def _field(text: str) -> Field:
    kind, name = text.split()
    kind, _, count = kind.removesuffix("]").partition("[")
    return Field(name, _full(kind), None if not text.split(maxsplit=1)[0].endswith("]") else int(count or 0))


_XYZ = ("float64 x", "float64 y", "float64 z")
_ROWS = (
    _type("builtin/Time", "b106235e25a4c5ed35098aa0a61a3ee9c9b18d197f398b0e4206cea9acf9c197",
          "int32 sec", "uint32 nanosec"),
    _type("std/Header", "f49fb3ae2cf070f793645ff749683ac6b06203e41c891e17701b1cb597ce6a01",
          "builtin/Time stamp", "string frame_id"),
    _type("std/Bool", "feb91e995ff9ebd09c0cb3d2aed18b11077585839fb5db80193b62d74528f6c9", "bool data"),
    _type("std/Int32", "b6578ded3c58c626cfe8d1a6fb6e04f706f97e9f03d2727c9ff4e74b1cef0deb", "int32 data"),
    _type("std/String", "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18", "string data"),
    # A structure of C cannot be empty: ROS IDL puts this member into those that are.
    _type("std/Empty", "20b625256f32d5dbc0d04fee44f43c41e51c70d3502f84b4a08e7a9c26a96312",
          "uint8 structure_needs_at_least_one_member"),
    _type("std/MultiArrayDimension", "5e773a60a4c7fc8a54985f307c7837aa2994252a126c301957a24e31282c9cbe",
          "string label", "uint32 size", "uint32 stride"),
    _type("std/MultiArrayLayout", "4c66e6f78e740ac103a94cf63259f968e48c617e7699e829b63c21a5cb50dac6",
          "std/MultiArrayDimension[] dim", "uint32 data_offset"),
    _type("std/UInt8MultiArray", "5687e861b8d307a5e48b7515467ae7a5fc2daf805bd0ce6d8e9e604bade9f385",
          "std/MultiArrayLayout layout", "uint8[] data"),
    _type("geo/Point", "6963084842a9b04494d6b2941d11444708d892da2f4b09843b9c43f42a7f6881", *_XYZ),
    _type("geo/Vector3", "cc12fe83e4c02719f1ce8070bfd14aecd40f75a96696a67a2a1f37f7dbb0765d", *_XYZ),
    _type("geo/Quaternion", "8a765f66778c8ff7c8ab94afcc590a2ed5325a1d9a076ffff38fbce36f458684", *_XYZ, "float64 w"),
    _type("geo/Pose", "d501954e9476cea2996984e812054b68026ae0bfae789d9a10b23daf35cc90fa",
          "geo/Point position", "geo/Quaternion orientation"),
    _type("geo/PoseWithCovariance", "9a7c0fd234b7f45c6098745ecccd773ca1085670e64107135397aee31c02e1bb",
          "geo/Pose pose", "float64[36] covariance"),
    _type("geo/Twist", "9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a",
          "geo/Vector3 linear", "geo/Vector3 angular"),
    _type("geo/TwistStamped", "5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64",
          "std/Header header", "geo/Twist twist"),
    _type("geo/TwistWithCovariance", "49f574f033f095d8b6cd1beaca5ca7925e296e84af1716d16c89d38b059c8c18",
          "geo/Twist twist", "float64[36] covariance"),
    _type("geo/Transform", "beb83fbe698636351461f6f35d1abb20010c43d55374d81bd041f1ba2581fddc",
          "geo/Vector3 translation", "geo/Quaternion rotation"),
    _type("geo/TransformStamped", "0a241f87d04668d94099cbb5ba11691d5ad32c2f29682e4eb5653424bd275206",
          "std/Header header", "string child_frame_id", "geo/Transform transform"),
    _type("nav_msgs/msg/Odometry", "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0",
          "std/Header header", "string child_frame_id", "geo/PoseWithCovariance pose",
          "geo/TwistWithCovariance twist"),
    _type("tf2_msgs/msg/TFMessage", "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",
          "geo/TransformStamped[] transforms"),
    _type("sensor/JointState", "a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e",
          "std/Header header", "string[] name", "float64[] position", "float64[] velocity", "float64[] effort"),
    _type("sensor/Range", "b42b62562e93cbfe9d42b82fe5994dfa3d63d7d5c90a317981703f7388adff3a",
          "std/Header header", "uint8 radiation_type", "float32 field_of_view", "float32 min_range",
          "float32 max_range", "float32 range", "float32 variance"),
    _type("sensor/PointField", "5c6a4750728c2bcfbbf7037225b20b02d4429634732146b742dee1726637ef01",
          "string name", "uint32 offset", "uint8 datatype", "uint32 count"),
    _type("sensor/PointCloud2", "9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5",
          "std/Header header", "uint32 height", "uint32 width", "sensor/PointField[] fields", "bool is_bigendian",
          "uint32 point_step", "uint32 row_step", "uint8[] data", "bool is_dense"),
    _type("sensor/BatteryState", "4bee5dfce981c98faa6828b868307a0a73f992ed0789f374ee96c8f840e69741",
          "std/Header header", "float32 voltage", "float32 temperature", "float32 current", "float32 charge",
          "float32 capacity", "float32 design_capacity", "float32 percentage", "uint8 power_supply_status",
          "uint8 power_supply_health", "uint8 power_supply_technology", "bool present", "float32[] cell_voltage",
          "float32[] cell_temperature", "string location", "string serial_number"),
    _type("sensor/Imu", "7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b",
          "std/Header header", "geo/Quaternion orientation", "float64[9] orientation_covariance",
          "geo/Vector3 angular_velocity", "float64[9] angular_velocity_covariance",
          "geo/Vector3 linear_acceleration", "float64[9] linear_acceleration_covariance"),
    _type("diag/KeyValue", "d68081eaa540288c5440753baecef0c4e16e81a5f78ad68902ded5100413bb42",
          "string key", "string value"),
    _type("diag/DiagnosticStatus", "b0e3e692ea2d54a8af2f4ef1930e81556a2db55216b771f8a7d2724ed47bf0e4",
          "byte level", "string name", "string message", "string hardware_id", "diag/KeyValue[] values"),
    _type("diag/DiagnosticArray", "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
          "std/Header header", "diag/DiagnosticStatus[] status"),
    _type("rosgraph_msgs/msg/Clock", "692f7a66e93a3c83e71765d033b60349ba68023a8c689a79e48078bcb5c58564",
          "builtin/Time clock"),
    _type("rcl_interfaces/msg/Log", "e28ce254ca8abc06abf92773b74602cdbf116ed34fbaf294fb9f81da9f318eac",
          "builtin/Time stamp", "uint8 level", "string name", "string msg", "string file", "string function",
          "uint32 line"),
    _type("rmw/Gid", "ab6f21cfbb0a6dbb837161e1110c2051a2850ed9f9c53944d7115d9bcebedf71", "char[16] data"),
    _type("rmw/NodeEntitiesInfo", "8ffef65ee2d088c63b1e8fcd31e800ba9fc8dbe0ee15ca60d1676de5218087a7",
          "string node_namespace", "string node_name", "rmw/Gid[] reader_gid_seq", "rmw/Gid[] writer_gid_seq"),
    _type("rmw/ParticipantEntitiesInfo", "91a0593bacdcc50ea9bdcf849a938b128412cc1ea821245c663bcd26f83c295e",
          "rmw/Gid gid", "rmw/NodeEntitiesInfo[] node_entities_info_seq"),
)  # fmt: skip

#: The halves of services; only a service as a whole has a hash on the wire.
_HALVES = (
    _type("std_srvs/srv/SetBool_Request", "", "bool data"),
    _type("std_srvs/srv/SetBool_Response", "", "bool success", "string message"),
    _type("std_srvs/srv/Trigger_Request", "", "uint8 structure_needs_at_least_one_member"),
    _type("std_srvs/srv/Trigger_Response", "", "bool success", "string message"),
)

#: Service → its hash, as the generated code of Jazzy's std_srvs has it.
SERVICES: Mapping[str, str] = {
    "std_srvs/srv/SetBool": "RIHS01_abe9e4bb6b41b40e6789712c00ec8871923e089af3f667a79992a428cff2da0a",
    "std_srvs/srv/Trigger": "RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f",
}

#: Name → type.
MESSAGES: Mapping[str, MessageType] = {row.name: row for row in (*_ROWS, *_HALVES)}
