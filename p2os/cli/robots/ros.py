"""`p2os ros`: a robot as a ROS 2 node, without ROS; and its URDF.

Theory of operation. One thread waits for the network and for the robot's states, which wake it, and turns each into the
other. Two deadmen stop the robot: the node's, when no speed came for so long, and behind it the client's, when this
loop hangs; so nothing here calls the client but for what a message asks.

Invariant: the robot moves only while speeds come in, none older than the deadman's time.
"""

import contextlib
import sys
import time
from collections import deque
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Annotated

import typer

from p2os.cli.groups import ROBOTS
from p2os.cli.held_robot import held
from p2os.cli.kept_files import FORCE_HELP, refuse_to_overwrite
from p2os.cli.names import ReportedModel, urls
from p2os.cli.quantities import option
from p2os.client import Link, LinkLostError, Notice, Robot, RobotState
from p2os.client.notices import (
    Connected,
    DeadmanStopped,
    GapStopped,
    GaveUp,
    LinkLost,
    MotorsDisabled,
    MotorsDisabledError,
    PacketArrived,
    words_of,
)
from p2os.pioneer.devices.laser import read_laser
from p2os.protocol.times import CYCLE_NS
from p2os.robots.motor_step import STEP_MPS
from p2os.robots.parameters import load_parameters
from p2os.ros.codec import Message
from p2os.ros.frames import Frames
from p2os.ros.robot_node import Asked, MotorPower, Refused, ResetOdometry, RobotNode, Speed, StopRequest
from p2os.ros.transport import DOMAIN, LOOPBACK, MOST_DOMAIN, NodeOptions, RosTransport, Topic
from p2os.ros.transports import TRANSPORTS, open_transport
from p2os.ros.urdf import urdf_text
from p2os.transport.wall_clock import wall_clock
from simbase.command_line.signals import postponed
from simbase.errors import UsageError
from simbase.files import write_text
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos
from simbase.units import COUNT, SPEED, TIME

HELP = """Run a ROS 2 node for a robot, without ROS.

It publishes odometry, TF, wheels, sonar, battery, diagnostics and the thesis's
topics, and subscribes to cmd_vel. Without cmd_vel for --deadman, the robot
stops. Programs on this machine find the node at once; --interface ADDRESS opens
it to a network. For stock ROS 2 on this machine:
export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST.

\b
Examples:
  p2os ros tcp:127.0.0.1:8101                  a robot of `p2os serve`
  p2os ros serial:/dev/ttyUSB0 --domain 7      a real one
  p2os ros URL --interface 192.168.1.5         for other machines, too
  p2os ros URL --transport zenoh --router      for rmw_zenoh
  p2os ros URL --namespace /robot1             beside others
  p2os ros URL --laser lms2xx                  with the laser of `p2os serve --laser`
  p2os ros urdf p2dx --out p2dx.urdf           what RViz draws
"""
#: chosen: within it a loop of 10 Hz may lose four messages.
DEADMAN_NS: Nanos = 500 * NS_PER_MS
#: chosen: how often health is reported, as ROS' own nodes do.
HEALTH_NS: Nanos = 1 * NS_PER_S
#: chosen: how long a wait for the network holds a signal off at most, before STOP leaves.
LOOK_S = 0.02
#: chosen: how much of what the robot has sent is published before speeds, deadman and the end are looked at again.
NEWS_OF_A_TURN = 16
#: chosen: how much of it waits at most, half a minute of a robot that sends as the manual says.
MOST_NEWS = 256
#: chosen: a message that a publisher repeats 20 times a second is complained of once.
COMPLAINT_NS: Nanos = 1 * NS_PER_S
#: What is reported on stderr.
REPORTED = (Connected, LinkLost, GaveUp, DeadmanStopped, GapStopped, MotorsDisabled)
#: In place of a URL.
URDF = "urdf"

TransportName = Annotated[str, typer.Option("--transport", help="Which ROS 2 speaks.", metavar="|".join(TRANSPORTS))]
Domain = Annotated[
    int, option(COUNT, "--domain", purpose="ROS_DOMAIN_ID.", least="0", most=f"{MOST_DOMAIN}", shown=f"{DOMAIN}")
]
Interface = Annotated[
    str, typer.Option(help="Address or name of the network; with zenoh the router's.", metavar="ADDRESS")
]
Router = Annotated[bool, typer.Option("--router", help="With zenoh: be the router.")]


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("ros", help=HELP, rich_help_panel=ROBOTS)(ros)


