"""Clients of others at the virtual robot."""

import sys

from tools.foreign.judges.drives import Drives
from tools.foreign.row import ProgramKind, Row, Source

OURS = Source(folder="ours", url="", commit="")
ARIA = Source(
    folder="aria", url="https://github.com/reedhedges/AriaCoda", commit="b0d02e05888f9317eb2cedbac2b6f14deabdd6ee"
)
PLAYER = Source(
    folder="player", url="https://github.com/playerproject/player", commit="cb1e0b1349735bcad64eba8846b422f2dc59b768"
)
SOAR = Source(folder="py", url="https://snakes-on-a-robot.readthedocs.io", commit="1.5.2")
ARDUINO = Source(
    folder="p2os-arduino", url="https://github.com/qemu-gazebo-sim/p2os-arduino",
    commit="b350bd5ec3b88cb85b62815d57b6f04aee39b57b",
)  # fmt: skip
CARMEN = Source(
    folder="carmen", url="https://github.com/qh-huang/carmen", commit="449241e5a3baf0979b7ff418ca3c4616e3301501"
)
ROS1 = Source(
    folder="ros-p2os", url="https://github.com/allenh1/p2os", commit="f5ef44a0d0324a5177f29928b84593910d5d14ec"
)

#: Soar's own windows aside, which alone let a brain meet a real robot: its robot, told what a brain would tell it.
_SOAR_MOVER = """import time
from soar.robot.pioneer import PioneerRobot
robot = PioneerRobot(serial_ports=["{line}"])
robot.simulated = False
robot.on_load()
robot.on_start()
while True:
    robot.fv = 0.2
    robot.on_step(0.1)
    time.sleep(0.1)
"""
#: player's own configuration; without a pulse its driver is silent between two speeds.
_PLAYER = """driver (
  name "p2os" provides ["odometry:::position2d:0"]
  use_tcp 1 tcp_remote_host "{host}" tcp_remote_port {port} pulse 1.0
)
"""
#: Through player's library in C, which stands beside every player; its bindings for Python do not.
_PLAYER_MOVER = """import ctypes, time
c = ctypes.CDLL("libplayerc.so")
for create in c.playerc_client_create, c.playerc_position2d_create:
    create.restype = ctypes.c_void_p
client = ctypes.c_void_p(c.playerc_client_create(None, b"127.0.0.1", {free}))
assert c.playerc_client_connect(client) == 0
base = ctypes.c_void_p(c.playerc_position2d_create(client, 0))
assert c.playerc_position2d_subscribe(base, 1) == 0
c.playerc_position2d_enable(base, 1)
while True:
    c.playerc_position2d_set_cmd_vel(base, *map(ctypes.c_double, (0.2, 0.0, 0.0)), 1)
    time.sleep(0.2)
"""


#: AriaCoda's examples and tests: those that drive by themselves, and those that open a session and look or wait. Left
#: out are those that open a serial port or TCP port 8101 whatever they are told, and those that end by themselves.
_ARIA_DRIVES = (
    "simpleMotionCommands", "wander", "actionExample", "gotoActionExample", "wanderAndLogData", "vel2Test",
    "moveCommandTest",
)  # fmt: skip
_ARIA_TALKS = (
    "simpleConnect", "demo", "teleopActionsExample", "actionGroupExample", "robotSyncTaskExample", "motionDebugInfo",
    "dataLoggerExample", "customRangeSensorExample", "auxSerialExample", "gripperExample", "lasers",
    "triangleDriveToActionExample", "encoderTest", "sonarTest", "testMobileSim", "connectionTest2",
    "robotPacketHandlerTest", "logSIPs", "logSIPData", "logRobotJoystick", "simstat", "moveRobotInSim", "laserConnect",
    "lineFinderExample", "sickLogger", "ptzTest",
)  # fmt: skip
#: Those that need to be told to use a device, and what shows that it answers.
_ARIA_WORDS = {
    "lasers": ("-connectLaser",),
    "laserConnect": ("-connectLaser",),
    "lineFinderExample": ("-connectLaser",),
}
_ARIA_SHOWS = {
    "lasers": r"Have 181 'raw' readings",
    "laserConnect": r"connected\. Have 181 'current' readings",
    "lineFinderExample": r"Connected to laser",
    "sickLogger": r"Taking readings from the 361 laser values",
    "ptzTest": r"=> At pan -\d",
    "gripperExample": r"Grip: +\w",
    "logRobotJoystick": r"Got a joystick packet",
}


