"""A virtual Pioneer on a real line, in real or scaled time: what `p2os serve` runs.

This is the I/O layer around `Pioneer`: it reads the clock, waits on descriptors and
moves bytes; every decision is the controller's. It serves one client at a time.
A second one is accepted, sent the reason in a line and closed, since a robot has one host. A client
that vanishes stops the robot at once and frees it for the next; so does one that has no open
session for longer than `sync_limit_ns`, if there is such a limit.

A robot with a speed of its line (`settings.baud`) is read and written at that
speed, whatever the medium; a real serial port paces itself. HOSTBAUD changes both.

Its time is a `RobotTime`: the robot does not run while no client is connected and it stands
still, nor through a pause of the machine, which is reported, and which is silence for its
watchdog: a real robot would have received nothing either. Robots of one world (`multi_robot_world`)
share theirs; one that has no client is then carried along by the others.
"""

import contextlib
from collections.abc import Callable, Sequence
from functools import partial

from p2os.errors import TransportError
from p2os.event_log import EventCallback, logged, logger
from p2os.pioneer.controller import Pioneer
from p2os.pioneer.serve.aux_endpoint import AuxEndpoint
from p2os.pioneer.serve.multi_robot_world import MultiRobotWorld
from p2os.pioneer.serve.paced_line import PacedLine
from p2os.pioneer.serve.robot_time import SETTLE_NS, RobotTime
from p2os.pioneer.serve.world_orders import change_world
from p2os.transport.ports import READ_BYTES, HungUpError, Listener, Transport
from p2os.transport.waiting import BLIND_POLL_S, ClosingLines, has_hung_up, wait_readable, waits_of
from p2os.transport.wall_clock import wall_clock
from simbase.timing import NS_PER_S, Nanos

_LOG = logger("serve")

#: chosen: the first robot of a world steps it for all so often. Else the packet that is due first waits for the work
#: of a whole cycle, of 64 robots 50 ms.
LEADING_WAIT_S = 0.005
#: chosen: well below the pause, and often enough for a robot that is connected but not open.
ACTIVE_WAIT_S = 0.1
#: chosen: how soon a fleet notices that it should end.
IDLE_WAIT_S = 0.5
#: chosen: no P2OS client sends more than its line carries for so long; one that does, or has left as much, is dropped.
LONGEST_BEHIND_NS: Nanos = 5 * NS_PER_S
#: chosen: 4 MB of a client that is dropped are discarded, so that a terminal is clean for the next.
MOST_READS_LOST = 1024
#: chosen: a second of a 9600 baud line; a client that sends faster finds its own medium full.
MOST_WAITING = 960


