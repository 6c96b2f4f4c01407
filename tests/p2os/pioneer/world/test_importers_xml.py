"""SDF and URDF: nested poses, included files, shapes in their places."""

# ruff: noqa: E501  # lines of XML stand as they are

import math
from pathlib import Path

import pytest

from p2os.errors import WorldError
from p2os.pioneer.world import load_world, parse_world
from p2os.pioneer.world.writer import write_world

CRATE = """<sdf version="1.7"><model name="crate"><static>true</static><pose>1 0 0 0 0 0</pose>
  <link name="l"><pose>0 1 0.5 0 0 0</pose><collision name="c"><pose>0 0 0 0 0 {turn}</pose><geometry>
    <box><size>2 1 1</size></box></geometry></collision>
    <visual name="v"><geometry><box><size>9 9 9</size></box></geometry></visual></link></model></sdf>"""
SDF = """<?xml version="1.0"?>
<sdf version="1.7"><world name="w">
  <include><uri>model://sun</uri></include>
  <light name="x"/>
  <include><uri>crate.sdf</uri><name>first</name><pose degrees="true">0 0 0 0 0 90</pose></include>
  <model name="house"><static>true</static><pose>10 0 0 0 0 0</pose>
    <model name="room"><pose>0 5 0 0 0 0</pose>
      <link name="l">
        <collision name="post"><pose>1 0 1 0 0 0</pose><geometry><cylinder><radius>0.1</radius><length>2</length></cylinder></geometry></collision>
        <collision name="ball"><pose relative_to="f">0 0 1 0 0 0</pose><geometry><sphere><radius>0.5</radius></sphere></geometry></collision>
        <collision name="ground"><geometry><plane><normal>0 0 1</normal></plane></geometry></collision>
        <collision name="hill"><geometry><heightmap/></geometry></collision>
        <collision name="slope"><pose>3 0 0 0 -0.1 0</pose><geometry><box><size>2 1 0.2</size></box></geometry></collision>
        <collision name="wedge"><geometry><mesh><uri>package://any/wedge.stl</uri><scale>2 2 2</scale></mesh></geometry></collision>
      </link></model></model>
</world></sdf>"""
WEDGE = (
    "solid w\nfacet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 0 1\nendloop\nendfacet\nendsolid w\n"
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "crate.sdf").write_text(CRATE.format(turn=0.5))
    (tmp_path / "wedge.stl").write_text(WEDGE)
    (tmp_path / "w.sdf").write_text(SDF)
    return tmp_path


def test_an_sdf_world_has_everything_in_its_place(folder: Path) -> None:
    world = load_world(folder / "w.sdf")
    crate, post = world.obstacles
    # Included with a quarter turn: (1, 1) goes to (-1, 1), and 0.5 rad are added.
    assert (crate.x_m, crate.y_m, crate.heading_rad) == pytest.approx((-1.0, 1.0, math.pi / 2 + 0.5))
    assert (crate.length_m, crate.base_m, crate.height_m, crate.name) == (2.0, 0.0, 1.0, "first: crate/l/c")
    assert (post.x_m, post.y_m, post.radius_m, post.base_m, post.height_m) == (11.0, 5.0, 0.1, 0.0, 2.0)
    ball, slope, wedge = world.meshes
    assert ball.bounds == (
        pytest.approx((9.5, 4.5, 0.5), abs=1e-9),
        pytest.approx((10.5, 5.5, 1.5), abs=1e-9),
    )
    # Nose up: the end at greater x is the higher one.
    high = max(slope.vertices, key=lambda vertex: vertex[2])
    assert high[0] > 13.5
    assert wedge.bounds[1] == pytest.approx((12.0, 5.0, 2.0))
    assert {line.split(": ", 1)[1].split(":")[0] for line in world.skipped} >= {"SDF <light>", "geometry <heightmap>"}
    assert any("relative_to" in line for line in world.skipped)
    assert parse_world(write_world(world), "again").meshes == world.meshes


URDF = """<robot name="scene">
  <link name="base"><visual><origin xyz="0 0 0.5"/><geometry><box size="1 1 1"/></geometry></visual></link>
  <link name="arm"><collision><geometry><cylinder radius="0.1" length="1"/></geometry></collision>
    <collision><origin xyz="1 0 0" rpy="1.5707963267948966 0 0"/><geometry><cylinder radius="0.1" length="1"/></geometry></collision>
    <visual><geometry><box size="9 9 9"/></geometry></visual></link>
  <link name="tip"><collision><geometry><mesh filename="wedge.stl" scale="1 1 2"/></geometry></collision></link>
  <joint name="j" type="revolute"><parent link="base"/><child link="arm"/><origin xyz="2 0 0.5" rpy="0 0 1.5707963267948966"/></joint>
  <joint name="k" type="fixed"><parent link="arm"/><child link="tip"/><origin xyz="1 0 0"/></joint>
</robot>"""


