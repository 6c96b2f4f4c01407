"""What is exported comes back: by our own readers, and by the programs that the formats belong to."""

import math
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given, settings

from p2os.pioneer.export import scene_of
from p2os.pioneer.export.scene import Box, Cylinder, ExportScene, SceneBody, Sphere, TriangleMesh
from p2os.pioneer.export.triangles import triangulated
from p2os.pioneer.world import known_worlds, load_world, parse_world
from p2os.pioneer.world.interchange.transform import IDENTITY, Transform, after, apply
from p2os.pioneer.world.model import World
from p2os.robots.parameters import known_robots, load_parameters
from tests.p2os.pioneer.export.exported import differences, expected, worlds, written
from tests.tools.each_row import each_row

P2DX = load_parameters("p2dx")


@settings(max_examples=25)
@given(world=worlds())
@pytest.mark.parametrize("name", ["made.sdf", "made.urdf"])
def test_our_own_readers_give_back_the_world_that_was_exported(name: str, world: World) -> None:
    with TemporaryDirectory() as folder:
        again = load_world(written(Path(folder), name, world))
    assert differences(expected(world), again) == []
    assert again.skipped == ()


@pytest.mark.parametrize("ending", [".sdf", ".urdf"])
@pytest.mark.parametrize("name", known_worlds())
def test_a_shipped_world_with_a_robot_at_its_start_comes_back_without_the_robot(
    name: str, ending: str, tmp_path: Path
) -> None:
    world = load_world(name, 3)
    again = load_world(written(tmp_path, f"{name}{ending}", world, P2DX))
    walkers = {item.name for item in world.obstacles if item.walk is not None}
    assert [line for line in differences(expected(world), again) if not any(name in line for name in walkers)] == []


@pytest.mark.parametrize("ending", [".gltf", ".glb", ".sdf", ".urdf"])
def test_the_largest_world_comes_back(ending: str, tmp_path: Path) -> None:
    wall = '[[wall]]\nname = "w"\nfrom_m = [-9999.9, 0]\nto_m = [9999.9, 0]\n'
    extent = "extent_m = [-10000, -10000, 10000, 10000]\n"
    world = parse_world(f'name = "far"\n{extent}[start]\nx_m = 0\ny_m = 5\n{wall}', "far")
    again = load_world(written(tmp_path, f"far{ending}", world))
    assert again.extent == world.extent
    xs = [x for mesh in again.meshes for x, _, _ in mesh.vertices] or [item.reach_m for item in again.obstacles]
    assert max(xs) == pytest.approx(10_000.0, abs=0.2)


@settings(max_examples=20)
@given(world=worlds())
def test_gltf_gives_back_the_triangles_of_every_shape_in_its_place(world: World) -> None:
    with TemporaryDirectory() as folder:
        (mesh,), (binary,) = (load_world(written(Path(folder), f"made.{end}", world)).meshes for end in ("gltf", "glb"))
    assert (binary.vertices, binary.triangles) == (mesh.vertices, mesh.triangles)
    found = [mesh.vertices[index] for triangle in mesh.triangles for index in triangle]
    wanted = []
    for body in scene_of(world, None).bodies:
        shape = triangulated(body.shape)
        corners = apply(after(body.place.transform, body.at.transform), shape.vertices)
        wanted += [corners[index] for triangle in shape.triangles for index in triangle]
    # 32-bit numbers below 100 m: 4 um each in a shape's own place, and the reader leaves out what has no area.
    assert len(found) <= len(wanted)
    wanted_rows = iter(wanted)
    for corner in found:
        assert any(math.dist(corner, other) < 5e-5 for other in wanted_rows)


def world_places(scene: ExportScene) -> dict[str, Transform]:
    """Return where each body's frame is in the world."""
    places: dict[str | None, Transform] = {None: IDENTITY}
    for body in scene.bodies:
        places[body.name] = after(places[body.parent], body.place.transform)
    return {name: place for name, place in places.items() if name is not None}


def flat(place: Transform) -> list[float]:
    return [value for row in place for value in row[:3]]


def origin(place: Transform) -> list[float]:
    return [row[3] for row in place]


def sizes_in_mujoco(body: SceneBody) -> list[float]:
    if isinstance(body.shape, Box):
        return [size / 2 for size in body.shape.size_m]
    if isinstance(body.shape, Cylinder):
        return [body.shape.radius_m, body.shape.length_m / 2]
    assert isinstance(body.shape, Sphere)
    return [body.shape.radius_m]


