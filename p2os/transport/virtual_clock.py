"""A clock for tests of programs that drive a robot: it stands while a thread works, and jumps where all of them wait.

    clock = VirtualClock()
    with served_pioneer(clock=clock) as served, Robot(served, clock=clock) as robot:
        robot.drive(2.0)  # takes milliseconds
        clock.until(lambda: ...)

A drive, a deadman, a search for a lost robot take no longer than their work does, and
a busy machine makes none of them late: a thread that gets no processor counts as one
that works. For asyncio `VirtualClock.event_loop` makes the loop:
`asyncio.Runner(loop_factory=clock.event_loop)`.

Theory of operation. The threads of a clock are the one that made it, those of hosts and
clients with it, and who ever waited on it. When the last of them begins to wait, and no
line that one of them waits for has something to read, the clock jumps to the earliest
deadline and that one thread goes on. Who waits for a condition looks again before each
jump, as somebody may have changed it.

Bytes must arrive as they are sent, as those of a socket of this machine do; a robot on
a cable or in another process has a time of its own. What a thread waits for elsewhere
(a lock, an event, `time.sleep`, a real port) stops the clock: `until` waits for such things.
Which of several things that happen at one time comes first is left to the system, so a
packet may come a cycle later in another run. For runs that repeat byte for byte there
is the bench.

Invariant: the clock moves only while each of its threads waits.
"""

import asyncio
import contextlib
import math
import selectors
import threading
import time
import weakref
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass, field
from typing import Any

from p2os.transport.waiting import WakeUp, wait_readable
from simbase.timing import NS_PER_S, Nanos

#: chosen: how soon, in real time, the end of a thread is noticed, or an interrupt of one that waits.
HEARTBEAT_S = 0.01
#: chosen: `until` looks at least so often, in virtual time: a twentieth of a SIP cycle.
LOOK_S = 0.005


@dataclass(eq=False, slots=True)
class _Wait:
    """A thread that waits."""

    deadline: Nanos | None
    wake: Callable[[], None]
    descriptors: tuple[int, ...] = ()
    #: Up to which piece of others' work it has looked; None: it waits for no work.
    seen: int | None = None
    #: It was told to go on: its thread works, whenever it gets the processor.
    is_over: bool = False


@dataclass(eq=False, slots=True)
class _Member:
    """A thread of the clock, what wakes it from a wait for descriptors, and its wait."""

    wake_up: WakeUp
    wait: _Wait | None = None


@dataclass(eq=False, slots=True)
class _Members:
    """The threads of a clock, in the order in which they came."""

    by_thread: dict[threading.Thread, _Member] = field(default_factory=dict)

    def of(self, thread: threading.Thread) -> _Member:
        if (member := self.by_thread.get(thread)) is None:
            member = self.by_thread[thread] = _Member(WakeUp())
        return member

    def waits(self) -> list[_Wait] | None:
        """Return what they wait for; None while one of them works. Those that have ended are left out for good."""
        for thread in [thread for thread in self.by_thread if not thread.is_alive()]:
            self.by_thread.pop(thread).wake_up.close()
        found = [member.wait for member in self.by_thread.values()]
        waits = [wait for wait in found if wait is not None and not wait.is_over]
        return waits if len(waits) == len(found) else None

    def close(self) -> None:
        for member in self.by_thread.values():
            member.wake_up.close()


