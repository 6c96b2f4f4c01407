"""What adapter_fw/build.py makes, for the tests that run it."""

import sys
from functools import cache
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[2]


@cache
def load_script(path: str) -> ModuleType:
    """Return a script of the checkout as a module."""
    name = path.replace("/", "_").removesuffix(".py")
    spec = spec_from_file_location(name, ROOT / path)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


BUILD = load_script("adapter_fw/build.py")


def built(name: str, folder: Path) -> tuple[Path, dict[str, int]]:
    """Return a target's program and the size of its core; skip the test where its compiler is missing."""
    target = BUILD.TARGETS[name]
    if not BUILD.is_installed(name):
        pytest.skip(f"{' or '.join(target.tools)} is not installed: apt-get install {target.package}")
    program = folder / target.output
    return program, BUILD.build(name, program)
