"""Many robots in one thread, orders, AUX ports, paced lines, and hostile clients."""

import os
import random
import resource
import socket
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from p2os.pioneer.serve.aux_endpoint import AuxEndpoint
from p2os.pioneer.serve.control_line import ControlLine
from p2os.pioneer.serve.fleet import Fleet
from p2os.pioneer.serve.host import LONGEST_BEHIND_NS, MOST_READS_LOST, MOST_WAITING, Host
from p2os.pioneer.serve.orders import execute
from p2os.protocol.commands import Command
from p2os.protocol.commands import CommandNumber as C
from p2os.protocol.frames import Decoder, Frame
from p2os.protocol.sip import SIP_KINDS
from p2os.transport import Listener, Loops, Transport, listen_url, open_url
from p2os.transport.ports import READ_BYTES
from simbase.timing import NS_PER_MS, NS_PER_S
from tests.p2os.conftest import context_of

#: A bound on every wait; reached only when something is broken.
PATIENCE_S = 30.0
pytestmark = pytest.mark.skipif(os.name != "posix", reason="pseudo-terminals are Unix's")


class Clock:
    """A clock that stands until it is set."""

    now = 0

    def __call__(self) -> int:
        return self.now


def say(line: Transport, number: int, argument: int | bytes | None = None) -> None:
    line.write(Command(number, argument).to_frame().to_bytes())


def frames(line: Transport, decoder: Decoder) -> list[Frame]:
    decoder.receive(line.read(), 0)
    found = []
    while (item := decoder.next_item()) is not None:
        assert isinstance(item, Frame)
        found.append(item)
    return found


