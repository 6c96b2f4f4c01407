"""Write the C header of the structs that C and Python share, from their declaration.

A test holds the committed header to what comes out here.
Usage: python tools/generate_layout.py
"""

from pathlib import Path

from bluepill_sim.extension.layout import header

HEADER = Path(__file__).resolve().parents[1] / "bluepill_sim/extension/source/fabric/layout.h"

if __name__ == "__main__":
    HEADER.write_text(header(), encoding="utf-8")