def test_a_urdf_stands_with_its_joints_at_zero(folder: Path) -> None:
    (folder / "a.urdf").write_text(URDF)
    world = load_world(folder / "a.urdf")
    base, arm = world.obstacles
    assert (base.x_m, base.base_m, base.height_m) == (0.0, 0.0, 1.0)
    assert (arm.x_m, arm.y_m, arm.base_m, arm.radius_m) == (2.0, 0.0, 0.0, 0.1)
    lying, tip = world.meshes
    # One metre ahead of the arm, which looks along y; its length lies along the arm's -y, that is x.
    assert lying.bounds[0] == pytest.approx((1.5, 0.9, 0.4), abs=1e-6)
    assert lying.bounds[1] == pytest.approx((2.5, 1.1, 0.6), abs=1e-6)
    assert tip.bounds[1] == pytest.approx((2.0, 2.0, 2.5))
    assert world.skipped == ("skipped: that joints move: each stands at its zero",)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.sdf", CRATE.replace("2 1 1", "2 1"), "needs 3 numbers, got 2"),
        ("a.sdf", CRATE.replace("2 1 1", "2 1 -1"), "must be above 0"),
        ("a.sdf", CRATE.replace("2 1 1", "2 1 nan"), "not finite"),
        ("a.sdf", CRATE.replace("1 0 0 0 0 0", "1e9 0 0 0 0 0"), "out of range"),
        ("a.sdf", "<sdf><include><uri>a.sdf</uri></include></sdf>", "include each other"),
        ("a.sdf", "<sdf><include/></sdf>", "without a <uri>"),
        ("a.sdf", "<sdf><include><uri>https://x/y</uri></include></sdf>", "not a local file"),
        ("a.sdf", "<sdf><include><uri>model://none</uri></include></sdf>", "which is not there"),
        ("a.sdf", "<sdf/>", "nothing in it"),
        ("a.sdf", "<sdf><model>" * 20 + "</model></sdf>" * 20, None),
        ("a.sdf", "<sdf>" + "<model>" * 20 + "</model>" * 20 + "</sdf>", "models within each other"),
        ("a.urdf", URDF.replace('parent link="base"', 'parent link="tip"'), "ring"),
        ("a.urdf", URDF.replace('<child link="arm"/>', ""), "has no child"),
        ("a.urdf", URDF.replace('parent link="base"', 'parent link="bse"'), "'j' names 'bse', which is no link here"),
        ("a.urdf", URDF.replace('child link="tip"', 'child link="tp"'), "'k' names 'tp', which is no link here"),
        ("a.urdf", URDF.replace('child link="tip"', 'child link="arm"'), "'arm' hangs on two joints"),
        ("a.urdf", URDF.replace('link name="tip"', 'link name="arm"'), "two links are named 'arm'"),
        ("a.urdf", URDF.replace("wedge.stl", "none.stl"), "which is not there"),
        ("a.urdf", URDF.replace("wedge.stl", ""), "names no file"),
        ("a.urdf", URDF.replace("wedge.stl", "a.urdf"), "no reader for this mesh"),
        ("a.urdf", URDF.replace('radius="0.1"', 'radius="0"'), "must be above 0"),
        ("a.urdf", "<sdf/>", "expected <robot>, got <sdf>"),
    ],
)
def test_a_broken_description_is_one_line(folder: Path, name: str, text: str, message: str | None) -> None:
    (folder / name).write_text(text.replace("{turn}", "0"))
    with pytest.raises(WorldError) as caught:
        load_world(folder / name)
    assert (message or "") in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_model_folder_is_found_by_its_name(folder: Path) -> None:
    (folder / "models" / "box").mkdir(parents=True)
    (folder / "models" / "box" / "model.sdf").write_text(CRATE.format(turn=0))
    (folder / "b.sdf").write_text("<sdf><include><uri>models/box</uri></include></sdf>")
    assert len(load_world(folder / "b.sdf").obstacles) == 1


@pytest.mark.parametrize("name", ["w.sdf", "a.urdf"])
def test_only_a_mesh_has_another_up_axis(folder: Path, name: str) -> None:
    from p2os.pioneer.world.placing import Placing
    from p2os.pioneer.world.readers import read_placed

    (folder / "a.urdf").write_text(URDF)
    with pytest.raises(WorldError, match="Z up"):
        read_placed(folder / name, Placing(up="y"))


def test_an_xml_file_cut_anywhere_is_refused(folder: Path) -> None:
    for length in range(0, len(SDF) - 10, 37):
        (folder / "cut.sdf").write_text(SDF[:length])
        with pytest.raises(WorldError):
            load_world(folder / "cut.sdf")
