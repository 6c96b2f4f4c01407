"""Mode A: the pins meet the body without adapter or protocol, as in a plain simulator.

Three plug-ins and the plant that they sit on: a digital distance sensor, an
absolute encoder of few bits, a joint motor of few bits. How bits stand for
numbers is the adapter's codec, so that both modes speak one language.
"""

from robot_bench.direct.distance import DistanceSensors
from robot_bench.direct.encoder import WheelEncoder
from robot_bench.direct.motor import JointMotor
from robot_bench.direct.robot import DirectRobot, DirectSettings

__all__ = ["DirectRobot", "DirectSettings", "DistanceSensors", "JointMotor", "WheelEncoder"]
