"""Served robots whose clients, operators and devices do anything: what each is sent and told, and when, as approved."""

import os
import random
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import pytest

from p2os.errors import TransportError
from p2os.pioneer.controller import ControllerSettings
from p2os.pioneer.controller.faults import FAULTS
from p2os.pioneer.serve import background_host, control_line, fleet, fleet_order, world_orders
from p2os.pioneer.serve.aux_endpoint import AuxEndpoint
from p2os.pioneer.serve.control_line import ControlLine, Terminal
from p2os.pioneer.serve.fleet import Fleet, open_hosts
from p2os.pioneer.serve.fleet_file import parse_fleet
from p2os.pioneer.serve.fleet_order import FleetOrder, RobotOrder, make_fleet
from p2os.pioneer.serve.host import Host
from p2os.pioneer.serve.multi_robot_world import MultiRobotWorld
from p2os.pioneer.serve.orders import LONGEST_LINE, execute
from p2os.pioneer.serve.paced_line import PacedLine
from p2os.pioneer.serve.robot_time import LONGEST_PAUSE_NS, SETTLE_NS, RobotTime
from p2os.pioneer.world.model import Pose
from p2os.protocol.commands import Command
from p2os.protocol.commands import CommandNumber as C
from p2os.protocol.profiles import Profile
from p2os.transport import HungUpError, Listener, Loops, Transport, listen_url
from simbase.timing import NS_PER_MS, NS_PER_S
from tests.tools.suite.acted import Acted, taken
from tests.tools.suite.approved import Trace, judge_of, rounded, said, tried
from tests.tools.suite.declared import declared_of

pytestmark = pytest.mark.skipif(os.name != "posix", reason="pseudo-terminals are Unix's")

ORDERS = (
    "status", "status", "1: status", "2: status", " 2 :reset", "reset", "reset now", "help", "help me", "1:help",
    "clear all",
    "dance", "", "0: status",
    "4: status", "x: status", "2:", "fault sonar-stuck 3 1.2", "1: fault bumper front 2", "fault wheel-blocked left",
    "clear sonar-stuck 3", "clear bumper", "fault low-battery 10.5", "fault reboot", "fault", "joystick 512 1023 1",
    "digital 7", "place box 1 0.5 0.3 0.2", "place box 1 1 0.3 0.2 45", "place post 2 0 0.05", "place post 2 0",
    "place",
    "2: place post -1 -1 0.05", "move box-1 1.5 1 90", "move post-1 0 2", "move robot-2 1 1", "remove robot-1",
    "remove box-1", "remove post-9", "remove 'a: b'", 'move "open', "place cube 1 1 1", "place box 1001 0 1 1",
    "place post 0 0 0.0001", "remove", "stats",
)  # fmt: skip
SYNCS = [Command(0), Command(1), Command(2), Command(C.OPEN), Command(C.ENABLE, 1)]


class Clock:
    now = 0

    def __call__(self) -> int:
        return self.now


def did(action: Callable[..., object], *arguments: object, **named: object) -> str:
    try:
        return tried(action, *arguments, **named)
    except OSError as error:
        return type(error).__name__


def raw(commands: Sequence[Command]) -> bytes:
    return b"".join(command.to_frame().to_bytes() for command in commands)


def short(data: bytes) -> str:
    """Return bytes as a text, long ones by their checksum."""
    return data.hex() if len(data) < 40 else f"{len(data)} bytes {zlib.crc32(data):08x}"


