"""Worlds drawn at random, their plans, pictures and shadows, against what was approved."""

import math
import random
from collections.abc import Iterator

from p2os.pioneer.body import ray_cast
from p2os.pioneer.world import drawing, geometry, model, solids
from p2os.pioneer.world.loader import known_worlds, load_world
from p2os.pioneer.world.makers import KINDS, make_world
from p2os.pioneer.world.placing import Placing, placed_world, with_z_up
from p2os.pioneer.world.plan import Bands, Plan
from p2os.pioneer.world.start_places import floor_height, start_places
from p2os.pioneer.world.writer import write_world
from p2os.robots.parameters import load_parameters
from tests.p2os.pioneer.world.walks.things import drawn_mesh, drawn_thing, drawn_walk, drawn_world
from tests.tools.suite.approved import Trace, judge_of, rounded, said, tried
from tests.tools.suite.declared import declared_of

P2DX, PATROLBOT = load_parameters("p2dx"), load_parameters("patrolbot-sh")


def makers(draw: random.Random) -> Iterator[str]:
    for kind in KINDS:
        for seed in range(3):
            yield rounded(write_world(make_world(kind, seed)))


def shipped(draw: random.Random) -> Iterator[str]:
    for name in known_worlds():
        world = load_world(name, 7)
        yield rounded(write_world(world))
        yield said(world.to_plain())


def meshes(draw: random.Random) -> Iterator[str]:
    for number in range(24):
        mesh = drawn_mesh(draw, f"mesh {number}")
        yield said((mesh.bounds, [model.normal_of(*(mesh.vertices[i] for i in one)) for one in mesh.triangles]))
        yield said([model.has_area(*(mesh.vertices[i] for i in one)) for one in mesh.triangles])
        for low, high in ((0.05, 0.22), (0.0, 0.4), (-0.3, 0.1)):
            yield said((model.cut(mesh, low), model.shadow(mesh, low, high)))
    for grains in (0.05, 0.09, 0.11, 0.5, 0.99, 1.01, 2.0, 9.0, 11.0):  # two corners nearly at one place
        near = grains * model.GRAIN_M
        corners = ((0.0, 0.0, 0.1), (1.0, 0.0, 0.1), (1.0, near, 0.1), (0.0, 1.0, 0.15))
        mesh = model.Mesh(name="twins", vertices=corners, triangles=((0, 1, 2), (0, 2, 3)))
        yield said((grains, model.shadow(mesh, 0.05, 0.2), model.cut(mesh, 0.12), model.joined(
            [((0.0, 0.0), (1.0, 0.0)), ((1.0 + near, 0.0), (2.0, 0.0)), ((3.0, 0.0), (3.0 + near, 0.0))])))  # fmt: skip


def joins(draw: random.Random) -> Iterator[str]:
    for _ in range(12):
        grid = [(draw.randrange(4) * 1.0, draw.randrange(4) * draw.choice((1.0, 1.00004, 1.0002))) for _ in range(24)]
        yield said(model.joined(zip(grid[::2], grid[1::2], strict=True)))


def walks(draw: random.Random) -> Iterator[str]:
    for _ in range(12):
        walk = drawn_walk(draw)
        yield said((walk.repeat, walk.round_trip(), [walk.pose_at(seconds / 2) for seconds in range(30)]))


def things(draw: random.Random) -> Iterator[str]:
    for number in range(60):
        item = drawn_thing(draw, f"thing {number}")
        bands = [Bands(robot) for robot in (P2DX, PATROLBOT)]
        yield said((item.section, item.reach_m, item.kind.is_driven_on, item.to_plain(), item.stands_in(0.1, 0.2)))
        yield said([(one.is_touched(item), one.echoes(item), one.stops_wheels(item)) for one in bands])
        yield said((drawing.look_of(item), [(one.name, one.points) for one in drawing.shapes_of(item)]))


def footprints(draw: random.Random) -> Iterator[str]:
    for number in range(60):
        item = drawn_thing(draw, f"thing {number}")
        shape = geometry.Footprint(item)
        x, y, turn = item.x_m + draw.uniform(-2, 2), item.y_m + draw.uniform(-2, 2), draw.uniform(-3, 3)
        hull = geometry.placed(geometry.hull_polygon(P2DX.body), x, y, turn)
        rays = [(math.cos(turn + step / 20), math.sin(turn + step / 20)) for step in range(-6, 7)]
        yield said((shape.bounds, shape.reach, shape.edges, shape.contains(x, y)))
        yield said((shape.distance_to_point(x, y), shape.distance(hull), shape.way_out(hull), shape.normal_at(x, y)))
        yield said([shape.hit(x, y, *ray) for ray in rays])
        yield said(ray_cast.cast([shape], x, y, rays, 3.0))
        yield said(ray_cast.echoes([shape], x, y, rays, 3.0))
    for name in ("p2dx", "p3at", "powerbot-sh", "amigo"):
        robot = load_parameters(name)
        yield said((geometry.hull_polygon(robot.body), geometry.wheel_polygons(robot)))


