"""The client's core joined to a byte line and a clock, who listens to it, and what a program waits for.

`Line` is what both I/O layers do each time they wake; nothing is waited for here. The
functions below it turn the core's outcomes into errors. A call that
waits is a generator: it yields what it waits for, and is sent whether that came; the
blocking robot and that of asyncio differ in how they wait alone.

Theory of operation. The core's time is the clock's without the gaps in which packets
came: what waited in the system while the program or its machine paused was sent in
time, so no timeout may run over it. After a gap STOP is the first frame out, then what
waits is read, then it is judged: where nothing sound waited, the gap counts as silence
of the robot.

Invariant: `finish` returns, or is left by an exception, only after STOP has been written to a line that takes it.
"""

import contextlib
import logging
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from typing import TypeAlias, TypeVar

from p2os.client.core import PacketType, RobotCore, request_for
from p2os.client.goals import MotionAxis, MotionGoal, MotionResult, as_number
from p2os.client.notices import (
    BaudKept,
    ConnectError,
    DeadmanStopped,
    Disobeyed,
    GapStopped,
    GaveUp,
    LinkLost,
    LinkLostError,
    MotionError,
    MotorsDisabled,
    NoAnswerError,
    Notice,
    OdometryDoubtful,
    PacketArrived,
    RobotUnknown,
    words_of,
)
from p2os.client.outbox import CloseLine, OpenLine, Send, SetBaud
from p2os.client.robot_state import Link, RobotState
from p2os.errors import TransportError
from p2os.event_log import logger
from p2os.protocol.commands import Command, CommandNumber, enable, stop, vel
from p2os.transport.ports import Transport
from p2os.transport.wall_clock import GAP_NS, Clock, GapWatch, wall_clock
from simbase.errors import P2osError
from simbase.interrupts import held_back
from simbase.timing import NS_PER_S, Nanos

#: chosen: more reads a turn than any line fills between two wakes; a flood must not starve the clock.
MOST_READS = 16
#: chosen: the longest wait of a line that has nothing to do.
LONGEST_WAIT_NS: Nanos = NS_PER_S // 2

#: chosen: how often a noisy line is reported at most.
DROPS_LOG_NS: Nanos = NS_PER_S

#: How many notices wait for a slow reader.
MOST_NOTICES = 1000
#: chosen: how often a waiting program counts as having made a call, for the deadman.
TOUCH_S = 0.25

Result = TypeVar("Result")
#: Yields what is waited for and how many seconds at most, None for ever; is sent whether it came.
Waiting: TypeAlias = Generator[tuple[Callable[[RobotCore], bool], float | None], bool, Result]
#: Acts on the core at a time.
Act = Callable[[RobotCore, Nanos], Result]

_LOG = logger("client")
#: Notices that are no plain news (INFO).
_LEVELS = {
    PacketArrived: logging.DEBUG,
    GaveUp: logging.ERROR,
    **dict.fromkeys(
        (LinkLost, BaudKept, DeadmanStopped, Disobeyed, GapStopped, MotorsDisabled, OdometryDoubtful, RobotUnknown),
        logging.WARNING,
    ),
}

#: What is written where the core cannot be asked any more: it was interrupted, or has failed. Some of it may have been
#: sent already; a repetition changes nothing.
CLOSING_FRAMES = b"".join(
    command.to_frame().to_bytes() for command in (stop(), vel(0), enable(False), Command(CommandNumber.CLOSE))
)


