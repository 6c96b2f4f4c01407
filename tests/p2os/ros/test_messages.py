"""The table of messages and their bytes, against the definitions and the serialiser of rosbags."""

import contextlib
import hashlib
import json
import math
import sys
from collections.abc import Iterable
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from p2os.errors import MissingDependencyError, RemoteProtocolError
from p2os.ros.codec import from_cdr, to_cdr
from p2os.ros.message_table import SERVICES, MessageField, message_type, standard_types
from p2os.ros.transport import NodeOptions
from p2os.ros.transports import TRANSPORTS, open_transport
from tests.p2os.ros.spoken_types import SPOKEN
from tests.tools.each_row import each_row

pytest.importorskip("cyclonedds", reason="the extra ros is not installed")
pytest.importorskip("rosbags", reason="the extra ros is not installed")
NUMBERS = {
    "bool": st.booleans(), "byte": st.integers(0, 255), "char": st.integers(0, 255), "uint8": st.integers(0, 255),
    "int32": st.integers(-(1 << 31), (1 << 31) - 1), "uint32": st.integers(0, (1 << 32) - 1),
    "float32": st.floats(width=32, allow_nan=False), "float64": st.floats(allow_nan=False),
    "string": st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=9),
}  # fmt: skip


def values(field: MessageField) -> st.SearchStrategy[Any]:
    """Return what a field may hold."""
    one = NUMBERS[field.kind] if field.kind in NUMBERS else messages(field.kind)
    if field.count is None:
        return one
    many = st.lists(one, min_size=field.count, max_size=field.count or 3)
    return many.map(bytes) if field.kind in {"byte", "char", "uint8"} else many


def messages(name: str) -> st.SearchStrategy[dict[str, Any]]:
    """Return messages of a type."""
    return st.fixed_dictionaries({field.name: values(field) for field in message_type(name).fields.values()})


#: A type whose strings are bounded to so many characters, of which the wire shows nothing.
BOUNDED_STRINGS, MOST_CHARACTERS, STRING, BOUNDED_STRING = "rmw_dds_common/msg/NodeEntitiesInfo", 256, 17, 21
#: Numbers of kinds in a type description (type_description_interfaces/msg/FieldType), and what an array adds.
KINDS = {
    "uint8": 3, "char": 3, "int32": 6, "uint32": 7, "int64": 8, "float32": 10, "float64": 11, "bool": 15, "byte": 16,
    "string": STRING,
}  # fmt: skip
NESTED, ARRAY, BOUNDED, SEQUENCE = 1, 48, 96, 144


def described(name: str, fields: Iterable[tuple[str, str, int | None]]) -> dict[str, Any]:
    """Return a type's description by REP 2016; a count below 0 is a bound."""
    rows = []
    for label, kind, count in fields:
        adds = 0 if count is None else SEQUENCE if count == 0 else ARRAY if count > 0 else BOUNDED
        row = {
            "type_id": KINDS.get(kind, NESTED) + adds, "capacity": abs(count or 0), "string_capacity": 0,
            "nested_type_name": "" if kind in KINDS else kind,
        }  # fmt: skip
        if name == BOUNDED_STRINGS and kind == "string":
            row |= {"type_id": BOUNDED_STRING, "string_capacity": MOST_CHARACTERS}
        rows.append({"name": label, "type": row})
    return {"type_name": name, "fields": rows}


def hash_of(name: str, known: dict[str, dict[str, Any]]) -> str:
    """Return the RIHS01 of a type."""
    named: set[str] = set()
    left = [name]
    while left:
        nested = {field["type"]["nested_type_name"] for field in known[left.pop()]["fields"]} - {""} - named
        named |= nested
        left += nested
    whole = {"type_description": known[name], "referenced_type_descriptions": [known[one] for one in sorted(named)]}
    return f"RIHS01_{hashlib.sha256(json.dumps(whole).encode()).hexdigest()}"


DESCRIBED = {
    name: described(name, ((field.name, field.kind, field.count) for field in message_type(name).fields.values()))
    for name in SPOKEN
}


#: Types whose hash is on the wire.
HASHED = sorted(name for name in SPOKEN if message_type(name).hash)


@each_row("name", HASHED)
def test_a_type_has_the_hash_that_its_fields_give(name: str) -> None:
    assert hash_of(name, DESCRIBED) == message_type(name).hash