class Place:
    """Robots that are served on lines of this process, by a clock that stands until it is set."""

    def __init__(self, order: FleetOrder, speed: float = 1.0) -> None:
        self.loops, self.clock, self.events = Loops(), Clock(), list[str]()
        self.made = make_fleet(order)
        with patch.object(fleet, "listen_url", self.listen):
            self.hosts = open_hosts(
                order, self.made, speed=speed, clock=self.clock,
                events=[self._noting(number) for number in range(1, len(order.robots) + 1)],
            )  # fmt: skip
        if len(self.hosts) == 1:
            self.hosts[0]._waits = self  # type: ignore[assignment]  # it waits as `wait_readable` does
        self.clients: list[list[Transport]] = [[] for _ in self.hosts]
        self.devices: list[Transport] = []

    def listen(self, url: str) -> Listener:
        return listen_url(url, loops=self.loops)

    def wait_readable(self, descriptors: Sequence[int], longest_s: float) -> None:
        self.events.append(f"{len(descriptors)} {longest_s:.6f}")

    def _noting(self, number: int) -> Callable[[int, str, str], None]:
        return lambda now, what, detail: self.events.append(f"{number} {now} {what}: {detail}")

    def happened(self) -> str:
        found, self.events[:] = said(self.events), []
        return found

    def turn(self) -> str:
        if len(self.hosts) == 1:
            self.hosts[0].turn(0.25, (0,))
        else:
            for host in self.hosts:
                host.run_due()
            for host in self.hosts:
                host.read_lines()
        shown = [[self._read(client) for client in clients] for clients in self.clients]
        waits = [(host.wait_s(), len(host.descriptors()), host.client, host.now) for host in self.hosts]
        return said((shown, [self._read(device) for device in self.devices], waits))

    @staticmethod
    def _read(client: Transport) -> str:
        data = b""
        try:
            for _ in range(9):
                data += client.read()
        except TransportError as error:
            return f"{short(data)} {error}"
        return short(data)


def one_act(draw: random.Random, place: Place) -> str:  # noqa: C901, PLR0911 - a table of acts
    """Do one thing that a client, an operator, a device or the machine may do; return the answer to it."""
    which = draw.randrange(len(place.hosts))
    host, clients = place.hosts[which], place.clients[which]
    match draw.randrange(20):
        case 0 | 1 | 2 | 3 | 4 if not clients or draw.random() < 0.3:
            line = place.loops.connect(host.listener.description.removeprefix("loop:"))
            clients.append(line)
            return did(line.write, raw(SYNCS))
        case 0 | 1 | 2 | 3 | 4 | 5 if clients:
            drive = Command(draw.choice((C.VEL, C.RVEL, C.MOVE)), draw.choice((300, -200, 90, 0)))
            return did(draw.choice(clients).write, raw([*SYNCS[:4], drive, Command(C.PULSE)]))
        case 6 if clients:
            clients.pop(draw.randrange(len(clients))).close()
        case 7 if clients:
            return did(clients[0].write, raw([Command(C.VEL, 200)] * draw.choice((20, 120, 500))))
        case 8 if clients:
            several = [
                Command(C.HOSTBAUD, draw.choice((1, 4))),
                Command(C.CONFIG),
                Command(C.CLOSE),
                Command(C.GETAUX2, 3),
            ]
            return did(clients[0].write, raw([draw.choice(several)]))
        case 9 if clients:
            return did(clients[0].write, raw([Command(C.TTY3, b"to aux"), Command(C.RESET)][: draw.choice((1, 1, 2))]))
        case 10:
            place.devices.append(place.loops.connect("aux"))
        case 11 if place.devices:
            return did(place.devices[-1].write, b"from aux")
        case 12 if place.devices:
            place.devices.pop(0).close()
        case 13 | 14 | 15 | 16:
            words = draw.choice(ORDERS)
            return said((words, execute(place.hosts, words)))
        case 17:
            place.clock.now += LONGEST_PAUSE_NS + draw.choice((0, 1, 5 * NS_PER_S))
    return ""


def life(draw: random.Random, place: Place, steps: int) -> Iterator[str]:
    yield said((place.made.starts, place.made.body, place.made.notes, place.turn()))
    for _ in range(steps):
        yield rounded(one_act(draw, place))
        place.clock.now += draw.choice((1, 10, 40, 100, 200, 299)) * NS_PER_MS
        yield place.turn()
        yield place.happened()
    for number, host in enumerate(place.hosts):
        host.close()
        yield place.happened()
        yield said([place._read(client) for client in place.clients[number]])
    yield said([place._read(device) for device in place.devices])


def robots(count: int, **named: Any) -> tuple[RobotOrder, ...]:
    chosen = ControllerSettings(**named.pop("settings", {}))
    first = RobotOrder(port="loop:r1", settings=chosen, aux=((2, "loop:aux"),), **named)
    return first, *(RobotOrder(port=f"loop:r{number}", settings=chosen, **named) for number in range(2, count + 1))


def alone(draw: random.Random) -> Iterator[str]:
    order = FleetOrder(robots=robots(1, sync_limit_ns=900 * NS_PER_MS, at=Pose(0.5, 0.0, 1.0)), body="kinematic")
    yield from life(draw, Place(order), 70)