def ros(
    url: Annotated[
        str, typer.Argument(help="Where the robot is; or the word urdf.", metavar="URL|urdf", autocompletion=urls)
    ],
    model: Annotated[
        str | None, typer.Argument(help="With urdf: robot model, or a TOML file.", metavar="MODEL|FILE")
    ] = None,
    transport: TransportName = "dds",
    domain: Domain = DOMAIN,
    interface: Interface = LOOPBACK,
    router: Router = False,
    namespace: Annotated[str, typer.Option(help="What names of topics and frames begin with.", metavar="NAME")] = "",
    name: Annotated[str, typer.Option(help="Of the node.", metavar="NAME")] = "p2os",
    deadman_ns: Annotated[
        Nanos,
        option(TIME, "--deadman", purpose="Stop after so long without cmd_vel.", above_zero=True, shown="500ms"),
    ] = DEADMAN_NS,
    motor_step: Annotated[
        float,
        option(SPEED, "--motor-step", purpose="Of motor_left and _right.", above_zero=True, shown=f"{STEP_MPS:g}m/s"),
    ] = STEP_MPS,
    laser: Annotated[
        str | None,
        typer.Option(help="Ask a simulator for its laser: topic scan.", metavar="MODEL|FIELD,STEP,RANGE"),
    ] = None,
    robot: ReportedModel = "",
    lasts_ns: Annotated[Nanos | None, option(TIME, "--for", purpose="End after so long.", above_zero=True)] = None,
    out: Annotated[Path | None, typer.Option(help="With urdf: the file; else it is printed.", metavar="FILE")] = None,
    force: Annotated[bool, typer.Option("--force", help=FORCE_HELP)] = False,
) -> None:
    """Be a ROS 2 node for a robot, or write its URDF."""
    options = NodeOptions(name=name, namespace=namespace, domain=domain, interface=interface, is_router=router)
    if url == URDF:
        if model is None:
            raise UsageError("urdf of which robot?", hint="p2os ros urdf p2dx")
        write_urdf(model, out, options, force=force)
        return
    if model is not None or out is not None or force:
        raise UsageError("a model, --out and --force go with urdf", hint="--robot MODEL for the robot at a URL")
    scanner = None if laser is None else read_laser(laser)
    with contextlib.closing(open_transport(transport, options)) as network:
        client = Robot(url, model=robot or None, deadman_s=2 * deadman_ns / NS_PER_S)  # the second one
        with held(client, moves=True):
            config = client.config
            fitted = (0, 0) if config is None else (config.frontbumps, config.rearbumps)
            robot_node = RobotNode(
                client.parameters, options, deadman_ns=deadman_ns, bumpers_fitted=fitted, motor_step_mps=motor_step,
                laser=scanner, cycle_ns=(0 if config is None else config.sipcycle * NS_PER_MS) or CYCLE_NS,
            )  # fmt: skip
            where = f"domain {domain}, {interface}"
            typer.echo(f"/{name} on {transport}, {where}: {client.parameters.title} on {url}; Ctrl-C ends")
            sys.stdout.flush()
            ends = None if lasts_ns is None else wall_clock() + lasts_ns
            NodeLoop(client, network, robot_node).run(lambda: ends is not None and wall_clock() >= ends)


def write_urdf(model: str, out: Path | None, options: NodeOptions, *, force: bool) -> None:
    """Write a robot's URDF, or print it.

    Raises:
        ParametersError: There is no such model.
        UsageError, FileError: The file is there already, or cannot be written.
    """
    text = urdf_text(Frames.of(load_parameters(model), options.namespace))
    if out is None:
        sys.stdout.write(text)
        return
    refuse_to_overwrite(out, force=force)
    write_text(out, text)


