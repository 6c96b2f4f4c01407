"""The case: its solids, its fit with the board, and that its files are of this design."""

import math
import random
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hardware.case import __main__ as command
from hardware.case import design, fit
from hardware.case import picture as drawing
from hardware.case.picture import draw, read_stl
from hardware.case.solids import Block, PrintedPart, Solid, UprightCylinder

GENERATED = command.GENERATED
COORDINATES = st.floats(-4, 4)


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("shape", ["block", "cylinder"])
def test_near_is_what_reaches_into_a_space_if_only_to_its_side(axis: int, shape: str) -> None:
    solid: Solid = Block(x=(-1, 1), y=(-1, 1), z=(-1, 1))
    if shape == "cylinder":
        solid = UprightCylinder(at=(0, 0), radius_mm=1, z=(-1, 1))
    part = PrintedPart(name="one", solids=(solid,))
    for low, high, is_near in ((1, 2, True), (1.01, 2, False), (-2, -1, True), (-2, -1.01, False), (-3, 3, True)):
        space = [-0.5, 0.5] * 3
        space[2 * axis : 2 * axis + 2] = low, high
        left, right, top, bottom, under, over = space
        assert bool(part.near((left, right, top, bottom, under, over)).solids) is is_near, (low, high)


@given(COORDINATES, COORDINATES, COORDINATES)
def test_what_is_cut_away_is_gone_and_what_comes_later_is_there(x: float, y: float, z: float) -> None:
    outer = Block(x=(-3, 3), y=(-3, 3), z=(-3, 3), corner_mm=1)
    hole = UprightCylinder(at=(0, 0), radius_mm=2, z=(-3, 3), is_cut=True)
    pin = UprightCylinder(at=(0, 0), radius_mm=1, z=(-3, 3))
    body = PrintedPart(name="ring", solids=(outer, hole, pin))
    assert body.holds(x, y, z) == ((outer.holds(x, y, z) and not hole.holds(x, y, z)) or pin.holds(x, y, z))
    assert body.near((x, x, y, y, z, z)).holds(x, y, z) == body.holds(x, y, z)


@pytest.mark.parametrize(
    ("x", "y", "is_in"), [(3, 0, True), (3, 2, True), (3, 2.01, False), (2.7, 2.7, True), (2.72, 2.72, False)]
)
def test_a_round_corner_ends_at_its_radius(x: float, y: float, is_in: bool) -> None:
    assert Block(x=(-3, 3), y=(-3, 3), z=(0, 1), corner_mm=1).holds(x, y, 0.5) == is_in


def test_the_case_fits_every_board(capsys: pytest.CaptureFixture[str]) -> None:
    assert command.main(["check"]) == 0
    assert capsys.readouterr().out.count("good") == len(fit.CHECKS)


def without(body: PrintedPart, name: str) -> PrintedPart:
    assert any(solid.name == name for solid in body.solids)
    return PrintedPart(name=body.name, solids=tuple(solid for solid in body.solids if solid.name != name))


def shifted(body: PrintedPart, name: str, dx: float) -> PrintedPart:
    def moved(solid: Solid) -> Solid:
        if solid.name != name:
            return solid
        if isinstance(solid, UprightCylinder):
            return replace(solid, at=(solid.at[0] + dx, solid.at[1]))
        return replace(solid, x=(solid.x[0] + dx, solid.x[1] + dx))

    return PrintedPart(name=body.name, solids=tuple(moved(solid) for solid in body.solids))


