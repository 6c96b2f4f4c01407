"""The one import of PyBullet, without the line that its library prints when it is loaded."""

import importlib
import os
from types import ModuleType

_STANDARD_ERROR = 2


def _load() -> ModuleType:
    """Import PyBullet with the process's standard error turned away for that moment."""
    # PyBullet needs NumPy and does not say so: a missing one is named first, aloud.
    importlib.import_module("numpy")
    try:
        kept = os.dup(_STANDARD_ERROR)
    except OSError:
        return importlib.import_module("pybullet")
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, _STANDARD_ERROR)
        return importlib.import_module("pybullet")
    finally:
        os.dup2(kept, _STANDARD_ERROR)
        os.close(kept)
        os.close(nowhere)


pybullet = _load()
