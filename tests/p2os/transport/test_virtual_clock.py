"""The clock on which tests of programs take no longer than their work: when it stands, when and how far it jumps."""

import asyncio
import os
import socket
import threading
import time
from collections.abc import Callable

import pytest

from p2os import Robot, VirtualClock, served_pioneer
from p2os.client.robot_state import Link
from p2os.transport.waiting import RealWaits, waits_of
from p2os.transport.wall_clock import wall_clock
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos


def in_thread(clock: VirtualClock, work: Callable[[], object]) -> threading.Thread:
    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    clock.add(thread)
    return thread


def test_a_wait_of_the_only_thread_is_a_jump_of_that_length_and_work_takes_no_time() -> None:
    clock = VirtualClock()
    began_s = time.monotonic()
    clock.sleep(3600.0)
    assert clock() == 3600 * NS_PER_S
    time.sleep(0.02)
    assert clock() == 3600 * NS_PER_S
    clock.sleep(0.0)
    clock.sleep(-1.0)
    assert clock() == 3600 * NS_PER_S
    clock.sleep(1e-12)
    assert clock() == 3600 * NS_PER_S + 1, "what is shorter than a nanosecond ends, too"
    assert time.monotonic() - began_s < 60


def test_threads_wake_one_after_the_other_in_the_order_of_their_deadlines() -> None:
    clock, woken = VirtualClock(), list[tuple[str, Nanos]]()

    def sleeper(name: str, period_ms: int) -> Callable[[], None]:
        def work() -> None:
            while clock() < 60 * NS_PER_MS:
                clock.sleep(period_ms / 1000)
                woken.append((name, clock() // NS_PER_MS))

        return work

    with clock.standing():
        threads = [in_thread(clock, sleeper("a", 20)), in_thread(clock, sleeper("b", 30))]
    clock.until(lambda: not any(thread.is_alive() for thread in threads))
    expected = [("a", 20), ("b", 30), ("a", 40), ("a", 60), ("b", 60)]
    assert sorted(woken, key=lambda it: (it[1], it[0])) == expected
    assert [at for _, at in woken] == sorted(at for _, at in woken)


def test_it_stands_while_another_of_its_threads_works() -> None:
    clock, may_end = VirtualClock(), threading.Event()
    working = in_thread(clock, lambda: (clock.sleep(0.5), may_end.wait(30))[0])
    threading.Timer(0.05, may_end.set).start()
    seen: list[tuple[Nanos, bool]] = []
    clock.sleep(0.5)
    clock.sleep(1.0)
    seen.append((clock(), may_end.is_set()))
    assert seen == [(1500 * NS_PER_MS, True)]
    working.join(30)


def test_bytes_end_a_wait_without_time_and_come_before_any_jump() -> None:
    clock = VirtualClock()
    near, far = socket.socketpair()
    got: list[tuple[bytes, Nanos]] = []

    def read() -> None:
        while len(got) < 50:
            if clock.wait_readable((near.fileno(),), 10.0):
                got.append((near.recv(100), clock()))

    reader = in_thread(clock, read)
    with near, far:
        for number in range(50):
            far.send(bytes((number,)))
            clock.sleep(0.001)
        reader.join(30)
    assert got == [(bytes((number,)), number * NS_PER_MS) for number in range(50)]
    assert clock() == 50 * NS_PER_MS


def test_until_looks_at_others_work_and_gives_up_at_its_limit() -> None:
    clock, done = VirtualClock(), list[Nanos]()
    in_thread(clock, lambda: (clock.sleep(0.25), done.append(clock()))[0])
    clock.until(lambda: done)
    assert done == [250 * NS_PER_MS]
    assert 0 <= clock() - done[0] <= 5 * NS_PER_MS
    began = clock()
    with pytest.raises(TimeoutError, match="within 2 s of the clock"):
        clock.until(lambda: False, within_s=2.0)
    assert clock() - began == 2 * NS_PER_S


def test_who_waits_for_a_condition_looks_before_each_jump() -> None:
    clock, changed, values = VirtualClock(), threading.Condition(), list[Nanos]()

    def change() -> None:
        clock.sleep(0.3)
        with changed:
            values.append(clock())
            changed.notify_all()
        clock.sleep(5.0)

    in_thread(clock, change)
    with changed:
        while not values:
            clock.wait_for_change(changed, 60.0)
        assert clock() == values[0] == 300 * NS_PER_MS
        before = clock()
        while clock() < before + 2 * NS_PER_S:
            clock.wait_for_change(changed, (before + 2 * NS_PER_S - clock()) / NS_PER_S)
        assert clock() == before + 2 * NS_PER_S, "its own limit is a deadline"


def test_a_thread_that_has_ended_holds_nobody_up() -> None:
    clock = VirtualClock()
    in_thread(clock, lambda: clock.sleep(0.1)).join(0.0)
    in_thread(clock, lambda: None).join(30)
    clock.sleep(5.0)
    assert clock() == 5 * NS_PER_S


def test_a_look_ends_in_real_time_where_somebody_works() -> None:
    clock, may_end = VirtualClock(), threading.Event()
    working = in_thread(clock, lambda: may_end.wait(30) and None)
    began_s = time.monotonic()
    clock.look(0.01)
    assert time.monotonic() - began_s < 10
    assert clock() == 0
    may_end.set()
    working.join(30)
    clock.look(30.0)
    assert clock() == 30 * NS_PER_S


def test_an_event_loop_on_it_jumps_between_its_timers_and_stands_for_its_executor() -> None:
    clock = VirtualClock()

    async def story() -> list[float]:
        loop = asyncio.get_running_loop()
        times = [loop.time()]
        await asyncio.sleep(100.0)
        times.append(loop.time())
        later = loop.call_later(50.0, times.append, -1.0)
        await loop.run_in_executor(None, time.sleep, 0.05)
        later.cancel()
        times.append(loop.time())
        await asyncio.gather(asyncio.sleep(1.0), asyncio.sleep(2.0))
        times.append(loop.time())
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(7.0):
                await asyncio.Event().wait()
        times.append(loop.time())
        return times

    with asyncio.Runner(loop_factory=clock.event_loop) as runner:
        assert runner.run(story()) == pytest.approx([0.0, 100.0, 100.0, 102.0, 109.0], abs=1e-6)
    assert clock() == pytest.approx(109 * NS_PER_S, abs=1000)


def session() -> list[Nanos]:
    """Drive a served robot, lose its session, find it again; return when each was done."""
    clock, times = VirtualClock(), list[Nanos]()
    with served_pioneer(body="kinematic", clock=clock) as served, Robot(served, clock=clock) as robot:
        times.append(clock())
        robot.drive(0.3)
        times.append(clock())
        robot.sleep(2.0)
        times.append(clock())
        served.reset()
        clock.until(lambda: robot.link is not Link.OPEN)
        robot.wait_open()
        times.append(clock())
    return times


def test_a_session_takes_as_long_each_time_to_a_packet_and_less_than_it_says() -> None:
    began_s = os.times().elapsed
    first = session()
    took_s = os.times().elapsed - began_s
    assert session() == pytest.approx(first, abs=200 * NS_PER_MS)  # two of its steps wait for packets, one each 100 ms
    assert [first[2] - first[1], first[1] - first[0] > NS_PER_S] == [2 * NS_PER_S, True]
    assert took_s < first[-1] / NS_PER_S


def test_the_real_clock_and_any_function_wait_in_real_time() -> None:
    assert isinstance(waits_of(wall_clock), RealWaits)
    assert isinstance(waits_of(lambda: 0), RealWaits)
    clock = VirtualClock()
    assert waits_of(clock) is clock
