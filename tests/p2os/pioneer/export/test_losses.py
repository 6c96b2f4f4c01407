"""What a format does not hold is said: the table of formats against the files that are written."""

from pathlib import Path

import pytest

from p2os.cli.main import run
from p2os.errors import WorldError
from p2os.pioneer.export import FORMATS, export, scene_of
from p2os.pioneer.export.scene import Property
from p2os.pioneer.world import load_world, parse_world
from p2os.pioneer.world.model import ObstacleKind
from p2os.robots.parameters import load_parameters
from simbase.errors import UsageError
from tests.p2os.pioneer.export.exported import written

P2DX = load_parameters("p2dx")
#: All that a world can have.
EVERYTHING = """name = "all"
extent_m = [-5, -5, 5, 5]
[[ramp]]
name = "up::hill"
x_m = 3
y_m = 3
length_m = 1
width_m = 1
rise_m = 0.1
[[cylinder]]
name = "walker"
x_m = 2
y_m = 2
radius_m = 0.2
path_m = [[2, 2], [2, 3]]
[[box]]
name = "carton"
x_m = -2
y_m = -2
length_m = 0.3
width_m = 0.3
mass_kg = 2
[[mesh]]
name = "tent"
vertices_m = [[3, -3, 0], [4, -3, 0], [3, -4, 1]]
triangles = [[0, 1, 2]]
[[mark]]
name = "here"
points_m = [[1, 1]]
"""


@pytest.mark.parametrize("ending", FORMATS)
def test_each_kind_of_loss_is_said_in_one_line_and_what_is_not_there_is_not_lost(ending: str) -> None:
    world = parse_world(EVERYTHING, "all.toml")
    for place, robot in ((world, P2DX), (world, None), (None, P2DX)):
        holds = scene_of(place, robot).holds
        said = export(f"all{ending}", place, robot).losses
        lost = [prop for prop in Property if holds.get(prop) and not FORMATS[ending].cell(prop).held]
        assert len(said) == len(lost)
        assert all(f"does not hold {prop.value} (" in line for prop, line in zip(lost, said, strict=True))
    assert export(f"room{ending}", load_world("room"), P2DX).losses != ()


def test_every_property_of_the_table_is_counted_in_some_scene() -> None:
    world = parse_world(EVERYTHING, "all.toml")
    counted = {
        prop for scene in (scene_of(world, P2DX), scene_of(world, None)) for prop, count in scene.holds.items() if count
    }
    assert counted == set(Property)


def test_an_empty_export_and_an_unknown_ending_are_refused() -> None:
    with pytest.raises(WorldError, match="neither a world nor a robot"):
        export("a.sdf")
    with pytest.raises(UsageError, match=r"nothing can be exported to 'a\.fbx'"):
        export("a.fbx", None, P2DX)


def test_the_command_line_writes_a_world_with_a_robot_and_says_what_is_lost(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "room.SDF"
    assert run(["world", "convert", "room", "--robot", "p2dx", "--out", str(out)]) == 0
    said = capsys.readouterr()
    assert said.out == f"{out}: room, 6.4 x 6.4 m: 9 obstacles, with Pioneer 2-DX\n"
    assert said.err == "note: SDF does not hold the sonars' cones and ranges (8): the places alone\n"
    assert run(["world", "convert", "room", "--out", str(out)]) == 2
    assert "is there already" in capsys.readouterr().err
    assert run(["world", "show", str(out)]) == 0


def test_meshes_are_files_beside_it_and_none_is_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "all.toml").write_text(EVERYTHING, encoding="utf-8")
    (tmp_path / "all_mesh1.obj").write_text("mine", encoding="utf-8")
    words = ["world", "convert", str(tmp_path / "all.toml"), "--out", str(tmp_path / "all.urdf")]
    assert run(words) == 2
    assert "all_mesh1.obj is there already" in capsys.readouterr().err
    assert not (tmp_path / "all.urdf").exists()
    assert run([*words, "--force"]) == 0
    assert load_world(tmp_path / "all.urdf").meshes[0].name == "tent"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "neither a world nor a robot is named"),
        (["--robot", "p2dx"], "a robot cannot be written to a terminal"),
        (["--robot", "p2dx", "--out", "a.toml"], "a robot cannot be written to a.toml"),
        (["room", "--out", "a.jpg"], "hint: --out FILE with .toml, .sdf, .urdf, .xml, .gltf, .glb"),
        (["room", "--robot", "p9", "--out", "a.sdf"], "no robot model 'p9'"),
        (["room", "--out", "missing/a.sdf"], "no such file or directory"),
    ],
)
def test_what_cannot_be_exported_is_one_line_and_a_hint(
    words: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["world", "convert", *words]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert said in err
    assert err.count("\n") <= 2
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("ending", [".sdf", ".urdf", ".gltf", ".glb"])
def test_what_the_table_says_is_held_comes_back(ending: str, tmp_path: Path) -> None:
    world = parse_world(EVERYTHING, "all.toml")
    again = load_world(written(tmp_path, f"all{ending}", world))
    came_back = {
        Property.KIND: any(item.kind is ObstacleKind.RAMP for item in again.obstacles),
        Property.WALK: any(item.walk is not None for item in again.obstacles),
        Property.PUSHED: any(item.mass_kg > 0 for item in again.obstacles),
        Property.ROUND: any(item.is_cylinder for item in again.obstacles),
        Property.START: again.extent == world.extent,
        Property.MARK: again.marks != (),
        Property.NAME: any("::" in item.name for item in again.obstacles),
    }
    made = FORMATS[ending]
    assert [prop for prop, is_back in came_back.items() if made.cell(prop).held and not is_back] == []