def paced(draw: random.Random) -> Iterator[str]:
    order = FleetOrder(robots=robots(1, settings={"baud": 9600}, faults=("sonar-dead 2",)), body="kinematic")
    yield from life(draw, Place(order), 60)


def fast(draw: random.Random) -> Iterator[str]:
    order = FleetOrder(robots=robots(1, model="p3at", sync_limit_ns=2 * NS_PER_S), body="kinematic", world="arena")
    yield from life(draw, Place(order, speed=2.5), 40)


def together(draw: random.Random) -> Iterator[str]:
    order = FleetOrder(robots=robots(3, settings={"rear_sonar": True}), body="kinematic", seed=4)
    yield from life(draw, Place(order), 50)


def apart(draw: random.Random) -> Iterator[str]:
    order = FleetOrder(robots=robots(2), body="kinematic", apart=True, cross_talk=False)
    yield from life(draw, Place(order), 40)


def shouting(draw: random.Random) -> Iterator[str]:
    """Yield what becomes of clients that send more than a line takes."""
    shout = raw([Command(C.VEL, 200)] * 1500)
    for baud, leaves in ((9600, True), (9600, False), (None, False)):
        place = Place(FleetOrder(robots=robots(1, settings={"baud": baud}), body="kinematic"))
        (host,) = place.hosts
        line = place.loops.connect("r1")
        line.write(raw(SYNCS))
        for number in range(26):
            if number > 2:
                did(line.write, shout)
            if number == 9:
                second = place.loops.connect("r1")
            if number == 13 and leaves:
                line.close()
            place.clock.now += 240 * NS_PER_MS
            host.run_due()
            host.read_lines()
            waits = None if host._lines is None else host._lines[0].waiting
            yield said((host.client, waits, len(host.descriptors()), host.pioneer.state.open)) + place.happened()
        yield place._read(second)
        host.close()


def turns(draw: random.Random) -> Iterator[str]:
    """Yield how long a fleet waits, and for how many descriptors."""
    place, waited, ticks = Place(FleetOrder(robots=robots(2), body="kinematic")), list[str](), list[str]()
    operator = place.loops.listen("operator")
    control = ControlLine(operator)

    def wait(descriptors: Sequence[int], longest_s: float) -> set[int]:
        place.clock.now += max(round(longest_s * NS_PER_S), 0)
        waited.append(f"{len(descriptors)} {longest_s:.6f}")
        found = draw.choice(((), descriptors, descriptors[:1]))
        return {*found}

    def tick(period_s: float) -> None:
        ticks.append(f"{period_s} {place.clock.now}")

    with patch.object(fleet, "wall_clock", place.clock), patch.object(fleet, "wait_readable", wait):
        served = Fleet(
            place.hosts, control=control,
            ticks=[(period_s, partial(tick, period_s)) for period_s in (0.25, 0.4)],
        )  # fmt: skip
        lines: list[Transport] = []
        for number in range(60):
            if number in {5, 20, 33}:
                lines.append(place.loops.connect("r1" if number == 5 else "r2"))
                lines[-1].write(raw(SYNCS))
            if number == 24:
                lines.append(place.loops.connect("operator"))
            if number in {26, 30}:
                lines[-1 if number == 26 else 2].write(b"status\n" if number == 26 else b"2: fault reboot\r\nstatus")
            if number == 50:
                lines[0].close()
            served.turn(0.5 if number % 7 else 0.03)
            yield (
                said((waited, ticks, [place._read(line) for line in lines[1 if number > 49 else 0 :]]))
                + place.happened()
            )
            waited.clear()
            ticks.clear()
        left = [3]

        def is_over() -> bool:
            left[0] -= 1
            return left[0] == 0

        served.run(until=is_over)
        seen: Any = Polled(Terminal(lambda _: None))
        seen.poll_s = 0.002
        Fleet(place.hosts, control=ControlLine(seen)).turn(0.5)  # somebody may come where no descriptor shows it
        yield said((waited, len(lines), [host.listener.fileno() for host in place.hosts], operator.fileno()))
    busy = FleetOrder(robots=robots(3), body="kinematic")
    taken = Loops()
    taken.listen("r3")
    both = FleetOrder(robots=(RobotOrder(port="loop:r4", aux=((1, "loop:aux"), (2, "loop:r3"))),), body="kinematic")

    def listen(url: str) -> Listener:
        return listen_url(url, loops=taken)

    with patch.object(fleet, "listen_url", listen):
        yield did(open_hosts, busy, make_fleet(busy), events=[None] * 3, listens=[listen] * 3)
        yield did(open_hosts, both, make_fleet(both), events=[None])
    yield said([did(taken.connect, name).partition(" object")[0] for name in ("r1", "r2", "r3", "r4", "aux")])