@pytest.mark.parametrize("name", SERVICES)
def test_a_service_has_the_hash_that_its_halves_give(name: str) -> None:
    info = "service_msgs/msg/ServiceEventInfo"
    whole = {
        info: described(info, [("event_type", "uint8", None), ("stamp", "builtin_interfaces/msg/Time", None),
                               ("client_gid", "char", 16), ("sequence_number", "int64", None)]),
        f"{name}_Event": described(f"{name}_Event", [("info", info, None), ("request", f"{name}_Request", -1),
                                                     ("response", f"{name}_Response", -1)]),
        name: described(name, [("request_message", f"{name}_Request", None),
                               ("response_message", f"{name}_Response", None),
                               ("event_message", f"{name}_Event", None)]),
    }  # fmt: skip
    assert hash_of(name, DESCRIBED | whole) == SERVICES[name]


@pytest.mark.parametrize(
    ("name", "hash_"),
    [
        ("std_msgs/msg/String", "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"),
        ("std_msgs/msg/Empty", "20b625256f32d5dbc0d04fee44f43c41e51c70d3502f84b4a08e7a9c26a96312"),
        ("geometry_msgs/msg/Twist", "9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a"),
        ("nav_msgs/msg/Odometry", "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0"),
        ("sensor_msgs/msg/Range", "b42b62562e93cbfe9d42b82fe5994dfa3d63d7d5c90a317981703f7388adff3a"),
    ],
)
def test_the_hash_is_that_of_jazzys_generated_code(name: str, hash_: str) -> None:
    assert message_type(name).hash == f"RIHS01_{hash_}"


@settings(max_examples=25)
@given(st.data())
def test_a_message_is_written_as_an_independent_serialiser_writes_it_and_comes_back_whole(data: st.DataObject) -> None:
    rosbags = pytest.importorskip("rosbags.typesys", reason="rosbags is not installed")
    store = rosbags.get_typestore(rosbags.Stores.ROS2_JAZZY)
    name = data.draw(st.sampled_from(sorted(name for name in SPOKEN if name in store.fielddefs)))
    message = data.draw(messages(name))
    written = to_cdr(name, message)
    assert bytes(store.serialize_cdr(store.deserialize_cdr(written, name), name)) == written
    assert from_cdr(name, written) == message


def test_fields_that_are_left_out_are_zero() -> None:
    assert from_cdr("geometry_msgs/msg/Vector3", to_cdr("geometry_msgs/msg/Vector3", {"y": 1.5})) == {
        "x": 0.0, "y": 1.5, "z": 0.0,
    }  # fmt: skip


def test_a_field_that_the_type_has_not_is_refused() -> None:
    with pytest.raises(KeyError, match="Twist has no speed"):
        to_cdr("geometry_msgs/msg/Twist", {"speed": 1.0})


def test_ranges_without_an_echo_stay_infinite() -> None:
    written = to_cdr("sensor_msgs/msg/Range", {"range": math.inf})
    assert from_cdr("sensor_msgs/msg/Range", written)["range"] == math.inf


@settings(max_examples=100)
@given(st.sampled_from(SPOKEN), st.binary(max_size=80))
def test_hostile_bytes_are_a_message_or_a_refusal(name: str, data: bytes) -> None:
    with contextlib.suppress(RemoteProtocolError):
        assert from_cdr(name, b"\0\1\0\0" + data).keys() == message_type(name).fields.keys()


def test_each_cut_of_a_message_is_refused_or_is_no_twist_of_the_sender() -> None:
    whole = to_cdr("geometry_msgs/msg/Twist", {"linear": {"x": 1.0}, "angular": {"z": 2.0}})
    for cut in range(1, len(whole)):
        with pytest.raises(RemoteProtocolError):
            from_cdr("geometry_msgs/msg/Twist", whole[:cut])


@pytest.mark.parametrize("transport", TRANSPORTS)
def test_no_node_is_opened_without_the_definitions(monkeypatch: pytest.MonkeyPatch, transport: str) -> None:
    standard_types.cache_clear()
    monkeypatch.setitem(sys.modules, "rosbags.typesys", None)
    with pytest.raises(MissingDependencyError, match="ROS 2 messages need rosbags"):
        open_transport(transport, NodeOptions())
