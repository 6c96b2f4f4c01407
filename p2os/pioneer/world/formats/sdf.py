"""SDF (Gazebo's worlds and models) as static geometry.

Taken: worlds, models within each other, links, collisions with box, cylinder,
sphere, mesh; poses, nested, in radians or with degrees="true"; `include` of
files that are here. A model of one upright box or cylinder with a mass can be pushed,
with the friction that ODE is given; any other that could move stands still.

Left out, and reported: poses relative to a named frame, other geometry, lights,
plugins, sensors. Joints need nothing: each link has its place.
"""

import math
from pathlib import Path

from p2os.errors import WorldError
from p2os.pioneer.world.formats.annotation import Traits, is_no_thing, noted_traits, noted_world, pushed
from p2os.pioneer.world.formats.collection import PLAIN, STANDS_STILL, Collection
from p2os.pioneer.world.formats.local_file import find_local
from p2os.pioneer.world.formats.shapes import take_geometry
from p2os.pioneer.world.formats.xml_tree import Element, numbers, read_xml
from p2os.pioneer.world.interchange.transform import IDENTITY, Transform, after, from_roll_pitch_yaw
from p2os.pioneer.world.model import Pose, World

#: Files that include each other in a ring end here.
DEEPEST_INCLUDE = 8
MOST_INCLUDES = 1000
#: SDF 1.7, <mu> of ODE: what holds where a file names none.
FRICTION = 1.0
#: As `model://sun`: it is in nearly every world.
SUN = ("light", "sun")
NOTED = ("light", "actor", "population", "road", "plugin")


def read(path: Path, up: str) -> World:
    """Return the world of an SDF file.

    Raises:
        WorldError: The file is no SDF, or what it names is not here.
    """
    if up not in {"auto", "z"}:
        raise WorldError(f"{path}: SDF is Z up; up = {up!r} makes no sense")
    collection = Collection(path)
    reader = _Reader(collection)
    reader.file(path, IDENTITY, 0, "")
    return collection.world(*(reader.noted or ()))


class _Reader:
    def __init__(self, collection: Collection) -> None:
        self._collection = collection
        self._includes = 0
        #: The start and the extent that p2os wrote.
        self.noted: tuple[Pose, tuple[float, float, float, float]] | None = None

    def file(self, path: Path, place: Transform, depth: int, name: str) -> None:
        root = read_xml(path, "sdf", "gazebo")
        for world in root.all("world"):
            self._holder(world, place, path, depth, name)
            self.noted = self.noted or (noted_world(world, path) if depth == 0 else None)
        self._holder(root, place, path, depth, name)

    def _holder(self, holder: Element, place: Transform, path: Path, depth: int, prefix: str) -> None:
        """Take the models and includes of a world, a model or a file."""
        for child in holder.children:
            if child.tag == "model":
                self._model(child, place, path, depth, prefix)
            elif child.tag == "include":
                self._include(child, place, path, depth, prefix)
            elif child.tag in NOTED and (child.tag, child.get("name")) != SUN:
                self._collection.skip(f"SDF <{child.tag}>")

    def _model(self, model: Element, outer: Transform, path: Path, depth: int, prefix: str) -> None:
        if depth > DEEPEST_INCLUDE:
            raise WorldError(f"{path}:{model.line}: models within each other more than {DEEPEST_INCLUDE} deep")
        if is_no_thing(model):
            return
        name = f"{prefix}{model.get('name', 'model')}"
        noted = noted_traits(model, path)
        traits = self._traits(model, noted or PLAIN, path)
        place = after(outer, self._pose(model, path))
        for link in model.all("link"):
            at_link = after(place, self._pose(link, path))
            for collision in link.all("collision"):
                geometry = collision.first("geometry")
                if geometry is not None:
                    at = after(at_link, self._pose(collision, path))
                    shape = f"{name}/{link.get('name', 'link')}/{collision.get('name', 'collision')}"
                    take_geometry(
                        name if noted else shape, geometry, at, self._collection, path, in_attributes=False,
                        traits=traits,
                    )  # fmt: skip
        self._holder(model, place, path, depth + 1, f"{name}/")

    def _traits(self, model: Element, traits: Traits, path: Path) -> Traits:
        """Return what a model's shapes are: one that moves can be pushed if it is one solid with a mass."""
        static = model.first("static")
        if static is not None and static.text.strip().lower() in {"1", "true"}:
            return traits
        links = model.all("link")
        shapes = [shape for link in links for shape in link.all("collision")]
        mass = links[0].first("inertial", "mass") if len(links) == len(shapes) == 1 else None
        if mass is None or model.all("model") or model.all("include"):
            self._collection.skip(STANDS_STILL)
            return traits
        mu = shapes[0].first("surface", "friction", "ode", "mu")
        friction = numbers(mu, mu.text, path, 1)[0] if mu is not None else FRICTION
        moving = pushed(traits, numbers(mass, mass.text, path, 1)[0], friction)
        if moving is traits:
            self._collection.skip(STANDS_STILL)
        return moving

    def _include(self, include: Element, outer: Transform, path: Path, depth: int, prefix: str) -> None:
        self._includes += 1
        uri, name = include.first("uri"), include.first("name")
        if uri is None:
            raise WorldError(f"{path}:{include.line}: <include> without a <uri>")
        if uri.text.strip() in {"model://sun", "model://ground_plane"}:
            return  # the floor is there anyway
        if depth >= DEEPEST_INCLUDE or self._includes > MOST_INCLUDES:
            raise WorldError(
                f"{path}:{include.line}: files include each other more than {DEEPEST_INCLUDE} deep, "
                f"or more than {MOST_INCLUDES} times"
            )
        found = find_local(uri.text, path)
        if found.is_dir():
            found = find_local("model.sdf", found / "model.sdf")
        label = prefix if name is None else f"{prefix}{name.text.strip()}: "
        self.file(found, after(outer, self._pose(include, path)), depth + 1, label)

    def _pose(self, element: Element, path: Path) -> Transform:
        pose = element.first("pose")
        if pose is None or not pose.text.strip():
            return IDENTITY
        if pose.get("relative_to"):
            self._collection.skip(f"relative_to={pose.get('relative_to')!r}: the pose is taken within what holds it")
        x, y, z, *turns = numbers(pose, pose.text, path, 6)
        if pose.get("degrees").lower() in {"1", "true"}:
            turns = [math.radians(value) for value in turns]
        return from_roll_pitch_yaw(x, y, z, turns[0], turns[1], turns[2])
