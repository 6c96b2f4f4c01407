"""The bill of materials of a house, as CycloneDX 1.6: what it is, what it requires and what its files hold of others.

The time and the serial number that the format allows are left out: two builds have the same bytes.
"""

import json
import re
from collections.abc import Iterator, Mapping
from typing import Any

from packaging.requirements import Requirement

from tools.packaging.staging import ROOT

#: Name, version and licence of what the page's bundle holds.
LOCK = ROOT / "tools" / "page" / "package-lock.json"
#: The house with the bundle.
HAS_BUNDLE = re.compile(r"view/bundle/")


def bill(project: Mapping[str, Any], files: list[str]) -> str:
    """Return the bill of a staged house.

    Args:
        project: The table `project` of its pyproject.toml.
        files: Those that it has, by their paths.
    """
    own = f"pkg:pypi/{project['name']}@{project['version']}"
    required = [Requirement(line) for line in project["dependencies"]]
    parts = [
        *({"type": "library", "bom-ref": f"pkg:pypi/{one.name}", "name": one.name, "scope": "required",
           "purl": f"pkg:pypi/{one.name}", "description": f"required: {one}"} for one in required),
        *(_bundled() if any(HAS_BUNDLE.search(name) for name in files) else ()),
    ]  # fmt: skip
    table = {
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "version": 1,
        "metadata": {
            "component": {
                "type": "application", "bom-ref": own, "name": project["name"], "version": project["version"],
                "description": project["description"], "purl": own, "licenses": [_licence(project["license"])],
            }
        },
        "components": parts,
        "dependencies": [{"ref": own, "dependsOn": [part["bom-ref"] for part in parts]}],
    }  # fmt: skip
    return json.dumps(table, indent=1) + "\n"


def _bundled() -> Iterator[dict[str, Any]]:
    packages = json.loads(LOCK.read_text(encoding="utf-8"))["packages"]
    for path, row in packages.items():
        if path and not row.get("dev"):
            name = path.rpartition("node_modules/")[2]
            purl = f"pkg:npm/{name.replace('@', '%40')}@{row['version']}"
            yield {
                "type": "library", "bom-ref": purl, "name": name, "version": row["version"], "purl": purl,
                "scope": "required", "licenses": [_licence(row["license"])], "description": "in the page's bundle",
            }  # fmt: skip


def _licence(name: str) -> dict[str, Any]:
    return {"license": {"id": name}}
