"""Readers of other programs' files: `read(path, up)`, by its ending an entry point of the group `p2os.world_readers`.

A reader is imported when a file of its kind is opened, so that its dependencies are needed only then. Files are taken
to be hostile: sizes are bounded before memory is asked for, and whatever is wrong ends in a `WorldError`.
"""