@settings(max_examples=15)
@given(world=worlds())
def test_mujoco_reads_the_same_shapes_poses_masses_and_frictions(world: World) -> None:
    mujoco = pytest.importorskip("mujoco")
    with TemporaryDirectory() as folder:
        model = mujoco.MjModel.from_xml_path(str(written(Path(folder), "made.xml", world, P2DX)))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    scene = scene_of(world, P2DX)
    places = world_places(scene)
    assert model.ngeom == len(scene.bodies)
    for body in scene.bodies:
        geom, at = model.geom(body.name), after(places[body.name], body.at.transform)
        assert geom.friction[0] == pytest.approx(body.friction)
        assert model.body(body.name).mass[0] == pytest.approx(body.mass_kg)
        if isinstance(body.shape, TriangleMesh):  # the engine turns a mesh to its own axes
            continue
        assert list(geom.size[: len(sizes_in_mujoco(body))]) == pytest.approx(sizes_in_mujoco(body))
        assert list(data.geom(body.name).xpos) == pytest.approx(origin(at), abs=1e-9)
        assert list(data.geom(body.name).xmat) == pytest.approx(flat(at), abs=1e-9)


def test_mujoco_moves_an_exported_robot_as_fast_as_its_wheels_turn(tmp_path: Path) -> None:
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_path(str(written(tmp_path, "room.xml", load_world("room"), P2DX)))
    data = mujoco.MjData(model)
    assert sum(model.body_mass) == pytest.approx(P2DX.body.mass_kg)
    data.ctrl[:] = 4.0  # rad/s
    for _ in range(500):
        mujoco.mj_step(model, data)
    before = data.qpos[0]
    for _ in range(1000):
        mujoco.mj_step(model, data)
    # 4 rad/s on wheels of 82.5 mm: 0.33 m in a second; the motor of a velocity servo lags a little.
    assert data.qpos[0] - before == pytest.approx(4 * P2DX.body.wheel_diameter_m / 2, rel=0.05)
    assert abs(data.qpos[1]) < 0.01
    assert abs(data.qpos[2]) < 0.005


def test_pybullet_reads_the_same_shapes_poses_masses_and_frictions(tmp_path: Path) -> None:
    pybullet = pytest.importorskip("pybullet")
    world = load_world("office", 1)
    path = written(tmp_path, "office.urdf", world, P2DX)
    scene = scene_of(world, P2DX)
    places, bodies = world_places(scene), {body.name: body for body in scene.bodies}
    client = pybullet.connect(pybullet.DIRECT)
    try:
        flags = pybullet.URDF_USE_IMPLICIT_CYLINDER  # else a cylinder is a hull of many corners
        robot = pybullet.loadURDF(str(path), useFixedBase=True, flags=flags, physicsClientId=client)
        seen = 0
        for link in range(pybullet.getNumJoints(robot, physicsClientId=client)):
            body = bodies.get(pybullet.getJointInfo(robot, link, physicsClientId=client)[12].decode())
            dynamics = pybullet.getDynamicsInfo(robot, link, physicsClientId=client)
            if body is None:  # a sonar's place
                assert dynamics[0] == 0
                continue
            seen += 1
            assert dynamics[1] == pytest.approx(body.friction)
            assert dynamics[0] == pytest.approx(body.mass_kg)
            place = pybullet.getLinkState(robot, link, physicsClientId=client)[4]
            assert list(place) == pytest.approx(origin(places[body.name]), abs=1e-6)
            (shape,) = pybullet.getCollisionShapeData(robot, link, physicsClientId=client)
            if isinstance(body.shape, Box):
                assert shape[3] == pytest.approx(body.shape.size_m)
            elif isinstance(body.shape, Cylinder):
                assert shape[3][:2] == pytest.approx((body.shape.length_m, body.shape.radius_m))
        assert seen == len(scene.bodies)
    finally:
        pybullet.disconnect(client)


@pytest.mark.parametrize("ending", [".gltf", ".glb"])
def test_trimesh_reads_the_same_nodes_with_y_up(ending: str, tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    world = load_world("ramp")
    scene = trimesh.load(written(tmp_path, f"ramp{ending}", world, P2DX))
    assert {body.name for body in scene_of(world, P2DX).bodies} <= set(scene.graph.nodes)
    # The floor reaches 1 m beyond the extent and 0.5 m down; the walls are 1.5 m high; y becomes -z.
    (x0, y0, z0), (x1, y1, z1) = scene.bounds.tolist()
    assert (x0, x1, -z1, -z0) == pytest.approx((-2.6, 9.8, -2.5, 7.4), abs=1e-5)
    assert (y0, y1) == pytest.approx((-0.5, 1.5), abs=1e-5)
    assert all(mesh.volume > 0 for mesh in scene.geometry.values())


@each_row("name", known_robots())
def test_every_robot_is_exported_with_every_sonar(name: str) -> None:
    robot = load_parameters(name)
    bodies = scene_of(None, robot).bodies
    assert len(bodies[0].marks) == robot.sonar_fitted
    assert all(min(body.inertia) > 0 for body in bodies)