class Looped:
    """A host on a line inside this process, with a clock that the test holds."""

    def __init__(self, robot: Any, *, listener: Listener | None = None, **host: Any) -> None:
        self.loops, self.clock, self.events = Loops(), Clock(), list[str]()
        self.robot = robot
        self.url = "loop:robot" if listener is None else listener.description
        self.host = Host(
            robot.pioneer, listener or self.loops.listen("robot"), clock=self.clock,
            on_event=lambda _now, what, detail: self.events.append(f"{what}: {detail}"), **host,
        )  # fmt: skip
        self.line = self.reopen()
        self.decoder = Decoder()
        self.host.turn(0)

    def run_unread(self, milliseconds: int) -> None:
        """Run the host while no client reads."""
        for _ in self.turns(milliseconds):
            pass

    def turns(self, milliseconds: int) -> Iterator[None]:
        """Turn the host a millisecond from now, for bytes may wait, and then when it would wake, to the millisecond."""
        step = 1
        while milliseconds > 0:
            step = min(step, milliseconds)
            milliseconds -= step
            self.clock.now += step * NS_PER_MS
            self.host.turn(0)
            yield
            step = max(int(self.host.wait_s() * 1000 + 1e-6), 1)

    def reopen(self) -> Transport:
        """Come as a new client; a terminal is opened as the serial port that it looks like."""
        return open_url(self.url.replace("pty:", "serial:"), loops=self.loops)

    def run(self, milliseconds: int) -> list[tuple[int, Frame]]:
        found = []
        for _ in self.turns(milliseconds):
            found += [(self.clock.now // NS_PER_MS, frame) for frame in frames(self.line, self.decoder)]
        return found

    def open(self) -> None:
        for number in (0, 1, 2, C.OPEN):
            say(self.line, number)
            self.run(60)


def test_a_paced_line_takes_the_time_of_its_characters_both_ways(make_robot: Callable[..., Any]) -> None:
    looped = Looped(make_robot(baud=9600))
    say(looped.line, 0)
    (answer,) = looped.run(50)
    # 6 characters there and 6 back, 6.25 ms each way, and a turn of 1 ms each.
    assert 13 <= answer[0] <= 15
    looped.host.close()


def test_the_host_follows_hostbaud_and_the_way_back(make_robot: Callable[..., Any]) -> None:
    from p2os.protocol.profiles import Profile

    looped = Looped(make_robot(baud=9600, profile=Profile.ARCOS))
    looped.open()
    say(looped.line, C.HOSTBAUD, 4)
    looped.run(120)
    start = looped.clock.now // NS_PER_MS
    say(looped.line, C.CONFIG)
    at = next(at for at, frame in looped.run(100) if frame.kind == 0x20)
    assert at - start <= 40, "at 115200 a CONFIGpac takes 12 ms and waits for one packet at most"
    say(looped.line, C.CLOSE)
    looped.run(50)
    assert looped.robot.pioneer.baud == 9600
    looped.host.close()


def test_a_flood_on_a_paced_line_waits_in_the_medium_not_in_memory(make_robot: Callable[..., Any]) -> None:
    looped = Looped(make_robot(baud=9600))
    looped.open()
    for _ in range(200):
        looped.line.write(Command(C.CONFIG).to_frame().to_bytes() * 20)
    looped.run(300)
    lines = looped.host._lines
    assert lines is not None
    assert lines[0].waiting <= MOST_WAITING + 4096
    assert lines[1].waiting < 500
    looped.host.close()


@pytest.mark.parametrize("url", ["loop:", "pty:", "tcp:127.0.0.1:0"])
def test_who_floods_a_paced_line_and_vanishes_leaves_it_free_at_once(make_robot: Callable[..., Any], url: str) -> None:
    """Megabytes wait in a socket, minutes at 9600 bit/s: the next client was refused till the last had come."""
    made = Looped(make_robot(baud=9600), listener=None if url == "loop:" else listen_url(url))
    made.open()
    say(made.line, C.ENABLE, 1)
    say(made.line, C.VEL, 200)
    assert any(frame.kind == 0x33 for _, frame in made.run(500))
    for _ in range(8):  # 7200 bytes: 7.5 s of such a line
        made.line.write(Command(C.VEL, 200).to_frame().to_bytes() * 100)
        made.run(1)
    made.line.close()
    made.run_unread(50)
    assert any("left while its bytes waited" in event for event in made.events)
    assert not made.robot.pioneer.state.motors_enabled
    made.line = made.reopen()
    made.decoder = Decoder()
    made.run(50)
    made.open()
    assert made.robot.pioneer.state.open
    made.line.close()
    made.host.close()


def test_who_floods_and_vanishes_is_not_obeyed_to_the_last_frame(make_robot: Callable[..., Any]) -> None:
    """Seconds of frames may wait in a socket; a robot whose client has gone stands at once."""
    made = Looped(make_robot())
    made.open()
    for _ in range(40):
        made.line.write(Command(C.VEL, 200).to_frame().to_bytes() * 100)
    made.line.close()
    made.run_unread(2)
    assert any("client gone" in event for event in made.events)
    made.host.close()


def test_a_client_that_floods_holds_up_neither_the_robot_nor_who_comes_next(
    make_robot: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    made = Looped(make_robot())
    made.open()
    client, reads = made.host._client, 0

    def flood(_: int = READ_BYTES) -> bytes:
        nonlocal reads
        reads += 1
        assert reads < 2 * MOST_READS_LOST, "the host reads on and on"
        return bytes(READ_BYTES)

    monkeypatch.setattr(client, "read", flood)
    first, made.line = made.line, made.reopen()

    def came(milliseconds: int) -> int:
        made.clock.now += milliseconds * NS_PER_MS
        made.host.turn(0)
        return sum(event.startswith("client connected") for event in made.events)

    # The first turn finds that it is behind; 5 s later it is let go.
    assert [came(100) for _ in range(50)] == [1] * 50
    assert came(99) == 1
    assert came(1) == 2
    first.close()
    assert any("sent more than can be read" in event for event in made.events)
    made.open()
    assert made.robot.pioneer.state.open
    made.host.close()


def test_who_shouts_for_five_seconds_is_dropped_and_a_burst_is_not(make_robot: Callable[..., Any]) -> None:
    """What a dead client's machine still holds hides that it is dead."""
    made = Looped(make_robot(baud=9600))
    made.open()
    shout = Command(C.VEL, 200).to_frame().to_bytes() * 400
    made.line.write(shout)  # 3600 bytes
    made.run_unread(4500)
    made.line.write(shout * 5)
    made.run_unread(LONGEST_BEHIND_NS // NS_PER_MS - 100)
    assert not any("client gone" in event for event in made.events)
    made.run_unread(200)
    assert any("sent more than can be read" in event for event in made.events)
    made.host.close()


def test_a_robot_runs_faster_than_the_clock_when_asked(make_robot: Callable[..., Any]) -> None:
    looped = Looped(make_robot(), speed=4.0)
    looped.open()
    before = looped.host.now
    packets = [frame for _, frame in looped.run(500) if frame.kind in SIP_KINDS]
    assert looped.host.now - before == 2 * NS_PER_S
    assert 19 <= len(packets) <= 21
    looped.host.close()


def test_a_device_at_an_aux_port_talks_through_the_robot(make_robot: Callable[..., Any]) -> None:
    loops = Loops()
    member = AuxEndpoint(1, loops.listen("aux"))
    looped = Looped(make_robot(), aux=[member])
    looped.open()
    say(looped.line, C.TTY2, b"nobody")
    looped.run(5)
    device = open_url("loop:aux", loops=loops)
    say(looped.line, C.TTY2, b"?")
    looped.run(5)
    assert device.read() == b"?"
    say(looped.line, C.GETAUX, 2)
    device.write(b"42")
    assert [frame.data for _, frame in looped.run(150) if frame.kind == 0xB0] == [b"42"]
    device.close()
    looped.run(5)
    second = open_url("loop:aux", loops=loops)
    looped.run(5)
    say(looped.line, C.TTY2, b"!")
    looped.run(5)
    assert second.read() == b"!"
    looped.host.close()


def test_orders_go_to_one_robot_or_all_and_are_answered(make_robot: Callable[..., Any]) -> None:
    hosts = [Looped(make_robot(baud=rate)).host for rate in (None, 9600)]
    assert execute(hosts, "2: fault sonar-dead 1") == ["robot 2: fault sonar-dead 1"]
    assert context_of(hosts[0].pioneer)["faults"].sonar == {}
    assert len(execute(hosts, "thing on")) == 2
    first, second = execute(hosts, "status")
    assert first.startswith("robot 1 at 0.0 s: no session")
    assert "12.6 V" in second
    assert any("sonar-stuck NUMBER METRES" in line for line in execute(hosts, "help"))
    assert execute(hosts, "3: status") == ["error: no robot '3'", "hint: robots: 1 to 2"]
    assert execute(hosts, "dance")[0] == "error: no order 'dance'"


class Serving:
    """A fleet in a thread."""

    def __init__(self, robots: Sequence[Any]) -> None:
        self.robots, self.events = robots, list[str]()
        hosts = [
            Host(
                robot.pioneer, listen_url("tcp:127.0.0.1:0"),
                on_event=lambda _now, what, detail: self.events.append(f"{what}: {detail}"),
            )
            for robot in robots
        ]  # fmt: skip
        orders = listen_url("tcp:127.0.0.1:0")
        self.urls, self.orders = [host.listener.description for host in hosts], orders.description
        self.ticks = 0
        self._end = threading.Event()
        fleet = Fleet(hosts, control=ControlLine(orders), ticks=[(0.01, self._tick)])
        self._thread = threading.Thread(target=fleet.run, kwargs={"until": self._end.is_set}, daemon=True)
        self._thread.start()

    def _tick(self) -> None:
        self.ticks += 1

    def wait_for(self, is_so: Callable[[], object]) -> None:
        end = time.monotonic() + PATIENCE_S
        while not is_so():
            assert time.monotonic() < end, self.events
            time.sleep(0.002)

    def close(self) -> None:
        self._end.set()
        self._thread.join(PATIENCE_S)
        assert not self._thread.is_alive()


@pytest.fixture
def serving(make_robot: Callable[..., Any]) -> Iterator[Serving]:
    made = Serving([make_robot() for _ in range(3)])
    yield made
    made.close()


def drive(serving: Serving, index: int) -> Transport:
    """Open a session that drives, as an honest client does."""
    line, decoder = open_url(serving.urls[index]), Decoder()
    for number in (0, 1, 2):
        say(line, number)
        found: list[int] = []

        def is_answered(number: int = number, found: list[int] = found) -> bool:
            found += [frame.kind for frame in frames(line, decoder)]
            return number in found

        serving.wait_for(is_answered)
    for number, argument in ((C.OPEN, None), (C.ENABLE, 1), (C.VEL, 100)):
        say(line, number, argument)
    serving.wait_for(lambda: any(frame.kind == 0x33 for frame in frames(line, decoder)))
    return line


def test_a_fleet_serves_each_of_its_robots_and_takes_orders(serving: Serving) -> None:
    lines = [drive(serving, index) for index in range(3)]
    orders = open_url(serving.orders)
    orders.write(b"2: fault stop-button\r\nsta")
    serving.wait_for(lambda: not serving.robots[1].pioneer.state.motors_enabled)
    orders.write(b"tus\n")
    heard = bytearray()

    def all_notified() -> bool:
        heard.extend(orders.read())
        return heard.count(b"robot") >= 4

    serving.wait_for(all_notified)
    assert serving.robots[0].pioneer.state.motors_enabled
    orders.close()
    again = open_url(serving.orders)
    again.write(b"1: clear stop-button\n")
    serving.wait_for(again.read)
    serving.wait_for(lambda: serving.ticks)
    for line in (*lines, again):
        line.close()


def test_a_robot_whose_client_vanishes_in_motion_runs_on_to_a_stand(serving: Serving) -> None:
    drive(serving, 0).close()
    body = serving.robots[0].body
    serving.wait_for(lambda: body.state.left_speed_mps == 0 and any("client gone" in event for event in serving.events))


def address(url: str) -> tuple[str, int]:
    return "127.0.0.1", int(url.rpartition(":")[2])


def open_descriptors() -> int:
    """Return how many this process has; 0 where the system does not count them."""
    place = Path("/proc/self/fd")
    return len(list(place.iterdir())) if place.is_dir() else 0


def garbage(seed: int) -> bytes:
    return random.Random(seed).randbytes(3000)


HALF = Command(C.VEL, 300).to_frame().to_bytes()[:5]
HARM = {
    "half a frame": [HALF],
    "count FF": [b"\xfa\xfb\xff" + b"\x00" * 40],
    "count 0": [b"\xfa\xfb\x00" * 500],
    "a flood of noise": [garbage(seed) for seed in range(20)],
    "a flood of questions": [Command(C.CONFIG).to_frame().to_bytes() * 500] * 20,
    "syncs out of order": [Command(number).to_frame().to_bytes() for number in (2, 1, 2, 0, 2, 1)] * 50,
}


@pytest.mark.parametrize("harm", HARM)
def test_after_a_client_that_means_harm_the_next_is_served(serving: Serving, harm: str) -> None:
    with socket.create_connection(address(serving.urls[0]), timeout=PATIENCE_S) as bad:
        for piece in HARM[harm]:
            bad.sendall(piece)
    drive(serving, 0).close()


def test_a_client_that_floods_and_never_reads_is_left_and_the_robot_stands(serving: Serving) -> None:
    line = drive(serving, 0)
    with socket.create_connection(address(serving.urls[0]), timeout=PATIENCE_S) as second:
        assert second.recv(5) == b"busy:", "refused while somebody drives"
    questions = Command(C.CONFIG).to_frame().to_bytes() * 100
    end = time.monotonic() + PATIENCE_S
    while not any("client gone" in event for event in serving.events):
        assert time.monotonic() < end
        try:
            line.write(questions)
        except Exception:  # noqa: BLE001 - either side may end it first
            line.close()
    serving.wait_for(lambda: not serving.robots[0].pioneer.state.motors_enabled)
    drive(serving, 0).close()


def test_a_hundred_connections_leave_nothing_behind(serving: Serving) -> None:
    before = open_descriptors()
    for _ in range(100):
        socket.create_connection(address(serving.urls[0]), timeout=PATIENCE_S).close()
    drive(serving, 0).close()
    serving.wait_for(lambda: not serving.robots[0].pioneer.state.open)
    assert open_descriptors() <= before + 8


def test_a_silent_client_is_stopped_by_the_watchdog_though_it_stays(make_robot: Callable[..., Any]) -> None:
    looped = Looped(make_robot())
    looped.open()
    say(looped.line, C.ENABLE, 1)
    say(looped.line, C.VEL, 300)
    looped.line.write(HALF)
    looped.run(3500)
    assert looped.robot.pioneer.state.watchdog_expired
    assert looped.robot.pioneer.state.left_setpoint_mps == 0
    assert looped.host.client is not None
    looped.host.close()


def driving(make_robot: Callable[..., Any], **host: Any) -> Looped:
    made = Looped(make_robot(), **host)
    made.open()
    say(made.line, C.ENABLE, 1)
    say(made.line, C.VEL, 300)
    made.run(1500)
    assert made.robot.body.state.left_speed_mps == pytest.approx(0.3)
    return made


def test_a_robot_whose_client_was_killed_behind_an_open_line_brakes_after_two_seconds(
    make_robot: Callable[..., Any],
) -> None:
    """A terminal that another program has open, or a relay: nothing shows that the client is dead."""
    made = driving(make_robot)
    say(made.line, C.PULSE)
    made.run(1)
    last_frame_ms = made.clock.now // NS_PER_MS
    speeds = []
    for _ in range(6000):
        made.run(1)
        speeds.append((made.clock.now // NS_PER_MS - last_frame_ms, made.robot.body.state.left_speed_mps))
    begins = next(at for at, speed in speeds if speed < 0.3 - 1e-9)
    assert 2000 < begins <= 2002  # the watchdog's 2 s, and the first step of the ramp
    standing_poses = next(at for at, speed in speeds if speed == 0)
    assert standing_poses <= begins + 1001  # 300 mm/s at 300 mm/s²
    assert all(speed == 0 for at, speed in speeds if at >= standing_poses)
    made.host.close()


def test_a_pause_of_the_machine_is_silence_for_the_watchdog(make_robot: Callable[..., Any]) -> None:
    """A real robot would have stood long ago; ours went on with its old speed for two seconds of its own."""
    made = driving(make_robot)
    made.clock.now += 3600 * NS_PER_S
    made.run(1)
    assert made.robot.pioneer.state.watchdog_expired
    made.run(1001)
    assert made.robot.body.state.left_speed_mps == 0
    say(made.line, C.PULSE)
    made.run(1001)
    assert made.robot.body.state.left_speed_mps == pytest.approx(0.3), "the next frame revives it, as the real one"
    made.host.close()


def test_shorter_pauses_add_up_to_the_watchdogs_time(make_robot: Callable[..., Any]) -> None:
    made = driving(make_robot)
    say(made.line, C.PULSE)
    made.run(1)
    made.clock.now += 900 * NS_PER_MS
    made.run(99)
    made.clock.now += 900 * NS_PER_MS
    made.run(100)
    assert not made.robot.pioneer.state.watchdog_expired
    made.run(1)
    assert made.robot.pioneer.state.watchdog_expired
    made.host.close()


def test_a_client_that_never_reads_is_left_and_the_robot_stands(make_robot: Callable[..., Any]) -> None:
    made = driving(make_robot)
    for _ in range(4000):
        say(made.line, C.CONFIG)
        made.run_unread(50)
        if made.host.client is None:
            break
    assert made.events[-1].startswith("client gone: loop:robot has stopped reading")
    made.run_unread(1000)
    assert made.robot.body.state.left_speed_mps == 0
    made.line = made.reopen()
    made.decoder = Decoder()
    made.run(1)
    made.open()
    assert made.robot.pioneer.state.open
    made.host.close()


# Clients that do not synchronise ---------------------------------------------------------


def test_a_silent_client_is_dropped_at_the_limit_and_sent_the_reason(make_robot: Callable[..., Any]) -> None:
    made = Looped(make_robot(), sync_limit_ns=10 * NS_PER_S)
    say(made.line, 0)  # to synchronise is no session yet
    made.run_unread(9_999)
    assert made.host.client is not None
    made.run_unread(1)
    assert made.events[-1] == "client gone: loop:robot had no open session for 10 s"
    assert made.line.read().endswith(b"loop:robot had no open session for 10 s\r\n")
    made.line = made.reopen()
    made.run_unread(1)
    assert made.events[-1] == "client connected: loop:robot"
    made.host.close()


def test_a_client_with_a_session_stays_and_its_time_begins_anew_with_close(make_robot: Callable[..., Any]) -> None:
    made = Looped(make_robot(), sync_limit_ns=NS_PER_S, speed=4.0)
    made.open()
    made.run_unread(5_000)
    assert made.host.client is not None, "silent, but the watchdog has stopped its robot"
    say(made.line, C.CLOSE)
    made.run_unread(990)
    assert made.host.client is not None
    made.run_unread(20)
    assert made.host.client is None
    made.host.close()


def test_a_client_has_its_time_whatever_was_before_it(make_robot: Callable[..., Any]) -> None:
    made = Looped(make_robot(), sync_limit_ns=NS_PER_S)
    made.line.close()
    made.run_unread(3_000)
    for _ in range(2):
        made.line = made.reopen()
        made.run_unread(1)
        made.run_unread(998)
        assert made.host.client is not None
        made.run_unread(2)
        assert made.host.client is None
        made.run_unread(700)
    assert [event.partition(": ")[0] for event in made.events[-4:]] == ["client connected", "client gone"] * 2
    made.host.close()


def test_who_has_a_terminal_open_cannot_be_sent_away(make_robot: Callable[..., Any]) -> None:
    made = Looped(make_robot(), listener=listen_url("pty:"), sync_limit_ns=NS_PER_S)
    made.run_unread(3_000)
    assert made.events == [f"client connected: {made.url}"]
    made.line.close()
    made.host.close()


# More descriptors than select knows ------------------------------------------------------


@pytest.fixture
def past_select() -> Iterator[None]:
    """Let every descriptor that is opened from now on be above what `select` takes."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if hard != resource.RLIM_INFINITY and hard < 2048:
        pytest.skip(f"this system allows {hard} descriptors")
    resource.setrlimit(resource.RLIMIT_NOFILE, (2048, hard))
    first = os.open(os.devnull, os.O_RDONLY)
    taken = [first]
    while taken[-1] < 1100:
        taken.append(os.dup(first))
    yield
    for descriptor in taken:
        os.close(descriptor)
    resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def test_a_robot_is_served_past_a_thousand_descriptors(past_select: None, serving: Serving) -> None:
    line = drive(serving, 0)
    assert line.fileno() > 1024
    orders = open_url(serving.orders)
    orders.write(b"status\n")
    serving.wait_for(orders.read)
    for each in (line, orders):
        each.close()
