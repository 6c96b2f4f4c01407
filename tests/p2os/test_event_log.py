"""What the library logs: by name and level, nothing by itself, and never from a model."""

import asyncio
import logging
import re
import subprocess
import sys
import time

import pytest

from p2os import Robot, served_pioneer
from p2os.client import aio
from p2os.event_log import log_event, logger
from p2os.transport.virtual_clock import VirtualClock
from simbase.timing import NS_PER_S
from tests.p2os.client.served_robot import QUICK, Recorder, ServedRobot


def lines(caplog: pytest.LogCaptureFixture, part: str) -> list[str]:
    return [f"{it.levelname} {it.getMessage()}" for it in caplog.records if it.name == f"p2os.{part}"]


def test_a_client_logs_its_session_and_a_host_its_client(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.DEBUG, "p2os")
    clock = VirtualClock()
    with served_pioneer(body="kinematic", clock=clock) as url, Robot(url, settings=QUICK, clock=clock) as robot:
        robot.next_state()
        url.order("fault sonar-stuck 3 1.2")
        url.reset()
    client, serve = lines(caplog, "client"), lines(caplog, "serve")
    assert client[0].startswith("INFO connected: ")
    assert "(p2dx), after 0." in client[0]
    assert client[-1] == "INFO closed"
    assert [line.partition(": ")[2].partition(":")[0] for line in serve][:2] == ["client connected", "synchronised"]
    assert any(line.endswith("s: fault: sonar-stuck 3 1.2") for line in serve)
    assert any("s: started over: " in line for line in serve)
    assert all(line.split()[1] == url for line in serve)


def test_whoever_has_closed_a_client_finds_that_logged() -> None:
    class Slow(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            if record.getMessage() == "closed":
                time.sleep(0.1)
                logged.append("closed")

    logged: list[str] = []
    handler, of_clients = Slow(), logging.getLogger("p2os.client")
    level = of_clients.level
    of_clients.addHandler(handler)
    of_clients.setLevel(logging.INFO)
    clock = VirtualClock()
    try:
        with served_pioneer(body="kinematic", clock=clock) as url, Robot(url, settings=QUICK, clock=clock) as robot:
            robot.close()
            assert logged == ["closed"]
    finally:
        of_clients.removeHandler(handler)
        of_clients.setLevel(level)


def test_an_asyncio_client_logs_the_same(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "p2os")

    async def session(url: str) -> None:
        async with aio.Robot(url, settings=QUICK) as robot:
            await robot.next_state()

    with served_pioneer(body="kinematic") as url:
        asyncio.run(session(url))
    assert [line.partition(":")[0] for line in lines(caplog, "client")] == [
        "INFO connected", "INFO configuration known", "INFO closed",
    ]  # fmt: skip


def test_a_lost_line_and_the_way_back_are_logged(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "p2os")
    served = ServedRobot("loop:robot", clock=VirtualClock())
    recorder = Recorder(served.open)
    try:
        with Robot(served.url, settings=QUICK, opener=recorder, clock=served.clock) as robot:
            recorder.lines[-1].is_broken = True
            served.until(lambda: any("link lost" in line for line in lines(caplog, "client")))
            robot.wait_open(30)
    finally:
        served.close()
    kinds = [line.partition(":")[0] for line in lines(caplog, "client")]
    assert [kind for kind in kinds if kind != "INFO configuration known"] == [
        "INFO connected", "WARNING link lost", "INFO reconnect planned", "INFO connected", "INFO closed",
    ]  # fmt: skip


def test_packets_that_a_noisy_line_spoils_are_logged_at_most_once_a_second(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "p2os")
    clock = VirtualClock()
    with served_pioneer(body="kinematic", clock=clock) as url, Robot(url, settings=QUICK, clock=clock) as robot:
        url.order("fault line-noise 0.001")
        clock.until(lambda: any("dropped" in line for line in lines(caplog, "client")))
        url.order("clear line-noise")
        robot.close()
    dropped = [line for line in lines(caplog, "client") if "dropped" in line]
    assert re.fullmatch(r"WARNING packets dropped: \d, not sound", dropped[0])
    assert len(dropped) <= 2


def test_an_event_of_a_part_is_one_line_at_the_level_of_its_kind(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.DEBUG, "p2os")
    for what in ("watchdog expired", "command", "opened"):
        log_event(logger("bench"), "pioneer", NS_PER_S, what, "" if what == "opened" else "why")
    assert lines(caplog, "bench") == [
        "WARNING pioneer at 1.000 s: watchdog expired: why",
        "DEBUG pioneer at 1.000 s: command: why",
        "INFO pioneer at 1.000 s: opened",
    ]


def test_a_program_that_asks_for_no_log_sees_none() -> None:
    code = "from p2os.event_log import logger; logger('client').error('lost'); logger('bench').error('died')"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("", "")
