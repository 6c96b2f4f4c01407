"""Drive each body against the things of an arena and measure each contact.

    python tools/surveys/contact_survey.py                             # thirty headings, three bodies, three models
    python tools/surveys/contact_survey.py --body bullet --headings 6
    python tools/surveys/contact_survey.py --picture docs/pictures/contact.svg

A robot drives from the middle of the arena with both rims at 0.4 m/s, ramped as the firmware
ramps, until it meets a thing; the same command goes on for some seconds, then both set-points
are zero. `SurveyedContact.faults` says what of a contact breaks the contract of `body`'s data sheet.

Needs the engines of the bodies. Ends with 1 where a contact
breaks the contract.
"""

import argparse
import itertools
import math
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from p2os.pioneer.body.contract import BodyState, RobotBody
from p2os.pioneer.body.factory import engines, make_body
from p2os.pioneer.world import load_world
from p2os.pioneer.world.model import Pose, World
from p2os.robots.parameters import RobotParameters, load_parameters

MODELS = ("p2dx", "p3dx-sh", "powerbot")
COMMAND_MPS, RAMP_MPS2 = 0.4, 0.3
#: The states are looked at so often, steps of 1 ms.
LOOK_STEPS = 10
LOOK_S = LOOK_STEPS / 1000
#: A robot that has met nothing by then has no contact, s; and how long one is watched.
LONGEST_WAY_S, WATCHED_S = 30.0, 8.0
#: Speeds of the centre are means over so many looks.
MEAN_LOOKS = 10

# The contract.
#: Of the command: a centre that is faster slides, rims that are slower are blocked.
SLIDE_SHARE, BLOCKED_SHARE = 0.2, 0.1
DECIDED_S, STALL_S, REST_S, STOP_S = 1.5, 0.6, 2.0, 0.05
MOST_SIGN_CHANGES = 2
#: Slower is no turn, rad/s, and no motion, m/s.
TURNING_RADPS, RESTING_MPS = 0.05, 0.005
#: Above the kinetic energy of the robot at its command, per kg; a share.
ENERGY_MARGIN = 1.05


@dataclass(frozen=True, slots=True, kw_only=True)
class SurveyedContact:
    """What was measured of one contact; times in seconds from the first touch, None where it did not happen."""

    body: str
    model: str
    heading_deg: float
    #: First stall bit.
    stall_s: float | None
    #: From both rims blocked to the first stall bit, the longest.
    blocked_to_stall_s: float
    #: When all came to rest for good.
    rest_s: float | None
    #: From the first time with both stall bits to rest, or for as long as it was watched; None where it never stood.
    stand_to_rest_s: float | None
    #: Share of the looks at which its centre slid.
    slide_share: float
    #: Whether it slid, had a stall bit, or touched nothing at `DECIDED_S`; or was blocked, or did so until lately, as
    #: where wheels spin before they are blocked, and is decided again within `STALL_S`.
    is_decided: bool
    #: The longest time, from `DECIDED_S` on, in which it touched and neither slid nor had a stall bit.
    undecided_s: float
    sign_changes: int
    #: The greatest kinetic energy in that of the command.
    energy: float
    #: From the set-points at zero until the rims stood, None where they did not within a second.
    stop_s: float | None

    def faults(self) -> list[str]:
        """Return what of this breaks the contract."""
        found = []
        if not self.is_decided:
            found.append(f"neither slides nor stalls {DECIDED_S:g} s after the first touch")
        # What slid until then may come to be blocked.
        if self.undecided_s > STALL_S:
            found.append(f"neither slides nor stalls for {self.undecided_s:.2f} s")
        if self.blocked_to_stall_s > STALL_S:
            found.append(f"blocked for {self.blocked_to_stall_s:.2f} s without a stall bit")
        if self.sign_changes > MOST_SIGN_CHANGES:
            found.append(f"its turn changes sign {self.sign_changes} times")
        if self.stand_to_rest_s is not None and self.stand_to_rest_s > REST_S:
            found.append(f"moves for {self.stand_to_rest_s:.2f} s after both wheels stalled")
        if self.energy > ENERGY_MARGIN:
            found.append(f"{self.energy:.2f} times the energy of the command")
        if self.stop_s is None or self.stop_s > STOP_S:
            found.append("a stop is not effective at once")
        return found


def measure(
    body: RobotBody, model: RobotParameters, heading_deg: float, watched_s: float = WATCHED_S
) -> SurveyedContact | None:
    """Drive against whatever is there; return what was measured, None where nothing is met."""
    body.reset(Pose(0.0, 0.0, math.radians(heading_deg)), 0)
    for step in range(round(LONGEST_WAY_S * 1000)):
        speed = min(COMMAND_MPS, step * RAMP_MPS2 / 1000)
        body.step(speed, speed)
        if step % LOOK_STEPS == 0 and body.state.collisions:
            break
    else:
        return None
    states = list(_watch(body, COMMAND_MPS, watched_s))
    stopping = list(_watch(body, 0.0, 1.0))
    return judged_states(body.name, model, heading_deg, states, stopping)


