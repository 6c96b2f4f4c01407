"""Readers of other programs' files, each of which gives a `World`.

A reader is imported when a file of its kind is opened, so that its dependencies
are needed only then. Files are taken to be hostile: sizes are bounded before
memory is asked for, and whatever is wrong ends in a `WorldError`.
"""

from p2os.pioneer.world.formats.placing import Placing
from p2os.pioneer.world.formats.readers import FORMATS, read_placed, read_world

__all__ = ["FORMATS", "Placing", "read_placed", "read_world"]
