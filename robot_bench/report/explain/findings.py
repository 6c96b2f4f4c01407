"""Findings that every kind of failure may come down to: a program that stopped looking, wheels that do not obey.

Invariant: a finding that is called a cause says no more than what was recorded or compared.
"""

import itertools
from bisect import bisect_right
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from robot_bench.recording.run_record import RunRecord
from robot_bench.recording.signals import SignalSteps, motor_steps
from robot_bench.report.explain.chain import ChainLink, Evidence
from robot_bench.report.explain.probing import SAME_NS, Codes, Prober, Way
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos

#: chosen: wheels that are off by more than this, and by more than half a motor step, do not do what the pins ask.
OFF_MPS = 0.04
#: chosen: ramps, the line and the adapter's sampling are over after so long with one code.
SETTLED_NS: Nanos = 1200 * NS_PER_MS
#: Limits at which a counter of 8, 16 or 32 bits, signed or not, runs over.
_LIMITS = (1 << 8, 1 << 15, 1 << 16, 1 << 31)
#: chosen: so many lines and variables are named.
NAMED = 3


@dataclass(frozen=True, slots=True)
class Finding:
    """What was found; `is_cause` is False where it is no more than what is known."""

    says: str
    is_cause: bool = True


def numbers(names: Sequence[str]) -> str:
    """Return names as a list in words."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}" if names else ""


def steady_since(record: RunRecord, at: Nanos) -> tuple[tuple[int, int], Nanos]:
    """Return the codes of the motors at a time, and since when they are those; 0 where nothing has run."""
    return all_steady_since(record, (at,))[0]


def all_steady_since(record: RunRecord, times: Iterable[Nanos]) -> list[tuple[tuple[int, int], Nanos]]:
    """Return what `steady_since` does for each of some times; the pins' edges are gone through once."""
    left, right = (motor_steps(record.pins, motor) for motor in (1, 2))

    def last(steps: SignalSteps, at: Nanos) -> tuple[int, Nanos]:
        if not steps.times:
            return 0, 0
        place = max(0, bisect_right(steps.times, at) - 1)
        return steps.values[place], steps.times[place]

    found = [(last(left, at), last(right, at)) for at in times]
    return [((one, other), max(since, later)) for (one, since), (other, later) in found]


def codes_between(record: RunRecord, since: Nanos, until: Nanos) -> Way:
    """Return since when the motors had which codes, over a time."""
    times = {t for motor in (1, 2) for t in motor_steps(record.pins, motor).times if since < t <= until}
    at = [since, *sorted(times)]
    return [(t, codes) for t, (codes, _) in zip(at, all_steady_since(record, at), strict=True)]


def in_words(codes: Codes) -> str:
    """Return the codes of both motors as a person reads them."""
    return f"{codes[0]:+d}, {codes[1]:+d}"


def held_codes(way: Way, until: Nanos) -> str:
    """Return in words which codes the motors had over a time: the one, or that of most of it, and for how long."""
    spans: Counter[Codes] = Counter()
    for (t, codes), (end, _) in itertools.pairwise([*way, (until, (0, 0))]):
        spans[codes] += end - t
    held = max(spans, key=lambda codes: spans[codes])
    whole = until - way[0][0]
    if whole - spans[held] < SAME_NS:
        return in_words(held)
    return f"{in_words(held)} for {spans[held] / NS_PER_S:.2f} of {whole / NS_PER_S:.2f} s"


def obeyed(record: RunRecord, step_mps: float, at: Nanos, steps: list[ChainLink]) -> Finding | None:
    """Return that, and why, the wheels do not do what the motor pins ask just before a time; None where they do."""
    if any(net.startswith("motor") for net in record.waves):
        return None  # duties, not codes
    codes, since = steady_since(record, at)
    before = [pose for pose in record.poses if at - 250 * NS_PER_MS <= pose.t < at - 40 * NS_PER_MS]
    if at - since < SETTLED_NS or not before:
        return None
    pose = before[-1]
    wheels = pose.left / 1e6, pose.right / 1e6
    off = max(abs(code * step_mps - speed) for code, speed in zip(codes, wheels, strict=True))
    if off <= max(OFF_MPS, step_mps / 2):
        return None
    asked = ", ".join(f"{code * step_mps * 1000:+.0f}" for code in codes)
    has = ", ".join(f"{speed * 1000:+.0f}" for speed in wheels)
    steps.append(
        ChainLink(t=since, part="wire", says=f"the motor pins ask for {asked} mm/s", evidence=Evidence.RECORDED)
    )
    steps.append(ChainLink(t=pose.t, part="motion", says=f"the wheels run at {has} mm/s", evidence=Evidence.RECORDED))
    why = _why_not_obeyed(record, at, steps)
    return Finding(f"the motors do not do what the pins ask ({asked} mm/s wanted, {has} mm/s driven)"
                   + (f": {why}" if why else "; why is not known"))  # fmt: skip


