"""The example programs and what builds them: files of the checkout, for tests of the emulator without the bench."""

import importlib.util
from pathlib import Path
from types import ModuleType

EXAMPLES = Path(__file__).resolve().parents[2] / "robot_bench" / "firmware"


def _loaded(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location("build_of_examples", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def __getattr__(name: str) -> ModuleType:
    """Return `build`, the module of the folder that builds a program, when it is asked for."""
    if name != "build":
        raise AttributeError(name)
    return globals().setdefault(name, _loaded(EXAMPLES / "build.py"))