class Line:
    """Moves bytes between a `RobotCore` and the transport that its owner opens.

    Args:
        core: The client.
        baud: Speed at which a serial line is opened; None for other lines.
        clock: Nanoseconds that never go back, and go on while the machine sleeps.
    """

    def __init__(self, core: RobotCore, baud: int | None, clock: Clock = wall_clock) -> None:
        self.core = core
        self._baud = baud
        self._clock = clock
        self._transport: Transport | None = None
        #: The clock's time of the last look, and what the core's time leaves out of it.
        self._looked_at: Nanos = clock()
        self._left_out: Nanos = 0
        #: Frames that had come at the last look: a pause within a read begins after it.
        self._received = 0
        self._watch = GapWatch(self._looked_at)
        #: The core's time of the last turn.
        self._turned_at: Nanos = 0
        #: Packets that were dropped on this connection, so far as the log knows, and when it was reported.
        self._logged_drops = 0
        self._logged_drops_at: Nanos = -DROPS_LOG_NS
        #: The owner is to open the line and to call `opened` or `failed`.
        self.is_wanted = False

    @property
    def transport(self) -> Transport | None:
        """The open line, or None."""
        return self._transport

    @property
    def is_over(self) -> bool:
        """Whether the client is closed and everything has gone out."""
        return self.core.link is Link.CLOSED and self.core.is_quiet and self._transport is None and not self.is_wanted

    def now(self) -> Nanos:
        """Read the clock and return the core's time; after a gap STOP is sent before anything else."""
        self._looked_at = self._clock()
        if (gap_ns := self._watch.gap(self._looked_at)) > 0:
            self._take_gap(gap_ns)
        self._received = self.core.stats.frames_received
        return self._looked_at - self._left_out

    def opened(self, transport: Transport) -> None:
        """Take the line that was wanted; it is closed where it is not wanted any more."""
        self.is_wanted = False
        now = self.now()
        if self.core.link is not Link.OPENING:
            transport.close()
            return
        self._transport = transport
        self.core.line_opened(now, self._baud)

    def failed(self, error: Exception) -> None:
        """Take the news that the line cannot be opened, whatever its opener raised."""
        self.is_wanted = False
        hint = error.hint if isinstance(error, P2osError) else None
        reason = str(error) if isinstance(error, P2osError) else f"{type(error).__name__}: {error}"
        self.core.line_failed(reason, hint, self.now())

    def turn(self) -> None:
        """Read, act on time, write: all that is to be done now."""
        now = self.now()
        self._read(now)
        self.core.advance_to(now)
        self.write(now)
        self._turned_at = now

    def write(self, now: Nanos) -> None:
        """Carry out the actions that are due; none where a gap has begun since the last look: they are old then."""
        while not self._is_stale() and (action := self.core.take_action(now)) is not None:
            match action:
                case OpenLine():
                    self.is_wanted = True
                case CloseLine():
                    self._close()
                case SetBaud() if self._transport is not None:
                    self._transport.set_baud(action.baud)
                case Send() if self._transport is not None:
                    try:
                        self._transport.write(action.data)
                    except TransportError as error:
                        self._lose(error, now)
                case _:
                    pass  # the line has gone meanwhile

    def take_news(self) -> list[RobotState | Notice]:
        """Return what the program has to be notified of, oldest first, and forget it."""
        news = list(self.core.news)
        self.core.news.clear()
        return news

    def log(self, news: Sequence[RobotState | Notice]) -> None:
        """Log what was taken, and packets that were dropped meanwhile; a program's handlers run here: hold no lock."""
        for item in news:
            if not isinstance(item, RobotState):
                _LOG.log(_LEVELS.get(type(item), logging.INFO), "%s", words_of(item))
        stats = self.core.stats
        drops = stats.wire.bad_checksums + stats.wire.bad_counts + stats.wire.stalled + stats.malformed
        if drops < self._logged_drops:  # another connection
            self._logged_drops = 0
        if drops > self._logged_drops and self._looked_at - self._logged_drops_at >= DROPS_LOG_NS:
            _LOG.warning("packets dropped: %d, not sound", drops - self._logged_drops)
            self._logged_drops, self._logged_drops_at = drops, self._looked_at

    def log_end(self) -> None:
        """Log that the client is closed."""
        _LOG.info("closed")

    def wait_s(self) -> float:
        """Return for how many seconds nothing is due without bytes; whoever comes back later has had a gap."""
        deadline = self._looked_at + LONGEST_WAIT_NS
        if (due := self.core.next_deadline()) is not None:
            deadline = max(min(deadline, due + self._left_out), self._looked_at)  # 0 is at once
        self._watch.expect(deadline)
        return max(deadline - self._clock(), 0) / NS_PER_S

    def waits(self, is_so: Callable[[RobotCore], bool], timeout_s: float | None) -> Iterator[float]:
        """Yield for how many seconds to wait next until something is so; the deadman does not trip meanwhile."""
        ends = None if timeout_s is None else self.now() + round(timeout_s * NS_PER_S)
        while not is_so(self.core):
            now = self.now()
            self.core.touch(now)
            if ends is not None and now >= ends:
                return
            yield TOUCH_S if ends is None else min(TOUCH_S, (ends - now) / NS_PER_S)

    def finish(self) -> None:
        """Stop the robot, close its session and give the line back, all at once: nobody is left to space the frames.

        Interrupts (Ctrl-C) meanwhile are raised when that is done. A second call changes nothing.
        """
        with contextlib.suppress(Exception):  # giving the line back may fail too; the robot has its watchdog
            held_back(self._finish)

    def _finish(self) -> None:
        self._stop_robot()
        with contextlib.suppress(Exception):  # an interrupt can have left it in any state
            self.core.close(self._looked_at - self._left_out)
        self._close()

    def _is_stale(self) -> bool:
        if self.core.link is not Link.OPEN or self._clock() - self._looked_at <= GAP_NS:
            return False
        self._watch.expect(self._looked_at)  # the next look finds the gap
        return True

    def _take_gap(self, gap_ns: Nanos) -> None:
        if self.core.link is not Link.OPEN:
            self._left_out += gap_ns  # a search goes on where it was
            return
        now = self._looked_at - self._left_out - gap_ns
        self.core.take_gap(gap_ns, now)
        self.write(now)
        self._read(now)
        if self.core.stats.frames_received != self._received:
            self._left_out += gap_ns
            return
        now += gap_ns  # the robot was silent for so long
        self.core.advance_to(now)
        self.write(now)

    def _read(self, now: Nanos) -> None:
        for _ in range(MOST_READS):
            if self._transport is None:
                return
            try:
                data = self._transport.read()
            except TransportError as error:
                self._lose(error, now)
                return
            if not data:
                return
            self.core.receive(data, self._arrival(now))

    def _arrival(self, now: Nanos) -> Nanos:
        """Return when bytes that waited in the system arrived: before any timeout that they would have prevented."""
        due = self.core.next_deadline()
        if due is None or due > now:
            return now
        return max(self._turned_at, due - 1)

    def _stop_robot(self) -> None:
        if self._transport is not None:
            with contextlib.suppress(Exception):  # it is given back all the same
                self._transport.write(CLOSING_FRAMES)

    def _lose(self, error: TransportError, now: Nanos) -> None:
        if self.core.link is Link.OPEN:  # what failed may be one call, of a line that carries
            self._stop_robot()
        self._close()
        self.core.line_lost(str(error), now)

    def _close(self) -> None:
        if self._transport is not None:
            self._transport.close()
            self._transport = None