def _watch(body: RobotBody, speed_mps: float, seconds: float) -> Iterator[BodyState]:
    for _ in range(round(seconds * 1000 / LOOK_STEPS)):
        body.hold(speed_mps, speed_mps, LOOK_STEPS)
        yield body.state


def judged_states(
    name: str, model: RobotParameters, heading_deg: float, states: Sequence[BodyState], stopping: Sequence[BodyState]
) -> SurveyedContact:
    """Return what the states after a first touch, and those after the command to stop, amount to."""
    speeds = [_speed(states, look) for look in range(len(states))]
    slides = [speed >= SLIDE_SHARE * COMMAND_MPS for speed in speeds]
    stalls = [state.stalled_left or state.stalled_right for state in states]
    stands = [state.stalled_left and state.stalled_right for state in states]
    blocked = [_rim(state) < BLOCKED_SHARE * COMMAND_MPS for state in states]
    rests = [max(_rim(state), speed) <= RESTING_MPS for state, speed in zip(states, speeds, strict=True)]
    # The first state is a look after the touch.
    decided = min(round(DECIDED_S / LOOK_S), len(states)) - 1
    undecided = [
        state.in_contact and not slide and not stall for state, slide, stall in zip(states, slides, stalls, strict=True)
    ]
    turns = [state.turn_radps for state in states if abs(state.turn_radps) > TURNING_RADPS]
    rest = next((look for look in reversed(range(len(states))) if not rests[look]), -1) + 1
    stand_s = _first(stands)
    rest_s = rest * LOOK_S
    own = model.body
    gyration_m2 = ((own.hull_front_m + own.hull_rear_m) ** 2 + own.hull_width_m**2) / 12
    energies = [
        speed**2 + gyration_m2 * state.turn_radps**2
        for speed, state in list(zip(speeds, states, strict=True))[MEAN_LOOKS:]
    ]
    return SurveyedContact(
        body=name,
        model=model.subclass,
        heading_deg=heading_deg,
        stall_s=_first(stalls),
        blocked_to_stall_s=_longest(
            is_blocked and not stall for is_blocked, stall in zip(blocked, stalls, strict=True)
        ),
        rest_s=rest_s if rest < len(states) else None,
        stand_to_rest_s=None if stand_s is None else max(0.0, rest_s - stand_s),
        slide_share=sum(slides) / len(slides),
        is_decided=blocked[decided] or _is_decided_lately(undecided, decided),
        undecided_s=_longest(undecided[decided:]),
        sign_changes=sum(one * other < 0 for one, other in itertools.pairwise(turns)),
        energy=max(energies) / COMMAND_MPS**2,
        stop_s=_first(_rim(state) < RESTING_MPS for state in stopping),
    )


def _is_decided_lately(undecided: Sequence[bool], look: int) -> bool:
    """Tell whether a contact is decided at a look, or was until lately and is again within the time of a stall bit."""
    before = next((n for n in range(look, -1, -1) if not undecided[n]), None)
    behind = next((n for n in range(look, len(undecided)) if not undecided[n]), len(undecided))
    return before is not None and (behind - before - 1) * LOOK_S <= STALL_S


def _speed(states: Sequence[BodyState], look: int) -> float:
    """Return the mean speed of the robot's centre over `MEAN_LOOKS`, m/s."""
    since = max(0, look - MEAN_LOOKS)
    now, then = states[look], states[since]
    return math.dist((now.x_m, now.y_m), (then.x_m, then.y_m)) / (max(1, look - since) * LOOK_S)


def _rim(state: BodyState) -> float:
    """Return the speed of the faster rim, m/s."""
    return max(abs(state.left_speed_mps), abs(state.right_speed_mps))


def _first(claims: Iterable[bool]) -> float | None:
    """Return after how many seconds a claim is true for the first time."""
    return next((look * LOOK_S for look, claim in enumerate(claims) if claim), None)


def _longest(claims: Iterable[bool]) -> float:
    """Return for how many seconds a claim is true without a break, at the most."""
    return LOOK_S * max((sum(1 for _ in run) for claim, run in itertools.groupby(claims) if claim), default=0)


def survey(bodies: Sequence[str], models: Sequence[str], headings: int, world: World) -> Iterator[SurveyedContact]:
    """Measure a contact for each model, body and heading that meets a thing."""
    for model in models:
        parameters = load_parameters(model)
        for name in bodies:
            body = make_body(name, world, parameters)
            for number in range(headings):
                found = measure(body, parameters, number * 360.0 / headings)
                if found is not None:
                    yield found