class Polled:
    """Where somebody may come, which no descriptor shows."""

    poll_s, description = 0.125, "polled"

    def __init__(self, line: Transport) -> None:
        self.lines: list[Transport | None] = [None, line]

    def accept(self) -> Transport | None:
        return self.lines.pop(0)

    def fileno(self) -> int | None:
        return None

    def close(self) -> None:
        self.lines = []


def operators(draw: random.Random) -> Iterator[str]:  # noqa: PLR0915 - one operator after the other
    written: list[str] = []
    place = Place(FleetOrder(robots=robots(2), body="kinematic", apart=True))
    listener = place.loops.listen("operator")
    control = ControlLine(listener)
    yield said((control.poll_s, len(control.descriptors()), control.serve(place.hosts)))
    for number in range(24):
        if number % 8 == 0:
            line = place.loops.connect("operator")
        if number % 8 == 7:
            line.close()
        else:
            pieces = ("status\n", "reset\r", "\n\n", "2: he", "lp\n", "dance\n1: status\n", "x" * LONGEST_LINE + "\n",
                      "x" * (LONGEST_LINE + 1) + "\n", "status" + " " * 300, "\n", "\xff\n")  # fmt: skip
            line.write(draw.choice(pieces).encode("latin-1"))
        yield said((control.serve(place.hosts), len(control.descriptors()), control.poll_s, place._read(line)))
    control.close()
    yield said((control.descriptors(), control.serve([])) if listener.fileno() != -1 else "closed")
    polled: Any = Polled(Terminal(written.append))
    control = ControlLine(polled)
    for _ in range(2):
        yield said((control.poll_s, control.descriptors(), control.serve(place.hosts)))
    yield said((control.poll_s, control.descriptors()))
    control.close()
    yield said(polled.lines)
    calls: list[str] = []
    gone = Acted(
        calls,
        "operator",
        read=[b"status\n", TransportError("gone")],
        write=[TransportError("gone")],
        close=[TransportError("x")],
    )
    polled.lines = [gone]
    yield said((control.serve(place.hosts), control.poll_s)) + taken(calls)
    typed: list[Any] = [b"status\n2: st", b"atus\n", OSError(5, "Input/output error"), b""]

    def read(descriptor: int, most: int) -> bytes:
        assert descriptor == 0
        given = typed.pop(0) if typed else b""
        if isinstance(given, OSError):
            raise given
        return given[:most]

    with ExitStack() as acting:
        acting.enter_context(
            patch.object(control_line, "wait_readable", lambda _found, longest_s: {0} if longest_s == 0 else {})
        )
        acting.enter_context(patch.object(os, "read", read))
        for is_terminal, group in ((False, 5), (True, 5), (True, 6)):
            acting.enter_context(patch.object(os, "isatty", lambda _, is_so=is_terminal: is_so))
            acting.enter_context(patch.object(os, "tcgetpgrp", lambda _, group=group: group))
            acting.enter_context(patch.object(os, "getpgrp", lambda: 5))
            typed[:0] = [b"1: status\n"]
            control = ControlLine(None, written.append)
            yield said((Terminal.is_ours(), control.poll_s, control.descriptors(), control.serve(place.hosts), written))
            written.clear()
        acting.enter_context(patch.object(os, "isatty", lambda _: False))
        for _ in range(5):
            yield said((control.descriptors(), control.serve(place.hosts), control.descriptors(), written))
        terminal = Terminal(written.append)
        typed[:] = [b"abc", OSError(5, "Input/output error"), b""]
        yield said([did(terminal.read) for _ in range(3)] + [terminal.fileno(), terminal.description])

        def full(_: str) -> None:
            raise OSError(28, "No space left on device")

        yield did(Terminal(full).write, b"x")
        acting.enter_context(patch.object(os, "isatty", lambda _: True))
        acting.enter_context(patch.object(os, "tcgetpgrp", lambda _: full("")))
        yield said((Terminal.is_ours(), did(terminal.read), ControlLine(None).descriptors()))


