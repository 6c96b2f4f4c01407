"""PROTOCOL.md says what the code speaks: its tables are those of the code, its links lead somewhere."""

import re
import runpy
from pathlib import Path

from p2os.protocol.commands import ROWS
from p2os.protocol.frames import Frame
from p2os.protocol.packets import PACKET_NAMES

ROOT = Path(__file__).resolve().parents[3]
PAGE = (ROOT / "PROTOCOL.md").read_text(encoding="utf-8")
GENERATOR = runpy.run_path(str(ROOT / "tools" / "generators" / "protocol.py"))


def test_the_tables_are_those_of_the_code() -> None:
    assert set(re.findall(r"<!-- table: ([a-z ]+) -->", PAGE)) == set(GENERATOR["TABLES"])
    assert GENERATOR["page"](PAGE) == PAGE, "run `make generated`"


def test_every_command_and_packet_is_in_the_page() -> None:
    assert all(f"| {int(row.number)} | {row.name} |" in PAGE for row in ROWS)
    assert all(name in PAGE for name in PACKET_NAMES.values())


def test_every_example_is_a_sound_frame() -> None:
    shown = re.findall(r"`(FA FB [0-9A-F ]+)` \|", PAGE)
    assert len(shown) >= 10
    assert [Frame.from_bytes(bytes.fromhex(text)).to_bytes().hex(" ").upper() for text in shown] == shown


def test_the_links_lead_to_headings() -> None:
    headings = {re.sub(r"[^a-z0-9 -]", "", line[3:].lower()).replace(" ", "-")
                for line in PAGE.splitlines() if line.startswith("## ")}  # fmt: skip
    assert set(re.findall(r"\]\(#([^)]+)\)", PAGE)) == headings
