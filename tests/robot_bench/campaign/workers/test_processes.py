"""Work in forks of this process: what becomes of it whatever becomes of the fork, and that it comes to an end."""

import os
import signal
from collections.abc import Callable
from pathlib import Path

import pytest

from robot_bench.campaign.campaign_file import RunLimits
from robot_bench.campaign.trial import Outcome, TrialVerdict
from robot_bench.campaign.workers.processes import MOST_TRIES, Processes

#: Looks at what goes on; may end it.
Look = Callable[[], None]
SOUND = Outcome(verdict=TrialVerdict.PASSED)


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
