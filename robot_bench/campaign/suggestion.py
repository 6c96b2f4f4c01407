"""The campaign file that `p2os campaign new SCENARIO` writes: one that finds something with no editing.

A program that carries out a list of its own (drive so far, turn, stop) has to do that whatever its clock and its SRAM
at power-on are: these vary, and its scenario's own goals judge. A robot that roams by itself meets things of every
kind that a firmware may be blind to: thin posts, boxes, walls, dead ends and gaps, in the scenario's own world and
from other starts. What it has to show is what any such robot has to: it touches nothing, keeps off things, does not
stay where a way is free, and turns, bends and goes back for a reason.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from string import Template

from p2os.pioneer.world import load_world
from p2os.toml_file import toml_value
from robot_bench.scenario.scenario import Scenario
from simbase.timing import NS_PER_S

#: chosen: of a floor, what a robot may start in, as a share of each side.
START_SHARE = 0.1
#: chosen: seconds; a robot has turned at the first things by then, and a machine does a run in a second or two.
LONGEST_S = 60.0

HEAD = """\
# What is searched: $searched.
#   p2os campaign $file                 docs/campaigns.md has all keys
scenario = $scenario_name
${firmware}"""
SEARCH = """\
search = $search     # grid, random, latin-hypercube, sobol, tpe, cma-es, quality-diversity, coverage
corpus = $corpus    # points that reached something new, kept for the next campaign
swarm = 0.5             # each point turns half of what varies, is drawn or disturbs off
${seed}
[budget]
"""
RUN = """
[limits]                # of one run
cpu_s = 300.0
memory_mb = 2000

[cheap]                 # the runs that propose; any key of a scenario, such as mode = "direct"
body = "kinematic"
${duration}
[full]                  # those that confirm
${mode}body = $body
${duration}
[vary]                  # every key that --set takes: a range, with a step or without, or a list of values
"""
SCRIPTED_TEMPLATE = Template(
    HEAD
    + "${room}"
    + SEARCH
    + """\
runs = $runs               # of the cheap kind
confirmations = 20      # runs in full: of what failed, and at the end of the nearest misses
minutes = 10.0
"""
    + RUN
    + """\
${seeds}crystal_ppm = { from = -100, to = 100 }
sram = ["zeros", "random"]
${charge}${errors}
$ahead# The scenario's own goals have to hold: it carries out a list of its own. [[draw]] and [[goal]] say otherwise.
"""
)
ERRORS = """\
# controller.errors = ["ideal", "realistic"]    # mode adapter: with noise a goal on exact words may be missed rightly
"""
#: Of a robot on own pins: from nearly empty to full.
CHARGE = "charge = { from = 0.1, to = 1.0 }     # of its battery\n"
#: What is drawn where a goal of the scenario's is excused by it.
IN_THE_WAY = "in the way"
ROOM = """\
gap_m = 0.1             # between what is drawn and other things
free_m = 0.2            # about the robot as it begins
"""
AHEAD = f"""\
[[draw]]                # goals that the program then cannot meet say so: excused_by
name = "{IN_THE_WAY}"
kind = "box"
count = [0, 0, 0, 0, 0, 0, 0, 0, 0, 1]
ahead_m = {{ from = 0.45, to = 0.75 }}
aside_m = {{ from = -0.02, to = 0.02 }}
length_m = 0.2
width_m = 0.3

"""
#: A Pioneer's controller and line; what a program cannot make up for excuses the goals that it spoils.
DISTURBED = """\
[[disturb]]             # a sonar sees one distance for ever; what it spoils does not judge the run
fault = "sonar-stuck {sonar} {range_m}"
sonar = { from = 1, to = 8 }
range_m = { from = 0.2, to = 3.0 }
at_s = { from = 1.0, to = 50.0 }
share = 0.1

[[disturb]]             # its ranges scatter by so much; a sound program may then come nearer than it is to
fault = "sonar-noisy {sonar} {range_m}"
sonar = { from = 1, to = 8 }
range_m = { from = 0.01, to = 0.1 }
at_s = { from = 1.0, to = 50.0 }
share = 0.3

[[disturb]]             # or it sees nothing
fault = "sonar-dead {sonar}"
sonar = { from = 1, to = 8 }
at_s = { from = 1.0, to = 50.0 }
share = 0.1

