"""Why a robot came no further: what it did in the longest time in which it stayed where it was.

    reset      the chip was reset, and began anew
    obeyed     its motor pins asked for way, and the wheels did not turn
    stuck      the program takes notice of nothing any more
    opposite   with no sensor seeing anything it drives its wheels opposite ways
    stays so   it goes on with it when nothing is in sight, as it did not before
    sees       a sonar that was made to err keeps a pin high, and without it the program drives on
    itself     the program held the motors so while it looked at its inputs: why is not known

Invariant: as of `robot_bench.report.explain.contact`.
"""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from robot_bench.events.kinds import Pose
from robot_bench.report.explain.chain import ChainLink, Evidence
from robot_bench.report.explain.findings import (
    CONTROL,
    Finding,
    codes_between,
    ended,
    held_codes,
    injected,
    let_go,
    numbers,
    obeyed,
    steady_since,
    told,
)
from robot_bench.report.explain.probing import QUIET_NS, Codes, Prober, SensorResponse
from robot_bench.report.explain.replay import ChipReset
from robot_bench.report.explain.scene import Scene
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos

#: chosen: a robot that stays within so many metres for so large a part of the run came no further.
STAYS_M, PART = 0.15, 0.25
#: chosen: a program begins to drive within so long of its reset.
BEGINS_NS: Nanos = 6 * NS_PER_S


@dataclass(frozen=True, slots=True)
class _Stay:
    since: Nanos
    until: Nanos
    turned_rad: float


