"""The picture of one point of a campaign: its world and the robot's way in it, an SVG that stands alone.

A page of this project draws by itself (`p2os.view`); this is for where no script runs, as in a comment.
"""

from dataclasses import replace

from p2os.pioneer.world import load_world
from p2os.pioneer.world.drawing import DrawnShape, Look, shapes_of, svg
from robot_bench.campaign.conduct import Run
from robot_bench.campaign.trial import unpacked
from robot_bench.scenario.world_script import placed_things
from simbase.errors import P2osError

#: The longer side of the plan in a comment, pixels.
_SIDE_PX = 300
#: Of what marks where a run ended, metres.
_MARK_M = 0.1


def picture(run: Run) -> str:
    """Return the world of a run with the way of its robot, where that ended or touched something, and what was placed.

    Empty where the world is not to be had.
    """
    try:
        with unpacked(run.trial.files) as folder:
            scenario = run.trial.scenario(folder)
            world = load_world(scenario.world, seed=scenario.seed)
            world = replace(world, start=scenario.start or world.start)
    except P2osError:
        return ""
    over = [shape for item in placed_things(scenario.changes) for shape in shapes_of(item)]
    way = tuple((x / 1000, y / 1000) for x, y in run.outcome.way_mm)
    if way:
        over.append(DrawnShape(Look.WAY, "the robot's way", way, is_open=True))
    hits = [DrawnShape(Look.HIT, f"touched {hit.what}", ((hit.x_m, hit.y_m),), _MARK_M) for hit in run.outcome.hits[:1]]
    ends = [DrawnShape(Look.HIT, "its end", (point,), _MARK_M) for point in way[-1:]]
    return svg(world, over=[*over, *(hits or ends)], side_px=_SIDE_PX)
