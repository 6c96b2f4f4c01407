"""Parameters of a robot: by its subclass, from a file of one's own, or for the identity that a robot sends.

One TOML file a model in `p2os/robots/`, each number with its source; a user's
own file is TOML too, or one of ARIA's (`.p`).
"""

from functools import cache
from pathlib import Path

from p2os.robots.aria_file import aria_table
from p2os.robots.model import BodyParameters, Equipment, MotionDefaults, ParametersError, RobotParameters, SonarPose
from p2os.robots.model_file import build_parameters, file_parameters, known_robots, shipped_table, text_of
from p2os.toml_file import is_file
from simbase.errors import nearest, shown, shown_name

__all__ = [
    "BodyParameters",
    "Equipment",
    "MotionDefaults",
    "ParametersError",
    "RobotParameters",
    "SonarPose",
    "known_robots",
    "load_parameters",
]

#: What an unknown robot is taken for when its name has no known beginning.
FALLBACK = "p2dx"
#: Beginnings of names that belong to a shipped model, where no model's own name begins them.
FAMILIES = {
    "p2a": "p2at", "p2p": "p2pb", "p2": "p2dx", "p3at": "p3at-sh", "p3a": "p3at-sh", "p3": "p3dx-sh",
    "amigo": "amigo-sh", "power": "powerbot-sh", "patrol": "patrolbot-sh", "people": "peoplebot-sh", "perf": "perfpb",
    "mt400": "patrolbot-sh", "researchpb": "patrolbot-sh", "psos": "pion1m", "pion": "pion1m", "seekur": "seekur",
}  # fmt: skip


def load_parameters(name_or_path: str | Path) -> RobotParameters:
    """Return a model's parameters, by its subclass or from a file (TOML, or ARIA's `.p`).

    Raises:
        ParametersError: The model is unknown, or the file is missing or breaks the schema.
    """
    name = str(name_or_path)
    if name.lower() in known_robots():
        return _shipped(name.lower())
    path = Path(name)
    if path.suffix == ".toml" and is_file(path):
        return file_parameters(path)
    if path.suffix == ".p" and is_file(path):
        return build_parameters(name, aria_table(name, text_of(path), nearest_model))
    if path.suffix in {".toml", ".p"}:
        raise ParametersError(f"no robot file {shown_name(name)}", hint=f"known models: {', '.join(known_robots())}")
    raise ParametersError(f"no robot model {shown(name)}", hint=nearest(name.lower(), known_robots()))


@cache
def _shipped(name: str) -> RobotParameters:
    """Return a model that ships with the package, read once: a campaign asks for it in each of its runs."""
    return build_parameters(f"{name}.toml", shipped_table(name))


def nearest_model(subclass: str) -> str:
    """Return the shipped model that a name belongs to: itself, the longest name it begins with, or its family."""
    name = subclass.lower()
    models = [model for model in known_robots() if name.startswith(model)]
    if models:
        return max(models, key=len)
    return next((model for start, model in FAMILIES.items() if name.startswith(start)), FALLBACK)
