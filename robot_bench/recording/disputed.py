"""What of a run hangs on its body: contacts after which the bodies differ, and what was decided after them.

Theory of operation. The bodies agree on a robot that meets a face nearly along it or nearly head-on, and on an edge or
a post straight ahead (p2os.pioneer.body.contacts). Of every other contact that the robot drives into, what follows is
the body's answer; so a verdict after the first of them may be another one on another body. From the trace: the pose
before the contact, the thing's place at that time, and where the hull was touched.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import cast

from p2os.pioneer.body.contacts import DISPUTED_BESIDE_M, DISPUTED_DEG
from p2os.pioneer.body.factory import engines
from robot_bench.events.codec import Json
from robot_bench.events.kinds import Contact, Pose, Verdict
from robot_bench.recording.run_record import RunRecord
from simbase.timing import NS_PER_S

#: chosen: nearer to the corner of a box the hull meets its edge, and no face, m.
EDGE_M = 0.02
#: chosen: below it the robot stands, and whatever touches it has come to it, m/s.
DRIVING_MPS = 0.02
_MICRO = 1e6


@dataclass(frozen=True, slots=True, kw_only=True)
class DisputedContact:
    """A contact after which the bodies differ.

    `angle_deg` is that of the robot's heading to the face, 90 head-on; None at an edge or a post, `beside_m` how far
    beside the robot's middle that is.
    """

    contact: Contact
    angle_deg: float | None
    beside_m: float

    def __str__(self) -> str:
        how = f"{self.beside_m:.2f} m beside its middle" if self.angle_deg is None else f"at {self.angle_deg:.0f}°"
        return f"{self.contact.what} at {self.contact.t / NS_PER_S:.3f} s, {how}"


def first_disputed(record: RunRecord) -> DisputedContact | None:
    """Return the first contact of a run after which the bodies differ."""
    return next((found for contact in record.contacts if (found := _disputed(record, contact)) is not None), None)


def decided_after(record: RunRecord, contact: Contact) -> list[Verdict]:
    """Return the verdicts that came after a contact; one that the contact itself decided does not hang on the rest."""
    return [verdict for verdict in record.verdicts if verdict.t > contact.t]


def body_note(record: RunRecord) -> str:
    """Return in a line which verdicts hang on the run's body, and why; empty where none does."""
    body = str(record.meta.get("body") or "")
    found = first_disputed(record) if body else None
    decided = [] if found is None else decided_after(record, found.contact)
    if not decided:
        return ""
    ranked = sorted(engines().values(), key=lambda engine: -engine.rank)
    other = next((f"run it with --body {engine.name}, too " for engine in ranked if engine.name != body), "")
    goals = ", ".join(f"{verdict.goal} ({'met' if verdict.met else 'missed'})" for verdict in decided)
    return (
        f"hangs on the body {body}: after the contact with {found} the bodies differ, and so may {goals}; "
        f"{other}(docs/pioneer.md, oblique hits)"
    )


def _disputed(record: RunRecord, contact: Contact) -> DisputedContact | None:
    pose = _pose_before(record, contact)
    thing = _thing_at(record, contact)
    if pose is None or thing is None or abs(pose.left + pose.right) / 2 < DRIVING_MPS * _MICRO:
        return None
    heading = pose.heading / _MICRO
    dx, dy = contact.x_m - pose.x / _MICRO, contact.y_m - pose.y / _MICRO
    beside_m = abs(dy * math.cos(heading) - dx * math.sin(heading))
    normal = _face_normal(thing, contact)
    if normal is None:
        is_disputed, angle_deg = beside_m > DISPUTED_BESIDE_M, None
    else:
        angle_deg = math.degrees(math.asin(min(1.0, abs(math.cos(heading - normal)))))
        is_disputed = DISPUTED_DEG[0] < angle_deg < DISPUTED_DEG[1]
    return DisputedContact(contact=contact, angle_deg=angle_deg, beside_m=beside_m) if is_disputed else None


def _pose_before(record: RunRecord, contact: Contact) -> Pose | None:
    """Return the last pose before a contact: at the contact itself the wheels may stand already."""
    return next((pose for pose in reversed(record.poses) if pose.t < contact.t), None)


def _thing_at(record: RunRecord, contact: Contact) -> Json | None:
    """Return the thing that was touched, where it stood then; None where the trace does not have it."""
    world = cast("Json", record.meta.get("world") or {})
    return next((thing for thing in _things(record, world, contact.t) if repr(thing.get("name")) == contact.what), None)


def _things(record: RunRecord, world: Json, until: int) -> Iterator[Json]:
    things = {str(one["name"]): one for one in cast("list[Json]", world.get("obstacles") or [])}
    for change in record.changes:
        if change.t <= until and change.op != "remove":
            things[change.name] = {**things.get(change.name, {}), **change.fields, "name": change.name}
    yield from things.values()


def _face_normal(thing: Json, contact: Contact) -> float | None:
    """Return the direction of the normal of the face that was touched, rad; None of an edge or a round thing."""
    if thing.get("shape") != "box":
        return None
    x, y, heading, length, width = (
        float(cast("float", thing[key])) for key in ("x", "y", "heading", "length", "width")
    )
    dx, dy = contact.x_m - x, contact.y_m - y
    along = abs(dx * math.cos(heading) + dy * math.sin(heading)) - length / 2
    across = abs(dy * math.cos(heading) - dx * math.sin(heading)) - width / 2
    if along > -EDGE_M and across > -EDGE_M:
        return None
    return heading if along > across else heading + math.pi / 2
