"""URDF as static geometry: a description of a robot or a scene, standing still.

Taken: links with `collision` (with `visual` where a link has no collision) of
box, cylinder, sphere, mesh; joints of every kind at their zero. A link of one upright
box or cylinder that has a mass and hangs on a floating joint can be pushed, with the
friction that PyBullet is given (`<contact>`).

Left out, and reported: any other movement, transmissions, sensors. Xacro files must
be expanded first.

Ours and not yourdfpy's: yourdfpy 0.0.60 brings 300 MB of packages (scipy, embree, ...) for these 80 lines, fails with
a TypeError on `package://file`, takes one in five damaged files that are refused here, and names no line.
"""

from collections.abc import Sequence
from pathlib import Path

from p2os.errors import WorldError
from p2os.pioneer.world.formats.annotation import Traits, is_no_thing, noted_traits, noted_world, pushed
from p2os.pioneer.world.formats.collection import PLAIN, STANDS_STILL, Collection
from p2os.pioneer.world.formats.shapes import take_geometry
from p2os.pioneer.world.formats.xml_tree import Element, numbers, read_xml
from p2os.pioneer.world.interchange.transform import IDENTITY, Transform, after, from_roll_pitch_yaw
from p2os.pioneer.world.model import World

#: PyBullet's, of a link that names none.
FRICTION = 0.5


def read(path: Path, up: str) -> World:
    """Return the world of a URDF file.

    Raises:
        WorldError: The file is no URDF, or its joints make no tree.
    """
    if up not in {"auto", "z"}:
        raise WorldError(f"{path}: URDF is Z up; up = {up!r} makes no sense")
    root, collection = read_xml(path, "robot"), Collection(path)
    joints = root.all("joint")
    parents = _parents(root.all("link"), joints, path)
    if any(joint.get("type") not in {"fixed", "floating", ""} for joint in joints):
        collection.skip("that joints move: each stands at its zero")
    places: dict[str, Transform] = {}
    for link in root.all("link"):
        if is_no_thing(link):
            continue
        place = _place(link.get("name"), parents, places, path)
        joint, _ = parents.get(link.get("name"), (None, ""))
        traits = noted_traits(link, path) or PLAIN
        if joint is not None and joint.get("type") == "floating":
            traits = _traits(link, traits, collection, path)
        shown = link.all("collision") or link.all("visual")
        for number, shape in enumerate(shown):
            geometry = shape.first("geometry")
            if geometry is not None:
                name = link.get("name") + (f" {number + 1}" if len(shown) > 1 else "")
                at = after(place, _origin(shape, path))
                take_geometry(name, geometry, at, collection, path, in_attributes=True, traits=traits)
    return collection.world(*(noted_world(root, path) or ()))


def _traits(link: Element, traits: Traits, collection: Collection, path: Path) -> Traits:
    """Return what a link that hangs on nothing is: one solid with a mass can be pushed."""
    mass, friction = link.first("inertial", "mass"), link.first("contact", "lateral_friction")
    if mass is None or len(link.all("collision")) != 1:
        collection.skip(STANDS_STILL)
        return traits
    (mass_kg,) = numbers(mass, mass.get("value"), path, 1)
    mu = numbers(friction, friction.get("value"), path, 1)[0] if friction is not None else FRICTION
    moving = pushed(traits, mass_kg, mu)
    if moving is traits:
        collection.skip(STANDS_STILL)
    return moving


def _parents(links: Sequence[Element], joints: Sequence[Element], path: Path) -> dict[str, tuple[Element, str]]:
    """Return the joint on which each link hangs, and the link that the joint hangs on."""
    names: set[str] = set()
    for link in links:
        if link.get("name") in names:
            raise WorldError(f"{path}:{link.line}: two links are named {link.get('name')!r}")
        names.add(link.get("name"))
    parents: dict[str, tuple[Element, str]] = {}
    for joint in joints:
        parent, child = _ends(joint, "parent", path), _ends(joint, "child", path)
        for name in (parent, child):
            if name not in names:
                raise WorldError(
                    f"{path}:{joint.line}: joint {joint.get('name')!r} names {name!r}, which is no link here"
                )
        if parents.setdefault(child, (joint, parent))[0] is not joint:
            raise WorldError(f"{path}:{joint.line}: link {child!r} hangs on two joints")
    return parents


def _place(link: str, parents: dict[str, tuple[Element, str]], places: dict[str, Transform], path: Path) -> Transform:
    """Return where a link is, from its chain of joints; `places` keeps what is known of other links."""
    chain: dict[str, Element] = {}
    while link in parents and link not in places:
        chain[link], link = parents[link]
        if link in chain:
            raise WorldError(f"{path}:{chain[link].line}: the joints go round in a ring at link {link!r}")
    place = places.get(link, IDENTITY)
    for child, joint in reversed(chain.items()):
        place = places[child] = after(place, _origin(joint, path))
    return place


def _origin(element: Element, path: Path) -> Transform:
    origin = element.first("origin")
    if origin is None:
        return IDENTITY
    x, y, z = numbers(origin, origin.get("xyz", "0 0 0"), path, 3)
    roll, pitch, yaw = numbers(origin, origin.get("rpy", "0 0 0"), path, 3)
    return from_roll_pitch_yaw(x, y, z, roll, pitch, yaw)


def _ends(joint: Element, end: str, path: Path) -> str:
    found = joint.first(end)
    if found is None or not found.get("link"):
        raise WorldError(f"{path}:{joint.line}: joint {joint.get('name')!r} has no {end}")
    return found.get("link")
