"""Make the Arduino and PlatformIO library of the P2OS client: `python adapter_fw/pack_library.py [--out DIR]`.

The library is `library/` with the protocol core beside its sources, as both
systems want it: library.json, library.properties, src/, examples/.
"""

import argparse
import shutil
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
NAME = "P2OSClient"


def pack(folder: Path) -> Path:
    """Write the library into a folder anew, and return where it lies."""
    target = folder / NAME
    if target.exists():
        shutil.rmtree(target)
    shutil.copytree(HERE / "library", target)
    shutil.copytree(HERE / "core" / "p2os", target / "src" / "p2os")
    shutil.copy(HERE.parent / "LICENSE", target / "LICENSE")
    return target


def main() -> int:
    """Pack, and print where."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, default=HERE / "build", help="folder that the library's folder is put into")
    words = parser.parse_args()
    words.out.mkdir(parents=True, exist_ok=True)
    target = pack(words.out)
    print(f"{target}: {sum(1 for path in target.rglob('*') if path.is_file())} files")
    return 0


if __name__ == "__main__":
    sys.exit(main())
