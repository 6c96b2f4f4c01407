"""A robot's URDF with the names of its frames, as RViz and robot_state_publisher want it.

The shapes are those of `p2os world convert --robot`; here the links are called as TF calls them.
"""

from dataclasses import replace

from p2os.pioneer.export import scene_of
from p2os.pioneer.export.scene import SceneBody, SceneMark
from p2os.pioneer.export.scenes import part_names
from p2os.pioneer.export.urdf import write
from p2os.ros.frames import BASE, Frames, frame_of


def urdf_text(frames: Frames) -> str:
    """Return the URDF of a robot."""
    scene = scene_of(None, frames.parameters)
    own = frames.parameters.subclass
    names = {body: frames.name(frame_of(part) or BASE) for body, part in part_names(frames.parameters).items()}
    bodies = tuple(_renamed(body, names, frames) for body in scene.bodies)
    return write(replace(scene, bodies=bodies), own, joint_name="{}_joint")[f"{own}.urdf"].decode()


def _renamed(body: SceneBody, names: dict[str, str], frames: Frames) -> SceneBody:
    marks = tuple(SceneMark(name=frames.sonar(number), place=mark.place) for number, mark in enumerate(body.marks))
    return replace(body, name=names[body.name], parent=names.get(body.parent or ""), marks=marks)