@pytest.mark.parametrize(
    ("which", "change", "check", "said"),
    [
        ("base", lambda body: without(body, "RS-232"), fit.plugs_reach_their_sockets,
         "RS-232: the base is in the way at x 60.6, y 101.3, z 0.0 mm"),
        ("base", lambda body: without(body, "USB"), fit.plugs_reach_their_sockets,
         "USB of the BluePill: the base is in the way at x 13.1, y -3.0, z 9.6 mm"),
        ("base", lambda body: shifted(body, "USB", 1.7), fit.plugs_reach_their_sockets,
         "USB of the BluePill: the base is in the way at x 13.1, y -3.0, z 9.6 mm"),
        ("base", lambda body: without(body, "12 V"), fit.plugs_reach_their_sockets,
         "12 V: the base is in the way at x 9.5, y 101.4, z 1.0 mm"),
        ("base", lambda body: without(body, "5 V"), fit.plugs_reach_their_sockets,
         "5 V: the base is in the way at x 25.1, y 101.2, z 4.8 mm"),
        ("base", lambda body: without(body, "boss"), fit.bosses_carry_the_board,
         "no boss with an insert below the hole at x 4.0, y 4.0, z 0.0 mm"),
        ("base", lambda body: shifted(body, "insert", 2.1), fit.bosses_carry_the_board,
         "no boss with an insert below the hole at x 4.0, y 4.0, z 0.0 mm"),
        ("base", lambda body: shifted(body, "boss", 10.0), fit.solder_keeps_off_the_base,
         "a pad at x 11.0, y 94.4, z 0.0 mm stands in the base at x 10.6, y 94.0, z -4.6 mm"),
        ("base", lambda body: shifted(body, "inside", 0.7), fit.parts_touch_nothing,
         "rev-b: the board stands in the base at x 0.0, y 3.0, z -1.6 mm"),
        ("base", lambda body: shifted(body, "ear", 70.0), fit.a_small_printer_takes_it,
         "base: 187 x 120 mm"),
        ("lid", lambda body: without(body, "screw"), fit.bosses_carry_the_board,
         "no hole of the lid above x 4.0, y 4.0, z 0.0 mm"),
        ("lid", lambda body: without(body, "light of D7"), fit.lights_are_seen,
         "rev-b: D7"),
        ("lid", lambda body: without(body, "USB of the ESP32"), fit.plugs_reach_their_sockets,
         "USB of the ESP32: the lid is in the way at x 70.7, y 41.6, z 20.6 mm"),
        ("lid", lambda body: shifted(body, "USB of the ESP32", 1.7), fit.plugs_reach_their_sockets,
         "USB of the ESP32: the lid is in the way at x 70.7, y 41.6, z 20.6 mm"),
        ("lid", lambda body: without(body, "button"), fit.hands_reach_what_they_use,
         "button: the lid is closed at x 92.8, y 52.2, z 20.0 mm"),
        ("lid", lambda body: without(body, "STOP"), fit.hands_reach_what_they_use,
         "stop: the lid is closed at x 96.0, y 12.8, z 20.0 mm"),
        ("lid", lambda body: shifted(body, "lip", 0.5), fit.base_and_lid_do_not_meet,
         "at x 99.0, y 0.0, z 18.5 mm"),
    ],
)  # fmt: skip
def test_a_fault_of_the_case_is_noticed(
    which: str, change: object, check: object, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    changed = change(getattr(design, which)())  # type: ignore[operator]
    monkeypatch.setattr(design, which, lambda: changed)
    assert check()[0] == said  # type: ignore[operator]


def test_a_part_in_a_spacer_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fit, "mounting_holes", lambda _variant: ((50.0, 20.0),))
    assert any("spacer" in line for line in fit.parts_keep_off_the_spacers())


def test_the_files_are_of_this_design() -> None:
    assert (GENERATED / command.STAMP).read_text(encoding="utf-8").strip() == design.stamp(), (
        "python -m hardware.case build"
    )


@pytest.mark.parametrize("name", ["base", "lid"])
def test_an_stl_file_has_the_size_and_the_volume_of_its_body(name: str) -> None:
    body: PrintedPart = getattr(design, name)()
    triangles = read_stl(GENERATED / f"{name}.stl")
    left, right, top, bottom, low, high = body.extent
    corners = [corner for triangle in triangles for corner in triangle]
    for axis, sides in enumerate(((left, right), (-bottom, -top), (low, high))):
        values = [corner[axis] for corner in corners]
        assert (min(values), max(values)) == pytest.approx(sides, abs=0.01)
    volume = sum(
        ax * (by * cz - bz * cy) - ay * (bx * cz - bz * cx) + az * (bx * cy - by * cx)
        for (ax, ay, az), (bx, by, bz), (cx, cy, cz) in triangles
    ) / 6  # fmt: skip
    rng, hits, tries = random.Random(0), 0, 30_000
    for _ in range(tries):
        hits += body.holds(rng.uniform(left, right), rng.uniform(top, bottom), rng.uniform(low, high))
    space = (right - left) * (bottom - top) * (high - low)
    assert volume == pytest.approx(space * hits / tries, rel=0.05)