class Host:
    """Serves one virtual robot on one listener.

    Args:
        pioneer: The robot.
        listener: Where its clients connect.
        on_event: Notified of clients that come and go, and of pauses.
        clock: Nanoseconds; never goes back.
        speed: Robot seconds a second of the clock.
        shared: The time and the multi-robot world of robots that share a world, with this one's number there, from 0;
            the time then knows the clock and the speed.
        paced: Whether bytes take the time that `settings.baud` gives them; False where the medium does it itself.
        aux: What is at the AUX ports.
        sync_limit_ns: A client that has no open session for so many nanoseconds of the clock is dropped; None: never.
            Without effect on a terminal or serial port, which cannot be closed on who has it open.
    """

    def __init__(
        self,
        pioneer: Pioneer,
        listener: Listener,
        *,
        on_event: EventCallback | None = None,
        clock: Callable[[], Nanos] = wall_clock,
        speed: float = 1.0,
        shared: tuple[RobotTime, MultiRobotWorld, int] | None = None,
        paced: bool = True,
        aux: Sequence[AuxEndpoint] = (),
        sync_limit_ns: Nanos | None = None,
    ) -> None:
        self.pioneer = pioneer
        pioneer.on_event = logged(_LOG, listener.description, pioneer.on_event)
        self.listener = listener
        self.aux = tuple(aux)
        self._notified = logged(_LOG, listener.description, on_event)
        self._time = RobotTime(clock, speed) if shared is None else shared[0]
        self._bring: Callable[[Nanos], object] = self._advance_to
        #: Of the robots that share the world, if others do.
        self.multi_robot_world: MultiRobotWorld | None = None
        #: Which it is among those, from 0.
        self.number = 0
        if shared is not None:
            _, multi_robot_world, number = shared
            self.number = number
            self.multi_robot_world = multi_robot_world
            member = multi_robot_world.members[number]
            member.advance_to, member.next_due, member.due = self._advance_to, self._next_due, None
            self._bring = partial(multi_robot_world.bring, number)
        self._client: Transport | None = None
        self._closing_lines = ClosingLines(self._time.clock)
        self._waits = waits_of(self._time.clock)
        self._sync_limit_ns = sync_limit_ns
        #: When the client came, and when it had an open session last.
        self._came_at: Nanos = 0
        self._open_at: Nanos = 0
        #: What was left out of the time so far.
        self._left_out: Nanos = self._time.left_out
        self._settled_at: Nanos = 0
        self._baud = pioneer.baud
        #: Since when more waits than could be read at once.
        self._behind_since: Nanos | None = None
        #: To the robot and from it.
        self._lines: tuple[PacedLine, PacedLine] | None = None
        if paced and self._baud is not None:
            self._lines = PacedLine(self._baud), PacedLine(self._baud)

    @property
    def now(self) -> Nanos:
        """Return the robot's time, in nanoseconds."""
        return self._time.now

    @property
    def client(self) -> str | None:
        """Return who is connected, or None."""
        return None if self._client is None else self._client.description

    def turn(self, longest_wait_s: float, woken_by: Sequence[int] = ()) -> None:
        """Do what is due, then wait for the next deadline, bytes or client, at most so long.

        What makes one of the descriptors `woken_by` readable ends the wait, too.
        """
        self.run_due()
        self._waits.wait_readable((*self.descriptors(), *woken_by), min(self.wait_s(), longest_wait_s))
        self.read_lines()

    def run_due(self) -> None:
        """Do what is due by the clock."""
        self._read_clock()
        self._closing_lines.poll()
        if self._is_idle():
            return
        self._bring(self.now)
        self._follow_speed()
        self._send_output()
        self._serve_aux()
        self._check_session()

    def read_lines(self) -> None:
        """Take clients that have come and bytes that have arrived."""
        self._read_clock()
        self._accept_client()
        self._read_client()
        if not self._is_idle():
            self._serve_aux()

    def descriptors(self) -> list[int]:
        """Return the descriptors that become readable when there is something to read."""
        found = []
        if (listening := self.listener.fileno()) is not None:
            found.append(listening)
        if self._client is not None and self._may_receive():
            with contextlib.suppress(TransportError):
                found.append(self._client.fileno())
        if not self._is_idle():
            for member in self.aux:
                with contextlib.suppress(TransportError):
                    found += member.descriptors()
        return found

    def wait_s(self) -> float:
        """Return how long nothing will be due; `IDLE_WAIT_S` at most."""
        waits = [ACTIVE_WAIT_S if self._closing_lines else IDLE_WAIT_S]
        if not self._is_idle():
            waits.append(LEADING_WAIT_S if self._leads() else ACTIVE_WAIT_S)
            waits += [max(due - self.now, 0) / NS_PER_S / self._time.speed for due in self._deadlines()]
            waits += [member.poll_s for member in self.aux if member.poll_s is not None]
        if self._client is None:
            waits.append(IDLE_WAIT_S if self.listener.poll_s is None else self.listener.poll_s)
        else:
            try:
                self._client.fileno()
            except TransportError:
                waits.append(BLIND_POLL_S)
        return min(waits)

    def close(self) -> None:
        """Stop the robot, close the client's line and give the ports back."""
        self._drop_client("the host ends")
        self._closing_lines.close()
        self.listener.close()
        for member in self.aux:
            member.close()

    def do(self, words: str) -> None:
        """Inject or clear a fault, or press something on the robot: the words of `Pioneer.do`.

        Raises:
            UsageError: They mean nothing; nothing has changed then.
        """
        self._bring(self.now)
        self.pioneer.do(words, self.now)

    def start_over(self) -> None:
        """Put the robot back at its start; its client's line stays, the session does not.

        Raises:
            UsageError: Another robot stands there; nothing has changed then.
        """
        if self.multi_robot_world is not None:
            self.multi_robot_world.start_over([self.number], self.now)
        else:
            self._bring(self.now)
            self.pioneer.start_over(self.now)
        self.go_on()

    def go_on(self) -> None:
        """Run on for as long as a boot takes, also without a client."""
        self._time.go_on()
        self._settled_at = self.now + SETTLE_NS

    def change_world(self, words: str) -> str:
        """Change the world of the robot and of all that share it: an order of `world_orders`; return what was done.

        Raises:
            UsageError: The words mean nothing; nothing has changed then.
            WorldError: There is no such thing, or it is part of the building.
        """
        if self.multi_robot_world is not None:
            return change_world(self.multi_robot_world.scene_at(self.now), words, self.multi_robot_world.names)
        self._bring(self.now)
        return change_world(self.pioneer.body, words)

    def _advance_to(self, limit: Nanos) -> None:
        """Run the robot until `limit`, with what arrives by then on a line that takes its time."""
        if self._lines is not None:
            for at, data in self._lines[0].take(limit):
                self._receive(data, at)
        self.pioneer.advance_to(limit)

    def _next_due(self) -> Nanos | None:
        """Return when anything is due with the robot or arrives there."""
        due = [self.pioneer.next_due(), self._lines[0].next_deadline() if self._lines is not None else None]
        return min((at for at in due if at is not None), default=None)

    def _deadlines(self) -> list[Nanos]:
        due = [self.pioneer.next_deadline()]
        if self._lines is not None:
            due += [line.next_deadline() for line in self._lines]
        return [at for at in due if at is not None]

    def _may_receive(self) -> bool:
        """Tell whether the line to the robot takes more."""
        return self._lines is None or self._lines[0].waiting < MOST_WAITING

    def _send_output(self) -> None:
        data = b"".join(self.pioneer.take_output())
        if self._lines is not None:
            if data:
                self._lines[1].put(data, self.now)
            data = b"".join(lump for _, lump in self._lines[1].take(self.now))
        if self._client is None or not data:
            return
        try:
            self._client.write(data)
        except HungUpError:  # what it sent before may still wait, its STOP: reading it ends with the same
            return
        except TransportError as error:
            self._drop_client(str(error))

    def _receive(self, data: bytes, at: Nanos) -> None:
        """Give the robot bytes, and follow it to another speed."""
        self.pioneer.receive(data, at)
        self._follow_speed()

    def _follow_speed(self) -> None:
        """Give the line the robot's speed: HOSTBAUD changes it; CLOSE, a reboot and a new start change it back."""
        baud = self.pioneer.baud
        if baud is None or baud == self._baud:
            return
        self._baud = baud
        for line in self._lines or ():
            line.set_baud(baud)
        if self._client is not None and self._lines is None:
            self._send_output()
            self._client.set_baud(baud)

    def _serve_aux(self) -> None:
        if self.aux:
            self._bring(self.now)
        for member in self.aux:
            member.move_bytes(self.pioneer, self.now)

    def _accept_client(self) -> None:
        """Accept a client, or refuse it when there is one.

        One that has just left makes room for the one that comes, but may still hide behind what it has sent. As long as
        more waits than a read takes, who comes waits too: until that is read, or the flood ends the client.
        """
        if self._client is not None:
            listening = self.listener.fileno()
            if listening is None or not wait_readable([listening], 0):
                return
            while self._read_client():
                if self._behind_since is not None:
                    return
        transport = self.listener.accept()
        if transport is None:
            return
        if self._client is not None:
            first = self._client.description
            self._notify("client refused", f"{transport.description}: {first} is connected")
            connected_s = (self.now - self._came_at) / self._time.speed / NS_PER_S
            peer = first.removeprefix("tcp:")
            self._closing_lines.add(transport, f"busy: {peer} has been connected for {connected_s:.0f} s")
            return
        self.pioneer.take_output()  # what it sent while no client was there
        self._client, self._came_at, self._open_at = transport, self.now, self.now
        self._time.client_came()
        self._notify("client connected", transport.description)

    def _read_client(self) -> bool:
        """Read the client's bytes; return whether there were any."""
        if self._client is None:
            return False
        if not self._may_receive():
            self._check_backlog(self._client)
            return False
        try:
            data = self._client.read()
        except TransportError as error:
            self._drop_client(str(error))
            return False
        if self._lines is not None:
            self._lines[0].put(data, self.now)
        elif data:
            self._bring(self.now)
            self._receive(data, self.now)
            self._send_output()
        if len(data) < READ_BYTES:
            self._behind_since = None
        elif self._client is not None:  # more waits
            self._check_backlog(self._client)
        return bool(data)

    def _check_session(self) -> None:
        """Drop a client that has had no open session for too long."""
        if self._client is None or self._sync_limit_ns is None or self.listener.fileno() is None:
            return
        if self.pioneer.state.open:
            self._open_at = self.now
        elif self.now - self._open_at >= self._sync_limit_ns * self._time.speed:
            limit_s = self._sync_limit_ns / NS_PER_S
            self._drop_client(f"{self._client.description} had no open session for {limit_s:g} s", send_reason=True)

    def _check_backlog(self, client: Transport) -> None:
        """Drop a client that has left more than could be read so far, or that floods the line for too long.

        What a client has closed may still wait in its own machine, behind what it
        has sent: then only the flood shows it. What it has sent is lost.
        """
        if self._behind_since is None:
            self._behind_since = self.now
        reason = f"{client.description} left while its bytes waited"
        with contextlib.suppress(TransportError):
            if not has_hung_up(client.fileno()):
                if self.now - self._behind_since < LONGEST_BEHIND_NS:
                    return
                limit_s = LONGEST_BEHIND_NS // NS_PER_S
                reason = f"{client.description} sent more than can be read for {limit_s} s"
            for _ in range(MOST_READS_LOST):
                if not client.read():
                    break
        self._drop_client(reason)

    def _drop_client(self, reason: str, *, send_reason: bool = False) -> None:
        """Stop the robot and close its client's line; `send_reason` sends it to the client."""
        if self._client is None:
            return
        client, self._client, self._behind_since = self._client, None, None
        self._time.client_left()
        self._bring(self.now)
        if self._lines is not None:  # what is still on the line arrives
            self.pioneer.receive(self._lines[0].take_all(), self.now)
        self.pioneer.hang_up(self.now)
        self.pioneer.take_output()
        self._baud = self.pioneer.baud
        for line in self._lines or ():
            line.clear()
            if self._baud is not None:
                line.set_baud(self._baud)
        self._settled_at = self.now + SETTLE_NS
        self._notify("client gone", reason)  # before the client can know: whoever ends us then finds it written
        if send_reason:
            self._closing_lines.add(client, reason)
        else:
            with contextlib.suppress(TransportError):
                client.close()

    def _is_idle(self) -> bool:
        if self._leads() and not self._time.stands:
            return False
        return self._client is None and self.now >= self._settled_at

    def _leads(self) -> bool:
        """Tell whether it is the first of several robots: the one that steps their world."""
        return self.multi_robot_world is not None and self.number == 0

    def _read_clock(self) -> None:
        """Bring the robot's time up to the clock's, leaving out what the robot need not run through."""
        if pause := self._time.read():
            self._notify("lag", f"the machine paused for {pause / NS_PER_S:.1f} s; the robot's time leaves it out")
        if silence := self._time.left_out - self._left_out:
            self._left_out += silence
            self._bring(self.now)
            self.pioneer.count_silence(silence, self.now)

    def _notify(self, what: str, detail: str) -> None:
        self._notified(self.now, what, detail)
