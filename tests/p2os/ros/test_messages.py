"""The table of messages and their bytes, against the definitions and the serialiser of rosbags."""

import contextlib
import math
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from p2os.errors import RemoteProtocolError
from p2os.ros.codec import from_cdr, to_cdr
from p2os.ros.message_table import MESSAGES, Field

rosbags = pytest.importorskip("rosbags.typesys", reason="rosbags is not installed")
STORE = rosbags.get_typestore(rosbags.Stores.ROS2_JAZZY)
NUMBERS = {
    "bool": st.booleans(), "byte": st.integers(0, 255), "char": st.integers(0, 255), "uint8": st.integers(0, 255),
    "int32": st.integers(-(1 << 31), (1 << 31) - 1), "uint32": st.integers(0, (1 << 32) - 1),
    "float32": st.floats(width=32, allow_nan=False), "float64": st.floats(allow_nan=False),
    "string": st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=9),
}  # fmt: skip


def values(field: Field) -> st.SearchStrategy[Any]:
    """Return what a field may hold."""
    one = NUMBERS[field.kind] if field.kind in NUMBERS else messages(field.kind)
    if field.count is None:
        return one
    many = st.lists(one, min_size=field.count, max_size=field.count or 3)
    return many.map(bytes) if field.kind in {"byte", "char", "uint8"} else many


def messages(name: str) -> st.SearchStrategy[dict[str, Any]]:
    """Return messages of a type."""
    return st.fixed_dictionaries({field.name: values(field) for field in MESSAGES[name].fields})


@pytest.mark.parametrize("name", MESSAGES)
def test_a_type_has_the_hash_that_its_definition_gives(name: str) -> None:
    assert MESSAGES[name].hash == STORE.hash_rihs01(name)


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_a_message_is_written_as_an_independent_serialiser_writes_it_and_comes_back_whole(data: st.DataObject) -> None:
    name = data.draw(st.sampled_from(sorted(MESSAGES)))
    message = data.draw(messages(name))
    written = to_cdr(name, message)
    assert bytes(STORE.serialize_cdr(STORE.deserialize_cdr(written, name), name)) == written
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


@settings(max_examples=150, deadline=None)
@given(st.sampled_from(sorted(MESSAGES)), st.binary(max_size=80))
def test_hostile_bytes_are_a_message_or_a_refusal(name: str, data: bytes) -> None:
    with contextlib.suppress(RemoteProtocolError):
        assert from_cdr(name, b"\0\1\0\0" + data).keys() == {field.name for field in MESSAGES[name].fields}


def test_each_cut_of_a_message_is_refused_or_is_no_twist_of_the_sender() -> None:
    whole = to_cdr("geometry_msgs/msg/Twist", {"linear": {"x": 1.0}, "angular": {"z": 2.0}})
    for cut in range(1, len(whole)):
        with pytest.raises(RemoteProtocolError):
            from_cdr("geometry_msgs/msg/Twist", whole[:cut])