class ProgressInquest:
    """Looks for why a robot stayed where it was.

    Args:
        scene: Where it was.
        prober: Replays of its chip; None where there is none.
        until: The end of the time that counts.
    """

    def __init__(self, scene: Scene, prober: Prober | None, until: Nanos) -> None:
        self.scene = scene
        self._prober = prober
        self._until = until
        self.steps: list[ChainLink] = []

    def find(self) -> Finding:
        """Return what kept it, or what is known."""
        stay = self._longest_stay()
        reset = self._was_reset()
        if reset is not None:
            return reset
        if stay is None or stay.until - stay.since < PART * self._until:
            return self._opposite(self._until) or Finding(
                "the robot stayed nowhere for long; why it came no further is not known", is_cause=False
            )
        turned = f" and turned {math.degrees(stay.turned_rad):.0f}°" if stay.turned_rad > math.pi else ""
        self._step(
            stay.since,
            "motion",
            f"comes no further than {STAYS_M:.2f} m until {stay.until / NS_PER_S:.3f} s{turned}",
            Evidence.RECORDED,
        )
        middle = (stay.since + stay.until) // 2
        found = obeyed(self.scene.record, self.scene.step_mps, middle, self.steps)
        if found is not None:
            self._tell_who_let_go(middle)
            return found
        return (
            self._not_begun(stay)
            or self._stuck(stay, middle)
            or self._opposite(stay.until)
            or self._stays_so(stay, middle)
            or self._sees_what_is_not(middle)
            or self._itself(stay, middle)
        )

    def _was_reset(self) -> Finding | None:
        prober = self._prober
        resets = [] if prober is None else prober.replay.resets
        lost = [(reset, self._idle_after(reset.at)) for reset in resets]
        if prober is None or not lost or sum(idle for _, idle in lost) < PART / 2 * self._until:
            return None
        for reset, idle in lost[:3]:
            self._step(
                reset.at,
                "firmware",
                f"is reset by {words_of(reset)}, while at {reset.place}; stands for {idle / NS_PER_S:.1f} s",
                Evidence.REPLAYED,
            )
        first, stood_s = lost[0][0], sum(idle for _, idle in lost) / NS_PER_S
        return Finding(
            f"{words_of(first)} reset the chip {_times(len(resets))}, first at "
            f"{first.at / NS_PER_S:.3f} s; the robot stood {stood_s:.0f} s for it{self._last_fed(first.cause)}"
        )

    def _last_fed(self, cause: str) -> str:
        return fed(self._prober, cause, self.steps) if self._prober is not None else ""

    def _not_begun(self, stay: _Stay) -> Finding | None:
        """Tell of a program that had not asked its motors for anything by then."""
        record = self.scene.record
        edges = [edge for net in record.pins if net.startswith("motor") for edge in record.pins[net]]
        begins = min((t for t, level in edges if level and t > 0), default=None)
        if begins is not None and begins < (stay.since + stay.until) // 2:
            return None
        where = ""
        if self._prober is not None:
            at = (stay.since + min(stay.until, begins or stay.until)) // 2
            place = self._prober.last_place(at)
            self._step(at, "firmware", f"is at {place}", Evidence.REPLAYED)
            where = f"; at {at / NS_PER_S:.3f} s it is at {place}"
        when = "at no time" if begins is None else f"for the first time at {begins / NS_PER_S:.3f} s"
        return Finding(f"the program asks its motors for something {when}: it had not begun to drive{where}")

    def _stuck(self, stay: _Stay, middle: Nanos) -> Finding | None:
        prober = self._prober
        if prober is None or prober.takes_notice(middle):
            return None
        codes, since = steady_since(self.scene.record, middle)
        found = ended(prober, middle, stay.until, self.steps)
        if not found.is_cause:
            return None
        if steady_since(self.scene.record, stay.until)[1] != since:
            return found
        return Finding(f"{found.says}; the motors stay at {told(codes)} since {since / NS_PER_S:.3f} s")

    def _opposite(self, until: Nanos) -> Finding | None:
        prober = self._prober
        if prober is None:
            return None
        asked = [prober.answers(at) for at in prober.moments(until, 4)]
        bases = {answers[prober.sensors[0]].base for answers in asked}
        if len(asked) < 3 or len(bases) != 1:
            return None
        left, right = next(iter(bases))
        if left * right >= 0:
            return None
        self._step(
            asked[0][prober.sensors[0]].at,
            "firmware",
            f"with all sensors' pins held low for 3.5 s, the motors are at {left:+d}, {right:+d}; "
            f"so at {len(asked)} times",
            Evidence.CHANGED,
        )
        why = self._why_opposite(prober, asked)
        return Finding(
            f"the program drives its wheels opposite ways with nothing in sight (left {left:+d}, right {right:+d}): "
            f"the robot turns on the spot where it should drive on{why and f'; {why}'}",
            is_cause=bool(why),
        )

    def _why_opposite(self, prober: Prober, asked: Sequence[Mapping[str, SensorResponse]]) -> str:
        """Return what a program that turns with nothing in sight does with something in sight; empty: it tells nothing.

        A wrong sign of one motor makes a straight way of each turn too, so it shows at several sensors.
        """

        def drives_on(codes: Codes) -> bool:
            return min(codes) > 0

        alike = [net for net in prober.sensors if all(abs(sum(a[net].codes)) == 2 * abs(a[net].codes[0]) != 0
                                                      for a in asked)]  # fmt: skip
        on = [net for net in prober.sensors if all(drives_on(answers[net].codes) for answers in asked)]
        unseen = [net for net in prober.sensors if all(answers[net].noticed is None for answers in asked)]
        if len(alike) >= 2 and len(on) < 2:
            return (f"it drives them alike when {numbers([prober.replay.pin(net) for net in alike])}, each alone, "
                    "goes high: as with the sign of one motor wrong")  # fmt: skip
        if len(on) == 1 and on == alike:
            return (f"it drives on when {prober.replay.pin(on[0])} alone goes high, so at {len(asked)} times: as with "
                    f"{on[0]} inverted")  # fmt: skip
        if alike or on:
            return ""
        if all(drives_on(prober.codes_all(answers[prober.sensors[0]].at, level=True)) for answers in asked):
            return f"it drives on when all sensors' pins are high, so at {len(asked)} times: as with all inverted"
        if len(unseen) == 1:
            return (f"nothing in it depends on {prober.replay.pin(unseen[0])}: as with that one taken to be always "
                    "high")  # fmt: skip
        return ""

    def _stays_so(self, stay: _Stay, middle: Nanos) -> Finding | None:
        """Tell of a program that drove on with nothing in sight before, and does so no more."""
        prober, record = self._prober, self.scene.record
        codes, since = steady_since(record, middle)
        until = min(middle + self.scene.gives_up_ns, stay.until, self._until)
        if prober is None or until - middle < self.scene.gives_up_ns or middle - since < self.scene.gives_up_ns:
            return None
        held = prober.replay.run(middle, until, prober.held(middle, until, level=False))
        if any(net.startswith("motor") for _, net, _ in held.edges):
            return None
        begin = next((pose.t for pose in self.scene.poses(0, since) if min(pose.left, pose.right) > 20_000), None)
        if begin is None or begin + QUIET_NS > since:
            return None
        free = prober.codes_all(begin, level=False)
        if min(free) <= 0:
            return None
        lasts = (until - middle) / NS_PER_S
        self._step(middle, "firmware", f"keeps the motors at {told(codes)} also when all sensors' pins "
                   f"are held low for {lasts:.0f} s", Evidence.CHANGED)  # fmt: skip
        lines = prober.lines_run(middle, middle + 100 * NS_PER_MS)
        was = prober.lines_run(max(0, since - 300 * NS_PER_MS), since)
        gone = [line for line in was if line not in lines]
        if gone:
            self._step(since, "firmware", f"runs for the last time: {numbers(gone[:4])}", Evidence.REPLAYED)
        return Finding(
            f"the program never leaves what it does since {since / NS_PER_S:.3f} s (motors {told(codes)}): it does "
            f"the same with all sensors' pins held low for {lasts:.0f} s, though at {begin / NS_PER_S:.1f} s, with "
            f"nothing in sight, it drove on ({told(free)})"
        )

    def _sees_what_is_not(self, middle: Nanos) -> Finding | None:
        """Tell of a sensor's pin that a fault keeps high, and that alone keeps the program from driving on."""
        prober = self._prober
        if prober is None:
            return None
        for net in prober.sensors:
            fault = injected(self.scene.record, middle, "sonar", int(net[2:]))
            if fault is None or not fault[1].startswith("sonar-") or not prober.replay.level(net, middle):
                continue
            answer = prober.answers(middle, nets=[net])[net]
            if min(answer.base) > 0 >= min(answer.codes):
                self._step(fault[0], "world", f"fault injected: {fault[1]}", Evidence.RECORDED)
                return Finding(
                    f"{prober.replay.pin(net)} is high, where {fault[1]!r} was injected at "
                    f"{fault[0] / NS_PER_S:.3f} s; with it low, and all others, the program drives on "
                    f"({told(answer.base)}), "
                    f"with it alone high it does not ({told(answer.codes)})"
                )
        return None

    def _itself(self, stay: _Stay, middle: Nanos) -> Finding:
        codes, since = steady_since(self.scene.record, middle)
        prober = self._prober
        by = ""
        if prober is not None and 0 < since <= prober.replay.exact_until:
            nets = [net for net in prober.replay.outputs if since in self.scene.record.pins[net].times]
            place = prober.replay.writer(since, prober.replay.wires[nets[0]].bluepill[1]) if nets else None
            by = "" if place is None else f" by {place}"
        self._step(since, "firmware", f"sets the motors to {told(codes)}{by}", Evidence.REPLAYED)
        high = [] if prober is None else [net for net in prober.sensors if prober.replay.level(net, middle)]
        seen = f" with {numbers(high)} high" if high else " with no sensor's pin high"
        held = held_codes(codes_between(self.scene.record, stay.since, stay.until), stay.until)
        return Finding(
            f"from {stay.since / NS_PER_S:.1f} s to {stay.until / NS_PER_S:.1f} s the program itself kept the robot "
            f"there (motors {held}{seen}); whether that was right is not known",
            is_cause=False,
        )

    def _tell_who_let_go(self, at: Nanos) -> None:
        """Say which line of the program let go of the robot."""
        prober, gone = self._prober, let_go(self.scene.record, at)
        if prober is None or gone is None or not 0 < gone[1] <= prober.replay.exact_until:
            return
        wire, since, _ = gone
        place = prober.replay.writer(since, prober.replay.wires[wire].bluepill[1])
        if place is not None:
            level = "high" if CONTROL[wire][0] else "low"
            self._step(since, "firmware", f"takes {wire} {level} at {place}", Evidence.REPLAYED)

    def _idle_after(self, at: Nanos) -> Nanos:
        """Return how long the robot came nowhere after a time."""
        poses = self.scene.poses(at, min(at + BEGINS_NS, self._until))
        if not poses:
            return 0
        first = poses[0]
        return next((pose.t for pose in poses if _far(first, pose)), poses[-1].t) - at

    def _longest_stay(self) -> _Stay | None:
        poses = self.scene.poses(0, self._until)
        best = (0, 0)
        begin = 0
        for place, pose in enumerate(poses):
            while _far(poses[begin], pose):
                begin += 1
            if pose.t - poses[begin].t > poses[best[1]].t - poses[best[0]].t:
                best = begin, place
        first, last = best
        return _Stay(poses[first].t, poses[last].t, _turned(poses[first : last + 1])) if last > first else None

    def _step(self, t: Nanos, part: str, says: str, evidence: Evidence) -> None:
        self.steps.append(ChainLink(t=t, part=part, says=says, evidence=evidence))


