"""Work in forks of this process: what becomes of it whatever becomes of the fork, and that it comes to an end."""

import errno
import os
import signal
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path

import pytest

from robot_bench.campaign.campaign_file import RunLimits
from robot_bench.campaign.trial import Outcome, TrialVerdict
from robot_bench.campaign.workers.processes import MOST_TRIES, Processes

#: Looks at what goes on; may end it.
Look = Callable[[], None]
SOUND = Outcome(verdict=TrialVerdict.PASSED)
#: Four pieces of work take a dozen looks; one that waits forever, as many seconds as `LOOK_S` has it.
MOST_LOOKS = 200


@pytest.mark.parametrize("times", [0, 1, MOST_TRIES - 1, MOST_TRIES, 10**6])
@pytest.mark.parametrize("at_once", [1, 2])
def test_work_whose_process_is_killed_is_begun_again_and_not_for_ever(at_once: int, times: int, tmp_path: Path) -> None:
    """What others do beside it comes to its end, once each."""
    begun = tmp_path / "begun"
    begun.touch()

    def killed(_look: Look) -> Outcome:
        with begun.open("a") as file:
            file.write("x")
        if begun.stat().st_size <= times:
            os.kill(os.getpid(), signal.SIGKILL)
        return SOUND

    def look() -> None:
        assert begun.stat().st_size <= MOST_TRIES, "it goes on for ever"

    found: list[tuple[int, object]] = []
    works = [lambda _look: SOUND, killed, lambda _look: SOUND]
    Processes(at_once, RunLimits(), look)._do(works, lambda place, worked: found.append((place, worked[0])))
    last = Outcome(verdict=TrialVerdict.ERROR, failures=("its process was killed, again and again",))
    assert sorted(found, key=lambda row: row[0]) == [(0, SOUND), (1, SOUND if times < MOST_TRIES else last), (2, SOUND)]
    assert begun.stat().st_size == min(times + 1, MOST_TRIES)


@pytest.mark.parametrize("at", range(1, 5))
@pytest.mark.parametrize("is_of_fork", [False, True])
def test_work_comes_to_its_end_where_the_system_does_not_take_a_message(
    at: int, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, *, is_of_fork: bool
) -> None:
    """Once; what has no result is done again, in another process."""
    parent, send, sent = os.getpid(), Connection.send, tmp_path / "sent"
    sent.touch()

    def refuse(pipe: Connection, what: object) -> None:
        if (os.getpid() != parent) is is_of_fork:
            with sent.open("a") as file:
                file.write("x")
            if sent.stat().st_size == at:
                raise OSError(errno.ENOBUFS, os.strerror(errno.ENOBUFS))
        send(pipe, what)

    looks = iter(range(MOST_LOOKS))

    def look() -> None:
        assert next(looks, None) is not None, "it waits forever"

    monkeypatch.setattr(Connection, "send", refuse)
    found: list[tuple[int, object]] = []
    works = [lambda _look: SOUND] * 4
    Processes(1, RunLimits(), look)._do(works, lambda place, worked: found.append((place, worked[0])))
    assert sorted(found, key=lambda row: row[0]) == [(place, SOUND) for place in range(4)]
    assert sent.stat().st_size >= at