[[disturb]]             # packets are lost; the adapter waits 350 ms for the next one, and one comes each 100 ms
name = "short loss"
fault = "link-down"
at_s = { from = 5.0, to = 50.0 }
for_s = { from = 0.02, to = 0.12 }
share = 0.3

[[disturb]]             # the adapter stops, until the program asks for a connection anew
name = "lost link"
fault = "link-down"
at_s = { from = 5.0, to = 50.0 }
for_s = { from = 0.5, to = 10.0 }
share = 0.05

[[disturb]]             # the robot's controller begins anew: likewise
fault = "reboot"
at_s = { from = 5.0, to = 50.0 }
share = 0.05

[[disturb]]
fault = "low-battery {volts}"
volts = { from = 9.0, to = 12.0 }
at_s = { from = 1.0, to = 50.0 }

"""
POCKET = "pocket"
#: What excuses from which goal, where it may happen: what a program reads wrongly, or not at all, it answers wrongly.
EXCUSES: Mapping[str, tuple[str, ...]] = {
    "narrow": (POCKET, "sonar-stuck", "sonar-dead", "lost link", "reboot"),
    "blind": ("sonar-stuck", "sonar-dead", "lost link", "reboot"),
    "noisy": (POCKET, "sonar-stuck", "sonar-dead", "sonar-noisy", "lost link", "reboot"),
    "stuck": ("sonar-stuck", "lost link", "reboot"),
    "lost": ("lost link", "reboot"),
}
TEMPLATE = Template(
    HEAD
    + "${keeps}"
    + SEARCH
    + """\
runs = $runs              # of the cheap kind; about two seconds of a processor each
confirmations = 40      # runs in full: of what failed, and at the end of the nearest misses
minutes = 10.0
"""
    + RUN
    + """\
duration_s = { from = 60, to = 900, step = 1, tail = "long" }
${seeds}sram = ["random"]       # at power-on; where it is turned off, zeros
crystal_ppm = { from = -100, to = 100 }
$start.x_m = { from = $x0, to = $x1 }
$start.y_m = { from = $y0, to = $y1 }
$start.heading_deg = { from = 0, to = 355, step = 5 }

[[draw]]                # about the robot as it begins, open behind it: it has to come out backwards
kind = "dead-end"
name = "pocket"         # it leaves passages of less than 0.9 m: no goal on contacts judges there
count = 1
gap_m = 0.5
ahead_m = { from = 0.3, to = 0.6 }
aside_m = { from = -0.02, to = 0.02 }
heading_deg = { from = -1.5, to = 1.5 }
width_m = { from = 1.0, to = 1.08 }
depth_m = { from = 1.4, to = 2.0 }

[[draw]]                # things that stand in the way, each with a place and measures of its own
kind = "post"
count = { from = 1, to = 5 }

[[draw]]
kind = "box"
count = { from = 0, to = 3 }

[[draw]]                # before the robot as it begins, open to it: many a turn begins here
kind = "dead-end"
count = { from = 0, to = 1 }
ahead_m = { from = 1.0, to = 2.2 }
aside_m = { from = -0.3, to = 0.3 }
width_m = { from = 0.7, to = 1.4 }

[[draw]]
kind = "gap"
count = { from = 0, to = 1 }
ahead_m = { from = 0.8, to = 2.0 }
aside_m = { from = -0.4, to = 0.4 }
width_m = { from = 0.7, to = 1.2 }

[[draw]]
kind = "corner"
count = { from = 0, to = 2 }

[[draw]]
kind = "doorway"
count = { from = 0, to = 1 }

[[draw]]                # behind it or beside it
kind = "wall"
name = "wall behind"
count = { from = 0, to = 1 }
ahead_m = { from = -0.9, to = 0.3 }
aside_m = { from = -0.9, to = 0.9 }
heading_deg = { from = 0, to = 180 }

${disturbed}[[goal]]                # what has to hold, beside the scenario's own goals that keeps names
kind = "no_collision"
${narrow}ends_run = "missed"

[[goal]]
kind = "clearance"
${noisy}least_m = 0.05
ends_run = "missed"

[[goal]]                # it drives at all, link or no link
kind = "min_distance"
${stuck}distance_m = 0.5

[[goal]]                # where it sees free floor it neither stands nor turns on the spot
kind = "moves_on"
${stuck}way_m = 0.5
within_s = 40.0
free_m = 1.2
ends_run = "missed"

[[goal]]                # and it comes out of dead ends: dodge needs 94 s at most of one of 1.04 m, 53 s of a corner
kind = "moves_on"
${stuck}way_m = 0.5
within_s = 180.0
ends_run = "missed"