#: Wires by which a program has its robot → the level at which it has not, and what that means.
CONTROL: Mapping[str, tuple[bool, str]] = {
    "rst": (True, "holds the adapter in reset"),
    "p2dx_con": (False, "does not ask for the robot"),
}
#: chosen: so long after a control wire was let go the robot is connected again.
_RECONNECTS_NS: Nanos = 5 * NS_PER_S
#: What a fault acts on; a voltmeter that shows less acts on neither.
_LINE = ("link-down", "loose-connector", "line-noise")
_ANEW = ("brown-out", "reboot")
_ACTS_ON: Mapping[str, tuple[str, ...]] = {
    "wheels": (*_LINE, *_ANEW, "wheel-blocked", "stop-button", "bumper"),
    "sonar": (*_LINE, *_ANEW, "sonar-stuck", "sonar-noisy", "sonar-dead"),
}


def injected(record: RunRecord, at: Nanos, acts_on: str, sonar: int = 0) -> tuple[Nanos, str] | None:
    """Return the last fault that is in force at a time and acts on the wheels or on a sonar, and since when.

    Args:
        record: The run.
        at: The time.
        acts_on: "wheels" or "sonar".
        sonar: Of a sonar which one, from 1 on.
    """
    found: dict[str, Nanos] = {}
    for fault in record.faults:
        if fault.t <= at and fault.op in {"inject", "clear"}:
            found.pop(fault.words, None)
            kind, *values = fault.words.split()
            is_meant = not kind.startswith("sonar-") or values[:1] == [str(sonar)]
            is_over = kind in _ANEW and at - fault.t > _RECONNECTS_NS
            if fault.op == "inject" and kind in _ACTS_ON[acts_on] and is_meant and not is_over:
                found[fault.words] = fault.t
    return next(((since, words) for words, since in reversed(found.items())), None)


def let_go(record: RunRecord, at: Nanos) -> tuple[str, Nanos, str] | None:
    """Return the control wire by which the program had not its robot shortly before a time, since when, in words."""
    for wire, (level, means) in CONTROL.items():
        edges = record.pins.get(wire)
        place = -1 if edges is None else bisect_right(edges.times, at) - 1
        if edges is None or place < 0:
            continue
        words = f"{wire} {'high' if level else 'low'} {means}"
        if edges.levels[place] == level:
            return wire, edges.times[place], f"{words}, since {edges.times[place] / NS_PER_S:.3f} s"
        if place > 0 and at - edges.times[place] < _RECONNECTS_NS:
            since, until = edges.times[place - 1], edges.times[place]
            return wire, since, f"{words}: it was so from {since / NS_PER_S:.3f} s to {until / NS_PER_S:.3f} s"
    return None


def _why_not_obeyed(record: RunRecord, at: Nanos, steps: list[ChainLink]) -> str:
    """Return what the trace says of it; empty where it says nothing."""
    gone = let_go(record, at)
    if gone is not None:
        wire, since, says = gone
        steps.append(ChainLink(t=since, part="wire", says=f"{wire} {CONTROL[wire][1]}", evidence=Evidence.RECORDED))
        return says
    fault = injected(record, at, "wheels")
    if fault is not None:
        since, words = fault
        steps.append(ChainLink(t=since, part="wire", says=f"fault injected: {words}", evidence=Evidence.RECORDED))
        return f"{words!r} was injected at {since / NS_PER_S:.3f} s"
    notes = [note for note in record.events if note.t <= at and note.what != "command" and note.who != "body"]
    if notes:
        note = notes[-1]
        says = f"{note.who}: {note.what}{', ' if note.detail else ''}{note.detail}"
        steps.append(ChainLink(t=note.t, part="wire", says=says, evidence=Evidence.RECORDED))
        if note.what not in {"driving", "motors"}:
            return f"the last of the state log is {says!r}, at {note.t / NS_PER_S:.3f} s"
    return ""


