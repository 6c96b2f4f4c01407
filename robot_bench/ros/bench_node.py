"""A bench as a node: pins, the true motion of its robot and its clock as messages, and messages as levels on wires.

Published: `/clock`, odometry and TF (of the true pose: a bench knows it), wheels, ranges, and the thesis's topics, as
they stand on the pins. Taken: the distance and encoder topics of wires that the scenario cuts from its robot
(`outside`); what changes a level becomes an action at the next nanosecond, which the trace notes.

Source: the thesis, chapter 5.1.2.2: motors are published each 100 ms, sensors put on the pins when a message comes.

Invariant: what is published decides nothing; what is taken is in the trace, whole.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import cast

from adapter_sim.codec import motor_value
from adapter_sim.pinout import WireRole, load_pinout
from p2os.robots.parameters import RobotParameters
from p2os.ros.frames import Frames, time_of
from p2os.ros.robot_messages import OdometryMotion, joint_state, odometry, sonar_range
from p2os.ros.robot_node import Outgoing
from p2os.ros.thesis_topics import CODES, FIRST
from p2os.ros.topics import TOPICS
from p2os.ros.transport import NodeOptions, Received, Topic
from p2os.ros.urdf import urdf_text
from robot_bench.events.kinds import MICRO, Pose, Ranges
from robot_bench.scenario.hands.actions import Action
from simbase.timing import NS_PER_MS, Nanos

#: Who did it, in the trace.
WHO = "ros"
SET_PIN = "set_pin"
#: The thesis's emulator told its motors so often; a change is told at once.
REPEAT_NS: Nanos = 100 * NS_PER_MS
#: Topic → the value of the pin-out whose wires it is.
VALUES = {
    "motor_left": "motor1", "motor_right": "motor2", "encoder_left": "encoder1", "encoder_right": "encoder2",
}  # fmt: skip
ALWAYS = ("clock", "odom", "tf", "joint_states")


class BenchNode:
    """What a bench publishes, and takes.

    Args:
        level_of: The level of a wire of the pin-out at a time.
        parameters: Of its robot.
        options: The node's names.
        outside: Kinds of wires that ROS drives, of a scenario's `outside`.
    """

    def __init__(
        self,
        level_of: Callable[[str, Nanos], bool],
        parameters: RobotParameters,
        options: NodeOptions,
        outside: Iterable[str] = (),
    ) -> None:
        self._level_of, self._options = level_of, options
        self._frames = Frames.of(parameters, options.namespace)
        pinout = load_pinout()
        #: Topic → its wires, the least significant first.
        wires = {self._topic(key): tuple(pinout.value(value).wires) for key, value in VALUES.items()}
        for number, wire in enumerate(pinout.with_role(WireRole.DISTANCE), start=FIRST):
            wires[self._topic("distance_sensor", number)] = (wire.name,)
        self._signed = {self._topic(key) for key in VALUES if key.startswith("motor")}
        roles = {wire.name: wire.role.value for wire in pinout.wires}
        #: Topics whose wires ROS drives, and those that it is sent.
        self.taken: Mapping[Topic, tuple[str, ...]] = {
            topic: names for topic, names in wires.items() if roles[names[0]] in set(outside)
        }
        self._published = {topic: names for topic, names in wires.items() if topic not in self.taken}
        self._values: dict[Topic, int] = {}
        self._repeat_at: Nanos = 0
        #: What ROS has put on the wires.
        self._levels: dict[str, bool] = {}
        self.refused = 0

    def announced(self) -> Iterator[Topic]:
        """Yield what is published from the beginning."""
        yield from (self._topic(key) for key in ALWAYS)
        yield from self._published
        yield from (self._topic("range", number) for number in range(self._frames.parameters.sonar_fitted))

    def first(self) -> list[Outgoing]:
        """Return what stays as it is."""
        fixed = self._frames.fixed(0, range(self._frames.parameters.sonar_fitted))
        return [
            (self._topic("tf_static"), {"transforms": fixed}),
            (self._topic("robot_description"), {"data": urdf_text(self._frames)}),
        ]

    def take_pose(self, pose: Pose) -> list[Outgoing]:
        """Return what a pose of the robot makes."""
        body, track_m = self._frames.parameters.body, self._frames.parameters.track_mm / 1000
        radius_m, left, right = body.wheel_diameter_m / 2, pose.left / MICRO, pose.right / MICRO
        motion = OdometryMotion(
            x_m=pose.x_m, y_m=pose.y_m, heading_rad=pose.heading_rad,
            forward_mps=pose.speed_mps, turn_radps=(right - left) / track_m,
            wheels_rad=(pose.left_angle / MICRO, pose.right_angle / MICRO),
            rates_radps=(left / radius_m, right / radius_m),
        )  # fmt: skip
        place = (motion.x_m, motion.y_m, motion.heading_rad)
        return [
            (self._topic("odom"), odometry(pose.t, self._frames, motion)),
            (self._topic("tf"), {"transforms": self._frames.moving(pose.t, place, motion.wheels_rad)}),
            (self._topic("joint_states"), joint_state(pose.t, self._frames, motion)),
        ]

    def take_ranges(self, ranges: Ranges) -> list[Outgoing]:
        """Return what new ranges make."""
        return [
            (self._topic("range", number), sonar_range(ranges.t, self._frames, number, mm / 1000))
            for number, mm in enumerate(ranges.mm[: len(self._frames.parameters.sonar)])
        ]

    def tell(self, now: Nanos) -> list[Outgoing]:
        """Return the clock, and the values on the pins: those that changed, and all of them each 100 ms."""
        found: list[Outgoing] = [(self._topic("clock"), {"clock": time_of(now)})]
        is_due = now >= self._repeat_at
        if is_due:
            self._repeat_at = now + REPEAT_NS
        for topic, wires in self._published.items():
            value = self._value(topic, wires, now)
            if is_due or value != self._values.get(topic):
                self._values[topic] = value
                found.append((topic, {"data": value}))
        return found

    def take(self, received: Iterable[Received], at: Nanos) -> list[Action]:
        """Return what messages do to wires at a time: the levels that they change."""
        wanted: dict[str, bool] = {}
        for item in received:
            wires, value = self.taken[item.topic], cast("int", item.message["data"])
            if len(wires) > 1 and not 0 <= value < CODES:
                self.refused += 1
                continue
            bits = value if len(wires) > 1 else int(value != 0)
            wanted |= {wire: bool(bits >> place & 1) for place, wire in enumerate(wires)}
        changed = {wire: level for wire, level in wanted.items() if self._levels.get(wire) is not level}
        self._levels |= changed
        return [Action(at=at, do=SET_PIN, place=wire, level=level, who=WHO) for wire, level in changed.items()]

    def _value(self, topic: Topic, wires: tuple[str, ...], now: Nanos) -> int:
        code = sum(self._level_of(wire, now) << place for place, wire in enumerate(wires))
        return motor_value(code, len(wires)) if topic in self._signed else code

    def _topic(self, key: str, number: int | None = None) -> Topic:
        return TOPICS[key].topic(self._options, number)
