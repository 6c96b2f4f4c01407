"""What is MuJoCo's own: meshes, things that come while it drives, and a robot that is squeezed."""

import pytest

from p2os.errors import WorldError
from p2os.pioneer.body.factory import make_body
from p2os.pioneer.world.model import Mesh, Obstacle, Pose, Repeat, Triangle, Vertex, Walk, World
from p2os.robots.parameters import load_parameters
from tests.p2os.pioneer.body.bodies import drive, marks_of

pytestmark = marks_of("mujoco")
P2DX = load_parameters("p2dx")


def world_of(*things: Obstacle, meshes: tuple[Mesh, ...] = ()) -> World:
    return World(
        name="w", source="w", description="", start=Pose(0, 0, 0), extent=(-4, -4, 4, 4), obstacles=things,
        meshes=meshes,
    )  # fmt: skip


def mesh(*vertices: Vertex, triangles: tuple[Triangle, ...] = ((0, 1, 2),)) -> Mesh:
    return Mesh(name="part", vertices=vertices, triangles=triangles)


def test_a_robot_that_is_squeezed_gains_no_energy_to_speak_of() -> None:
    wall = Obstacle(name="wall", x_m=-0.36, y_m=0.0, length_m=0.2, width_m=3.0, fixed=True)
    walk = Walk(points_m=((1.0, 0.0), (-1.0, 0.0)), speed_mps=0.5, repeat=Repeat.ONCE)
    body = make_body("mujoco", world_of(wall, Obstacle(name="v", x_m=0, y_m=0, radius_m=0.2, walk=walk)), P2DX)
    fastest = max(abs(drive(body, 0.0, 0.0, 0.02).forward_mps) for _ in range(150))
    assert fastest < 2.0
    assert body.state.collisions >= 1


def test_one_upright_triangle_is_met_and_echoes() -> None:
    body = make_body("mujoco", world_of(meshes=(mesh((1, -1, 0), (1, 1, 0), (1, 0, 1)),)), P2DX)
    assert "upright walls" in str(body.note)
    assert body.ranges([3])[0] == pytest.approx(0.834, abs=0.001)
    assert body.clearance() == pytest.approx(1.0 - 0.18, abs=0.001)
    state = drive(body, 0.3, 0.3, 4.0)
    assert state.x_m == pytest.approx(1.0 - 0.18, abs=0.003)
    assert state.stalled_left


def test_a_sloping_face_is_met_as_its_shadow() -> None:
    # 45 degrees: at the hull's underside, 0.05 m, it is at x = 1.05; at its top, 0.22 m, at 1.22.
    sloping = mesh((1, -2, 0), (1, 2, 0), (2, 2, 1), (2, -2, 1), triangles=((0, 1, 2), (0, 2, 3)))
    state = drive(make_body("mujoco", world_of(meshes=(sloping,)), P2DX), 0.3, 0.3, 4.5)
    assert state.x_m == pytest.approx(1.05 - 0.18, abs=0.003)


@pytest.mark.parametrize(
    ("third", "taken"), [((3, 0, 0.3), False), ((3, 0, 0.0), True), ((2, 0, -0.2), True), ((1.2, 0, 1.0), True)]
)
def test_a_mesh_that_wheels_would_climb_is_refused(third: Vertex, taken: bool) -> None:
    world = world_of(meshes=(mesh((1, -1, third[2] if third[2] < 0 else 0.0), (1, 1, 0.0), third),))
    if taken:
        assert make_body("mujoco", world, P2DX).state.z_m == pytest.approx(0.0, abs=1e-4)
        return
    with pytest.raises(WorldError, match="'part': it has a floor that wheels would climb") as caught:
        make_body("mujoco", world, P2DX)
    assert caught.value.hint == "--body bullet"


def test_a_mesh_of_too_many_pieces_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("p2os.pioneer.body.mujoco.model.MOST_PIECES", 1)
    two = mesh((1, -1, 0), (1, 1, 0), (1, 0, 1), (2, 0, 1), triangles=((0, 1, 2), (1, 2, 3)))
    with pytest.raises(WorldError, match=r"2 pieces between 0\.05 and 0\.22 m"):
        make_body("mujoco", world_of(meshes=(two,)), P2DX)


def test_a_thing_that_comes_while_it_drives_disturbs_nothing() -> None:
    alone, joined = (make_body("mujoco", world_of(), P2DX) for _ in range(2))
    for body in (alone, joined):
        drive(body, 0.2, 0.15, 0.5)
    joined.place(Obstacle(name="far", x_m=3.5, y_m=0.0, radius_m=0.1, mass_kg=1.0))
    joined.place(Obstacle(name="gone", x_m=-3.5, y_m=0.0, radius_m=0.1))
    joined.remove("gone")
    one, other = (drive(body, 0.2, 0.15, 1.0) for body in (alone, joined))
    assert (other.x_m, other.y_m, other.heading_rad) == pytest.approx((one.x_m, one.y_m, one.heading_rad), abs=1e-6)
    assert other.left_angle_rad == pytest.approx(one.left_angle_rad, abs=1e-6)