class Listeners:
    """Who gets what the client has to tell: queues of the program's, and its callbacks."""

    def __init__(self) -> None:
        self._queues: list[deque[Notice]] = []
        self._on_state: list[Callable[[RobotState], None]] = []
        self._on_event: list[Callable[[Notice], None]] = []

    def on_state(self, callback: Callable[[RobotState], None]) -> Callable[[], None]:
        """Call `callback` with each state; return what ends that."""
        return _added(self._on_state, callback)

    def on_event(self, callback: Callable[[Notice], None]) -> Callable[[], None]:
        """Call `callback` with each notice; return what ends that."""
        return _added(self._on_event, callback)

    @contextlib.contextmanager
    def queue(self) -> Iterator[deque[Notice]]:
        """Give a queue that gets every notice meanwhile."""
        queue: deque[Notice] = deque(maxlen=MOST_NOTICES)
        self._queues.append(queue)
        try:
            yield queue
        finally:
            self._queues[:] = [other for other in self._queues if other is not queue]

    def keep(self, news: Sequence[RobotState | Notice]) -> None:
        """Put the notices into the queues."""
        for queue in tuple(self._queues):
            queue.extend(item for item in news if not isinstance(item, RobotState))

    def call(self, news: Sequence[RobotState | Notice]) -> None:
        """Call the callbacks, in order; hold no lock."""
        for item in news:
            if isinstance(item, RobotState):
                for on_state in tuple(self._on_state):
                    on_state(item)
            else:
                for on_event in tuple(self._on_event):
                    on_event(item)


Callback = TypeVar("Callback")


def _added(callbacks: list[Callback], callback: Callback) -> Callable[[], None]:
    callbacks.append(callback)

    def end() -> None:
        with contextlib.suppress(ValueError):
            callbacks.remove(callback)

    return end


# What a program waits for ----------------------------------------------------------------


def connecting(core: RobotCore) -> Waiting[None]:
    """Wait until the session is open and the robot known.

    Raises:
        ConnectError: It is not.
    """
    yield lambda core: core.is_ready or is_over(core), None
    if not core.is_ready:
        raise not_found(core)


def sleeping(duration_s: float) -> Waiting[None]:
    """Wait for so long."""
    yield lambda _: False, as_number(duration_s, "sleep", "seconds")


