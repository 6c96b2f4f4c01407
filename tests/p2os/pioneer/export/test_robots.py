"""Each robot as other programs get it: as many driven wheels as its table says, and a caster behind a single pair."""

import json
import math
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest

from p2os.pioneer.export import export
from p2os.pioneer.export.scene import JointKind
from p2os.pioneer.export.scenes import scene_of
from p2os.pioneer.world import load_world
from p2os.robots.parameters import ParametersError, RobotParameters, file_parameters, known_robots, load_parameters
from p2os.ros.frames import Frames
from p2os.ros.urdf import urdf_text
from tests.p2os.pioneer.export.exported import written
from tests.tools.each_row import each_row


def file_of(name: str, robot: RobotParameters) -> bytes:
    return export(name, None, robot).files[name]


def in_urdf(text: bytes | str) -> dict[str, float]:
    """Return the wheels that turn, and the torque of each, as any reader of XML finds them."""
    found = {}
    for joint in ET.fromstring(text).iter("joint"):  # noqa: S314 - our own text
        child, limit = joint.find("child"), joint.find("limit")
        if joint.attrib["type"] == "continuous" and child is not None and limit is not None:
            found[child.attrib["link"]] = float(limit.attrib["effort"])
    return found


def in_sdf(text: bytes) -> dict[str, float]:
    joints = ET.fromstring(text).iter("joint")  # noqa: S314 - our own text
    return {
        str(joint.findtext("child")): float(joint.findtext("axis/limit/effort") or math.nan)
        for joint in joints if joint.attrib["type"] == "continuous"
    }  # fmt: skip


def in_mjcf(text: bytes) -> dict[str, float]:
    root = ET.fromstring(text)  # noqa: S314 - our own text
    hinges = {joint.attrib["name"] for joint in root.iter("joint") if joint.attrib["type"] == "hinge"}
    motors = {motor.attrib["joint"]: float(motor.attrib["forcerange"].split()[1]) for motor in root.iter("velocity")}
    assert motors.keys() == hinges
    return motors


def in_gltf(text: bytes) -> dict[str, float]:
    nodes: list[dict[str, Any]] = json.loads(text)["nodes"]
    wheels = [node for node in nodes if "wheel_axis" in node.get("extras", {})]
    return {node["name"]: node["extras"]["torque_nm"] for node in wheels}


@each_row("name", known_robots())
def test_each_format_has_the_driven_wheels_of_the_robots_table(name: str) -> None:
    robot = load_parameters(name)
    made = [
        in_urdf(file_of("x.urdf", robot)), in_sdf(file_of("x.sdf", robot)), in_mjcf(file_of("x.xml", robot)),
        in_gltf(file_of("x.gltf", robot)),
    ]  # fmt: skip
    for wheels in made:
        assert len(wheels) == robot.equipment.wheels
        assert wheels == pytest.approx(dict.fromkeys(made[0], robot.body.motor_torque_nm))
    of_ros = in_urdf(urdf_text(Frames.of(robot, "")))
    assert [f"{frame}_joint" for frame in of_ros] == Frames.of(robot, "").joints
    assert list(of_ros.values()) == pytest.approx(list(made[0].values()))


@each_row("name", known_robots())
def test_a_robot_stands_on_its_wheels_and_weighs_what_its_table_says(name: str) -> None:
    robot = load_parameters(name)
    bodies = scene_of(None, robot).bodies
    wheels = [body.place for body in bodies if body.motion is JointKind.WHEEL]
    assert sum(body.mass_kg for body in bodies) == pytest.approx(robot.body.mass_kg)
    assert {place.z_m for place in wheels} == {robot.body.wheel_diameter_m / 2}
    assert sorted(place.y_m for place in wheels) == pytest.approx(sorted(-place.y_m for place in wheels))
    assert sum(place.x_m for place in wheels) == pytest.approx(0)
    casters = [body for body in bodies if body.name.endswith("caster")]
    assert len(casters) == (robot.equipment.wheels == 2)
    long, wide = (max(places) - min(places) for places in zip(*((one.x_m, one.y_m) for one in wheels), strict=True))
    if robot.equipment.wheels == 2:
        assert (long, wide) == (0, pytest.approx(robot.track_mm / 1000))
    else:
        assert robot.body.wheel_diameter_m < long < robot.body.hull_front_m + robot.body.hull_rear_m
        assert wide + robot.body.wheel_width_m <= robot.body.hull_width_m + 1e-9