FLEETS = (
    "[[robot]]", "", "world = 3\n[[robot]]", 'world = "mars"\n[[robot]]',
    'world = "office"\nbody = "kinematic"\n[[robot]]',
    'body = "jelly"\n[[robot]]', "seed = -1\n[[robot]]", f"seed = {2**63 - 1}\n[[robot]]", f"seed = {2**63}\n[[robot]]",
    "apart = true\ncross_talk = false\n[[robot]]", "apart = 1\n[[robot]]", 'worlds = "."\n[[robot]]',
    'worlds = "none"\n[[robot]]', 'world = "mine.toml"\n[[robot]]', "robot = 1", 'colour = "red"\n[[robot]]',
    *(f"[[robot]]\n{row}" for row in (
        "count = 0", "count = 1", "count = 3", "count = 256", "count = 257", "count = 2\nat = [0, 0]",
        'count = 2\naux = "1=pty:"', 'port = "tcp:127.0.0.1:9000"\ncount = 2', 'port = "tcp::65535"\ncount = 2',
        'port = "pty:/run/r"\ncount = 3', 'port = "pty:"\ncount = 2', 'port = "serial:/dev/a"\ncount = 2',
        'port = "serial:/dev/a?baud=19200"', 'port = "robot"', "at = [1, 2]", "at = [1.5, 2, 90]", "at = [1]",
        "at = [1, 2, 3, 4]", "at = [true, 2]", "at = [1000.0, -1000.0, -36000]", "at = [1000.001, 0]",
        "at = [0, -1000.1]",
        "at = [0, 0, 36000.1]", "at = [nan, 0]", 'at = ["1", 2]', "at = 3", 'model = "p3at"', 'model = "own.toml"',
        'model = "r2d2"', 'for = "aria"', 'for = "player"', 'laser = "lms2xx"', 'laser = "90deg,1deg,8m"',
        'laser = "x"',
        'flash = "flash.toml"', 'flash = "none.toml"', 'firmware = "AROS"', 'firmware = "aros"', "lenient = true",
        "lenient = false", "all_sonar = true", "rear_sonar = true", "rear_sonar = 2", 'errors = "realistic"',
        'errors = "awful"', "baud = 9600", "baud = 9601", "baud = 0", "baud = 1000001",
        'aux = ["1=pty:/run/a", "3=loop:b"]',
        'aux = ["1=pty:", "1=pty:"]', 'aux = ["4=pty:"]', 'aux = ["0=pty:"]', 'aux = "2pty:"', 'aux = ["2=robot"]',
        'faults = ["sonar-dead 3", "reboot"]', 'faults = "bumper front 1"', 'faults = ["sonar-dead 99"]',
        "sync_limit_s = 0.001", "sync_limit_s = 0.0009", "sync_limit_s = 1_000_000", "sync_limit_s = 1_000_001",
        "sync_limit_s = 2.5", 'sync_limit_s = "2"',
    )),
    '[[robot]]\nport = "tcp::9000"\n[[robot]]\ncount = 2\n[[robot]]\nport = "pty:a"\n[[robot]]\nmodel = "p2de"',
    '[[robot]]\nport = "tcp::9000"\n[[robot]]\nport = "tcp::9000"', '[[robot]]\nport = "tcp::0"\n[[robot]]',
    '[[robot]]\nport = "serial:/dev/a"\n[[robot]]',
)  # fmt: skip