#: Causes of resets in words.
_CAUSES = {
    "IWDG": "the independent watchdog (IWDG)", "WWDG": "the window watchdog (WWDG)", "SOFTWARE": "the program itself",
    "PIN": "the reset pin", "LOW_POWER": "a refused low-power mode",
}  # fmt: skip


def words_of(reset: ChipReset) -> str:
    """Return what reset the chip."""
    return _CAUSES.get(reset.cause, reset.cause)


def fed(prober: Prober, cause: str, steps: list[ChainLink]) -> str:
    """Return where a program fed its watchdog last before the first reset, and what it did not come by since."""
    resets = [reset for reset in prober.replay.resets if reset.cause == cause]
    if cause != "IWDG" or not resets:
        return ""
    feeds = prober.replay.feeds(max(0, resets[0].at - 12 * NS_PER_S), resets[0].at)
    if not feeds:
        return "; it was not fed in the 12 s before"
    at, place = feeds[-1]
    says = f"feeds the watchdog for the last time, at {place}"
    steps.append(ChainLink(t=at, part="firmware", says=says, evidence=Evidence.REPLAYED))
    usual = prober.lines_run(max(0, at - 100_000_000), at)
    after = prober.lines_run(at + 20_000, resets[0].at)
    new = [line for line in after if line not in usual]
    if new:
        says = f"from then on it goes by {numbers(new[:4])}, where it had not been in the 0.1 s before"
        steps.append(ChainLink(t=at, part="firmware", says=says, evidence=Evidence.REPLAYED))
    before_ms = (resets[0].at - at) / NS_PER_MS
    return f"; it was fed last at {at / NS_PER_S:.3f} s, {before_ms:.0f} ms before, at {place}, and not again till then"


def _turned(poses: Sequence[Pose]) -> float:
    return sum(abs(math.remainder(b.heading_rad - a.heading_rad, math.tau)) for a, b in itertools.pairwise(poses))


def _far(one: Pose, other: Pose) -> bool:
    return math.hypot(one.x_m - other.x_m, one.y_m - other.y_m) > STAYS_M


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"
