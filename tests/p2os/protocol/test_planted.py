"""A new command and a new packet, each said once: planted into a copy of the toolkit, seen everywhere."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
TABLE = "p2os/protocol/command_table.py"
HANDLERS = "p2os/pioneer/controller/commands.py"
SENSORS = "p2os/protocol/packets/sensors.py"
REGISTRY = "p2os/protocol/packets/registry.py"
#: File → what stands before the planted lines there, and these.
LAMP = """\
    LAMP = (201, (_A.TWO_BYTES,), "", None, "1.0 1.0 1.0", "Planted: light a lamp.",
        TwoBytes(low="level", high="lamp", is_signed=False))
"""
LIT = """\
    _C.LAMP: _two_bytes(lambda context, level, lamp: context.notes.append(("lamp lit", f"{lamp} {level}"))),
"""
COMMAND = {TABLE: ("    TIMER = 31,", LAMP), HANDLERS: ("    _C.PULSE: _plain", LIT)}
PACKET = {
    SENSORS: ("@dataclass(frozen=True, slots=True, kw_only=True)\nclass EncoderPacket", '''\
@dataclass(frozen=True, slots=True, kw_only=True)
class LampPacket(LaidOutPacket):
    """Planted."""

    NAME: ClassVar[str] = "LAMPpac"
    KIND: ClassVar[int] = 0x91
    LAYOUT: ClassVar[Construct] = Struct(part("lamp", Int8ul, "which"), part("level", Int16sl, "0.1 lux"))

    lamp: int
    level: int
    rest: bytes = b""


'''),
    REGISTRY: ("    _of(EncoderPacket),", "    _of(sensors.LampPacket),\n"),
}  # fmt: skip
#: What is seen of both, as JSON: the dissector, the page, the words of `decode`, a robot that is sent the command.
LOOK = """
import json, runpy
from pathlib import Path
from typer import Typer
from typer.testing import CliRunner
from p2os.capture.dissector import script
from p2os.capture.columns import decode as columns_of
from p2os.cli.captures import decode
from p2os.pioneer.controller.settings import ControllerSettings
from p2os.protocol.commands import command, command_row
from p2os.protocol.frames import Frame
from p2os.protocol.profiles import Profile
from p2os.robots.parameters import load_parameters
from tests.p2os.conftest import Robot

app = Typer()
app.callback()(lambda: None)
decode.register(app)
page = runpy.run_path("tools/generators/protocol.py")["page"](Path("PROTOCOL.md").read_text())
def decoded(frame):
    return CliRunner().invoke(app, ["decode", "--explain", frame.to_bytes().hex()]).output
try:
    row, told = command_row("lamp"), []
    frame = command("LAMP", 3, 2).to_frame()
    robot = Robot(load_parameters("p2dx"), ControllerSettings()).open()
    robot.say(201, row.word(3, 2))
    told = [list(event[1:]) for event in robot.events]
    takes, sent = row.takes, decoded(frame)
except Exception as error:
    takes, sent, told = str(error), "", []
came = Frame(bytes((0x91, 2, 0x9C, 0xFF)))
columns = columns_of(came.to_bytes(), Profile.AROS)
print(json.dumps({"lua": script(), "page": page, "takes": takes, "sent": sent, "told": told,
                  "came": decoded(came), "columns": [name for name, _ in columns.rows()]}))
"""


def planted(folder: Path) -> Path:
    """Return a copy of the toolkit with both planted in it."""
    for name in ("p2os", "tools/generators/protocol.py", "PROTOCOL.md"):
        target, source = folder / name, ROOT / name
        target.parent.mkdir(parents=True, exist_ok=True)
        if source.is_dir():
            shutil.copytree(source, target)  # compiled modules too
        else:
            shutil.copy(source, target)
    for name, (before, lines) in (COMMAND | PACKET).items():
        path = folder / name
        text = path.read_text(encoding="utf-8")
        assert text.count(before) == 1, name
        path.write_text(text.replace(before, lines + before), encoding="utf-8")
    path = folder / REGISTRY
    text = path.read_text(encoding="utf-8").replace("from p2os.protocol.packets.sensors",
                                                    "from p2os.protocol.packets import sensors\n"
                                                    "from p2os.protocol.packets.sensors", 1)  # fmt: skip
    path.write_text(text, encoding="utf-8")
    return folder


def seen(folder: Path) -> dict:
    """Return what a toolkit shows."""
    done = subprocess.run(
        [sys.executable, "-P", "-c", LOOK], cwd=folder, capture_output=True, text=True, timeout=60, check=False,
        env={**os.environ, "PYTHONPATH": f"{folder}{os.pathsep}{ROOT}"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.slow
def test_a_command_and_a_packet_that_are_each_said_once_are_seen_everywhere(tmp_path: Path) -> None:
    found = seen(planted(tmp_path))
    assert '[0xc9] = "LAMP",' in found["lua"]
    assert (
        "| 201 | LAMP | two bytes, level and lamp, each 0 to 255 | 1.0 | 1.0 | 1.0 | Planted: light a lamp. |"
        in (found["page"])
    )
    assert found["takes"] == "two bytes, level and lamp, each 0 to 255"
    assert "LAMP" in found["sent"]
    assert "level 3" in found["sent"], found["sent"]
    assert ["lamp lit", "2 3"] in found["told"]

    assert '[0x91] = "LAMPpac",' in found["lua"]
    assert "| `91` | LAMPpac | every field |" in found["page"]
    assert "**LAMPpac**, type `91`" in found["page"]
    assert "| 2 | 2 | `level` | signed; 0.1 lux |" in found["page"]
    assert "LAMPpac" in found["came"]
    assert "-100" in found["came"]
    assert found["columns"] == ["lamp"]


@pytest.mark.slow
def test_what_was_not_planted_is_seen_nowhere() -> None:
    found = seen(ROOT)
    assert found["takes"].startswith("no command 'lamp'")
    assert not [name for name in ("lua", "page", "sent", "came") if "LAMP" in found[name]]
    assert found["columns"] == ["raw"]
    assert found["page"] == (ROOT / "PROTOCOL.md").read_text(encoding="utf-8")
