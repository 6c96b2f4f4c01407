"""Runs a bench beside ROS: in steps, between which messages go both ways.

What comes in acts from the nanosecond after the step on, as everything that a script does, so that a run with these
inputs out of its trace, and without ROS, is the same. This module is the bench's network `ros`, by its entry point.
"""

import re
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

from p2os.ros.transport import DOMAIN, LOOPBACK, NodeOptions, RosTransport
from p2os.ros.transports import TRANSPORTS, open_transport
from robot_bench.bench import Bench, run_of
from robot_bench.events.kinds import Pose, Ranges
from robot_bench.ros.bench_node import BenchNode
from robot_bench.ros.recorded import read_inputs
from robot_bench.run import RunBench
from robot_bench.scenario.hands.doing import Doing
from robot_bench.scenario.scenario import Scenario
from simbase.errors import UsageError, shown
from simbase.timing import NS_PER_MS, Nanos

#: chosen: a hundred times a second, as `/clock` of other simulators; ten times as fast as the thesis's.
STEP_NS: Nanos = 10 * NS_PER_MS
NODE = "bench"
_WHERE = re.compile(r"(?P<transport>[a-z]+)(?::(?P<domain>\d{1,3}))?(?:@(?P<interface>[A-Za-z0-9_.:-]+))?")


@dataclass(frozen=True, slots=True)
class RosPlace:
    """Where a bench meets ROS: transport, domain and network."""

    transport: str
    options: NodeOptions

    @classmethod
    def read(cls, text: str) -> "RosPlace":
        """Return the place that a text names: "dds", "dds:42", "zenoh:42@127.0.0.1:7447".

        Raises:
            UsageError: It names none.
        """
        found = _WHERE.fullmatch(text)
        if found is None or found["transport"] not in TRANSPORTS:
            raise UsageError(f"--ros {shown(text)} is no place", hint="--ros dds:42, or --ros zenoh@127.0.0.1:7447")
        domain = DOMAIN if found["domain"] is None else int(found["domain"])
        return cls(found["transport"], NodeOptions(name=NODE, domain=domain, interface=found["interface"] or LOOPBACK))


def refuse_without_pins(scenario: Scenario) -> None:
    """Refuse scenarios that have not the pins of which ROS is told.

    Raises:
        UsageError: So it is.
    """
    if scenario.robots or scenario.own_robot is not None:
        raise UsageError("--ros is for one Pioneer on the wires of the pin-out", hint="a scenario such as dodge")


def place_before(word: str) -> list[str]:
    """Return the first transport where the word that follows `--ros` names none."""
    return [] if re.split("[:@]", word)[0] in TRANSPORTS else [next(iter(TRANSPORTS))]


@contextmanager
def met(text: str) -> Iterator[RunBench]:
    """Join the network at a place for a block, and yield what runs a bench as a node of it.

    Raises:
        UsageError: The text names no place.
        MissingDependencyError, TransportError: As `open_transport`.
    """
    place = RosPlace.read(text)
    with closing(open_transport(place.transport, place.options)) as network:
        yield lambda bench: run_beside(bench, network, place.options)


def with_inputs(path: Path) -> RunBench:
    """Return what runs a bench with what came in from ROS in an earlier run.

    Raises:
        FileError, TraceError: As `read_inputs`.
    """
    inputs = read_inputs(path)

    def drive(bench: Bench) -> None:
        run_of(bench).take_inputs(Doing(actions=tuple(inputs)))
        bench.run_until(bench.scenario.duration_ns)

    return drive


def run_beside(bench: Bench, network: RosTransport, options: NodeOptions) -> None:
    """Run a bench to its end as a node of a network."""
    harness = bench.parts.harness
    node = BenchNode(
        lambda wire, now: harness[wire].level(now), bench.scenario.parameters, options, bench.scenario.outside
    )
    for topic in node.taken:
        network.subscribe(topic)
    for topic in node.announced():
        network.announce(topic)
    outgoing = node.first()
    endings = [
        bench.events.subscribe(lambda pose: outgoing.extend(node.take_pose(pose)), Pose),
        bench.events.subscribe(lambda ranges: outgoing.extend(node.take_ranges(ranges)), Ranges),
    ]
    try:
        while bench.now < bench.end:
            before = bench.now
            bench.run_until((before // STEP_NS + 1) * STEP_NS)
            for topic, message in (*outgoing, *node.tell(bench.now)):
                network.publish(topic, message)
            outgoing.clear()
            if bench.now < bench.end:
                taken = node.take(network.take(0.0), bench.now + 1)
                run_of(bench).take_inputs(Doing(actions=tuple(taken)))
            if bench.now == before:  # a chip that stands still for good
                return
    finally:
        for end in endings:
            end()
