"""A profile for a person to read: functions by their cycles, the costliest first, and how long exceptions waited."""

from collections.abc import Sequence

from bluepill_sim.analysis.columns import in_columns
from bluepill_sim.analysis.cycle_profile import ASLEEP, CycleProfile
from bluepill_sim.analysis.interrupts.latency import ExceptionCost
from bluepill_sim.core.nvic import exception_name


def function_lines(profile: CycleProfile, *, most: int | None = None) -> list[str]:
    """Return a table of functions, and what it adds up to.

    Args:
        profile: of a run.
        most: how many functions are shown; None all.
    """
    total, functions = profile.total_cycles, profile.functions()
    awake = total - sum(f.exclusive_cycles for f in functions if f.name == ASLEEP)
    rows = []
    for f in functions[:most]:
        share = f"{f.exclusive_cycles / awake:.1%}" if f.name != ASLEEP and awake else ""
        calls = str(f.calls) if f.calls else ""
        rows.append((f.name, calls, str(f.exclusive_cycles), share, str(f.inclusive_cycles)))
    found = in_columns(("function", "calls", "cycles", "awake", "with callees"), rows, right=(1, 2, 3, 4))
    return [*found, f"{total} cycles, {awake / total:.2%} of them awake"] if total else found


def exception_lines(costs: Sequence[ExceptionCost], hz: int) -> list[str]:
    """Return a table of exceptions; nothing where none was entered.

    Args:
        costs: of a run.
        hz: the core's frequency, for times.
    """

    def cycles(value: float | None) -> str:
        return "" if value is None else f"{value:.0f} ({value * 1e6 / hz:.2f} µs)"

    rows = [
        (
            exception_name(cost.number),
            str(cost.entries),
            *(cycles(value) for value in (cost.least_wait, cost.mean_wait, cost.worst_wait, cost.worst_duration)),
        )
        for cost in costs
    ]
    headers = ("exception", "entries", "least wait", "mean", "worst", "longest run")
    return ["", *in_columns(headers, rows, right=(1, 2, 3, 4, 5))] if rows else []