def fleets(draw: random.Random) -> Iterator[str]:
    with TemporaryDirectory() as folder:
        Path(folder, "mine.toml").write_text('[world]\nname = "mine"\n')
        Path(folder, "own.toml").write_text("x = 1\n")
        Path(folder, "flash.toml").write_text('[flash]\nname = "Wilma"\n')
        for text in FLEETS:
            yield tried(parse_fleet, text, "f", Path(folder)).replace(folder, "")
        yield tried(FleetOrder, robots=robots(1), worlds=Path(folder, "none")).replace(folder, "")
    for count in (0, 1, 256, 257):
        yield tried(lambda count=count: len(FleetOrder(robots=robots(257)[:count]).robots))
    for ports in (("tcp::0", "tcp::0"), ("pty:", "pty:"), ("pty:a", "pty:a"), ("tcp::1", "tcp:127.0.0.1:1"), ("x",)):
        yield tried(lambda ports=ports: len(FleetOrder(robots=tuple(RobotOrder(port=port) for port in ports)).robots))
    for limit_ns in (None, -1, 0, 1):
        yield tried(RobotOrder, sync_limit_ns=limit_ns)
    for aux in ((), ((1, "pty:"), (2, "pty:"), (3, "pty:")), ((0, "pty:"),), ((4, "pty:"),), ((1, "a"), (1, "b"))):
        yield tried(lambda aux=aux: RobotOrder(aux=aux).aux)
    for given in (
        ["tcp::8101"],
        ["tcp::0"],
        ["tcp::65533"],
        ["pty:/run/r"],
        ["pty:"],
        ["loop:a"],
        ["tcp::1", "pty:b"],
        ["?"],
    ):
        yield said([tried(fleet_order.following_ports, given, count) for count in (0, 1, 2, 3, 4)])
    for port in ("serial:/dev/a", "serial:/dev/a?baud=19200", "serial:/dev/a?baud=1234", "tcp:", "pty:"):
        yield tried(fleet_order.serial_baud, port)
    for text in ("1=pty:", "3=tcp::1", "0=pty:", "4=pty:", "1", "=pty:", "1=robot", "1=pty:a=b"):
        yield tried(fleet_order.read_aux, text)


def made(draw: random.Random) -> Iterator[str]:
    """Yield which robots are made of orders, and which worlds their clients may load."""
    with TemporaryDirectory() as folder:
        text = Path(world_orders.__file__).parents[1].joinpath("world/worlds/room.toml").read_text()
        inside = Path(folder, "in")
        inside.mkdir()
        inside.joinpath("mine.toml").write_text(text)
        Path(folder, "out.toml").write_text(text)
        inside.joinpath("link.toml").symlink_to(Path(folder, "out.toml"))
        inside.joinpath("loop.toml").symlink_to(inside / "loop.toml")
        inside.joinpath("bad.toml").write_text("x = 1\n")
        first = str(Path(folder, "out.toml"))
        files = ("mine.toml", "bad.toml", "link.toml", "loop.toml", "../out.toml", "x", "a\0b", "", ".")
        for worlds in (None, inside):
            for count, is_apart in ((1, False), (2, False), (2, True)):
                order = FleetOrder(
                    robots=robots(count), world=first, worlds=worlds, apart=is_apart, body="kinematic", seed=3,
                )  # fmt: skip
                found = make_fleet(order)
                yield said((found.starts, found.body, found.notes, found.multi_robot_world is None))
                yield said([robot.settings.seed for robot in found.robots])
                for name in ("office", "room", first, *files):
                    load = found.robots[-1].loads_world
                    assert load is not None
                    yield f"{name} {tried(load, name, 0)}".replace(folder, "")
                    yield said([(robot.body.state, robot.body.note) for robot in found.robots])
    for settings in ({"rear_sonar": True}, {"baud": 19200}):
        for port in ("serial:/dev/a?baud=38400", "tcp::0"):
            chosen = ControllerSettings(**settings)
            one = RobotOrder(port=port, model="p3at", settings=chosen)
            found = make_fleet(FleetOrder(robots=(one,), body="kinematic"))
            yield said((found.robots[0].baud, len(found.robots[0].parameters.sonar), found.body))
    several = robots(3, at=Pose(0.0, 0.0, 0.0))
    yield tried(lambda: make_fleet(FleetOrder(robots=several, body="kinematic")).starts)
    yield tried(lambda: make_fleet(FleetOrder(robots=several, apart=True, body="kinematic")).starts)
    yield tried(lambda: make_fleet(FleetOrder(robots=robots(9), world="corridor", body="kinematic")).starts)
    found = make_fleet(FleetOrder(robots=robots(2), body="kinematic"))
    shared = found.multi_robot_world
    assert shared is not None
    yield tried(MultiRobotWorld, found.robots[::-1], shared.scene)
    yield said((shared.names, shared.next_deadline(), len(shared.robots)))
    shared.advance_to(1)
    for number, robot in enumerate(found.robots):
        shared.advance_to(1 + number * 30 * NS_PER_MS)
        robot.receive(raw(SYNCS), 1 + number * 30 * NS_PER_MS)
    before = shared.snapshot()
    for _ in range(2):
        for now in (31, 99, 100, 101, 131, 250):
            reached = shared.advance_to(now * NS_PER_MS)
            yield said(
                (reached, shared.next_deadline(), [b"".join(robot.take_output()).hex() for robot in found.robots])
            )
        shared.restore(before)
    shared.advance_to(40 * NS_PER_MS)
    found.robots[1].receive(raw([Command(C.VEL, 300)]), 40 * NS_PER_MS)
    shared.advance_to(600 * NS_PER_MS)
    yield tried(shared.start_over, [0], 600 * NS_PER_MS) + said([body.state for body in shared.scene.bodies])
    for robot, x_m in zip(found.robots, (1.0, 0.0), strict=True):
        robot.body.stand_at(x_m, 0.05, 0.0)
    yield tried(shared.start_over, [0, 0], 601 * NS_PER_MS) + said([body.state for body in shared.scene.bodies])
    yield tried(shared.start_over, {1, 0}, 602 * NS_PER_MS) + said([body.state for body in shared.scene.bodies])
    few: Any = SimpleNamespace(bodies=shared.scene.bodies[:1], dt_ns=shared.scene.dt_ns, step=lambda _: [])
    yield tried(shared.enter_world, few, b"few", 602 * NS_PER_MS)
    yield tried(shared.advance_to, 604 * NS_PER_MS)


