"""Numbers that no world has: refused when read, by file, line and key, and by the constructors for programs."""

from pathlib import Path

import pytest

from p2os.errors import WorldError
from p2os.pioneer.body.factory import make_body
from p2os.pioneer.world import load_world
from p2os.pioneer.world.file import IMPORT_KEYS, MESH_KEYS, SHAPES, START_KEYS, parse_world
from p2os.pioneer.world.model import Mesh, Obstacle
from p2os.robots.parameters import load_parameters
from tests.p2os.pioneer.body.bodies import each_body

HEAD = 'name = "w"\nextent_m = [-5, -5, 5, 5]\n'
BOX = '[[box]]\nname = "b"\nx_m = 1\ny_m = 1\nlength_m = 1\nwidth_m = 1\n'
MESH = '[[mesh]]\nname = "m"\nvertices_m = [[0, 0, 0], [1, 0, 0], [2, 0, 0]]\ntriangles = [[0, 1, 2]]\n'
TEXTS = {"name", "kind", "file", "up", "repeat", "fixed"}


def test_every_number_of_a_world_file_has_a_range() -> None:
    keys = [*(key for shape in SHAPES.values() for key in shape), *IMPORT_KEYS, *START_KEYS, *MESH_KEYS]
    assert {key.name for key in keys if key.least is None} <= TEXTS


@pytest.mark.parametrize(
    ("text", "place"),
    [
        (BOX.replace("length_m = 1", "length_m = 1e300"), "w.toml:7: [[box]] 1: length_m"),
        (BOX.replace("x_m = 1", "x_m = inf"), "w.toml:5: [[box]] 1: x_m"),
        (BOX + "mass_kg = 2e5\n", "w.toml:9: [[box]] 1: mass_kg"),
        (BOX + "mass_kg = 1e-30\n", "w.toml:3: [[box]] 1: obstacle 'b': what is pushed"),
        (BOX.replace('"b"', '"a\\u0000b"'), "w.toml:4: [[box]] 1: name"),
        (MESH, "w.toml:3: [[mesh]] 1: mesh 'm': no triangle of it has an area"),
        (MESH.replace("[[0, 1, 2]]", "[[0, 0.9, 2]]"), "w.toml:6: [[mesh]] 1: triangles: 0.9 is no whole number"),
        ('[[import]]\nfile = "a\\u0000.obj"\n', "w.toml:4: [[import]] 1: "),
        (f'[[import]]\nfile = "{"a" * 300}.obj"\n', "w.toml:4: [[import]] 1: "),
    ],
)
def test_what_no_body_bears_is_refused_by_its_place(text: str, place: str) -> None:
    with pytest.raises(WorldError) as caught:
        parse_world(HEAD + text, "w.toml")
    assert str(caught.value).startswith(place)
    assert str(caught.value).isprintable()


@pytest.mark.parametrize("body", each_body("kinematic"))
def test_an_engine_takes_the_ends_of_what_can_be_pushed(body: str) -> None:
    pytest.importorskip({"bullet": "pybullet"}.get(body, body))
    for size, mass in ((0.01, 0.001), (0.01, 10_000.0), (2.0, 10_000.0)):
        text = BOX.replace("length_m = 1\nwidth_m = 1", f"length_m = {size}\nwidth_m = {size}") + f"mass_kg = {mass}\n"
        one = make_body(body, parse_world(HEAD + text.replace("x_m = 1", "x_m = 3"), "w"), load_parameters("p2dx"))
        for _ in range(50):
            one.step(0.0, 0.0)
        assert all(abs(item.x_m) < 5 for item in one.take_moved())


def test_a_program_is_refused_the_same_numbers() -> None:
    with pytest.raises(WorldError, match="out of range"):
        Obstacle(name="b", x_m=0, y_m=0, length_m=1e300, width_m=1)
    with pytest.raises(WorldError, match="area"):
        Mesh(name="m", vertices=((0, 0, 0), (1, 0, 0), (2, 0, 0)), triangles=((0, 1, 2),))


def test_a_byte_order_mark_is_passed_over(tmp_path: Path) -> None:
    path = tmp_path / "w.toml"
    path.write_text(HEAD + BOX, encoding="utf-8-sig")
    assert [item.name for item in load_world(path).obstacles] == ["b"]


@pytest.mark.parametrize("name", ["a\0b.toml", "a" * 5000, "a\0.sdf"])
def test_a_name_that_no_file_can_have_is_refused(name: str) -> None:
    with pytest.raises(WorldError) as caught:
        load_world(name)
    assert str(caught.value).isprintable()
