"""Why a robot touched something: from the sensors that should have seen it to the motors, the first link that failed.

Theory of operation. Each link is looked at in turn, and the first that did not hold is the cause:

    obeyed    did the wheels do what the motor pins asked?            else: link, robot, adapter
    in sight  was the place in a sensor's cone before it was touched? else: a blind spot
    reported  did that sensor's pin go high?                          else: sensor, line, adapter
    noticed   does the program's way, or a variable, depend on it?    else: the program does not look, or looks away
    in time   how much of the time that was left had gone by then?    else: late
    away      does it answer by turning away from the sensor's side?  else: sides or sensors exchanged
    left      does it leave its way while a sensor shows something?   else: it drives on

Where all hold, the program did answer, in time, and whether its answer was right is not known: so it is said.

Invariant: a cause is given only of a link whose failure was recorded, or shown by two replays that differ in it.
"""

import math
from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from itertools import combinations

from robot_bench.events.kinds import Contact
from robot_bench.report.explain.chain import ChainLink, Evidence
from robot_bench.report.explain.findings import (
    Finding,
    all_steady_since,
    ended,
    held_codes,
    in_words,
    injected,
    numbers,
    obeyed,
    steady_since,
)
from robot_bench.report.explain.probing import SAME_NS, Prober, SensorResponse
from robot_bench.report.explain.replay import Hold
from robot_bench.report.explain.scene import Scene
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos

#: chosen: so long before a contact its place is looked for in the cones.
BEFORE_NS: Nanos = 8 * NS_PER_S
#: chosen: sonar, line and sampling of the adapter take less than this together.
TELLING_NS: Nanos = 600 * NS_PER_MS
#: chosen: an answer is late that comes after so large a part of the time that was left, and takes so long.
LATE_PART, LATE_NS = 0.4, 150 * NS_PER_MS
#: chosen: for so long nobody drives straight on at something near that he sees.
STRAIGHT_S = 1.0
#: chosen: a side is named of at least so many moments that agree.
AGREEING = 3


