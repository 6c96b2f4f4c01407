"""What is there already is not overwritten without a word where it could not be had again.

For recordings of a robot, for world files that people go on writing by hand, and for exports: their target
stands without an option's name, where the shell puts whatever `*.csv` finds. Pictures and reports are made anew.
"""

from pathlib import Path

from simbase.errors import UsageError

FORCE_HELP = "Overwrite a file that is there."


def refuse_to_overwrite(path: Path | None, *, force: bool) -> None:
    """Refuse a path at which a file with content stands; devices, pipes and empty files are free.

    Raises:
        UsageError: There is one, and `force` does not say otherwise.
    """
    if path is not None and not force and path.is_file() and path.stat().st_size > 0:
        raise UsageError(f"{path} is there already", hint="another name, or --force to overwrite it")
