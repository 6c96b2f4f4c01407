"""Clients of others that know models: each of them, with the packets of each family of firmware."""

import sys

from tools.foreign.judges.poses import Poses
from tools.foreign.row import ProgramKind, Row
from tools.foreign.rows.clients import ARIA, PLAYER

#: player's own configuration, with its sonar.
_PLAYER = """driver (
  name "p2os" provides ["odometry:::position2d:0" "sonar:0"]
  use_tcp 1 tcp_remote_host "{host}" tcp_remote_port {port} pulse 1.0
)
"""
#: Through player's library in C: its structures as playerc.h of that commit has them, on 64 bits.
_PLAYER_POSES = """import ctypes, time
from ctypes import c_char, c_double, c_int, c_uint16, c_uint32, c_void_p
c = ctypes.CDLL("libplayerc.so")
class Device(ctypes.Structure):
    _fields_ = [("id", c_void_p), ("client", c_void_p), ("host", c_uint32), ("robot", c_uint32),
                ("interface", c_uint16), ("index", c_uint16), ("driver", c_char * 64), ("subscribed", c_int),
                ("datatime", c_double), ("lasttime", c_double), ("fresh", c_int * 3), ("putmsg", c_void_p),
                ("user", c_void_p), ("callbacks", c_int), ("callback", c_void_p * 4), ("data", c_void_p * 4)]
class Position(ctypes.Structure):
    _fields_ = [("info", Device), ("pose", c_double * 3), ("size", c_double * 2), ("at", c_double * 3)]
class Sonar(ctypes.Structure):
    _fields_ = [("info", Device), ("poses", c_int), ("pose", c_void_p), ("ranges", c_int), ("range", c_void_p)]
for create in c.playerc_client_create, c.playerc_client_read:
    create.restype = c_void_p
c.playerc_position2d_create.restype = ctypes.POINTER(Position)
c.playerc_sonar_create.restype = ctypes.POINTER(Sonar)
client = c_void_p(c.playerc_client_create(None, b"127.0.0.1", {free}))
until = time.monotonic() + 20
while c.playerc_client_connect(client):
    assert time.monotonic() < until
    time.sleep(0.2)
base = c.playerc_position2d_create(client, 0)
assert c.playerc_position2d_subscribe(base, 1) == 0
sonar = c.playerc_sonar_create(client, 0)
assert c.playerc_sonar_subscribe(sonar, 1) == 0
c.playerc_position2d_enable(base, 1)
printed = 0
while True:
    c.playerc_client_read(client)
    if time.monotonic() > printed + 0.2:
        printed = time.monotonic()
        c.playerc_position2d_set_cmd_vel(base, *map(c_double, (0.2, 0.0, 0.2)), 1)
        print("pose %.4f %.4f %.5f" % tuple(base.contents.at), flush=True)
        print("sonar" + " 1" * sonar.contents.ranges, flush=True)
"""

MODELS: tuple[Row, ...] = (
    Row(
        name="aria-models", kind=ProgramKind.CLIENT, source=ARIA,
        program="the test of its C library, which prints poses",
        said="each model of its params/, with P2OS, AROS and ARCOS packets: right poses, every sonar received",
        judge=Poses(
            program="aria/source/matlab/test", knows="aria/source/params/*.p",
            commands=(("stdbuf", "-oL", "{program}", "-rh", "{host}", "-rrtp", "{port}"),),
            pose=r"x=(?P<x>-?[\d.]+) y=(?P<y>-?[\d.]+) th=(?P<th>-?[\d.]+)", metres=0.001, radians=0.017453292519943295,
            sonar=r" \d+=[\d.]+",
            environment=(("LD_LIBRARY_PATH", "{cache}/aria/source/lib"), ("ARIA", "{cache}/aria/source")),
            client="aria",  # else it looks for the batteries of a Pioneer LX on lines of their own
        ),
        needs=("stdbuf",), limit_s=1800.0,
        found="Pioneer 1 headings had 4096 counts a turn, not 1024",
    ),
    Row(
        name="player-models", kind=ProgramKind.CLIENT, source=PLAYER,
        program="its server with the p2os driver, C library and sources",
        said="each model of its robot_params.cc, with P2OS, AROS and ARCOS packets: right poses, every sonar received",
        judge=Poses(
            program="player/bin/player", knows="player/source/server/drivers/mixed/p2os/robot_params.cc",
            model=r'"([^"]+)", // Subclass', files=(("player.cfg", _PLAYER), ("poses.py", _PLAYER_POSES)),
            commands=(("{program}", "-p", "{free}", "{scratch}/player.cfg"), (sys.executable, "{scratch}/poses.py")),
            pose=r"pose (?P<x>-?[\d.]+) (?P<y>-?[\d.]+) (?P<th>-?[\d.]+)", sonar=r" 1(?= |$)",
            environment=(("LD_LIBRARY_PATH", "{cache}/player/lib"),),
            share=0.025,  # it rounds each packet's way, 20 mm at 0.2 m/s, to whole mm (sip.cc, rint)
        ),
        limit_s=1800.0,
    ),
)  # fmt: skip