class ContactAnalysis:
    """Looks for why one contact came about.

    Args:
        scene: Where the robot was.
        prober: Replays of its chip; None where there is none.
        hit: The contact.
    """

    def __init__(self, scene: Scene, prober: Prober | None, hit: Contact) -> None:
        self.scene, self.hit = scene, hit
        self._prober = prober
        self.steps: list[ChainLink] = []
        self.bearing = scene.bearing_rad(hit)
        #: From when on the thing stood where it was touched.
        self.since = scene.still_since(hit, hit.t - BEFORE_NS)
        self.expected = scene.should_see(hit, self.since)
        self.on = self._rises()

    def find(self) -> Finding:
        """Return the first link that did not hold, or what is known."""
        self._tell_motion()
        links: Sequence[Callable[[], Finding | None]] = (
            self._is_obeyed, self._is_in_sight, self._is_reported, self._is_noticed, self._is_in_time, self._is_away,
            self._is_left,
        )  # fmt: skip
        for link in links:
            found = link()
            if found is not None:
                return found
        return self._unknown()

    # Links.

    def _is_obeyed(self) -> Finding | None:
        return obeyed(self.scene.record, self.scene.step_mps, self.hit.t, self.steps)

    def _is_in_sight(self) -> Finding | None:
        hit, since = self.hit, self.since
        if since > hit.t - BEFORE_NS:
            self._step(since, "world", f"{hit.what} comes to where it is touched", Evidence.RECORDED)
        if self.expected:
            first = min(self.expected.values())
            nets = ", ".join(self.expected)
            self._step(
                first,
                "world",
                f"{hit.what} is within {self.scene.threshold_m:.2f} m in the cone of {nets}",
                Evidence.GEOMETRY,
            )
            return None
        if self.scene.may_see(hit, since) or self.on:
            return None
        if hit.t - since < TELLING_NS:
            return Finding(
                f"{hit.what} came to where it was touched only {(hit.t - since) / NS_PER_S:.2f} s before: no "
                "sensor tells in that time"
            )
        codes, began = steady_since(self.scene.record, hit.t - NS_PER_MS)
        if sum(codes) < 0:
            return Finding(
                f"the robot was driven backwards (motors {in_words(codes)}) since {began / NS_PER_S:.3f} s, where no "
                "sensor looks; whether that was right is not known",
                is_cause=False,
            )
        ahead = min((abs(math.remainder(self.bearing - sensor.heading_rad, math.tau)) for sensor in self.scene.sensors),
                    default=math.pi)  # fmt: skip
        return Finding(
            f"a blind spot: what was touched ({hit.place}) was in no sensor's cone before; it lies "
            f"{math.degrees(ahead):.0f}° beside the axis of the nearest one",
        )

    def _is_reported(self) -> Finding | None:
        if self.on or not self.expected:
            return None
        first = min(self.expected.values())
        left_s = (self.hit.t - first) / NS_PER_S
        net = min(self.expected, key=lambda name: self.expected[name])
        if self.hit.t - first < TELLING_NS:
            return Finding(
                f"it came into sight of {net} only {left_s:.2f} s before it was touched: no sensor tells in that time"
            )
        number = int(net[2:]) - 1
        fault = injected(self.scene.record, self.hit.t, "sonar", number + 1)
        if fault is not None:
            self._step(fault[0], "world", f"fault injected: {fault[1]}", Evidence.RECORDED)
        ranges = [mm for t, mm in self.scene.record.sonar if first <= t <= self.hit.t]
        shortest = min((mm[number] for mm in ranges if number < len(mm)), default=None)
        measured = "" if shortest is None else f"; its sonar measured {shortest / 1000:.2f} m at the least"
        return Finding(
            f"the sensor did not tell: {net} stayed low for the {left_s:.2f} s in which it should have seen "
            f"{self.hit.what}{measured}" + (f"; injected was {fault[1]!r}" if fault is not None else ""),
        )

    def _is_noticed(self) -> Finding | None:
        prober = self._prober
        if not self.on or prober is None:
            return None
        since = min(self.on.values())
        for net, at in self.on.items():
            self._step(at, "sensor", f"{prober.replay.pin(net)} goes high", Evidence.RECORDED)
        self._effect = effect = prober.effect(self._without(self.hit.t), self.hit.t, since)
        if effect.noticed is None:
            return self._why_unnoticed(prober, since)
        after_ms = (effect.noticed - since) / 1e6
        self._step(effect.noticed, "firmware", f"notices it, {after_ms:.1f} ms after, at {effect.by}", Evidence.CHANGED)
        return None

    def _why_unnoticed(self, prober: Prober, since: Nanos) -> Finding:
        hit, nets, left = self.hit, self._nets(prober), (self.hit.t - since) / NS_PER_S
        same = f"its way, variables and outputs are the same with {nets} held low since {since / NS_PER_S:.3f} s"
        self._step(hit.t, "firmware", same, Evidence.CHANGED)
        if not prober.takes_notice(since):
            return Finding(ended(prober, since, hit.t, self.steps).says)
        until = min(hit.t + 3 * NS_PER_S, prober.replay.end)
        late = prober.effect(self._without(until), until, since)
        if late.noticed is not None:
            return Finding(
                f"the program is late: it takes notice of {nets} only {(late.noticed - since) / NS_PER_S:.2f} s after "
                f"the pin went high, at {late.by}; the contact came after {left:.2f} s"
            )
        asked = self._asked
        ignored = [net for net in prober.sensors if asked and all(answers[net].noticed is None for answers in asked)]
        always = [net for net in self.on if net in ignored]
        if always:
            return Finding(
                f"the program ignores {numbers([prober.replay.pin(net) for net in ignored])}: nothing in it depends on "
                f"{'them' if len(ignored) > 1 else 'it'} at any of {len(asked)} times, though it does on others; "
                f"{always[0]} was high for the {left:.2f} s before the contact"
            )
        return Finding(
            f"the program takes no notice of {nets} in the {left:.2f} s before the contact, though it does of others, "
            "and of this at other times", is_cause=left >= STRAIGHT_S,
        )  # fmt: skip

    def _is_in_time(self) -> Finding | None:
        prober = self._prober
        if not self.on or prober is None or self._effect.noticed is None:
            return None  # what is not noticed is reported before
        since = min(self.on.values())
        took, left = self._effect.noticed - since, self.hit.t - since
        if took >= LATE_NS and took >= LATE_PART * left:
            pose, then = self.scene.pose(since), self.scene.pose(self._effect.noticed)
            way = math.hypot(then.x_m - pose.x_m, then.y_m - pose.y_m)
            return Finding(
                f"the program is late: it takes notice only {took / NS_PER_S:.2f} s after {numbers(list(self.on))} "
                f"went high, of {left / NS_PER_S:.2f} s that were left; the robot drove {way:.2f} m meanwhile"
            )
        answered = [answers[net].answered for answers in self._asked for net in self.on]
        nets = self._nets(prober)
        if len(self._asked) >= AGREEING and not any(answered):
            after = self._answers_after()
            if after is None and self._effect.answered is None:
                return Finding(
                    f"the program notices {nets} at {self._effect.by} and does nothing about it, here and at "
                    f"{len(self._asked)} other times: its outputs are the same with and without"
                )
            answered = [after]
        near = [answers[net] for answers in self._asked for net in self.on]
        same = max([self._effect.otherwise_ns, *(one.otherwise_ns for one in near)]) < SAME_NS
        if len(self._asked) >= AGREEING and same and left >= STRAIGHT_S * NS_PER_S:
            return Finding(
                f"the program notices {nets} at {self._effect.by} and sets its motors no otherwise for it (motors "
                f"{held_codes(self._effect.way, self.hit.t)}), here for {left / NS_PER_S:.2f} s and at "
                f"{len(self._asked)} other times"
            )
        least = min((one for one in answered if one is not None), default=0)
        answered_ns = None if self._effect.answered is None else self._effect.answered - since
        here = answered_ns is None or answered_ns >= least * 9 // 10  # within a round of its loop
        if len(self._asked) >= AGREEING and here and least >= LATE_NS and least >= LATE_PART * left:
            return Finding(
                f"the program is late: it notices {nets} at once, at {self._effect.by}, and answers after "
                f"{least / NS_PER_S:.2f} s at the soonest, of {left / NS_PER_S:.2f} s that were left"
            )
        return None

    def _answers_after(self) -> Nanos | None:
        """Return how long a near sensor's pin has to be high before the program answers; None: longer than is tried."""
        prober = self._prober
        if prober is None:
            return None
        at = self._asked[len(self._asked) // 2][prober.sensors[0]].at
        answers = prober.answers(at, BEFORE_NS, list(self.on))
        return min((one for net in self.on if (one := answers[net].answered) is not None), default=None)

    def _is_away(self) -> Finding | None:
        prober = self._prober
        if not self.on or prober is None:
            return None
        asked = [answers for answers in self._asked if sum(answers[prober.sensors[0]].base) > 0]
        found = exchanged(prober.sensors, asked, self._side) if len(asked) >= AGREEING else ""
        near = dict.fromkeys((*self.on, *self.expected))
        wrong = [
            net
            for net in (prober.sensors if found.startswith("left and") else near)
            if _is_toward(net, asked, self._side(net)) and (not found or net in found or found.startswith("left and"))
        ]
        mine = self._turn(self._effect.before) - self._turn(self._effect.after)
        if not wrong:
            return None
        for net in wrong[:2]:
            self._step(
                asked[-1][net].at,
                "firmware",
                f"when {prober.replay.pin(net)}, which looks {self._side(net)}, alone goes high, the motors go from "
                f"{in_words(asked[-1][net].base)} to {in_words(asked[-1][net].codes)}: a turn to the "
                f"{self._side(net)}; so at {len(asked)} times",
                Evidence.CHANGED,
            )
        if mine * (1 if self.bearing > 0 else -1) <= 0 and not found:
            return None
        as_with = f": as with {found}" if found else ""
        return Finding(
            f"the program turns towards what {numbers([prober.replay.pin(net) for net in wrong])} "
            f"see{'s' * (len(wrong) == 1)}{as_with}"
        )

    def _is_left(self) -> Finding | None:
        """Tell of a program that drives on straight at what its sensors show ahead."""
        if not self.on or self._prober is None or abs(self.bearing) > math.radians(60):
            return None
        codes, since = steady_since(self.scene.record, self.hit.t - NS_PER_MS)
        held = (self.hit.t - max(since, *self.on.values())) / NS_PER_S
        if codes[0] != codes[1] or codes[0] <= 0 or held < STRAIGHT_S:
            return None
        nets = numbers([self._prober.replay.pin(net) for net in self.on])
        lost = self._lost_reverse(self._prober)
        if lost:
            return Finding(f"the program never asks the {lost[0]} motor to go backwards, though it does the {lost[1]} "
                           f"one: it drives straight on (motors {in_words(codes)}) where the mirrored answer would "
                           f"turn it, for the last {held:.2f} s, with {nets} high")  # fmt: skip
        if self._effect.after == codes:
            return None  # it is not the sensors that make it drive so, and what else does is not known
        return Finding(
            f"the program drives straight on (motors {in_words(codes)}) for the last {held:.2f} s, with {nets} high "
            f"all the time; without them it would have set {in_words(self._effect.after)}"
        )

    def _lost_reverse(self, prober: Prober) -> tuple[str, str] | None:
        """Return the motor that is never reversed where, mirrored, the other one is; None where there is no such."""
        times = sorted({t for net in prober.replay.outputs if net.startswith("motor")
                        for t in self.scene.record.pins[net].times})  # fmt: skip
        given = [codes for codes, _ in all_steady_since(
            self.scene.record, [t for t in times if t <= prober.replay.end]
        )]  # fmt: skip
        given += [answer.codes for answers in self._asked for answer in answers.values()]
        nets = prober.sensors
        for motor, names in ((0, ("left", "right")), (1, ("right", "left"))):
            other = 1 - motor
            if any(codes[motor] < 0 for codes in given) or not any(codes[other] < 0 for codes in given):
                continue
            for answers in self._asked:
                for one, mirrored in zip(nets, reversed(nets), strict=True):
                    turn, wanted = answers[one].codes, answers[mirrored].codes
                    if wanted[other] < 0 < wanted[motor] == turn[other]:
                        return names
        return None

    def _unknown(self) -> Finding:
        if self._prober is None:
            return Finding(
                "the chip was not replayed, so what the program did with its inputs is not known", is_cause=False
            )
        if not self.on:
            return Finding("no sensor near the place had its pin high before; whether one should have had is not known",
                           is_cause=False)  # fmt: skip
        since, effect = min(self.on.values()), self._effect
        if effect.answered is None:
            return Finding(f"the program noticed {numbers(list(self.on))} and did nothing about it before the contact; "
                           "whether that was right is not known", is_cause=False)  # fmt: skip
        took = f" {(effect.answered - since) / 1e6:.0f} ms after"
        given, without = effect.before, effect.after
        if given == without and effect.otherwise is not None:
            given, without = effect.otherwise  # it answered, and has done with it
            took += f", for {effect.otherwise_ns / NS_PER_S:.2f} s"
        return Finding(
            f"the program answered{took} (motors {in_words(without)} without, {in_words(given)} with "
            f"{numbers(list(self.on))}); whether that answer was right is not known",
            is_cause=False,
        )

    # Helpers.

    def _nets(self, prober: Prober) -> str:
        return numbers([prober.replay.pin(net) for net in self.on])

    def _without(self, until: Nanos) -> list[Hold]:
        """Return the near sensors' pins held low from when they went high on."""
        return [Hold(wire=net, level=False, since=at, until=until) for net, at in self.on.items()]

    @cached_property
    def _asked(self) -> list[Mapping[str, SensorResponse]]:
        """What the program does at some times of the whole run when one sensor alone sees something."""
        prober = self._prober
        return [] if prober is None else [prober.answers(at) for at in prober.moments(prober.replay.end)]

    def _side(self, net: str) -> str:
        return next((sensor.side for sensor in self.scene.sensors if sensor.net == net), "left")

    @staticmethod
    def _turn(codes: tuple[int, int]) -> int:
        return codes[1] - codes[0]

    def _rises(self) -> dict[str, Nanos]:
        """Return when the pins of the sensors that should see the place, or look nearest to it, last went high."""
        near = [
            sensor.net
            for sensor in self.scene.sensors
            if sensor.net in self.expected
            or abs(math.remainder(self.bearing - sensor.heading_rad, math.tau)) <= math.radians(25)
        ]
        found = {}
        for net in near:
            edges = self.scene.record.pins[net]
            place = bisect_right(edges.times, self.hit.t) - 1
            if place >= 0 and not edges.levels[place] and edges.times[place] > self.hit.t - TELLING_NS:
                place -= 1  # it has just gone low
            if place >= 0 and edges.levels[place]:
                found[net] = edges.times[place]
        return found

    def _tell_motion(self) -> None:
        hit, pose = self.hit, self.scene.pose(self.hit.t)
        self._step(
            pose.t,
            "motion",
            f"the wheels run at {pose.left / 1000:+.0f} and {pose.right / 1000:+.0f} mm/s",
            Evidence.RECORDED,
        )
        self._step(hit.t, "contact", f"{hit.place}, {math.degrees(self.bearing):+.0f}° from ahead", Evidence.RECORDED)
        prober = self._prober
        if prober is None:
            return
        times = [t for net in prober.replay.outputs if net.startswith("motor")
                 for t in self.scene.record.pins[net].times if 0 < t <= hit.t]  # fmt: skip
        if not times:
            return
        at = max(times)
        codes = in_words(steady_since(prober.replay.record, hit.t)[0])
        net = next(
            net for net in prober.replay.outputs if net.startswith("motor") and at in self.scene.record.pins[net].times
        )
        place = (
            prober.replay.writer(at, prober.replay.wires[net].bluepill[1]) if at <= prober.replay.exact_until else None
        )
        by = "" if place is None else f", by {place}"
        if place is not None and (new := prober.new_lines(at)):
            self._step(
                at, "firmware", f"comes by {numbers(new[:-4:-1])}, where it had not been before", Evidence.REPLAYED
            )
        self._step(
            at, "firmware", f"sets the motors to {codes}{by}", Evidence.RECORDED if place is None else Evidence.REPLAYED
        )
        commands = [note for note in self.scene.record.events if note.what == "command" and note.t <= hit.t]
        if commands:
            self._step(commands[-1].t, "wire", f"the adapter sends {commands[-1].detail}", Evidence.RECORDED)

    def _step(self, t: Nanos, part: str, says: str, evidence: Evidence) -> None:
        self.steps.append(ChainLink(t=t, part=part, says=says, evidence=evidence))


def _is_toward(net: str, asked: Sequence[Mapping[str, SensorResponse]], side: str) -> bool:
    """Tell whether a sensor alone always makes it turn to the sensor's side, at enough times."""
    turns = [answers[net].turn for answers in asked if answers[net].answered is not None]
    sign = 1 if side == "left" else -1
    return len(turns) >= AGREEING and all(turn * sign > 0 for turn in turns)


def exchanged(nets: Sequence[str], asked: Sequence[Mapping[str, SensorResponse]], side: Callable[[str], str]) -> str:
    """Return which exchange of two would make every answer a turn away, and both sides alike; empty: none, or several.

    Answers that differ from time to time count neither way, and so are no evidence of an exchange: the two that are
    said to be exchanged always answer alike, each towards its own side where they look to different sides, and
    an exchange of the sides shows at two sensors of each.
    """

    def turns(order: Sequence[int], answers: Mapping[str, SensorResponse]) -> list[tuple[int, int]]:
        return [answers[nets[place]].codes for place in order]

    def are_sure(*pair: str) -> bool:
        alike = side(pair[0]) == side(pair[1])
        return all(_is_sure(net, asked) and (alike or _is_toward(net, asked, side(net))) for net in pair)

    def is_good(order: Sequence[int]) -> bool:
        for net_place, net in enumerate(nets):
            sign = 1 if side(net) == "left" else -1
            source = nets[order[net_place]]
            found = [answers[source].turn * sign for answers in asked if answers[source].answered is not None]
            if found and all(turn > 0 for turn in found):
                return False
            opposite = nets[order[len(nets) - 1 - net_place]]
            if any(answers[source].codes != answers[opposite].codes[::-1] for answers in asked) and not (
                _varies(source, asked) or _varies(opposite, asked)
            ):
                return False
        return True

    plain = list(range(len(nets)))
    if is_good(plain):
        return ""
    toward = [side(net) for net in nets if _is_sure(net, asked) and _is_toward(net, asked, side(net))]
    is_mirrored = is_good(plain[::-1]) and min(toward.count("left"), toward.count("right")) >= 2
    swaps = [(nets[one], nets[other]) for one, other in combinations(plain, 2) if is_good(_swapped(plain, one, other))]
    if is_mirrored and not swaps:
        return "left and right exchanged, at the sensors or at the motors"
    return next(
        (f"{one} and {other} exchanged" for one, other in swaps if len(swaps) == 1 and are_sure(one, other)), ""
    )


def _is_sure(net: str, asked: Sequence[Mapping[str, SensorResponse]]) -> bool:
    """Tell whether a sensor is always answered, and always alike."""
    return not _varies(net, asked) and all(answers[net].answered is not None for answers in asked)


def _varies(net: str, asked: Sequence[Mapping[str, SensorResponse]]) -> bool:
    return len({answers[net].codes for answers in asked}) > 1


def _swapped(order: Sequence[int], one: int, other: int) -> list[int]:
    found = list(order)
    found[one], found[other] = found[other], found[one]
    return found