[[goal]]                # turns go to the free side; one alone may go the other way, as every seventh of dodge does
kind = "turns_away"
${blind}near_m = 0.55
free_m = 0.8
row = 1
within_turns = 5
ends_run = "missed"

[[goal]]                # and so do arcs
kind = "steers_away"
${blind}near_m = 0.5
free_m = 0.8
within_s = 1.0
ends_run = "missed"

[[goal]]                # a turn ends where everything is free; dodge's long ones after 177 degrees at most
kind = "no_idle_turn"
${blind}free_m = 0.8
within_s = 0.5
long_deg = 180.0
apart_m = 0.55
ends_run = "missed"

[[goal]]                # nothing sees what is behind
kind = "backs_on_path"
${lost}off_m = 0.1
ends_run = "missed"
"""
)


def suggested(scenario: Scenario, scenario_name: str, file: str, given: Mapping[str, object] | None = None) -> str:
    """Return the text of a campaign file for a scenario.

    Args:
        scenario: It can be run.
        scenario_name: What the file is to call it: a name that ships, or its file as seen from the campaign's.
        file: What the campaign's file will be called.
        given: What is to stand for its keys `firmware` (as seen from the file), `search`, `seed` and `runs`.

    Raises:
        WorldError: Its world cannot be read.
    """
    parts = [robot.scenario for robot in scenario.robots if robot.scenario is not None] or [scenario]
    keys = dict(given or {})
    common = {
        "firmware": f"firmware = {toml_value(keys['firmware'])}\n" if "firmware" in keys else "",
        "search": toml_value(keys.get("search", "coverage")),
        "corpus": toml_value(f"{Path(file).stem.removesuffix('-campaign')}-corpus.jsonl"),
        "seed": f"seed = {keys['seed']}" + " " * 16 + "# of the search\n" if "seed" in keys else "",
        "scenario_name": toml_value(scenario_name), "file": file, "body": toml_value(scenario.body),
        "mode": "" if scenario.robots else f"mode = {toml_value(scenario.mode)}\n",
    }  # fmt: skip
    goals = [goal for part in parts for goal in part.goals]
    world = load_world(scenario.world, seed=scenario.seed)
    is_drawn = world != load_world(scenario.world, seed=scenario.seed + 1)
    common["seeds"] = "" if is_drawn else "seed = { from = 0, to = 999 }\n"
    if any(goal.definition.is_scripted for goal in goals):
        ahead = any(IN_THE_WAY in goal.excused_by for goal in goals)
        return SCRIPTED_TEMPLATE.substitute(
            common, searched=f"clocks, SRAM and more with which the firmware of {scenario.name} fails", duration="",
            runs=keys.get("runs", 64), charge=CHARGE if scenario.own_robot is not None else "",
            errors=ERRORS if scenario.own_robot is None else "",
            ahead=AHEAD if ahead else "", room=ROOM if ahead else "",
        )  # fmt: skip
    disturbed = scenario.own_robot is None and not scenario.robots and scenario.mode != "direct"
    start = scenario.robots[0].start if scenario.robots else scenario.start or world.start
    kinds = dict.fromkeys(goal.kind for goal in goals if goal.definition.holds_anywhere)
    excused = {name: _excused_by(by if disturbed else by[: by[0] == POCKET]) for name, by in EXCUSES.items()}
    x0, y0, x1, y1 = world.extent
    dx, dy = (x1 - x0) * START_SHARE / 2, (y1 - y0) * START_SHARE / 2
    return TEMPLATE.substitute(
        common | excused, searched=f"worlds in which the firmware of {scenario.name} fails",
        runs=keys.get("runs", 600), keeps=f"keeps = {toml_value(list(kinds))}\n" if kinds else "",
        duration=f"duration_s = {min(scenario.duration_ns / NS_PER_S, LONGEST_S)}\n",
        disturbed=DISTURBED if disturbed else "",
        start=f"robot.{scenario.robots[0].name}" if scenario.robots else "start",
        x0=round(start.x_m - dx, 2), x1=round(start.x_m + dx, 2),
        y0=round(start.y_m - dy, 2), y1=round(start.y_m + dy, 2),
    )  # fmt: skip


def _excused_by(names: Sequence[str]) -> str:
    return f"excused_by = {toml_value([*names])}\n" if names else ""