def _aria(program: str) -> Row:
    shows = _ARIA_SHOWS.get(program, "")
    does = "drives" if program in _ARIA_DRIVES else "opens a session"
    return Row(
        name=f"aria-{program}", kind=ProgramKind.CLIENT, source=ARIA,
        program="example",
        said=f"{does}{f'; prints `{shows}`' if shows else ''}",
        judge=Drives(
            program=f"aria/source/*/{program}",
            commands=(("{program}", "-rh", "{host}", "-rrtp", "{port}", *_ARIA_WORDS.get(program, ())),),
            serve=("--for", "aria"), moves=program in _ARIA_DRIVES, shows=shows,
            flash="[flash]\ngripper = 2\n" if "gripper" in program else "",
            environment=(("LD_LIBRARY_PATH", "{cache}/aria/source/lib"), ("ARIA", "{cache}/aria/source")),
        ),
    )  # fmt: skip


CLIENTS: tuple[Row, ...] = (
    Row(
        name="p2os-drive", kind=ProgramKind.CLIENT, source=OURS, program="our own client, for comparison",
        said="drives 0.2 m/s",
        judge=Drives(
            program=sys.executable,
            commands=((sys.executable, "-m", "p2os", "drive", "{url}", "--vel", "0.2m/s", "--for", "60s"),),
        ),
    ),
    *map(_aria, (*_ARIA_DRIVES, *_ARIA_TALKS)),
    Row(
        name="aria-c", kind=ProgramKind.CLIENT, source=ARIA,
        program="the test of its C library for MATLAB", said="drives 0.2 m/s in a circle",
        judge=Drives(
            program="aria/source/matlab/test", commands=(("{program}", "-rh", "{host}", "-rrtp", "{port}"),),
            serve=("--for", "aria"),
            environment=(("LD_LIBRARY_PATH", "{cache}/aria/source/lib"), ("ARIA", "{cache}/aria/source")),
        ),
    ),
    Row(
        name="soar", kind=ProgramKind.CLIENT, source=SOAR, program="package in the environment `py` of the cache",
        said="its robot class drives 0.2 m/s, without the windows",
        judge=Drives(
            program="py/lib/python*/site-packages/soar", serve=("--firmware", "ARCOS"),
            files=(("mover.py", _SOAR_MOVER),), commands=(("{cache}/py/bin/python", "{scratch}/mover.py"),),
        ),
    ),
    Row(
        name="player", kind=ProgramKind.CLIENT, source=PLAYER,
        program="its server with the p2os driver, and its C library",
        said="its client sets 0.2 m/s through the server",
        judge=Drives(
            program="player/bin/player", files=(("player.cfg", _PLAYER), ("mover.py", _PLAYER_MOVER)),
            commands=(("{program}", "-p", "{free}", "{scratch}/player.cfg"), (sys.executable, "{scratch}/mover.py")),
            environment=(("LD_LIBRARY_PATH", "{cache}/player/lib"),),
        ),
    ),
    Row(
        name="p2os-arduino", kind=ProgramKind.CLIENT, source=ARDUINO,
        program="its sources with an Arduino.h for this system and a sketch that drives 0.2 m/s",
        said="drives",
        judge=Drives(program="p2os-arduino/drive", commands=(("{program}", "{line}"),)),
    ),
    Row(
        name="carmen", kind=ProgramKind.CLIENT, source=CARMEN,
        program="its pioneerlib and carmenserial with a main of three lines that sets 0.2 m/s",
        said="drives",
        judge=Drives(program="carmen/drive", commands=(("{program}", "{line}"),)),
    ),
    Row(
        name="ros1", kind=ProgramKind.CLIENT, source=ROS1,
        program="p2os_driver in a workspace ros-p2os/devel, ROS 1 from Debian",
        said="drives what rostopic publishes on /cmd_vel",
        judge=Drives(
            program="ros-p2os/devel/lib/p2os_driver/p2os_driver", killed=1, commands=(
                ("roscore", "-p", "{free}"),
                ("{program}", "_port:={line}", "_pulse:=1.0"),
                ("rostopic", "pub", "-r", "5", "/cmd_motor_state", "p2os_msgs/MotorState", "{state: 1}"),
                ("rostopic", "pub", "-r", "5", "/cmd_vel", "geometry_msgs/Twist", "{linear: {x: 0.2}}"),
            ),
            environment=(("PYTHONPATH", "{cache}/ros-p2os/devel/lib/python3/dist-packages"),
                         ("ROS_HOME", "{scratch}"),
                ("ROS_MASTER_URI", "http://127.0.0.1:{free}"), ("ROS_IP", "127.0.0.1")),
        ),
        needs=("roscore", "rostopic"),
    ),
)  # fmt: skip
