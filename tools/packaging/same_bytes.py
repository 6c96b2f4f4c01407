"""Source distributions that are the same bytes whenever and wherever they are built.

Wheels are so by themselves where SOURCE_DATE_EPOCH is set; a source distribution keeps times, owners and the gzip's own
time.
"""

import gzip
import io
import os
import subprocess
import tarfile
from pathlib import Path

from tools.packaging.staging import ROOT


def epoch() -> int:
    """Return the time of a build's files, s since 1970: what SOURCE_DATE_EPOCH says, else that of the commit."""
    if given := os.environ.get("SOURCE_DATE_EPOCH"):
        return int(given)
    command = ["git", "log", "-1", "--format=%ct"]
    said = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False).stdout.strip()
    return int(said) if said else 315532800  # 1980, the first that a zip file can hold


def packed_again(path: Path) -> None:
    """Pack a .tar.gz anew, in place: in order of names, with one time and no owner."""
    at = epoch()
    with tarfile.open(path) as old:
        members = sorted(old.getmembers(), key=lambda member: member.name)
        content = {member.name: file.read() for member in members if (file := old.extractfile(member)) is not None}
    plain = io.BytesIO()
    with tarfile.open(fileobj=plain, mode="w", format=tarfile.PAX_FORMAT) as new:
        for member in members:
            member.mtime, member.uid, member.gid, member.uname, member.gname = at, 0, 0, "", ""
            member.mode, member.pax_headers = 0o755 if member.isdir() or member.mode & 0o100 else 0o644, {}
            data = content.get(member.name)
            new.addfile(member, None if data is None else io.BytesIO(data))
    with path.open("wb") as file, gzip.GzipFile(filename="", mode="wb", fileobj=file, mtime=at) as packed:
        packed.write(plain.getvalue())
