"""By how much a run held all its goals: one number for searches and maps, whatever the units of the goals.

A goal with a measure counts by it, a metre as 1 and ten seconds as 1; one without counts as met or missed. A run
without contact counts by its least clearance besides. The least of all is the margin of the run.

Invariant: a margin is negative exactly where the run failed.
"""

from collections.abc import Mapping

from robot_bench.campaign.trial import GoalResult, Outcome, TrialVerdict

#: How much of a unit counts as a whole margin.
WHOLE: Mapping[str, float] = {"m": 1.0, "s": 10.0, "deg": 45.0, "°": 45.0, "m/s": 0.5, "m/s²": 5.0, "J": 100.0}
#: chosen: of a goal that has no measure, or died of something else.
MISSED = -1.0
#: The least that a goal is missed by.
LEAST_MISS = -1e-3
MET = 1.0


def margin(outcome: Outcome) -> float | None:
    """Return the margin of a run, -1 to 1; None where there is no verdict."""
    if outcome.verdict is TrialVerdict.ERROR:
        return None
    found = [goal_margin(goal, outcome) for goal in outcome.goals if not goal.is_excused]
    if outcome.died:
        found.append(MISSED)
    return min(found, default=MET)


def goal_margin(goal: GoalResult, outcome: Outcome) -> float:
    """Return the margin of one goal of a run."""
    by = goal.robustness
    if goal.kind == "no_collision" and by is None and goal.met is not False:
        by = outcome.clearance_m
    scaled = None if by is None else by / WHOLE.get(goal.unit or "m", 1.0)
    if goal.met is False:
        return max(min(MISSED if scaled is None else scaled, LEAST_MISS), MISSED)
    return MET if scaled is None else min(max(scaled, 0.0), MET)