def plans(draw: random.Random) -> Iterator[str]:  # noqa: C901 - a table of acts
    for robot in (P2DX, PATROLBOT):
        for _ in range(8):
            world = drawn_world(draw)
            plan = Plan.of_world(world, robot)
            yield said([item.name for item in (*plan.obstacles, *plan.pushable(world))])
            for number in range(12):
                x, y, turn = draw.uniform(-4, 4), draw.uniform(-4, 4), draw.uniform(-3, 3)
                name = f"thing {draw.randrange(7)}"
                match draw.randrange(4):
                    case 0:
                        yield tried(plan.move, name, x, y, turn)
                    case 1:
                        yield tried(plan.remove, name)
                    case 2:
                        yield tried(plan.place, drawn_thing(draw, draw.choice((name, f"new {number}"))))
                things_there = [item for item in plan.obstacles if item.mass_kg]
                for item in things_there:
                    near = item.x_m - 0.2, item.y_m + 0.1, turn
                    if item.name in plan.touched(*near):
                        yield said((plan.push(item.name, *near), plan.find(item.name)))
                yield said((plan.clearance(x, y, turn), plan.clearance(x, y, turn, no_more_than=0.5)))
                yield said((plan.touched(x, y, turn), plan.contact(x, y, turn), plan.thing_at(x, y)))
                yield said(sorted(one.name for one in plan.echoing_within(x - 1, y - 1, x + 1, y + 1)))
            for place in range(4):
                yield said(floor_height(world, place - 2.0, 0.5, 0.2))
    for name in ("room", "office", "ramp", "walkway"):
        world = load_world(name, 3)
        yield tried(start_places, world, [P2DX, PATROLBOT, P2DX, P2DX], [None] * 4)


def pictures(draw: random.Random) -> Iterator[str]:
    for _ in range(6):
        world = drawn_world(draw)
        yield drawing.svg(world)
        for columns in (5, 40, 61):
            yield "\n".join(drawing.text(world, columns))
            yield drawing.text_key(world, columns)
    for name in ("office", "walkway"):
        yield drawing.svg(load_world(name, 1), side_px=300)
    yield said(
        [drawing.grid_step(span) for span in (0.3, 0.99, 1.0, 1.01, 4.9, 5.0, 9.9, 10.0, 10.1, 20.0, 51.0, 100.0)]
    )
    yield said([drawing.ticks(-1.0, 1.0, 0.5), drawing.ticks(-0.9, 1.1, 0.5)])


def placings(draw: random.Random) -> Iterator[str]:
    for _ in range(8):
        world = drawn_world(draw)
        placing = Placing(
            x_m=draw.choice((0.0, 1.5)), y_m=-2.0, z_m=draw.choice((0.0, 0.1)), heading_rad=draw.choice((0.0, 1.2)),
            scale=draw.choice((1.0, 2.0, 3.0)),
        )  # fmt: skip
        yield said(placing.is_identity)
        yield rounded(write_world(placed_world(world, placing)))
    yield said([with_z_up([(1.0, 2.0, 3.0)], up) for up in ("x", "y", "z")])
    yield said([Placing().is_identity, *(Placing(**{key: 0.5}).is_identity for key in ("x_m", "y_m", "z_m", "scale"))])
    yield said([tried(Placing, scale=scale) for scale in (0.0, -1.0, math.inf, 1e-9)])
    yield tried(Placing, up="w")
    yield said([solids.box((1, 2, 3)), solids.cylinder(1, 2, 4), solids.sphere(1, 6)])


TRACES: dict[str, Trace] = {
    each.__name__: each
    for each in (makers, shipped, meshes, joins, walks, things, footprints, plans, pictures, placings)
}
TRACES["declared"] = declared_of(
    "p2os.pioneer.world",
    "p2os.pioneer.world.formats",
    "p2os.pioneer.world.formats.meshes",
    "p2os.pioneer.world.interchange",
    "p2os.pioneer.world.makers",
)
test_what_was_approved_is_shown = judge_of(__file__, TRACES)