#: Of the picture: colours of the bodies, size of a panel and what stands around it, pixels; seconds that it shows.
COLOURS = {"kinematic": "#d55e00", "bullet": "#0072b2", "mujoco": "#009e73"}
PANEL_PX, TALL_PX, LEFT_PX, TOP_PX, GAP_PX = 620, 130, 60, 56, 34
SHOWN_S = 4.0


def picture(contacts: Sequence[SurveyedContact]) -> str:
    """Return an SVG of when each contact had its first stall bit (filled) and came to rest (ring), by heading."""
    models = list(dict.fromkeys(one.model for one in contacts))
    bodies = list(dict.fromkeys(one.body for one in contacts))
    height = TOP_PX + len(models) * (TALL_PX + GAP_PX) + 12
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {LEFT_PX + PANEL_PX + 20} {height}" font-size="12">',
        '<rect width="100%" height="100%" fill="#fff"/><g font-family="sans-serif">',
        _text(
            LEFT_PX, 16, "Seconds from the first touch to the first stall bit (filled) and to rest (ring), by heading"
        ),
        _text(LEFT_PX + 110 * len(bodies), 36, f"at the top edge: later than {SHOWN_S:g} s, or slides on"),
    ]
    for number, body in enumerate(bodies):
        x = LEFT_PX + 110.0 * number
        parts += [f'<circle cx="{x + 5}" cy="32" r="4" fill="{COLOURS[body]}"/>', _text(x + 14, 36, body)]
    for row, model in enumerate(models):
        top = TOP_PX + row * (TALL_PX + GAP_PX)
        parts.append(f'<rect x="{LEFT_PX}" y="{top}" width="{PANEL_PX}" height="{TALL_PX}" fill="none" stroke="#999"/>')
        parts.append(_text(LEFT_PX + 4, top + 14, model))
        for second in range(int(SHOWN_S) + 1):
            y = top + TALL_PX * (1 - second / SHOWN_S)
            parts += [
                f'<path d="M{LEFT_PX} {y:.1f}h{PANEL_PX}" stroke="#ddd"/>',
                _text(LEFT_PX - 32, y + 4, f"{second} s"),
            ]
        for heading in range(0, 361, 90):
            x = LEFT_PX + PANEL_PX * heading / 360
            parts.append(_text(x - 8, top + TALL_PX + 15, f"{heading}\N{DEGREE SIGN}"))
        for one in (one for one in contacts if one.model == model):
            colour = COLOURS[one.body]
            # Beside each other, where bodies agree.
            x = LEFT_PX + PANEL_PX * one.heading_deg / 360 + 5 * bodies.index(one.body) + 3
            for seconds, look in ((one.rest_s, f'fill="none" stroke="{colour}"'), (one.stall_s, f'fill="{colour}"')):
                y = top + TALL_PX * (1 - min(SHOWN_S if seconds is None else seconds, SHOWN_S) / SHOWN_S)
                parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2.6" {look}/>')
    return "\n".join([*parts, "</g></svg>\n"])


def _text(x_px: float, y_px: float, words: str) -> str:
    return f'<text x="{x_px:.1f}" y="{y_px:.1f}">{words}</text>'


def main() -> int:
    """Print what each contact was, and what of it breaks the contract."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--body", action="append", choices=engines(), help="may be given more than once; default: all")
    parser.add_argument("--model", action="append", help=f"may be given more than once; default: {', '.join(MODELS)}")
    parser.add_argument("--headings", type=int, default=30, help="default: 30")
    parser.add_argument("--seed", type=int, default=1, help="of the arena; default: 1")
    parser.add_argument("--picture", type=Path, metavar="FILE.svg", help="write the times as a picture, too")
    options = parser.parse_args()
    world = load_world("arena", options.seed)
    found = []
    print("model      body       heading   stall    rest  slides  signs  energy")
    for one in survey(options.body or engines(), options.model or MODELS, options.headings, world):
        found.append(one)
        stall, rest = (f"{'never':>7}" if s is None else f"{s:5.2f} s" for s in (one.stall_s, one.rest_s))
        print(f"{one.model:<10} {one.body:<10} {one.heading_deg:5.0f} \N{DEGREE SIGN} {stall} {rest}"
              f" {one.slide_share:6.0%} {one.sign_changes:6} {one.energy:7.2f}", *one.faults(), sep="  ")  # fmt: skip
    if options.picture is not None:
        options.picture.write_text(picture(found), encoding="utf-8")
    broken = sum(bool(one.faults()) for one in found)
    print(f"{len(found)} contacts, {broken} break the contract")
    return int(broken > 0)


if __name__ == "__main__":
    sys.exit(main())
