"""What SDF and URDF have no words for, in elements of our own: `<p2os:thing>` and `<p2os:world>`.

Other programs pass over them; `p2os.pioneer.world.formats.annotation` reads them.
"""

from p2os.pioneer.export.scene import ExportScene, SceneBody
from p2os.pioneer.export.xml_text import Tag, spaced
from p2os.pioneer.world.interchange.words import NAMESPACE, THING, WORLD

PREFIX = "p2os"
DECLARATION = {f"xmlns:{PREFIX}": NAMESPACE}


def annotate_thing(holder: Tag, body: SceneBody) -> None:
    """Add what a thing of a world is beside its geometry."""
    if body.kind:
        holder.add(
            f"{PREFIX}:{THING}", kind=body.kind, fixed="true" if body.is_fixed else "false",
            floor_m=spaced([body.floor_m]),
        )  # fmt: skip


def annotate_world(holder: Tag, scene: ExportScene) -> None:
    """Add where a robot begins, and how far the floor reaches."""
    if scene.start is not None and scene.extent is not None:
        holder.add(f"{PREFIX}:{WORLD}", start=spaced(scene.start), extent_m=spaced(scene.extent))