def ended(prober: Prober, silent: Nanos, failed: Nanos, steps: list[ChainLink]) -> Finding:
    """Return since when a program takes no notice of any sensor, what it does instead, and what ran over then."""
    since = prober.ended_noticing(silent)
    if since is None:
        return Finding("the program takes no notice of any sensor's pin, at any time before", is_cause=False)
    gap = read_gap(prober, since)
    if failed - since <= gap * 5 // 4:
        return Finding(f"the program is late: it reads its input pins only each {gap / NS_PER_S:.2f} s, and takes no "
                       f"notice of them from {since / NS_PER_S:.3f} s to {failed / NS_PER_S:.3f} s")  # fmt: skip
    says = f"the program takes no notice of any sensor's pin since {since / NS_PER_S:.3f} s"
    steps.append(ChainLink(t=since, part="firmware", says="a change of the sensors' pins changes its way, variables or "
                           "outputs for the last time", evidence=Evidence.CHANGED))  # fmt: skip
    now = prober.lines_run(silent, silent + 100 * NS_PER_MS)
    doing = sorted(now, key=lambda line: -now[line])
    before = prober.lines_run(max(0, since - 200 * NS_PER_MS), since)
    after = prober.lines_run(since + 200 * NS_PER_MS, min(failed, since + LOOKED_NS))
    gone = [line for line in before if line not in after]
    variables = ran_over(prober, since)
    if len(now) <= LOOP_LINES:
        runs = f"runs {numbers(doing[:NAMED])} and nothing else" if doing else "runs nothing"
        steps.append(ChainLink(t=silent, part="firmware", says=runs, evidence=Evidence.REPLAYED))
        return Finding(f"{says}: it is stuck at {doing[0]}" if doing else f"{says}: it stands still")
    if gone:
        steps.append(ChainLink(t=since, part="firmware", says=f"runs for the last time: {numbers(gone[:NAMED])}",
                               evidence=Evidence.REPLAYED))  # fmt: skip
        says += f"; {gone[0]} ran until then and not after"
    if variables:
        at, says_of_it = next(iter(variables.items()))
        steps.append(ChainLink(t=at, part="firmware", says=says_of_it, evidence=Evidence.REPLAYED))
        says += f"; {says_of_it} at {at / NS_PER_S:.3f} s"
    return Finding(says)


#: chosen: a program that runs no more than so many places in 100 ms, and takes no notice, is in a loop.
LOOP_LINES = 4
#: chosen: so long after that time is looked for what ran no more.
LOOKED_NS: Nanos = 5 * NS_PER_S


def read_gap(prober: Prober, at: Nanos) -> Nanos:
    """Return the longest time between two reads of input pins before a time; 0 where they are read often."""
    for span in (NS_PER_S // 5, 12 * NS_PER_S):
        reads = prober.replay.reads(max(0, at - span), at + NS_PER_MS)
        gaps = [
            after - before for before, after in itertools.pairwise(sorted(t for one in reads.values() for t in one))
        ]
        if sum(gaps) > NS_PER_S // 10:
            return max(gaps) if max(gaps) > NS_PER_S // 10 else 0
    return 0


def ran_over(prober: Prober, around: Nanos) -> Mapping[Nanos, str]:
    """Return which variables ran over, or passed a limit of a counter's width, around a time, and when."""
    span = 400 * NS_PER_MS
    seen = prober.replay.run(max(0, around - span), min(around + span, prober.replay.end), memory_ns=5 * NS_PER_MS)
    found: dict[Nanos, str] = {}
    for name, offset, size in prober.replay.variables:
        if size not in {1, 2, 4}:
            continue
        values = [(t, int.from_bytes(memory[offset : offset + size], "little")) for t, memory in seen.memory]
        whole = 1 << 8 * size
        for (_, a), (t, b) in itertools.pairwise(values):
            if a > whole * 7 // 8 and b < whole // 8:
                found.setdefault(t, f"variable {name} ran over from {a} to {b} ({8 * size} bits)")
            limit = next((limit for limit in _LIMITS if a < limit <= b < a + limit // 8 and limit < whole), None)
            if limit is not None:
                found.setdefault(t, f"variable {name} passed {limit}")
    return dict(sorted(found.items(), key=lambda item: ("ran over" not in item[1], abs(item[0] - around))))