class NodeLoop:
    """Moves messages between a robot and a network.

    No signal interrupts a call of the network: its library is C, and an exception in what that calls ends the process.

    Args:
        client: A connected robot.
        network: The node's transport.
        robot_node: What becomes of what.
    """

    def __init__(self, client: Robot, network: RosTransport, robot_node: RobotNode) -> None:
        self._client, self._network, self._node = client, network, robot_node
        self._news: deque[RobotState | Notice] = deque()
        self._state: RobotState | None = None
        self._health_due: Nanos = 0
        self._complained_at: Nanos = -COMPLAINT_NS
        self._link = Link.OPEN.value
        self._is_open = True
        self.counts = {"commands": 0, "refused": 0, "overrun": 0}

    def run(self, is_over: Callable[[], bool]) -> None:
        """Go on until `is_over` says so; it is asked each `LOOK_S` or more often."""
        with postponed():
            for topic in self._node.commands:
                self._network.subscribe(topic)
            for service in self._node.services:
                self._network.serve(service)
            for topic in self._node.announced():
                self._network.announce(topic)
        self._publish(self._node.first(stamp_of(wall_clock())))
        self._begin()
        endings = (self._client.on_state(self._tell), self._client.on_event(self._tell))
        try:
            while not is_over():
                self.turn()
        finally:
            for end in endings:
                end()

    def turn(self) -> None:
        """Wait for what comes, and hand it on."""
        due = self._node.next_deadline()
        wait_s = LOOK_S if due is None else min(LOOK_S, max(0, due - wall_clock()) / NS_PER_S)
        if self._news:
            wait_s = 0
        with postponed():
            received = self._network.take(wait_s)
        self.counts["commands"] += len(received)
        now = wall_clock()
        commands = [item for item in received if item.reply is None]
        for asked in (*self._node.take_commands(commands, now), *self._node.advance_to(now)):
            self._ask(asked)
        for call in received:
            if call.reply is not None:
                problem = self._ask(self._node.take_call(call))
                with postponed():
                    call.reply({"success": not problem, "message": problem})
        for item in [self._news.popleft() for _ in range(min(len(self._news), NEWS_OF_A_TURN))]:
            if isinstance(item, RobotState):
                self._state, self._is_open, self._link = item, True, Link.OPEN.value
                self._publish(self._node.take_state(item, stamp_of(item.at_ns)))
            else:
                self._take_notice(item)
        if now >= self._health_due:
            self._health_due = now + HEALTH_NS
            counts = {**self.counts, "damaged": self._network.damaged}
            health = self._node.tell_health(
                self._state, stamp_of(now), self._link, is_open=self._is_open, counts=counts
            )
            self._publish([health])

    def _publish(self, messages: Iterable[tuple[Topic, Message]]) -> None:
        with postponed():
            for topic, message in messages:
                self._network.publish(topic, message)

    def _tell(self, news: RobotState | Notice) -> None:
        """Take what the client's thread tells; of a robot that sends more than can be published, no more data."""
        if len(self._news) >= MOST_NEWS and isinstance(news, RobotState | PacketArrived):
            self.counts["overrun"] += 1
            return
        self._news.append(news)
        self._network.wake()

    def _begin(self) -> None:
        """Ask the robot for what a session begins with."""
        for number, argument in self._node.at_connection():
            with contextlib.suppress(LinkLostError):  # the next session asks again
                self._client.send(number, argument)

    def _take_notice(self, notice: Notice) -> None:
        if isinstance(notice, PacketArrived):
            self._publish(self._node.take_packet(notice.packet, stamp_of(notice.at_ns)))
        if isinstance(notice, Connected):
            self._begin()
        if isinstance(notice, LinkLost | GaveUp):
            self._is_open, self._link = False, words_of(notice)
        if isinstance(notice, LinkLost | GapStopped | DeadmanStopped | MotorsDisabled):
            self._node.stopped()
        if isinstance(notice, REPORTED):
            sys.stderr.write(f"{words_of(notice)}\n")

    def _ask(self, asked: Asked) -> str:
        """Ask the robot; return why it cannot, or nothing."""
        try:
            match asked:
                case Speed(forward_mps, turn_radps):
                    self._client.set_velocity(forward_mps, turn_radps)
                case StopRequest():
                    self._client.stop()
                    sys.stderr.write("stopped: nobody asked for a speed any more\n")
                case MotorPower(on):
                    self._client.enable(on)
                case ResetOdometry():
                    self._client.set_pose()
                    self._node.forget_place()
                case Refused(text):
                    return self._complain(text)
        except (LinkLostError, MotorsDisabledError) as error:
            return self._complain(str(error))
        return ""

    def _complain(self, text: str) -> str:
        self.counts["refused"] += 1
        now = wall_clock()
        if now - self._complained_at >= COMPLAINT_NS:
            self._complained_at = now
            sys.stderr.write(f"refused: {text}\n")
        return text


def stamp_of(at_ns: Nanos) -> Nanos:
    """Return an instant of the wall clock as ROS counts time: nanoseconds since 1970."""
    return time.time_ns() - (wall_clock() - at_ns)