def test_mujoco_drives_and_turns_a_robot_on_four_wheels(tmp_path: Path) -> None:
    mujoco = pytest.importorskip("mujoco")
    robot = load_parameters("p3at")
    model = mujoco.MjModel.from_xml_path(str(written(tmp_path, "room.xml", load_world("room"), robot)))
    data = mujoco.MjData(model)
    assert model.nu == 4

    def run(left: float, right: float, steps: int) -> tuple[float, float]:
        """Return the way and the turn while wheels are asked for these speeds, rad/s."""
        data.ctrl[:] = [left, right, left, right]
        for _ in range(500):
            mujoco.mj_step(model, data)
        x, heading = data.qpos[0], heading_of(data)
        for _ in range(steps):
            mujoco.mj_step(model, data)
        return float(data.qpos[0] - x), math.remainder(heading_of(data) - heading, math.tau)

    way, turn = run(4.0, 4.0, 500)
    assert way == pytest.approx(4 * robot.body.wheel_diameter_m / 2 * 0.5, rel=0.05)
    assert abs(turn) < 0.01
    _, turn = run(-3.0, 3.0, 500)
    assert turn > 0.1, "the wheels slip aside, and the robot turns to the left"


def heading_of(data: Any) -> float:
    w, x, y, z = data.qpos[3:7]
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


SIX = 'based_on = "p2at"\nsubclass = "six"\n[equipment]\nwheels = 6\n[body]\n'


def test_a_robot_of_a_users_file_has_as_many_axles_as_it_has_pairs_of_wheels(tmp_path: Path) -> None:
    file = tmp_path / "six.toml"
    file.write_text(SIX + "axle_distance_m = 0.4\nwheel_distance_m = 0.3\n")
    places = file_parameters(file).wheel_places
    assert [(one.name, one.x_m, one.y_m, one.is_left) for one in places[2:4]] == [
        ("axle 2 left wheel", 0.0, 0.15, True), ("axle 2 right wheel", 0.0, -0.15, False),
    ]  # fmt: skip
    assert [one.x_m for one in places[::2]] == pytest.approx([0.2, 0, -0.2])


def test_wheels_whose_places_no_file_says_stand_as_far_out_as_the_hull_reaches(tmp_path: Path) -> None:
    file = tmp_path / "four.toml"
    file.write_text('based_on = "p2dx"\nsubclass = "four"\n[equipment]\nwheels = 4\n')
    robot = file_parameters(file)
    front, rear = robot.wheel_places[0], robot.wheel_places[3]
    assert front.x_m - rear.x_m == pytest.approx(robot.body.hull_front_m + robot.body.hull_rear_m - 0.165)
    assert front.y_m - rear.y_m == pytest.approx(robot.body.hull_width_m - robot.body.wheel_width_m)


@pytest.mark.parametrize(("mass_kg", "is_sound"), [(6 * 0.8 + 0.2, False), (6 * 0.8 + 0.21, True)])
def test_a_robot_that_weighs_no_more_than_its_wheels_is_refused(mass_kg: float, is_sound: bool, tmp_path: Path) -> None:
    file = tmp_path / "six.toml"
    file.write_text(f"{SIX}mass_kg = {mass_kg}\n")
    if is_sound:
        assert file_parameters(file).body.mass_kg == mass_kg
    else:
        with pytest.raises(ParametersError, match=r"but wheels and caster have 5 kg"):
            file_parameters(file)