def test_a_cut_stl_file_is_refused(tmp_path: Path) -> None:
    data = (GENERATED / "lid.stl").read_bytes()
    (tmp_path / "lid.stl").write_bytes(data[:-1])
    with pytest.raises(ValueError, match=r"lid\.stl: \d+ triangles in"):
        read_stl(tmp_path / "lid.stl")


def test_the_picture_shows_the_board_in_the_base(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    draw(GENERATED, tmp_path / "case.png")
    from matplotlib.image import imread

    picture = imread(tmp_path / "case.png")[:, :, :3]
    green = (picture[:, :, 1] > picture[:, :, 0] + 0.1) & (picture[:, :, 1] > picture[:, :, 2] + 0.1)
    width = picture.shape[1] // 3
    assert green[:, :width].sum() > 5_000
    assert green[:, width:].sum() == 0


def test_a_picture_shows_the_nearest_face_at_its_place_in_its_light() -> None:
    numpy = pytest.importorskip("numpy")
    orange, blue = (1.0, 0.5, 0.0), (0.0, 0.5, 1.0)
    slab, tower = drawing._box(0, 40, 0, 30, -5, 0), drawing._box(10, 20, 5, 15, 0, 12)
    faces = [*((one, orange) for one in slab), *((one, blue) for one in tower)]
    picture = drawing._seen(faces, math.radians(28), math.radians(50)).round(3)
    assert picture.shape == (440, 560, 3)
    seen = {}
    for light in (0.588, 0.681, 0.929):  # of the front, of the right side, from above
        for name, colour in (("slab", orange), ("tower", blue)):
            rows, columns = numpy.nonzero((abs(picture - light * numpy.array(colour)) < 0.002).all(axis=2))
            seen[name, light] = len(rows), columns.min(), rows.min(), columns.max(), rows.max()
    wanted = {
        ("slab", 0.588): (478, 181, 103, 332, 177), ("slab", 0.681): (1243, 170, 87, 333, 177),
        ("slab", 0.929): (8469, 170, 54, 332, 177), ("tower", 0.588): (381, 225, 64, 266, 109),
        ("tower", 0.681): (738, 223, 51, 266, 109), ("tower", 0.929): (837, 223, 51, 266, 84),
    }  # fmt: skip
    for key, figures in wanted.items():
        assert seen[key] == pytest.approx(figures, abs=1, rel=0.004), key
    assert (picture == 1.0).all(axis=2).sum() == pytest.approx(234_254, abs=30)


@pytest.mark.skipif(find_spec("build123d") is not None, reason="build123d is installed")
def test_building_without_the_modeller_says_what_to_install(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(command, "CHECKS", {})
    assert command.main(["build", "--out", str(tmp_path)]) == 1
    assert "hint: python -m pip install build123d" in capsys.readouterr().err


@pytest.mark.skipif(find_spec("build123d") is None, reason="build123d is not installed: a modeller of 1 GB")
def test_building_gives_the_same_files(tmp_path: Path) -> None:
    assert command.main(["build", "--out", str(tmp_path)]) == 0
    for path in sorted(GENERATED.glob("*.stl")):
        assert (tmp_path / path.name).read_bytes() == path.read_bytes()


def test_a_part_in_the_way_of_the_esp32_s_cable_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    way = design.usb_way()
    low = replace(way, z=(0.0, way.z[1]))
    monkeypatch.setattr(design, "usb_way", lambda: low)
    assert any(line.startswith("rev-b: U5") for line in fit.parts_leave_the_cable_its_way())
