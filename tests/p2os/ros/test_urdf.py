"""The URDF of each robot, read by programs of others, against TF."""

import math
from pathlib import Path
from typing import Any, cast
from xml.etree import ElementTree as ET

import pytest

from p2os.robots.parameters import known_robots, load_parameters
from p2os.ros.frames import BASE, Frames
from p2os.ros.urdf import urdf_text
from tests.tools.each_row import each_row


def joints(text: str) -> dict[str, tuple[str, list[float], list[float]]]:
    """Return child → parent, xyz and rpy, as any reader of XML finds them."""
    found = {}
    for joint in ET.fromstring(text).iter("joint"):  # noqa: S314 - our own text
        parent, child, origin = (joint.find(tag) for tag in ("parent", "child", "origin"))
        assert parent is not None
        assert child is not None
        assert origin is not None
        xyz, rpy = ([float(word) for word in origin.attrib[key].split()] for key in ("xyz", "rpy"))
        found[child.attrib["link"]] = parent.attrib["link"], xyz, rpy
    return found


@each_row("robot", known_robots())
def test_each_frame_of_tf_is_a_link_at_the_same_place(robot: str) -> None:
    parameters = load_parameters(robot)
    frames = Frames.of(parameters, "/r1")
    tree = joints(urdf_text(frames))
    places = [*frames.fixed(0, range(parameters.sonar_fitted)), *frames.moving(0, (0, 0, 0), (0.0, 0.0))[1:]]
    assert {cast("Any", one)["child_frame_id"] for one in places} == tree.keys()
    for one in cast("list[Any]", places):
        parent, xyz, rpy = tree[one["child_frame_id"]]
        moved, turned = one["transform"]["translation"], one["transform"]["rotation"]
        assert parent == one["header"]["frame_id"] == "r1/base_link"
        assert [moved[axis] for axis in "xyz"] == pytest.approx(xyz)
        assert rpy[:2] == [0, 0]
        assert abs(math.remainder(2 * math.atan2(turned["z"], turned["w"]) - rpy[2], math.tau)) < 1e-9


@pytest.mark.bullet
def test_an_engine_of_others_reads_the_joints_of_the_wheels(tmp_path: Path) -> None:
    engine = pytest.importorskip("pybullet")
    file = tmp_path / "p2dx.urdf"
    file.write_text(urdf_text(Frames.of(load_parameters("p2dx"), "")))
    client = engine.connect(engine.DIRECT)
    try:
        body = engine.loadURDF(str(file), physicsClientId=client)
        assert engine.getBodyInfo(body, physicsClientId=client)[0] == BASE.encode()
        count = engine.getNumJoints(body, physicsClientId=client)
        found = [engine.getJointInfo(body, number, physicsClientId=client) for number in range(count)]
    finally:
        engine.disconnect(client)
    turning = {info[1].decode(): info[12].decode() for info in found if info[2] == engine.JOINT_REVOLUTE}
    assert turning == {"left_wheel_joint": "left_wheel", "right_wheel_joint": "right_wheel"}
    assert {info[12].decode() for info in found} >= {f"sonar_{number}" for number in range(8)}
