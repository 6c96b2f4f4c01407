"""A staged house made ready to be handed out: with a manual, completions and a bill of materials."""

import tomllib
from pathlib import Path

from tools.packaging import shell_files
from tools.packaging.bill import bill
from tools.packaging.staging import House, as_toml, stage

#: Where `setup.py` takes the bill from, and the folder of a shell's files.
BILL, SHARE = "sbom.cdx.json", "share"
#: The group of entry points whose names are verbs.
VERBS = "p2os.verbs"


def prepare(house: House, place: Path) -> Path:
    """Stage a house with all that a release of it has; return its folder.

    Raises:
        FileExistsError: The folder is there already.
    """
    stage(house, place)
    table = tomllib.loads((place / "pyproject.toml").read_text(encoding="utf-8"))
    project = table["project"]
    files = [path.relative_to(place).as_posix() for path in place.rglob("*")]
    (place / BILL).write_text(bill(project, files), encoding="utf-8")
    verbs = list(project["entry-points"].get(VERBS, ()))
    is_program = shell_files.PROGRAM in project.get("scripts", {})
    if verbs:
        table["tool"]["setuptools"]["data-files"] = shell_files.written(
            place, verbs, project["version"], is_program=is_program
        )
        (place / "pyproject.toml").write_text(as_toml(table), encoding="utf-8")
    with (place / "MANIFEST.in").open("a", encoding="utf-8") as manifest:
        manifest.write(f"include {BILL}\n" + (f"graft {SHARE}\n" if verbs else ""))
    return place