def next_state(core: RobotCore, timeout_s: float) -> Waiting[RobotState]:
    """Wait for the next packet.

    Raises:
        LinkLostError: None came in time.
    """
    before = core.state
    yield lambda core: core.state is not before, timeout_s
    if core.state is None or core.state is before:
        raise not_connected(core)
    return core.state


def newer_state(core: RobotCore, last: RobotState | None, left_s: float | None) -> Waiting[RobotState | None]:
    """Wait for a state that is not the last; None where the client or the time ends."""
    yield lambda core: core.state is not last or is_over(core), left_s
    return None if core.state is last else core.state


def next_notice(queue: deque[Notice]) -> Waiting[Notice | None]:
    """Wait for a notice; None where the client ends."""
    yield lambda core: bool(queue) or is_over(core), None
    return queue.popleft() if queue else None


def fetching(
    core: RobotCore, kind: type[PacketType], timeout_s: float, send: Callable[[Command], None]
) -> Waiting[PacketType]:
    """Ask for a packet and wait for it.

    Raises:
        NoAnswerError: None came in time.
        LinkLostError: No session is open.
        UsageError: Nothing asks for such a packet.
    """
    request, before = request_for(kind), core.newest(kind)
    send(request)
    if not (yield lambda core: core.newest(kind) is not before, timeout_s):
        raise no_answer(core, kind, timeout_s)
    packet = core.newest(kind)
    if packet is None:
        raise not_connected(core)
    return packet


def opening(core: RobotCore, timeout_s: float | None) -> Waiting[None]:
    """Wait until the session is open again after a loss.

    Raises:
        LinkLostError: It is not, in time or for good.
    """
    yield lambda core: core.link is Link.OPEN or is_over(core), timeout_s
    if core.link is not Link.OPEN:
        raise not_connected(core)


def reaching(
    core: RobotCore,
    axis: MotionAxis,
    speed: float | None,
    timeout_s: float | None,
    run: Callable[[Act[object]], object],
) -> Waiting[MotionResult]:
    """Begin a goal and wait for its end; who gives up waiting stops the robot.

    Raises:
        MotionError, LinkLostError, MotorsDisabledError: It did not arrive.
    """
    limit_ns = None if timeout_s is None else round(as_number(timeout_s, "timeout_s", "seconds") * NS_PER_S)
    begun: list[MotionGoal] = []
    run(lambda core, now: begun.append(core.begin_goal(axis, limit_ns, speed, now)))
    (goal,) = begun
    try:
        yield lambda _: goal.ended is not None, None
    finally:
        if goal.ended is None:
            run(lambda core, now: core.cancel_goal(goal, now))
    return motion_result(goal, core)


def is_over(core: RobotCore) -> bool:
    """Tell whether a client is closed or has given up."""
    return core.link in {Link.CLOSED, Link.FAILED}


# What goes wrong ---------------------------------------------------------


def not_found(core: RobotCore) -> ConnectError:
    """Return the error that says why no session could be opened."""
    problem = core.problem
    hint = problem.hint if isinstance(problem, GaveUp) else None
    return ConnectError(problem.reason if problem is not None else f"not connected ({core.link.value})", hint=hint)


def not_connected(core: RobotCore) -> LinkLostError:
    """Return the error that says why there is no session any more."""
    reason = f": {core.problem.reason}" if core.problem is not None else ""
    return LinkLostError(f"no packet comes ({core.link.value}){reason}", hint="is the robot on, and the cable in?")


def no_answer(core: RobotCore, kind: type, timeout_s: float) -> TransportError:
    """Return the error of a request that nothing answered."""
    if core.link is not Link.OPEN:
        return not_connected(core)
    return NoAnswerError(f"no {kind.__name__} within {timeout_s:g} s", hint="does this robot have the device?")


def motion_result(goal: MotionGoal, core: RobotCore) -> MotionResult:
    """Return what a goal came to, or raise why it did not arrive.

    Raises:
        LinkLostError: The link was lost on the way.
        MotionError: Anything else.
    """
    ended = goal.ended
    if ended is None:
        raise MotionError(f"{goal.axis.what}: the client was closed")
    if ended.problem is None:
        return MotionResult(ended.asked, ended.reached, ended.took_ns)
    text = f"{ended.what}: {ended.problem}; reached {ended.reached:.3f}"
    if core.link is not Link.OPEN:
        raise LinkLostError(text, hint="its watchdog stops the robot; is it on, and the cable in?")
    raise MotionError(text)
