"""Write the C header of the structs that C and Python share, from their declaration.

A test holds the committed header to what comes out here.
Usage: python tools/generate_layout.py [--check]
"""

import sys
from pathlib import Path

from bluepill_sim.extension.layout import header

HEADER = Path(__file__).resolve().parents[1] / "bluepill_sim/extension/source/fabric/layout.h"


def main() -> int:
    """Write or check."""
    if "--check" in sys.argv[1:]:
        is_same = HEADER.is_file() and HEADER.read_text(encoding="utf-8") == header()
        print(f"{HEADER.name}: {'up to date' if is_same else 'out of date: run tools/generate_layout.py'}")
        return 0 if is_same else 1
    HEADER.write_text(header(), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
