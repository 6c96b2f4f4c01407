"""Mappers and planners of others, by ROS 2."""

from tools.foreign.judges.navigates import Navigates
from tools.foreign.row import ProgramKind, Row, Source

KARTO = Source(
    folder="karto", url="https://github.com/ros-perception/open_karto",
    commit="3ef9f6baae5e277263068705ca0e1e406424da19",
)  # fmt: skip
#: In `office`: in each of its six rooms, and home; what each needs of room is 0.33 m.
OFFICE_GOALS = (
    (1.5, 0.0), (0.1, 1.8), (1.6, 2.4), (-0.3, 3.0), (1.5, -1.7), (0.0, -3.4), (1.5, -2.6), (4.35, -1.7), (6.2, -1.8),
    (5.0, -2.6), (5.85, 1.7), (4.2, 3.0), (6.2, 1.8), (9.6, 1.8), (8.0, 2.0), (10.2, 3.0), (10.05, -1.8), (10.2, -3.6),
    (8.4, -2.2), (0.0, 0.0),
)  # fmt: skip
#: Taken out: it walks blindly to and fro along the corridor, into robots too.
VISITOR = "visitor"

STACKS: tuple[Row, ...] = (
    Row(
        name="ros2-karto-navfn", kind=ProgramKind.STACK, source=KARTO,
        # karto/karto.so and navfn/navfn.so, each behind functions in C (tools/foreign/nodes), on ROS 2 Jazzy.
        program="Karto and Nav2's navfn planner as libraries, in nodes of ours on stock rclpy",
        said="maps office on the way to 20 goals with realistic errors; judged by true pose, contacts and obstacles",
        judge=Navigates(
            python="ros2/env/bin/python",
            programs=("karto/karto.so", "navfn/navfn.so", "ros2/env/lib/libtf2_msgs*fastrtps_c.so"),
            libraries=("ros2/env/lib",), goals=OFFICE_GOALS, without=(VISITOR,),
            commands=(
                ("{nodes}/mapper.py", "{cache}/karto/karto.so"),
                ("{nodes}/navigator.py", "{cache}/navfn/navfn.so", "{goals}", "{map}"),
            ),
        ),
        limit_s=1800.0,
    ),
)  # fmt: skip