def afterwards(draw: random.Random) -> Iterator[str]:
    """Yield how long robots run on that were put back, have lost their client, or hear an order."""
    for count, is_apart in ((1, False), (2, False), (2, True)):
        place = Place(FleetOrder(robots=robots(count), body="kinematic", apart=is_apart))
        place.clock.now += 100 * NS_PER_MS
        yield place.turn()
        for words in ("reset", "1: reset", "status", "place post 3 0 0.1", "fault bumper front 1", "clear all"):
            yield said(execute(place.hosts, words))
            for _ in range(12):
                yield place.turn()
                place.clock.now += 100 * NS_PER_MS
        line = place.loops.connect("r1")
        line.write(raw([*SYNCS, Command(C.VEL, 300)]))
        for number in range(18):
            if number == 4:
                line.close()
            yield place.turn() + said([host.pioneer.body.state for host in place.hosts]) + place.happened()
            place.clock.now += 100 * NS_PER_MS
        other = Host(place.made.robots[0], place.loops.listen("x"), aux=[AuxEndpoint(3, place.loops.listen("y"))])
        yield said((len(other.aux), other.wait_s(), other.now, other.client))
        other.close()
        yield did(place.loops.connect, "y")


def handed_over(draw: random.Random) -> Iterator[str]:
    """Yield what the next client reads, on a line that takes its time or none, soon behind one that asked for much."""
    much = [*SYNCS[:4], Command(C.CONFIG), Command(C.HOSTBAUD, 4), Command(C.CONFIG), Command(C.ENCODER, 2)]
    for baud in (None, 9600):
        for later_ms in (0, 1, 30):
            order = FleetOrder(robots=robots(1, model="p3dx", settings={"baud": baud}), body="kinematic")
            place = Place(order)
            (host,) = place.hosts
            first = place.loops.connect("r1")
            first.write(raw(much))
            for _ in range(9):
                place.turn()
                place.clock.now += 55 * NS_PER_MS
            first.write(raw(much[4:]))
            place.turn()
            place.clock.now += later_ms * NS_PER_MS
            first.close()
            place.clients[0].append(place.loops.connect("r1"))
            for _ in range(8):
                waits = [] if host._lines is None else [(line.waiting, line.next_deadline()) for line in host._lines]
                yield place.turn() + said((host.client, host.pioneer.baud, host._baud, waits)) + place.happened()
                place.clock.now += draw.choice((1, 5, 40)) * NS_PER_MS
            place.clients[0][0].write(raw(SYNCS))
            place.clock.now += 300 * NS_PER_MS
            yield place.turn() + place.happened()
            refused = place.loops.connect("r1")
            yield place.turn() + place.happened()
            host.close()
            yield did(refused.write, b"x") + place._read(refused) + place.happened()


