"""Find a file that another file names: beside it, never over the network."""

from pathlib import Path

from p2os.errors import WorldError
from p2os.pioneer.world.text_file import sized
from simbase.errors import shown


def find_local(uri: str, beside: Path) -> Path:
    """Return the file that a URI means.

    `package://name/rest` and `model://name/rest` are looked for as `name/rest`, then
    as `rest`, beside the naming file and in the folders above it; `file://` and
    plain paths as they are.

    Raises:
        WorldError: There is no such file here, or it is too large.
    """
    scheme, separator, rest = uri.strip().partition("://")
    if separator and scheme not in {"file", "package", "model"}:
        raise WorldError(f"{beside}: {shown(uri)} is not a local file", hint="fetch it first and name the copy")
    name = rest if separator else uri.strip()
    tries = [name]
    if separator and scheme != "file" and "/" in name:
        tries.append(name.split("/", 1)[1])
    folders = [beside.parent, *beside.resolve().parent.parents] if separator else [beside.parent]
    for folder in folders:
        for text in tries:
            path = folder / text
            try:
                if text and path.exists():
                    return sized(path)
            except (OSError, ValueError) as error:
                raise WorldError(f"{beside}: {shown(uri)} is no path") from error
    raise WorldError(f"{beside}: it names {shown(uri)}, which is not there", hint=f"put it beside {beside.name}")