class VirtualClock:
    """Nanoseconds from 0 on that pass only while every thread waits; called, it returns them."""

    def __init__(self) -> None:
        self._now: Nanos = 0
        self._lock = threading.Lock()
        self._members = _Members()
        #: How many waits have ended: pieces of work that may have changed something.
        self._work = 0
        #: How many pieces of work are done by threads that are not the clock's.
        self._held = 0
        self.add(threading.current_thread())
        weakref.finalize(self, self._members.close).atexit = False  # threads may still wait then

    def __call__(self) -> Nanos:
        """Return the time."""
        return self._now

    # What a program calls ------------------------------------------------------------------

    def sleep(self, duration_s: float) -> None:
        """Wait for so many seconds of this clock."""
        self.wait_readable((), duration_s)

    def until(self, is_so: Callable[[], object], within_s: float = 60.0) -> None:
        """Wait until something is so.

        Raises:
            TimeoutError: It was not, within so many seconds of this clock.
        """
        ends = self._now + round(within_s * NS_PER_S)
        while not is_so():
            if self._now >= ends:
                raise TimeoutError(f"it was not so within {within_s:g} s of the clock")
            self.sleep(LOOK_S)

    def event_loop(self) -> asyncio.AbstractEventLoop:
        """Return a new event loop whose timers go by this clock."""
        return _EventLoop(self)

    @contextlib.contextmanager
    def standing(self) -> Iterator[None]:
        """Let the clock stand until this ends, in whatever thread that is."""
        with self._lock:
            self._held += 1
        try:
            yield
        finally:
            with self._lock:
                self._held -= 1

    # How clients and hosts wait ------------------------------------------------------------

    def add(self, thread: threading.Thread) -> None:
        """Let the clock stand while a thread works, also before it has waited for the first time."""
        with self._lock:
            self._members.of(thread)

    def wait_readable(self, descriptors: Iterable[int], longest_s: float | None) -> set[int]:
        """Return the descriptors that have something to read, as soon as there is one; None waits for ever."""
        found = tuple(descriptors)
        if longest_s is not None and longest_s <= 0:
            return wait_readable(found, 0) if found else set()
        return self._wait(found, longest_s, math.inf)

    def look(self, longest_s: float) -> None:
        """Wait so many seconds of this clock or in real time, whichever end first: for who may wait for no clock."""
        self._wait((), longest_s, longest_s)

    def wait_for_change(self, changed: threading.Condition, longest_s: float) -> None:
        """Wait under a condition, at most so long: until it is notified, or others have worked."""

        def wake() -> None:
            with changed:
                changed.notify_all()

        wait = _Wait(self._deadline(longest_s), wake, seen=self._work)
        with self._waiting(wait):
            self._go_on()
            while not (wait.is_over or changed.wait(HEARTBEAT_S)):
                self._go_on()

    # Time ------------------------------------------------------------------------------------

    def _wait(self, descriptors: tuple[int, ...], longest_s: float | None, really_s: float) -> set[int]:
        with self._lock:
            member = self._members.of(threading.current_thread())
        wake_up = member.wake_up
        bell = wake_up.fileno()
        wait = _Wait(self._deadline(longest_s), wake_up.ring, descriptors)
        ends_s = time.monotonic() + really_s
        with self._waiting(wait):
            self._go_on()
            while True:
                ready = wait_readable((*descriptors, bell), min(HEARTBEAT_S, ends_s - time.monotonic()))
                wake_up.clear()
                ready -= {bell}
                if ready or wait.is_over or time.monotonic() >= ends_s:
                    return ready
                self._go_on()

    def _deadline(self, longest_s: float | None) -> Nanos | None:
        return None if longest_s is None else self._now + math.ceil(longest_s * NS_PER_S)

    @contextlib.contextmanager
    def _waiting(self, wait: _Wait) -> Iterator[None]:
        """Count this thread as one that waits."""
        with self._lock:
            member = self._members.of(threading.current_thread())
            member.wait = wait
        try:
            yield
        finally:
            with self._lock:
                member.wait = None
                if wait.seen is None:  # who only looks again has changed nothing
                    self._work += 1

    def _go_on(self) -> None:
        """Wake who is next, where every thread waits."""
        with self._lock:
            wait = self._next()
            if wait is not None:
                wait.is_over = True
        if wait is not None:
            wait.wake()

    def _next(self) -> _Wait | None:
        waits = self._members.waits()
        if self._held or not waits:
            return None
        descriptors = [descriptor for wait in waits for descriptor in wait.descriptors]
        try:
            if descriptors and wait_readable(descriptors, 0):
                return None  # whoever waits for it wakes by itself
        except (OSError, ValueError):  # one was closed meanwhile: its owner finds that out
            return None
        for wait in waits:
            if wait.seen is not None and wait.seen != self._work:
                return wait
        timed = [(wait.deadline, place) for place, wait in enumerate(waits) if wait.deadline is not None]
        if not timed:
            return None
        deadline, place = min(timed)
        self._now = max(self._now, deadline)
        return waits[place]


class _Selector(selectors.DefaultSelector):
    """Waits for an event loop's descriptors on a virtual clock."""

    def __init__(self, clock: VirtualClock) -> None:
        super().__init__()
        self._clock = clock

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        """Return what is ready: the descriptor of `epoll` itself shows that something is."""
        self._clock.wait_readable((self.fileno(),), timeout)
        return super().select(0)


class _EventLoop(asyncio.SelectorEventLoop):
    """An event loop on a virtual clock, which stands while an executor works for the loop."""

    def __init__(self, clock: VirtualClock) -> None:
        self._virtual = clock
        super().__init__(_Selector(clock))

    def time(self) -> float:
        """Return the clock's seconds."""
        return self._virtual() / NS_PER_S

    def run_in_executor(  # type: ignore[override]  # of typeshed's TypeVarTuple mypy makes nothing of the sort
        self, executor: Executor | None, func: Callable[..., Any], *args: Any
    ) -> asyncio.Future[Any]:
        """Do something in another thread."""
        work = contextlib.ExitStack()
        work.enter_context(self._virtual.standing())
        future = super().run_in_executor(executor, func, *args)
        future.add_done_callback(lambda _: work.close())
        return future

    async def shutdown_default_executor(self) -> None:
        """Wait for the end of its threads."""
        with self._virtual.standing():
            await super().shutdown_default_executor()