def world_words(draw: random.Random) -> Iterator[str]:
    found = make_fleet(FleetOrder(robots=robots(2), body="kinematic"))
    assert found.multi_robot_world is not None
    scene = found.multi_robot_world.scene
    bounds = ("place box -1000 1000 0.001 1000", "place box 0 5 0.0009 1", "place box 0 5 1 1000.1 0", "remove post-1",
              "place post 3 3 0.001", "move post-1 -1000 -1000 -1000", "removed", "move", "  ")  # fmt: skip
    for text in (*ORDERS, *bounds):
        yield said(
            (text, world_orders.is_world_order(text), tried(world_orders.change_world, scene, text, ("robot-1",)))
        )
    things: list[Any] = []

    def note(*given: object) -> None:
        things.append(given)

    for text in (*ORDERS, *bounds):
        acted: Any = SimpleNamespace(place=note, move=note, remove=note)
        yield tried(world_orders.change_world, acted, text) + said(things)
        things.clear()
    for number in range(world_orders.MOST_THINGS + 1):
        answer = tried(world_orders.change_world, scene, f"place post {number % 10} {20 + number // 10} 0.01")
    yield answer


def pacing(draw: random.Random) -> Iterator[str]:
    line, now = PacedLine(9600), 0
    for _ in range(80):
        match draw.randrange(8):
            case 0 | 1 | 2:
                line.put(draw.randbytes(draw.choice((0, 1, 15, 16, 17, 40))), now)
            case 3 if draw.random() < 0.3:
                line.set_baud(draw.choice((9600, 38400)))
            case 4 if draw.random() < 0.2:
                yield line.take_all().hex()
            case 5 if draw.random() < 0.2:
                line.clear()
        due = line.next_deadline()
        now = draw.choice((now, now + 3 * NS_PER_MS, now + 40 * NS_PER_MS, due or now, (due or now + 1) - 1))
        yield said(
            (now, line.waiting, line.free_at, due, [(at, data.hex()) for at, data in line.take(now)], line.waiting)
        )


def robot_time(draw: random.Random) -> Iterator[str]:
    for speed in (1.0, 0.3, 4.0):
        clock = Clock()
        clock.now = 77
        time = RobotTime(clock, speed)
        for _ in range(40):
            match draw.randrange(6):
                case 0:
                    time.client_came()
                case 1 if time._clients:
                    time.client_left()
                case 2:
                    time.go_on()
            clock.now += draw.choice((0, 1, 99_999_999, SETTLE_NS, LONGEST_PAUSE_NS, LONGEST_PAUSE_NS + 1))
            yield said((time.read(), time.now, time.left_out, time.stands))


def background(draw: random.Random) -> Iterator[str]:
    """Yield which order the options of a robot in the background become."""
    options: list[dict[str, Any]] = [
        {}, {"url": "pty:"}, {"robot": "p3at", "world": "office", "body": "kinematic", "seed": 7}, {"firmware": "aros"},
        {"firmware": Profile.ARCOS}, {"firmware": "dos"}, {"for_client": "aria"}, {"for_client": "x"},
        {"lenient": True},
        {"lenient": False}, {"laser": "lms2xx"}, {"laser": "x"}, {"all_sonar": True}, {"rear_sonar": True},
        {"rear_sonar": False}, {"errors": "realistic"}, {"errors": "x"}, {"baud": 9600}, {"baud": 1}, {"at": (1.0,
        2.0)},
        {"at": (1.0, 2.0, 0.5)}, {"at": (1.0, 2.0, 0.5, 9.0)}, {"faults": ["reboot"]}, {"aux": ["1=pty:/run/a"]},
        {"aux": ["5"]},
        {"worlds": "none"}, {"sync_limit_s": 1.5}, {"sync_limit_s": 0.0}, {"settings": ControllerSettings(baud=9600)},
        {"settings": ControllerSettings(), "baud": 9600, "lenient": True}, {"flash": "none.toml"},
    ]  # fmt: skip
    orders: list[FleetOrder] = []

    def make(order: FleetOrder) -> None:
        orders.append(order)
        raise HungUpError("made")

    with patch.object(background_host, "make_fleet", make):
        for given in options:
            yield said((given, tried(background_host.served_pioneer(**given).__enter__), orders))
            orders.clear()
    names = [row.split()[0] for row in execute([], "help")]
    yield said((names, [*FAULTS]))


TRACES: dict[str, Trace] = {
    each.__name__: each
    for each in (
        alone, paced, fast, together, apart, shouting, turns, operators, fleets, made, world_words, pacing, robot_time,
        background, afterwards, handed_over,
    )
}  # fmt: skip
TRACES["declared"] = declared_of("p2os.pioneer.serve")
test_what_was_approved_is_shown = judge_of(__file__, TRACES)
